"""References of a scenario: shapes, waypoint files, and code of the user."""

import logging
import re
from collections import Counter
from math import pi

import numpy as np
import pytest

from omnidrive.errors import InvalidReference, InvalidScenario
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid, save_nav2_map
from omnidrive.planning import Path
from omnidrive.reference import (
    SampledReference,
    ShapeReference,
    TimedReference,
    limit_usage,
    load_waypoints,
    save_waypoints,
)
from omnidrive.reference.shapes import Circle, Eight
from omnidrive.reference.timing.limits import SPEED_SHARE
from omnidrive.scenario import load_scenario, paper_scenario, plan_and_check, plan_at, retime
from omnidrive.scenario.scenario_file import parse_scenario, save_scenario, scenario_data
from omnidrive.study import run_study
from omnidrive.study.motion_plan import plan_facts, save_plan
from tests.study.small import small_scenario

SHAPES = ("circle", "eight", "square", "raised-cosine", "slalom", "random-smooth")
DATA = {
    "name": "shapes", "robot": {"name": "small"}, "plant": "kinematic",
    "controllers": ["pid", "holonomic-nmpc"],
    "tasks": {
        "track": {"durations": [20.0]},
        "noise": {"durations": [20.0]},
        "step": {"displacement": [0.5, 0.5, 0.3], "duration": 2.0},
        "horizon": {"duration": 20.0, "horizons": [5]},
        "faults": {"duration": 20.0, "faults": [{"kind": "pose-jump", "at": 1.0, "distance": 0.1}]},
    },
}  # fmt: skip


def scenario(reference, **changes):
    return parse_scenario(DATA | {"reference": reference} | changes, "test", allow_code=True)


def circle_file(tmp_path, name="w.csv", duration=12.0):
    save_waypoints(tmp_path / name, ShapeReference(Circle(), duration, Pose(3.0, 2.0, 0.5)))
    return tmp_path / name


@pytest.mark.parametrize("name", SHAPES)
def test_shape_begins_at_the_start_and_takes_the_durations_of_the_tasks(name):
    planned = plan_and_check(scenario(name, start=[1.0, -1.0, 0.5]))
    reference = planned.reference(20.0)
    assert reference.duration == 20.0
    assert reference.at(0.0).pose[:2] == pytest.approx((1.0, -1.0))
    assert planned.start == reference.at(0.0).pose
    assert planned.path.length / 20.0 < 1.0
    assert planned.clearance_bounds == (np.inf, np.inf)


@pytest.mark.parametrize("name", SHAPES)
def test_default_duration_is_that_of_half_a_metre_per_second_or_the_shortest(name):
    planned = plan_and_check(retime(scenario(name)))
    (first, *_) = planned.scenario.tasks.path_durations
    desired = max(planned.path.length / 0.5, planned.shortest)
    assert desired - 1e-6 <= first <= desired + 0.1
    fastest = plan_at(scenario(name))
    (first, *_) = fastest.scenario.tasks.path_durations
    used = plan_facts(fastest, fastest.reference(first))
    assert (
        85.0 < max(used[f"{each} used"].value for each in ("wheel speed", "wheel force")) <= 100.1
    )


def test_every_task_runs_with_a_shape_and_with_a_file(tmp_path):
    file = {"type": "waypoints", "file": str(circle_file(tmp_path))}
    for reference in ({"type": "circle", "radius": 0.8}, file):
        folder = tmp_path / "out" if reference is file else None
        study = run_study(scenario(reference), folder)
        counts = Counter(each.task for each in study.records)
        assert counts == {"track": 2, "noise": 2, "horizon": 1, "step": 2, "faults": 4}
        errors = {r.controller: r.metrics["me"] for r in study.records if r.task == "track"}
        assert errors["holonomic-nmpc"] < 1e-3
        assert not study.overlaps
    report = (tmp_path / "out" / "report.html").read_text()
    assert "open floor" in report
    assert '"cells":[[],[]]' in report


def test_run_folder_holds_a_copy_of_the_waypoints(tmp_path):
    file = circle_file(tmp_path)
    tasks = {"track": {"durations": [12.0]}}
    reference = {"type": "waypoints", "file": str(file)}
    made = scenario(reference, tasks=tasks, controllers=["feedforward"])
    first = run_study(made, tmp_path / "out")
    file.unlink()
    again = load_scenario(tmp_path / "out" / "scenario.yaml")
    second = run_study(again)
    assert second.records[0].metrics["me"] == first.records[0].metrics["me"]


def test_file_is_relative_to_the_scenario_file(tmp_path):
    circle_file(tmp_path)
    made = scenario({"type": "waypoints", "file": "w.csv"})
    save_scenario(made, tmp_path / "s.yaml")
    planned = plan_and_check(load_scenario(tmp_path / "s.yaml"))
    assert planned.start == pytest.approx((3.0, 2.0, 0.5))


def test_file_with_times_keeps_its_duration(tmp_path):
    made = scenario({"type": "waypoints", "file": str(circle_file(tmp_path, duration=12.0))})
    assert retime(made).tasks.track.durations == (12.0,)
    assert plan_at(made).scenario.tasks.track.durations == (12.0,)
    assert retime(made, duration=24.0).tasks.track.durations == (24.0,)
    planned = plan_and_check(retime(made))
    assert isinstance(planned.reference(12.0), SampledReference)
    faster, same = planned.reference(6.0), planned.reference(12.0)
    np.testing.assert_allclose(faster.at(2.0).pose, same.at(4.0).pose, atol=1e-12)
    np.testing.assert_allclose(faster.at(2.0).twist, 2.0 * np.array(same.at(4.0).twist), atol=1e-9)


def test_file_without_times_is_timed_within_the_limits(tmp_path):
    corners = np.array([[0.0, 0, 0], [2, 0, 0], [2, 0, pi / 2], [2, 2, pi / 2], [2, 2, pi / 2]])
    save_waypoints(tmp_path / "w.csv", Path(corners))
    planned = plan_at(scenario({"type": "waypoints", "file": str(tmp_path / "w.csv")}))
    assert isinstance(planned.motion, TimedReference)
    assert max(planned.motion.limit_usage.values()) == pytest.approx(1.0, abs=0.01)
    assert planned.path.length == pytest.approx(4.0, abs=0.05)
    poses = planned.path.samples
    distance = np.hypot(*(poses[:, :2] - corners[1, :2]).T).min()
    assert distance < 0.03
    np.testing.assert_allclose(poses[[0, -1]], corners[[0, -1]], atol=1e-9)


def test_plan_that_was_written_is_followed_again(tmp_path):
    planned = plan_and_check(paper_scenario())
    save_plan(planned, planned.reference(20.0), tmp_path / "p")
    written = load_waypoints(tmp_path / "p" / "reference.csv")
    reference = {"type": "waypoints", "file": str(tmp_path / "p" / "reference.csv")}
    made = plan_and_check(scenario(reference, robot={"name": "paper"}))
    assert made.motion.duration == written.duration == 20.0
    assert made.path.length == pytest.approx(planned.path.length, rel=1e-3)


@pytest.mark.parametrize("ending", ["csv", "traj"])
def test_shape_is_written_within_its_limits(tmp_path, ending):
    planned = plan_at(scenario({"type": "circle", "radius": 0.2}))
    duration = planned.scenario.tasks.path_durations[0]
    file = tmp_path / f"w.{ending}"
    save_plan(planned, planned.reference(duration), file)
    again = plan_and_check(scenario({"type": "waypoints", "file": str(file)}))
    facts = plan_facts(again, again.motion)
    assert facts["wheel force used"].value < 101.0
    assert facts["wheel speed used"].value < 101.0


def test_too_fast_shape_is_rejected_with_the_shortest_duration():
    made = scenario({"type": "circle", "radius": 5.0})
    slow = retime(made, duration=60.0)
    with pytest.raises(InvalidReference, match=r"2 s is too short .* shortest duration is \d+"):
        plan_and_check(retime(slow, duration=2.0))
    with pytest.raises(InvalidReference) as error:
        plan_and_check(retime(slow, duration=2.0))
    shortest = float(str(error.value).split()[-2])
    plan_and_check(retime(slow, duration=shortest))


def test_speeds_in_the_message_differ_if_a_duration_is_only_just_too_short():
    slow = retime(scenario({"type": "circle", "radius": 5.0}), duration=60.0)
    planned = plan_and_check(slow)
    (share,) = limit_usage(planned.motion, planned.limits[:1]).values()
    fastest = SPEED_SHARE * share * planned.motion.duration
    with pytest.raises(InvalidReference) as error:
        planned.reference(fastest / 1.013)
    needed, top = re.findall(r"([\d.]+) rad/s", str(error.value))
    assert float(needed) > float(top) == planned.robot.max_wheel_speed
    assert len(needed) < 10
    planned.reference(float(str(error.value).split()[-2]))


def test_motion_beyond_the_acceleration_limits_is_noted(caplog):
    made = scenario({"type": "circle", "radius": 0.3, "laps": 3})
    with caplog.at_level(logging.WARNING, "omnidrive"):
        plan_and_check(plan_at(made).scenario)
        assert not caplog.records
        fastest = plan_at(made).scenario.tasks.path_durations[0]
        plan_and_check(retime(made, duration=0.8 * fastest))
    (record,) = caplog.records
    message = record.getMessage()
    assert "exceeds the limit of the wheel force by a factor of 1.19, so" in message  # 0.77 / 0.8^2
    assert "cannot follow it exactly; the shortest duration within the limits is" in message


@pytest.mark.parametrize(
    ("radius", "share", "limit"), [(0.3, 0.92, "wheel force"), (5.0, 0.985, "wheel speed")]
)
def test_motion_within_the_reserve_of_a_limit_may_be_late(caplog, radius, share, limit):
    planned = plan_at(scenario({"type": "circle", "radius": radius, "laps": 3}))
    plan_and_check(retime(planned.scenario, duration=share * planned.shortest))
    (record,) = caplog.records
    message = record.getMessage()
    used = float(re.search(r"uses ([\d.]+) of the limit of the " + limit, message)[1])
    assert 0.77 < used <= 1.01
    assert "the robot may follow it late; the shortest duration with a reserve is" in message
    assert "exceeds" not in message


def test_obstacle_on_the_reference_is_noted(caplog, tmp_path):
    occupied = np.zeros((100, 100), bool)
    occupied[50, 50:] = True
    save_nav2_map(OccupancyGrid(occupied, 0.1, (-5.0, -5.0)), tmp_path / "m.yaml")
    wall = {"source": str(tmp_path / "m.yaml")}
    plan_and_check(scenario("circle", map=wall, start=[-3.0, -3.0]))
    assert not caplog.records
    planned = plan_and_check(scenario("circle", map=wall, start=[2.0, -1.0]))
    (record,) = caplog.records
    assert "overlaps an obstacle of the map on the reference" in record.getMessage()
    assert planned.clearance_bounds[1] < 0.0


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("cirle", "there is no reference 'cirle'.*did you mean 'circle'"),
        ({"type": "circle", "radis": 1.0}, "no parameter 'radis'.*did you mean 'radius'"),
        ({"type": "circle", "radius": -1.0}, "reference.radius is -1 m, need 0.01 to 1000 m"),
        ({"type": "circle", "heading": "tangnet"}, "reference.heading"),
        ({"type": "square", "rounding": 3.0}, "rounding is 3 m, need at most half the side, 1 m"),
        ({"type": "waypoints"}, "'reference.file' is missing"),
        ({"radius": 1.0}, "reference needs 'type'"),
        (7, "reference must be a name or a mapping"),
        ("path", "map, start, goal missing: a planned path needs a map, a start and a goal"),
        (None, "reference must be a name or a mapping"),
    ],
)
def test_invalid_references_are_rejected(reference, message):
    with pytest.raises(InvalidScenario, match=message):
        scenario(reference)


@pytest.mark.parametrize(("side", "turn"), [(400.0, 0.0), (1e10, 0.0), (1.0, 3.0)])
def test_path_too_long_for_its_control_points_is_rejected(tmp_path, side, turn):
    """Nine kilobytes could describe a motion of years."""
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    rows = [f"{x},{y},{turn * k}" for k, (x, y) in enumerate(corners * 350)]
    (tmp_path / "w.csv").write_text("\n".join(["x_m,y_m,yaw_rad", *rows]))
    with pytest.raises(InvalidReference, match=r"w.csv: the path is [\d,]+ m long .* most 1,0"):
        plan_and_check(scenario({"type": "waypoints", "file": str(tmp_path / "w.csv")}))


def test_missing_waypoint_file_is_reported(tmp_path):
    with pytest.raises(InvalidReference, match=r"cannot read the waypoint file .*nope.csv"):
        plan_and_check(scenario({"type": "waypoints", "file": str(tmp_path / "nope.csv")}))
    (tmp_path / "s.yaml").write_text(
        "name: a\nrobot: {name: small}\ncontrollers: [pid]\ntasks: {track: {durations: [5]}}\n"
        "reference: {type: waypoints, file: ''}\n"
    )
    with pytest.raises(InvalidScenario, match=r"reference.file must name a file, got ''"):
        load_scenario(tmp_path / "s.yaml")


CODE = '''
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.parameter import Bounds
from omnidrive.reference import ReferenceContext, Setpoint


@dataclass(frozen=True)
class Chirp:
    rate: Annotated[float, Bounds(0.01, 1.0, "rad/s^2")] = 0.1
    """Rate of the angular frequency, rad/s^2."""


class Swing:
    """Sideways swing of rising frequency."""

    def __init__(self, context: ReferenceContext, parameters: Chirp):
        self.start, self.rate, self.duration = context.start, parameters.rate, 6.0

    def at(self, t):
        row = self.window(t, 1, 0.0)[0]
        return Setpoint(Pose(*row[:3]), WorldTwist(*row[3:]))

    def window(self, t, n, dt):
        t = np.clip(t + dt * np.arange(n), 0.0, self.duration)
        rows = np.zeros((n, 6))
        rows[:, :3] = self.start
        rows[:, 1] += 0.2 * np.sin(0.5 * self.rate * t**2)
        rows[:, 4] = 0.2 * self.rate * t * np.cos(0.5 * self.rate * t**2)
        return rows


def not_a_motion(context):
    return 3


class Broken(Swing):
    """Motion with a wrong shape."""

    def __init__(self, context: ReferenceContext):
        super().__init__(context, Chirp())

    def window(self, t, n, dt):
        return np.full((n, 5), np.nan)
'''


@pytest.fixture
def own(tmp_path):
    file = tmp_path / "own.py"
    file.write_text(CODE)
    return file


@pytest.mark.long
def test_own_reference_keeps_its_duration_in_worker_processes_too(own):
    reference = {"type": f"{own}:Swing", "rate": 0.3}
    tasks = {"track": {"durations": [6.0]}}
    made = scenario(reference, tasks=tasks, controllers=["pid", "feedforward"])
    assert retime(made).tasks.track.durations == (6.0,)
    parallel, single = run_study(made, processes=2), run_study(made)
    assert len(single.records) == 2
    for a, b in zip(parallel.records, single.records, strict=True):
        assert a.metrics["me"] == b.metrics["me"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("not_a_motion", "returned a int, need an object with duration, at"),
        ("Broken", r"must return finite rows .* got an array of shape \(11, 5\)"),
    ],
)
def test_own_reference_of_another_kind_is_rejected(own, name, message):
    with pytest.raises(InvalidReference, match=message):
        plan_and_check(scenario(f"{own}:{name}"))


def test_planned_path_is_the_default_and_saved_as_such():
    data = scenario_data(small_scenario())
    assert data["reference"] == "path"
    assert parse_scenario(data, "again") == small_scenario()
    assert parse_scenario(data | {"reference": {"type": "path"}}, "again") == small_scenario()
    made = scenario({"type": "eight", "length": 3.0})
    assert scenario_data(made)["reference"]["length"] == 3.0
    assert parse_scenario(scenario_data(made), "again") == made
    assert made.reference.parameters == Eight(length=3.0)
