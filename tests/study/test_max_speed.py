"""Largest speed of the reference: `timing.max_speed` of a scenario and `--max-speed`."""

import json
import re
from math import hypot

import numpy as np
import pytest

from omnidrive.cli.main import load_verb
from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.errors import InvalidInput, InvalidReference, InvalidScenario
from omnidrive.planning import Path
from omnidrive.reference import RetimedReference, TimedReference, save_waypoints
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.scenario import paper_scenario, plan_and_check, plan_at, retime
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from tests.study.small import small_scenario


def limited(max_speed, *, law="uniform", reference=None):
    """Return the paper's scenario, or a small one with a reference, with a largest speed."""
    data = scenario_data(paper_scenario() if reference is None else small_scenario())
    data["timing"] = {"law": law, "max_speed": max_speed}
    if reference is not None:
        data["reference"] = reference
    return parse_scenario(data, "in a test")


def peak(reference):
    """Return the largest speed at 5001 times, m/s."""
    rows = reference.window(0.0, 5001, reference.duration / 5000)
    return float(np.hypot(rows[:, 3], rows[:, 4]).max())


def corner(tmp_path):
    """Return a waypoint file without times."""
    file = tmp_path / "corner.csv"
    save_waypoints(file, Path(np.array([[0.0, 0, 0], [3.0, 0, 0], [3.0, 3.0, 0]])))
    return {"type": "waypoints", "file": str(file)}


def timed(tmp_path):
    """Return a waypoint file of a straight motion of 4 m in 5 s, at most at 1.2 m/s."""
    file = tmp_path / "timed.csv"
    t = np.linspace(0.0, 5.0, 101)
    u = t / 5.0
    x, vx = 4.0 * (3 * u**2 - 2 * u**3), 4.0 * (6 * u - 6 * u**2) / 5.0
    still = np.zeros_like(t)
    poses, twists = np.column_stack([x, still, still]), np.column_stack([vx, still, still])
    save_waypoints(file, SampledReference(t, poses, twists))
    return {"type": "waypoints", "file": str(file)}


@pytest.mark.parametrize("law", ["uniform", "limits"])
def test_planned_path_keeps_the_largest_speed_in_its_shortest_duration(law):
    planned = plan_at(limited(0.6, law=law))
    reference = planned.reference(planned.shortest)
    assert 0.59 < peak(reference) <= 0.6 * 1.001
    assert planned.shortest > plan_at(limited(None, law=law)).shortest


def test_path_with_limits_goes_at_the_largest_speed_where_it_can():
    planned = plan_at(limited(0.6, law="limits"))
    assert planned.path.length / planned.shortest > 0.9 * 0.6  # not the fastest motion, slowed


@pytest.mark.parametrize("kind", ["circle", "slalom", "square"])
def test_shape_keeps_the_largest_speed(kind):
    planned = plan_at(limited(0.3, reference={"type": kind}))
    assert 0.295 < peak(planned.reference(planned.shortest)) <= 0.3 * 1.001


def test_waypoints_without_times_keep_the_largest_speed_and_accelerate_as_before(tmp_path):
    planned = plan_at(limited(0.3, reference=corner(tmp_path)))
    assert isinstance(planned.motion, TimedReference)
    assert peak(planned.motion) == pytest.approx(0.3, rel=0.01)
    assert planned.path.length / planned.shortest > 0.9 * 0.3


def test_waypoints_with_times_are_slowed_only_as_far_as_the_largest_speed_requires(tmp_path):
    reference = timed(tmp_path)
    slowed = plan_at(limited(0.6, reference=reference))
    assert isinstance(slowed.motion, RetimedReference)
    assert slowed.natural == pytest.approx(10.0, rel=1e-3)
    assert peak(slowed.motion) == pytest.approx(0.6, rel=1e-3)
    assert plan_at(limited(1.3, reference=reference)).natural == 5.0


@pytest.mark.parametrize("at_speed", [lambda made, speed: retime(made, speed=speed), plan_at])
@pytest.mark.parametrize("changes", [{}, {"reference": {"type": "circle", "radius": 2}}])
def test_mean_speed_that_is_too_high_is_named_with_the_highest(changes, at_speed):
    scenario = paper_scenario().with_values(**changes)
    with pytest.raises(InvalidReference, match=r"^a mean speed of 50 m/s is too high") as error:
        at_speed(scenario, 50.0)
    highest = float(re.findall(r"has ([\d.]+) m/s", str(error.value))[0])
    at_speed(scenario, highest)
    with pytest.raises(InvalidReference, match=rf"{highest:g} m/s"):
        at_speed(scenario, 1.05 * highest)


def test_duration_that_contradicts_the_largest_speed_is_an_error():
    with pytest.raises(InvalidReference, match=r"^20 s is too short .* the largest is 0\.4 m/s"):
        plan_and_check(limited(0.4))
    circle = retime(limited(0.3, reference={"type": "circle"}), duration=5.0)
    with pytest.raises(InvalidReference, match=r"would reach 2.* the largest is 0\.3 m/s"):
        plan_and_check(circle)


@pytest.mark.parametrize("timed_by", [retime, plan_at])
def test_mean_speed_above_the_largest_one_is_an_error(timed_by):
    with pytest.raises(InvalidInput, match=r"mean speed of 0.5 m/s exceeds the largest .* 0.4"):
        timed_by(limited(0.4), speed=0.5)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), 101.0])
def test_largest_speed_out_of_range_is_an_error(value):
    with pytest.raises(InvalidScenario, match=r"timing\.max_speed"):
        limited(value)


def test_option_lengthens_the_durations_of_a_scenario_only_where_needed():
    slow = ScenarioOptions(max_speed=0.4).resolve()
    assert slow.timing.max_speed == 0.4
    shortest, longest = slow.tasks.path_durations[0], slow.tasks.path_durations[-1]
    assert peak(plan_and_check(slow).reference(shortest)) <= 0.4 * 1.001
    assert longest == pytest.approx(1.5 * shortest)
    same = ScenarioOptions(max_speed=10.0).resolve()
    assert same.tasks == paper_scenario().tasks


def test_option_and_mean_speed_determine_duration_and_limit():
    options = ScenarioOptions(reference="circle", max_speed=0.3, speed=0.1)
    planned = plan_and_check(options.resolve())
    (duration, *_) = planned.scenario.tasks.path_durations
    assert planned.path.length / duration == pytest.approx(0.1, rel=0.01)
    assert hypot(*planned.reference(duration).at(duration / 2).twist[:2]) < 0.3


def test_plan_reports_the_use_of_the_largest_speed(capsys):
    load_verb("plan")(["--max-speed", "0.4", "--json"], standalone_mode=False)
    facts = json.loads(capsys.readouterr().out)
    assert 99.0 < facts["speed_used_percent"] <= 100.0
