"""Kinds of bad controllers in a study with good ones, whose results are bit for bit as without.

Each kind is a class; a new one needs only its sentence in BAD_CONTROLLERS.
"""

import json
import random
import time
from math import nan

import numpy as np
import pytest

from omnidrive.control import Command, FeedforwardController, Status, WheelSpeeds, WheelTorques
from omnidrive.control import pipeline as pipeline_module
from omnidrive.control.components import ControllerContext
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.scenario.tasks import DurationsTask, StepTask, Tasks
from omnidrive.simulation import Outcome
from omnidrive.study import run_study
from tests.command import omnidrive
from tests.study.small import small_scenario

TWIST = BodyTwist(0.1, 0.0, 0.0)
FAULT_TIME = 0.45  # s
TASKS = Tasks(track=DurationsTask(durations=(20.0,)))
GOOD = {"feedforward": "feedforward", "pid": "pid"}


class Bad(FeedforwardController):
    """A good controller until :data:`FAULT_TIME`; its subclasses then ``fail``."""

    def __init__(self, context: ControllerContext):
        super().__init__(context.dt)
        object.__setattr__(self, "context", context)

    def step(self, t, state, reference):
        if t < FAULT_TIME:
            return super().step(t, state, reference)
        return self.fail(t, state, reference)


def returning(value):
    """A controller whose steps return ``value``."""
    return type("Returning", (Bad,), {"fail": lambda self, *_: value})


def raising(error):
    """A controller whose steps raise ``error``."""

    def fail(self, *_):
        raise error

    return type("Raising", (Bad,), {"fail": fail})


class NoText(Exception):
    def __str__(self):
        raise RuntimeError("no text")


class Recursive(Bad):
    def fail(self, *arguments):
        return self.fail(*arguments)


class FailsAtConstruction(Bad):
    def __init__(self, context: ControllerContext):
        raise RuntimeError("no licence")


class FailsAtReset(Bad):
    def reset(self, state):
        raise RuntimeError("no memory left")


class FailsAtPreparation(Bad):
    def prepare(self):
        raise RuntimeError("cannot factorise")


class ExitsAtPreparation(Bad):
    def prepare(self):
        raise SystemExit(0)


class RaisingUnits(Bad):
    @property
    def detail_units(self):
        raise RuntimeError("no units")


class ListedUnits(Bad):
    detail_units = ("gain", "1")


class NumberedUnits(Bad):
    detail_units = {"gain": 1}


class FewDetails(Bad):
    detail_units = {"a": "1", "b": "1"}

    def fail(self, *_):
        return Command(TWIST, Status.OK, (1.0,))


class DetailsOfText(FewDetails):
    def fail(self, *_):
        return Command(TWIST, Status.OK, ("1", "2"))


class DetailsInAnArray(FewDetails):
    def fail(self, *_):
        return Command(TWIST, Status.OK, np.ones(2))


class Sleeps(Bad):
    def fail(self, *_):
        time.sleep(60.0)


class ComputesForever(Bad):
    def fail(self, *_):
        while True:
            pass


class SleepsWithoutExceptions(Bad):
    """It suppresses exceptions, also one that every bare ``except`` catches."""

    def fail(self, *_):
        while True:
            try:
                time.sleep(60.0)
            except BaseException:
                time.sleep(0.001)
            for _ in range(100):
                pass


class StepIsNoMethod(Bad):
    step = None


def no_controller(context):
    return {}


class OtherSampleTime(Bad):
    dt = 0.05

    def __init__(self, context: ControllerContext):
        pass


def arrays_of(value):
    """Return all arrays that an object holds in its fields, also in those of its fields."""
    if isinstance(value, np.ndarray):
        return [value] if value.dtype == float and value.flags.writeable else []
    if isinstance(value, tuple | list):
        fields = list(value)
    else:
        names = getattr(type(value), "__dataclass_fields__", {})
        fields = [getattr(value, name, None) for name in names]
    return [array for field in fields for array in arrays_of(field)]


class Changing(Bad):
    """It changes what it receives, and goes on."""

    def fail(self, t, state, reference):
        robot = self.context.robot
        for array in (robot.chassis.jacobian, robot.drive.jacobian, *arrays_of(reference)):
            np.multiply(array, 1.5, out=array)
        reference.window(t, 3, 0.1)[:] = 7.0
        if state.covariance is not None:
            state.covariance[:] = -1.0
        random.seed(0)
        np.random.seed(0)  # noqa: NPY002
        return Command(TWIST)


CONTROLLER = "the controller had no usable command: "
RESULT = CONTROLLER + "it returned "
TIMED_OUT = CONTROLLER + "its step at 0.5 s took longer than 0.3 s"
BAD_CONTROLLERS = {
    "exception": (raising(ZeroDivisionError("law")), CONTROLLER + "ZeroDivisionError: law"),
    "exit": (raising(SystemExit(0)), CONTROLLER + "SystemExit: 0"),
    "generator-exit": (raising(GeneratorExit()), CONTROLLER + "GeneratorExit"),
    "group": (
        raising(ExceptionGroup("two", [OSError(), OSError()])),
        "ExceptionGroup: two (2 sub-",
    ),
    "traceback": (
        raising(OSError("Traceback (most recent call last):\n a")),
        CONTROLLER + "OSError: Traceback",
    ),
    "memory": (raising(MemoryError("1 TB")), CONTROLLER + "MemoryError: 1 TB"),
    "no-text": (raising(NoText()), CONTROLLER),
    "long-text": (raising(ValueError("\n" * 10**6)), CONTROLLER),
    "recursion": (Recursive, CONTROLLER + "RecursionError: maximum recursion depth exceeded"),
    "construction": (FailsAtConstruction, CONTROLLER + "RuntimeError: no licence"),
    "reset": (FailsAtReset, CONTROLLER + "RuntimeError: no memory left"),
    "preparation": (FailsAtPreparation, CONTROLLER + "RuntimeError: cannot factorise"),
    "exit-at-preparation": (ExitsAtPreparation, CONTROLLER + "SystemExit: 0"),
    "no-method": (StepIsNoMethod, CONTROLLER + "TypeError: a controller needs the methods reset"),
    "no-controller": (
        no_controller,
        "TypeError: a controller needs the methods reset(state)",
    ),
    "sample-time": (OtherSampleTime, "the controller is built for a sample time of 0.05 s, but"),
    "none": (returning(None), RESULT + "None, not a Command"),
    "tuple": (returning((0.1, 0.0, 0.0)), RESULT + "a tuple, not a Command"),
    "array": (returning(np.zeros(3)), RESULT + "an ndarray, not a Command"),
    "twist": (returning(TWIST), RESULT + "a BodyTwist, not a Command"),
    "class": (returning(Command), RESULT + "the class Command, not a Command"),
    "world-twist": (returning(Command(WorldTwist(1.0, 0.0, 0.0))), "holds a WorldTwist, not a Bo"),
    "array-as-twist": (returning(Command(np.zeros(3))), "its command holds an ndarray, not a Body"),
    "nan": (returning(Command(BodyTwist(nan, 0.0, 0.0))), "its twist is not finite: BodyTwist("),
    "huge": (returning(Command(BodyTwist(0.0, 0.0, 1e300))), "its twist is too large: BodyTwist("),
    "text": (returning(Command(BodyTwist("a", "b", "c"))), "its twist is not of numbers: BodyTwi"),
    "endless-number": (returning(Command(BodyTwist(0.0, 10**5000, 0.0))), "is not of numbers"),
    "arrays": (
        returning(Command(BodyTwist(*np.ones((3, 1))))),
        "not of numbers: BodyTwist(vx=array",
    ),
    "complex": (returning(Command(BodyTwist(1j, 0.0, 0.0))), "not of numbers: BodyTwist(vx=1j,"),
    "three-wheels": (returning(Command(WheelSpeeds([1.0] * 3))), "holds 3 wheel speeds, but the"),
    "torques": (returning(Command(WheelTorques([1.0] * 4))), "does not execute wheel torques"),
    "status-number": (returning(Command(TWIST, 1)), "status of its command is an int, not a Sta"),
    "status-text": (
        returning(Command(TWIST, "ok")),
        "status of its command is a str, not a Sta",
    ),
    "failed": (returning(Command(TWIST, Status.FAILED, message="no way")), CONTROLLER + "no way"),
    "failed-with-text": (
        returning(Command(BodyTwist("a", 0.0, 0.0), Status.FAILED, message=None)),
        CONTROLLER.removesuffix(": "),
    ),
    "failed-wheels": (
        returning(Command(WheelSpeeds([nan] * 9), Status.FAILED, ("a",), "solver")),
        CONTROLLER + "solver",
    ),
    "message": (returning(Command(TWIST, message=3)), "message of its command is an int, not a te"),
    "units-raise": (RaisingUnits, CONTROLLER + "RuntimeError: no units"),
    "units-in-a-tuple": (ListedUnits, CONTROLLER + "TypeError: detail_units must map names to un"),
    "units-as-numbers": (NumberedUnits, CONTROLLER + "TypeError: detail_units must map names to"),
    "few-details": (FewDetails, "its command holds 1 details, its detail_units 2"),
    "details-of-text": (DetailsOfText, "the details of its command are not all numbers: ('1', '2'"),
    "details-in-an-array": (DetailsInAnArray, "the details of its command are an ndarray, not a t"),
    "sleep": (Sleeps, TIMED_OUT),
    "endless-loop": (ComputesForever, TIMED_OUT),
    "sleep-without-exceptions": (SleepsWithoutExceptions, TIMED_OUT),
    "changes": (Changing, ""),
}
ENDS_AT_ONCE = {
    "construction", "reset", "preparation", "exit-at-preparation", "no-method", "no-controller",
    "sample-time", "units-raise", "units-in-a-tuple", "units-as-numbers",
}  # fmt: skip
TRACED = {
    "exception",
    "exit",
    "generator-exit",
    "recursion",
    "construction",
    "reset",
    "preparation",
}


def logs(controllers, **changes):
    """Return the log of every controller in one study."""
    scenario = small_scenario(controllers=controllers, tasks=TASKS, **changes)
    return {run.controller: run.log for run in run_study(scenario).logs.runs}


def assert_equal(one, two):
    """Check that two logs are equal in every bit, except for computing times."""
    assert one.ending == two.ending
    for a, b in zip(one.columns, two.columns, strict=True):
        assert a.name == "step_time" or a.values.tobytes() == b.values.tobytes(), a.name


def test_bad_controllers_change_no_result_of_good_ones(monkeypatch):
    """A good one runs before, between and after them, all in one process."""
    alone = logs(GOOD)
    monkeypatch.setattr(pipeline_module, "STEP_TIMEOUT", 0.3)
    bad = {name: kind for name, (kind, _) in BAD_CONTROLLERS.items()}
    found = logs({"feedforward": "feedforward", **bad, "pid": "pid", "again": "feedforward"})
    for name in GOOD:
        assert_equal(found[name], alone[name])
    assert_equal(found["again"], alone["feedforward"])
    for name, (_, sentence) in BAD_CONTROLLERS.items():
        run = found[name]
        assert sentence in run.ending, (name, run.ending)
        assert "\n" not in run.reason
        assert len(run.reason) < 400
        assert len(run.traceback) < 20_000
        if name == "changes":
            continue
        assert run.outcome is Outcome.CONTROLLER_FAILED
        assert run.status[-1] == Status.FAILED
        assert "test_bad_parts.py" in run.traceback or name not in TRACED
        if name in ENDS_AT_ONCE:
            assert len(run.t) == 1
        else:  # the log is kept; a stalled controller is held for 0.5 s and ramped to zero
            ends = 1.4 if sentence == TIMED_OUT else 0.5
            assert run.t[-1] == pytest.approx(ends), name
            assert np.isfinite(run.pose).all()
            assert run.status[:5].tolist() == [Status.OK] * 5


def test_stalled_controller_is_held_then_ramped_to_rest(monkeypatch):
    monkeypatch.setattr(pipeline_module, "STEP_TIMEOUT", 0.2)
    run = logs({"sleeps": Sleeps})["sleeps"]
    commands = run.command[4:]  # that of 0.4 s is the last one of the controller
    held, ramp = commands[1:6], commands[6:]
    assert (held == commands[0]).all()
    shares = np.linalg.norm(ramp, axis=1) / np.linalg.norm(commands[0])
    assert shares == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.0], abs=1e-9)
    assert run.status[5:].tolist() == [Status.FALLBACK] * 9 + [Status.FAILED]
    assert Pose(*run.pose[-1]) != Pose(*run.pose[4])


WITH_STEP = Tasks(track=TASKS.track, step=StepTask(displacement=(1.0, 1.0, 0.5), duration=4.0))


def test_failed_runs_are_in_results_and_report(tmp_path):
    bad = {"at-a-step": raising(ZeroDivisionError("in my law")), "at-reset": FailsAtReset}
    controllers = {"feedforward": "feedforward", **bad}
    scenario = small_scenario(controllers=controllers, tasks=WITH_STEP)
    study = run_study(scenario, tmp_path / "out", figures=())
    content = (tmp_path / "out" / "results.json").read_text()
    data = json.loads(content, parse_constant=pytest.fail)  # such as NaN
    found = {record["controller"]: record for record in data["runs"]}
    finished = {name: record["finished"] for name, record in found.items()}
    assert finished == {"feedforward": True, "at-a-step": False, "at-reset": False}
    assert "ZeroDivisionError: in my law" in found["at-a-step"]["outcome"]
    assert found["at-a-step"]["traceback"].startswith("Traceback")
    assert "RuntimeError: no memory left" in found["at-reset"]["outcome"]
    assert "no memory left" in (tmp_path / "out" / "report.html").read_text()
    assert len(study.logs.select("step")) == 3


def test_study_whose_runs_all_fail_at_the_start_has_a_report(tmp_path):
    scenario = small_scenario(controllers={"bad": FailsAtReset}, tasks=WITH_STEP)
    study = run_study(scenario, tmp_path / "out")
    assert {record.outcome for record in study.records} == {"controller_failed"}
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.long
def test_command_exits_with_status_1_and_names_the_run(tmp_path):
    (tmp_path / "mine.py").write_text(
        "class Faulty:\n"
        "    def reset(self, state): pass\n"
        "    def step(self, t, state, reference): return None\n"
    )
    done = omnidrive(
        "compare", "--plant", "kinematic", "--tasks", "track,step", "--jobs", "1",
        "--controllers", "feedforward", "--controller", "mine.py:Faulty", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1
    message = " ".join(done.stderr.split())
    assert "track-Faulty-20s (at 0 s: " in message
    assert "it returned None, not a Command" in message
    assert "Traceback" not in done.stderr
