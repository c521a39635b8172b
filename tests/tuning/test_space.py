"""The space of tuned parameters: from bounds and defaults of any component."""

import numpy as np
import pytest

from omnidrive.components import component_names, configure
from omnidrive.control.pid import gain_inference
from omnidrive.errors import InvalidInput
from omnidrive.fuzzy import save
from omnidrive.tuning import parameter_space
from omnidrive.tuning.space import RATIO
from tests.tuning.synthetic import lqr


def by_name(space):
    return {each.name: each for each in space.dimensions}


def test_parameters_of_other_packages():
    found = by_name(parameter_space(lqr(), "paper"))
    assert list(found) == [
        "gains.0", "gains.1", "steps", "weights.position", "weights.offset", "limit",
    ]  # fmt: skip
    assert found["weights.position"].logarithmic
    assert found["weights.position"].unit == "1/m^2"
    assert found["steps"].integer
    assert not found["weights.offset"].logarithmic
    assert found["limit"].high == 2000.0  # finite


def test_fuzzy_pid_has_gains_sets_and_rules():
    fuzzy = configure("controllers", "fuzzy_t2")
    names = by_name(parameter_space(fuzzy, "paper", choose=["*"]))
    for name in ("position.kp", "heading.tuning", "fuzzy.error.small", "fuzzy.inputs.lag"):
        assert name in names
    assert sum(name.startswith("fuzzy.rules.") for name in names) == 7 * 7 * 3
    assert names["fuzzy.rules.kp.0.0"][1:4] == (-3.0, 3.0, 3.0)
    assert names["position.kp"].base == 4.0
    by_default = by_name(parameter_space(fuzzy, "paper"))
    assert names.keys() - by_default.keys() == {n for n in names if n.startswith("fuzzy.rules.")}
    recommended = by_name(parameter_space(configure("controllers", "fuzzy_t1"), "recommended"))
    assert recommended["position.kp"].base == 5.0
    assert "fuzzy.inputs.lag" not in recommended


@pytest.mark.parametrize("preset", ["paper", "published-code", "recommended"])
@pytest.mark.parametrize("name", component_names("controllers"))
def test_values_before_tuning_are_at_the_origin_and_all_values_in_bounds(name, preset):
    space = parameter_space(configure("controllers", name), preset)
    base = space.controller_with(space.base)
    assert base == space.controller
    bounds = space.bounds
    assert (bounds[:, 0] <= 0.0).all()
    assert (bounds[:, 1] >= 0.0).all()
    rng = np.random.default_rng(3)
    for _ in range(5):
        point = rng.normal(scale=20.0, size=len(bounds)).tolist()
        assert space.controller_with(space.values(point)) is not None


def test_scaled_coordinates():
    found = by_name(parameter_space(lqr(), "paper"))
    position = found["weights.position"]
    assert position.value(1.0) == pytest.approx(RATIO)
    assert position.scaled(position.value(-2.0)) == pytest.approx(-2.0)
    assert position.value(1000.0) == 100.0
    assert found["weights.offset"].value(1.0) == pytest.approx(0.2)
    assert found["steps"].value(1.4) == 4


def test_a_refused_combination_has_no_controller():
    space = parameter_space(lqr(), "paper")
    assert space.controller_with({"gains.0": 9.5}) is None
    changed = space.controller_with({"gains.0": 5.0, "weights.offset": 0.5})
    assert changed.parameters.gains == (5.0, 2.0)
    assert changed.changes == {"gains": [5.0, 2.0], "weights.offset": 0.5}


def test_patterns_and_ranges():
    space = parameter_space(
        lqr(), "paper", choose=["weights.*", "steps", "!weights.offset"], ranges={"steps": (2, 4)}
    )
    assert list(by_name(space)) == ["steps", "weights.position"]
    assert by_name(space)["steps"][1:4] == (2, 4, 3.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"choose": ["wieghts.position"]}, "did you mean 'weights.position'"),
        ({"choose": ["!*"]}, "nothing is left to tune"),
        ({"ranges": {"steps": (0, 4)}}, "need an increasing one within 1 to 6 steps"),
        ({"ranges": {"steps": (float("nan"), 4)}}, "need an increasing one"),
        ({"ranges": {"horizon": (1, 4)}}, "there is no tuned parameter 'horizon'"),
    ],
)
def test_bad_choices_are_refused(options, message):
    with pytest.raises(InvalidInput, match=message):
        parameter_space(lqr(), "paper", **options)


def test_gains_are_tuned_around_a_system_in_a_file(tmp_path):
    save(gain_inference("t1", "paper").system, tmp_path / "gains.fis")
    fuzzy = {"file": str(tmp_path / "gains.fis")}
    space = parameter_space(configure("controllers", "fuzzy_t1", {"fuzzy": fuzzy}), "paper")
    names = [each.name for each in space.dimensions]
    assert "position.kp" in names
    assert not any(name.startswith("fuzzy") for name in names)
    tuned = space.controller_with({"position.kp": 9.0})
    assert tuned.values["position"]["kp"] == 9.0
    assert tuned.values["fuzzy"]["file"]["name"] == "gains.fis"
