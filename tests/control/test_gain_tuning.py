"""The paper's fuzzy system: its table, its published form, and the presets that use it."""

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


def test_published_system_is_that_of_the_file():
    filed = load(shared("paper/IT1FUZZY.fis"))
    ours = gain_tuning_system(published_rules())
    np.testing.assert_array_equal(Inference(filed)(GRID), Inference(ours)(GRID))


def test_the_two_rule_tables_differ_in_two_cells():
    rows, columns = np.nonzero((paper_rules() != published_rules()).any(axis=2))
    cells = [(LABELS[i], LABELS[j]) for i, j in zip(rows, columns, strict=True)]
    assert cells == [("NS", "NM"), ("PS", "NM")]


@every_system
def test_changes_stay_in_their_range(kind, preset):
    changes = gain_inference(kind, preset)(GRID)
    assert np.abs(changes).max() <= 0.1
    assert np.abs(changes).max() > 0.05


@every_system
def test_kp_and_ki_are_odd_in_the_paper(kind, preset):
    if preset == "paper":
        infer = gain_inference(kind, preset)
        np.testing.assert_allclose(infer(-GRID)[:, 0], -infer(GRID)[:, 0], atol=0.021)


@every_system
def test_an_input_out_of_range_tunes_nothing(kind, preset):
    assert fuzzy_tuner(kind, preset)(1.5, 0.0) == (0.0, 0.0, 0.0)


@every_system
def test_a_lost_measurement_is_no_exception(kind, preset):
    assert np.isnan(fuzzy_tuner(kind, preset)(np.nan, 0.0)).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_types_differ_by_little(preset):
    first, second, third = (gain_inference(kind, preset)(GRID) for kind in KINDS)
    assert 1e-3 < np.abs(second - first).max() < 0.06
    assert 1e-4 < np.abs(third - second).max() < 0.03
