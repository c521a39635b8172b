"""Faulty controllers, plants and estimators of users: they end their own run only."""

import json
import subprocess
import sys
from math import nan

import numpy as np
import pytest

from omnidrive.control import Command, FeedforwardController, Status, WheelSpeeds
from omnidrive.estimation import LatestFix, State
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, Outcome, simulate
from omnidrive.study import jobs, run_study, save_scenario
from omnidrive.study.tasks import DurationsTask, StepTask, Tasks
from tests.study.small import small_scenario

DT = 0.1
HOLD = Hold(Pose(0.5, 0.0, 0.0), 1.0)
TWIST = BodyTwist(0.1, 0.0, 0.0)
POSE = Pose(0.0, 0.0, 0.0)


class Faulty(FeedforwardController):
    """A controller that returns ``value``, or raises it, from 0.45 s on."""

    value = None

    def step(self, t, state, reference):
        if t < 0.45:
            return super().step(t, state, reference)
        if isinstance(self.value, BaseException):
            raise self.value
        return self.value


class FaultyReset(FeedforwardController):
    def reset(self, state):
        raise RuntimeError("no memory left")


class FaultyPreparation(FeedforwardController):
    def prepare(self):
        raise RuntimeError("cannot factorise")


def faulty(value):
    """A controller whose steps fail with ``value``."""
    return type("Faulty", (Faulty,), {"value": value})(DT)


def run(controller=None, plant=None, estimator=None):
    return simulate(
        plant or KinematicPlant(named_robot("small")),
        controller or FeedforwardController(DT),
        HOLD,
        start=Pose(0.0, 0.0, 0.0),
        dt=DT,
        estimator=estimator,
    )


BAD_COMMANDS = {
    "exception": (ZeroDivisionError("in my law"), "ZeroDivisionError: in my law"),
    "several lines": (ZeroDivisionError("in\nmy law"), "ZeroDivisionError: in"),
    "group": (ExceptionGroup("two", [OSError(), OSError()]), "ExceptionGroup: two (2 sub-exc"),
    "traceback as message": (OSError("Traceback (most recent call last):\n a"), "OSError: Traceb"),
    "none": (None, "returned None, not a Command"),
    "tuple": ((0.1, 0.0, 0.0), "returned a tuple, not a Command"),
    "twist": (TWIST, "returned a BodyTwist, not a Command"),
    "world twist": (Command(WorldTwist(0.1, 0.0, 0.0)), "holds a WorldTwist, not a BodyTwist"),
    "array": (Command(np.zeros(3)), "holds an ndarray, not a BodyTwist"),
    "nan": (Command(BodyTwist(nan, 0.0, 0.0)), "its twist is not finite"),
    "huge": (Command(BodyTwist(1e300, 0.0, 0.0)), "its twist is too large: BodyTwist(vx=1e+300"),
    "number without end": (Command(BodyTwist(0.0, 10**5000, 0.0)), "its twist is not of numbers"),
    "text": (Command(BodyTwist("a", 0.0, 0.0)), "its twist is not of numbers: BodyTwist(vx='a',"),
    "arrays": (
        Command(BodyTwist(*np.ones((3, 1)))),
        "its twist is not of numbers: BodyTwist(vx=array([1.])",
    ),
    "complex": (Command(BodyTwist(1j, 0.0, 0.0)), "its twist is not of numbers: BodyTwist(vx=1j,"),
    "status as a number": (Command(TWIST, 0), "the status of its command is an int, not a Status"),
    "status as text": (Command(TWIST, "ok"), "the status of its command is a str, not a Status"),
    "no message": (Command(TWIST, message=None), "the message of its command is None, not a text"),
    "generator exit": (GeneratorExit(), "GeneratorExit"),
    "exit": (SystemExit(0), "SystemExit: 0"),
    "failed with text": (Command(BodyTwist("a", 0.0, 0.0), Status.FAILED, message=None), ""),
    "failed wheels": (Command(WheelSpeeds([nan] * 9), Status.FAILED, ("a",), "solver"), "solver"),
    "failed": (Command(TWIST, Status.FAILED, message="no solution"), "no solution"),
}


@pytest.mark.parametrize("name", BAD_COMMANDS)
def test_faulty_command_is_an_outcome(name):
    value, reason = BAD_COMMANDS[name]
    log = run(faulty(value))
    assert log.outcome is Outcome.CONTROLLER_FAILED
    assert reason in log.reason
    assert log.t[-1] == pytest.approx(0.5)
    assert log.status.tolist() == [0] * 5 + [Status.FAILED]
    assert ("test_foreign_parts.py" in log.traceback) == isinstance(value, BaseException)


@pytest.mark.parametrize("kind", [FaultyReset, FaultyPreparation])
def test_failed_start_of_a_controller_is_logged_with_one_row_and_traceback(kind):
    log = run(kind(DT))
    assert log.outcome is Outcome.CONTROLLER_FAILED
    assert len(log.t) == 1
    assert log.reason.startswith("RuntimeError: ")
    assert "test_foreign_parts.py" in log.traceback


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (KeyError("gyro"), "KeyError: 'gyro'"),
        (None, "returned None, not a State"),
        (Pose(0.0, 0.0, 0.0), "returned a Pose, not a State"),
        (State(0.0, (0.0, 0.0)), "pose of its State is (0.0, 0.0), need a Pose of numbers"),
        (State("0.5", POSE), "stamp of its State is '0.5', need a number"),
        (State(0.5, Pose(None, 0.0, 0.0)), "pose of its State is Pose(x=None, y=0.0, yaw=0.0)"),
        (State(0.5, POSE, (0.0, 0.0, 0.0)), "need a BodyTwist of numbers or None"),
        (State(0.5, POSE, None, [[1.0]]), "covariance of its State is [[1.0]], need a 3 x 3 array"),
        (State(0.5, POSE, None, np.eye(2)), "covariance of its State is array([[1., 0.],"),
        (State(0.5, POSE, fix_age=None), "fix_age of its State is None, need a number"),
        (SystemExit(3), "SystemExit: 3"),
    ],
)
def test_faulty_estimator_is_an_outcome(value, reason):
    class Faulty(LatestFix):
        def update(self, readings):
            if readings.stamp < 0.45:
                return super().update(readings)
            if isinstance(value, BaseException):
                raise value
            return value

    log = run(estimator=Faulty())
    assert log.outcome is Outcome.ESTIMATOR_FAILED
    assert reason in log.reason
    assert log.t[-1] == pytest.approx(0.5)


def with_fault(value):
    """Return ``make_controller`` with a faulty controller in place of `pid`."""
    original = jobs.make_controller

    def make(scenario, robot, label, *more):
        return faulty(value) if label == "pid" else original(scenario, robot, label, *more)

    return make


SCENARIO = small_scenario(
    controllers=("feedforward", "pid"),
    tasks=Tasks(
        track=DurationsTask(durations=(20.0,)),
        step=StepTask(displacement=(1.0, 1.0, 0.5), duration=4.0),
    ),
)


def test_other_runs_of_the_study_finish(tmp_path, monkeypatch):
    monkeypatch.setattr(jobs, "make_controller", with_fault(ZeroDivisionError("in my law")))
    study = run_study(SCENARIO, tmp_path / "out")
    data = json.loads((tmp_path / "out" / "results.json").read_text())
    finished = {record["name"]: record["finished"] for record in data["runs"]}
    assert finished == {"track-feedforward-20s": True, "track-pid-20s": False}
    (failed,) = (record for record in data["runs"] if not record["finished"])
    assert "ZeroDivisionError: in my law" in failed["outcome"]
    assert failed["traceback"].startswith("Traceback")
    assert (tmp_path / "out" / "report.html").exists()
    assert len(study.results.steps) == 2


def test_run_that_fails_before_its_first_sample_is_reported(tmp_path, monkeypatch):
    original = jobs.make_controller
    monkeypatch.setattr(
        jobs,
        "make_controller",
        lambda scenario, robot, label, *more: (
            FaultyReset(DT) if label == "pid" else original(scenario, robot, label, *more)
        ),
    )
    run_study(SCENARIO, tmp_path / "out")
    data = json.loads((tmp_path / "out" / "results.json").read_text())
    (failed,) = (record for record in data["runs"] if not record["finished"])
    assert "RuntimeError: no memory left" in failed["outcome"]


def test_study_whose_runs_all_fail_at_the_start_has_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(jobs, "make_controller", lambda *_: FaultyReset(DT))
    study = run_study(SCENARIO, tmp_path / "out")
    assert {result.run.outcome for result in study.results.tracks} == {Outcome.CONTROLLER_FAILED}
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.long
def test_command_exits_with_status_1_and_names_the_run(tmp_path):
    save_scenario(SCENARIO, tmp_path / "s.yaml")
    code = (
        "import sys, omnidrive.study.jobs as jobs\n"
        "original = jobs.make_controller\n"
        "class Faulty:\n"
        "    def reset(self, state): pass\n"
        "    def step(self, t, state, reference): return None\n"
        "def make(scenario, robot, label, *more):\n"
        "    return Faulty() if label == 'pid' else original(scenario, robot, label, *more)\n"
        "jobs.make_controller = make\n"
        "from omnidrive.cli import main\n"
        "sys.argv[1:] = ['compare', 's.yaml', '--jobs', '1', '--out', 'out']\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    message = " ".join(done.stderr.split())
    assert "track-pid-20s at 0 s" in message
    assert "it returned None, not a Command" in message
    assert "Traceback" not in done.stderr
