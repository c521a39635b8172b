"""The paper's fuzzy system: rule tables, published system, and presets."""

import numpy as np
import pytest

from omnidrive.control.pid import fuzzy_tuner, gain_inference, gain_tuning_system
from omnidrive.control.pid.rules import LABELS, paper_rules, published_rules
from omnidrive.fuzzy import Inference, load
from tests.shared_data import shared

KINDS = ("t1", "t2", "t3")
PRESETS = ("paper", "published-code")
GRID = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 21)] * 2), axis=-1).reshape(-1, 2)

every_system = pytest.mark.parametrize(
    ("kind", "preset"), [(kind, preset) for kind in KINDS for preset in PRESETS]
)


def test_published_system_equals_published_file():
    filed = load(shared("paper/IT1FUZZY.fis"))
    ours = gain_tuning_system(published_rules())
    np.testing.assert_array_equal(Inference(filed)(GRID), Inference(ours)(GRID))


def test_rule_tables_differ_in_two_cells():
    rows, columns = np.nonzero((paper_rules() != published_rules()).any(axis=2))
    cells = [(LABELS[i], LABELS[j]) for i, j in zip(rows, columns, strict=True)]
    assert cells == [("NS", "NM"), ("PS", "NM")]


@every_system
def test_gain_changes_stay_in_range(kind, preset):
    changes = gain_inference(kind, preset)(GRID)
    assert np.abs(changes).max() <= 0.1
    assert np.abs(changes).max() > 0.05


@every_system
def test_kp_is_odd_in_paper_preset(kind, preset):
    if preset == "paper":
        infer = gain_inference(kind, preset)
        np.testing.assert_allclose(infer(-GRID)[:, 0], -infer(GRID)[:, 0], atol=0.021)


@every_system
def test_input_out_of_range_gives_no_change(kind, preset):
    assert fuzzy_tuner(kind, preset)(1.5, 0.0) == (0.0, 0.0, 0.0)


@every_system
def test_lost_measurement_gives_nan(kind, preset):
    assert np.isnan(fuzzy_tuner(kind, preset)(np.nan, 0.0)).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_types_differ_slightly(preset):
    first, second, third = (gain_inference(kind, preset)(GRID) for kind in KINDS)
    assert 1e-3 < np.abs(second - first).max() < 0.06
    assert 1e-4 < np.abs(third - second).max() < 0.03
