"""Replay and comparison of logs: the same pipeline gives the same commands, bit for bit."""

import time
from dataclasses import dataclass, replace

import numpy as np
import pytest

pytest.importorskip("mcap")

from omnidrive import Pose, named_robot
from omnidrive.control import WheelSpeeds, WheelTorques
from omnidrive.control.controller import STOP
from omnidrive.deploy import DriveControls, SimulatedClock, SimulatedLink, drive, replay_log
from omnidrive.deploy.links.replay import ReplayLink
from omnidrive.deploy.log import DriveLog, read_log
from omnidrive.deploy.log_comparison import comparison_tables, replay_table
from omnidrive.deploy.log_replay import command_rows
from omnidrive.deploy.robot_link import ReportingLink, RobotLink
from omnidrive.deploy.scenario_files import attached_inputs, scenario_of_log
from omnidrive.deploy.scenario_robot import ScenarioRobot, scenario_pipeline, with_paper_noise
from omnidrive.errors import InvalidInput, InvalidLog
from omnidrive.evaluation.figures.command_difference import command_difference
from omnidrive.geometry import BodyTwist
from omnidrive.scenario import Scenario, plan_and_check
from omnidrive.study import RunFolder, planned_duration

SCENARIO = {
    "name": "eight",
    "seed": 3,
    "robot": {"name": "small"},
    "plant": "kinematic",
    "reference": {"type": "eight", "length": 0.4, "width": 0.2},
    "sensors": {"estimator": "kalman"},
    "tasks": {"track": {"durations": [4.0]}},
}


def planned_with(controller):
    scenario = Scenario.model_validate(SCENARIO | {"controllers": {"ours": controller}})
    return with_paper_noise(plan_and_check(scenario))


def inputs(planned, folder):
    made = RunFolder(folder / "inputs", numbered=True)
    made.save_inputs(planned)
    return attached_inputs(made)


def write_log(path, planned, hold_at=None):
    """Drive on simulated time with noisy poses; optionally held for a second on the way."""
    reference = planned.reference(planned_duration(planned))
    controls, clock = DriveControls(arm=True), SimulatedClock()

    class Link(SimulatedLink):
        def read(self):
            now = self._clock.now()
            if hold_at is not None and abs(now - hold_at) < 1e-6:
                controls.hold("a pause")
            elif hold_at is not None and abs(now - hold_at - 1.0) < 1e-6:
                controls.arm()
            return SimulatedLink.read(self)

    result = drive(
        Link(ScenarioRobot(planned)(), reference.at(0.0).pose),
        scenario_pipeline(planned, "ours"),
        reference,
        rate=1.0 / planned.scenario.sample_time,
        controls=controls,
        clock=clock,
        log=DriveLog(path, files=inputs(planned, path.parent)),
    )
    assert result.finished, result.ending
    return result


def replayed(path, planned):
    reference = planned.reference(planned_duration(planned))
    return replay_log(read_log(path), scenario_pipeline(planned, "ours"), reference)


ADAPTIVE = {"type": "holonomic-nmpc", "adapt": True}


@pytest.mark.parametrize(
    ("controller", "hold_at"),
    [
        ("feedforward", None),
        ("fuzzy_t1", 2.0),
        pytest.param(ADAPTIVE, None, marks=pytest.mark.long),
        pytest.param(ADAPTIVE, 2.0, marks=pytest.mark.long),
    ],
)
def test_the_same_controller_gives_the_logged_commands_bit_for_bit(controller, hold_at, tmp_path):
    planned = planned_with(controller)
    result = write_log(tmp_path / "a.mcap", planned, hold_at)
    with scenario_of_log(read_log(tmp_path / "a.mcap").files) as scenario:
        found = replayed(tmp_path / "a.mcap", plan_and_check(scenario))
    assert found.equal.all()
    assert found.logged.tobytes() == found.replayed.tobytes()
    np.testing.assert_array_equal(found.logged[:-1], result.run.command[:-1])
    assert not found.ending
    assert len(found.t) == len(result.run.t)
    assert ("All" in replay_table(found, "a.mcap").lead) == found.equal.all()


def test_another_controller_differs(tmp_path):
    write_log(tmp_path / "a.mcap", planned_with("feedforward"))
    found = replayed(tmp_path / "a.mcap", planned_with({"type": "feedforward", "position": 9}))
    assert 0 < found.equal.sum() < len(found.equal)  # the first and the last command are equal
    table = replay_table(found, "a.mcap")
    assert "commands differ" in table.lead
    difference = np.abs(found.replayed - found.logged)
    assert [row[0] for row in table.rows] == ["vx, m/s", "vy, m/s", "yaw rate, rad/s"]
    assert float(table.rows[0][1]) == pytest.approx(difference[:, 0].max(), rel=1e-2)
    assert float(table.rows[0][2]) == pytest.approx(found.t[difference[:, 0].argmax()])
    figure = command_difference(found.t, found.axes, found.logged, found.replayed)
    assert len(figure.axes) == 6


def test_two_logs_side_by_side(tmp_path):
    write_log(tmp_path / "a.mcap", planned_with("feedforward"), hold_at=2.0)
    write_log(tmp_path / "b.mcap", planned_with("fuzzy_t1"))
    logs = [read_log(tmp_path / name) for name in ("a.mcap", "b.mcap")]
    tracking, punctuality, states, commands = comparison_tables(logs, ["a", "b"])
    assert [row[:2] for row in tracking.rows] == [
        ("a", "FeedforwardController"), ("b", "FuzzyPidController"),
    ]  # fmt: skip
    assert float(tracking.rows[0][3]) > 0.0
    assert [row[3] for row in punctuality.rows] == ["0", "0"]
    named = [row[2] for row in states.rows if row[0] == "a"]
    assert named == ["armed", "running", "holding", "armed", "running", "stopped"]
    assert float(commands.rows[0][1]) > 0.0
    same = comparison_tables([logs[0], logs[0]], ["a", "a again"])[3]
    assert {row[1] for row in same.rows} == {"0"}


def test_commands_of_two_kinds_become_twists():
    robot = named_robot("small")
    twist = BodyTwist(0.1, -0.2, 0.3)
    speeds = WheelSpeeds(robot.chassis.wheel_speeds(twist))
    axes, rows = command_rows([twist, speeds], robot)
    assert [name for name, _ in axes] == ["vx", "vy", "yaw rate"]
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-12)
    axes, rows = command_rows([speeds, STOP], robot)
    assert axes[1] == ("speed of wheel 1", "rad/s")
    assert not rows[1].any()
    with pytest.raises(InvalidInput, match="torques cannot be compared"):
        command_rows([twist, WheelTorques([1.0] * 4)], robot)
    with pytest.raises(InvalidInput, match="not for the 4 wheels"):
        command_rows([WheelSpeeds([1.0] * 3)], robot)


def test_log_without_scenario_and_hostile_names_are_refused():
    with pytest.raises(InvalidLog, match="holds no scenario"), scenario_of_log({}):
        pass
    for name in ("../x", "a/b", "..", ".hidden", "a\\b", "x" * 200, "nul\0"):
        files = {"scenario/scenario.yaml": b"", f"scenario/{name}": b""}
        with pytest.raises(InvalidLog, match="unusable name"), scenario_of_log(files):
            pass


def test_scenario_of_a_log_imports_no_code(tmp_path):
    (tmp_path / "mine.py").write_text("raise SystemExit")
    files = {"scenario/scenario.yaml": b"name: x\ncontrollers: {a: 'mine.py:A'}\n"}
    with pytest.raises(InvalidInput, match="--allow-code"), scenario_of_log(files):
        pass


def test_robot_of_the_scenario_is_kept_beside_that_of_the_link(tmp_path):
    from omnidrive.robot import save_robot

    heavy = replace(named_robot("small"), mass=12.0)
    save_robot(heavy, tmp_path / "mine.yaml")
    data = SCENARIO | {"robot": {"name": str(tmp_path / "mine.yaml")}, "controllers": ["pid"]}
    files = inputs(plan_and_check(Scenario.model_validate(data)), tmp_path)
    assert set(files) == {"scenario/scenario.yaml", "scenario/robot.yaml"}
    with scenario_of_log(files) as scenario:
        assert plan_and_check(scenario).robot.mass == 12.0


def test_start_of_a_log_is_a_pose(tmp_path):
    write_log(tmp_path / "a.mcap", planned_with("feedforward"))
    (segment,) = read_log(tmp_path / "a.mcap").segments
    assert isinstance(segment.pose, Pose)


def drive_log(path, planned, clock, controller="ours"):
    link = ReplayLink(path)
    assert isinstance(link, RobotLink)
    assert isinstance(link, ReportingLink)
    reference = planned.reference(planned_duration(planned))
    pipeline = scenario_pipeline(planned, controller)
    result = drive(
        link, pipeline, reference, rate=1.0 / link.dt, start=reference.at(0.0).pose, clock=clock
    )
    return link, result


@pytest.mark.parametrize("begin", [0.0, 1234.5])
def test_a_log_drives_the_loop_as_the_robot_did(begin, tmp_path):
    planned = planned_with("feedforward")
    driven = write_log(tmp_path / "a.mcap", planned)
    link, result = drive_log(tmp_path / "a.mcap", planned, SimulatedClock(begin))
    assert result.finished
    np.testing.assert_allclose(result.run.command, driven.run.command, atol=1e-9)
    assert len(link.commands) == len(driven.run.t) - 1
    assert "vx 0 m/s" in link.report or "e-" in link.report
    other, _ = drive_log(
        tmp_path / "a.mcap", planned_with({"type": "feedforward", "position": 9}), SimulatedClock()
    )
    assert max(abs(ours.vx - logged.vx) for _, ours, logged in other.commands) > 1e-5


def test_a_log_that_ends_stops_the_loop(tmp_path):
    planned = planned_with("feedforward")
    write_log(tmp_path / "a.mcap", planned)
    longer = plan_and_check(
        Scenario.model_validate(
            SCENARIO
            | {"controllers": {"ours": "feedforward"}, "tasks": {"track": {"durations": [5]}}}
        )
    )
    _, result = drive_log(tmp_path / "a.mcap", longer, SimulatedClock())
    assert result.ending == "the link is lost: the log ends"


@pytest.mark.long  # it depends on the speed of the machine
def test_log_on_wall_time(tmp_path):
    planned = planned_with("feedforward")
    write_log(tmp_path / "a.mcap", planned)
    link = ReplayLink(tmp_path / "a.mcap")

    @dataclass
    class Fast:
        """A clock with wall time of the loop, ten times as fast."""

        def now(self):
            return 10.0 * time.monotonic()

        def sleep_until(self, t):
            time.sleep(max(0.0, 0.1 * t - time.monotonic()))

    reference = planned.reference(planned_duration(planned))
    result = drive(
        link, scenario_pipeline(planned, "ours"), reference, rate=1.0 / link.dt,
        start=reference.at(0.0).pose, clock=Fast(),
    )  # fmt: skip
    assert result.ending in {"the reference ends", "the link is lost: the log ends"}
    assert len(link.commands) > 0.5 * len(link._samples)
    differences = [abs(ours.vx - logged.vx) for _, ours, logged in link.commands]
    assert np.median(differences) < 1e-3
