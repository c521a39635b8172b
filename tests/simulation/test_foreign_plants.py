"""Plants, sensors and references of users that misbehave: the run ends, and its log is kept."""

import time
from math import inf, nan

import numpy as np
import pytest

from omnidrive.control import FeedforwardController, pipeline
from omnidrive.errors import InvalidInput, PlantLost
from omnidrive.estimation import LatestFix, PoseFix, SensorReadings
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold, Setpoint
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    KinematicPlant,
    Outcome,
    PerfectSensors,
    PlantState,
    environment,
    guard,
    simulate,
)

DT = 0.1
SMALL = named_robot("small")
START, REST = Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
GOOD = PlantState(START, REST, 0.0)
READINGS = SensorReadings(0.5)
FIX = PoseFix(0.5, START, 0.0, 0.0)
BAD_AFTER = 4
"""Number of calls that succeed."""


class Unprintable(Exception):
    def __str__(self):
        raise ValueError("no text")


class Bad:
    """Makes a method of a part misbehave from its fifth call on."""

    def __init__(self, value):
        self.value, self.calls = value, 0

    def __call__(self, good):
        self.calls += 1
        if self.calls <= BAD_AFTER:
            return good()
        if isinstance(self.value, BaseException):
            raise self.value
        if callable(self.value):
            return self.value()
        return self.value


def spoiled(part, method, value):
    """Return a class with a method that misbehaves, which is not type-checked at run time."""
    bad, original = Bad(value), getattr(part, method)
    replaced = {method: lambda self, *given: bad(lambda: original(self, *given))}
    return type(part.__name__, (part,), replaced)


def plant_with(value, method="step"):
    return spoiled(KinematicPlant, method, value)(SMALL)


def sensors_with(value):
    return spoiled(PerfectSensors, "read", value)()


def run(plant=None, sensors=None, reference=None, estimator=None):
    return simulate(
        plant or KinematicPlant(SMALL),
        FeedforwardController(DT),
        reference or Hold(Pose(0.5, 0.0, 0.0), 1.0),
        start=START,
        dt=DT,
        sensors=sensors,
        estimator=estimator,
    )


def check(log, outcome, reason, rows):
    """Check a failed run, whose log contains the samples before the failure."""
    assert log.outcome is outcome
    assert reason in log.reason
    assert "\n" not in log.reason
    assert len(log.reason) < 320
    assert log.t == pytest.approx(DT * np.arange(rows))
    assert np.isfinite(log.pose).all()


ERRORS = {
    "exception": (OSError("no answer"), "OSError: no answer"),
    "two lines": (OSError("no\nanswer"), "OSError: no"),
    "long": (ValueError("x" * 10_000), "ValueError: xxx"),
    "unprintable": (Unprintable(), "Unprintable: its message raises a ValueError"),
    "exit": (SystemExit(3), "SystemExit: 3"),
    "none": (None, "it returned None, not a"),
    "tuple": ((0.0, 0.0, 0.0), "it returned a tuple, not a"),
    "array": (np.zeros(3), "it returned an ndarray, not a"),
}
STATES = {
    "nan": (GOOD._replace(pose=Pose(nan, 0.0, 0.0)), "its state is not finite"),
    "infinite twist": (GOOD._replace(twist=BodyTwist(0.0, inf, 0.0)), "its state is not finite"),
    "pose": (GOOD._replace(pose=(0.0, 0.0)), "pose of its PlantState is (0.0, 0.0), need a Pose"),
    "text": (GOOD._replace(pose=Pose("0", 0.0, 0.0)), "need a Pose of numbers"),
    "integer": (GOOD._replace(pose=Pose(10**400, 0.0, 0.0)), "need a Pose of numbers"),
    "arrays": (GOOD._replace(pose=Pose(np.zeros(2), 0.0, 0.0)), "need a Pose of numbers"),
    "twist": (GOOD._replace(twist=None), "twist of its PlantState is None, need a BodyTwist"),
    "list": (GOOD._replace(wheel_angles=[0.0] * 4), "need a tuple of numbers"),
    "wheels": (GOOD._replace(wheel_speeds=(None,) * 4), "wheel_speeds of its PlantState is (None"),
    "work": (GOOD._replace(work=None), "work of its PlantState is None, need a number"),
    "collisions": (GOOD._replace(collisions=nan), "collisions of its PlantState is nan"),
    "saturated": (GOOD._replace(saturated=2**70), "need a sum of Saturation"),
}
FIXES = {
    "stamp": (READINGS._replace(stamp=nan), "stamp of its SensorReadings is nan"),
    "angles": (READINGS._replace(wheel_angles=np.zeros(4)), "need a tuple of numbers"),
    "rate": (READINGS._replace(yaw_rate="1"), "yaw_rate of its SensorReadings is '1'"),
    "fix": (READINGS._replace(fixes=(START,)), "need a tuple of PoseFix"),
    "fixes": (READINGS._replace(fixes=FIX), "need a tuple of PoseFix"),
    "fix pose": (READINGS._replace(fixes=(FIX._replace(pose=None),)), "need a tuple of PoseFix"),
}


@pytest.mark.parametrize(("value", "reason"), [*ERRORS.values(), *STATES.values()])
def test_faulty_plant_ends_the_run(value, reason):
    log = run(plant_with(value))
    check(log, Outcome.PLANT_FAILED, reason, BAD_AFTER + 1)
    assert bool(log.traceback) == isinstance(value, BaseException)


@pytest.mark.parametrize(("value", "reason"), [*ERRORS.values(), *FIXES.values()])
def test_faulty_sensors_end_the_run(value, reason):
    log = run(sensors=sensors_with(value))
    check(log, Outcome.SENSORS_FAILED, reason, BAD_AFTER)
    assert bool(log.traceback) == isinstance(value, BaseException)


def stalled():
    time.sleep(60.0)


def endless():
    while True:
        pass


@pytest.mark.parametrize("stall", [stalled, endless])
def test_stalled_part_is_ended_with_its_log(monkeypatch, stall):
    monkeypatch.setattr(guard, "PART_TIMEOUT", 0.2)
    monkeypatch.setattr(environment, "_SLOWEST", 0.0)
    began = time.monotonic()
    log = run(plant_with(stall))
    check(log, Outcome.PLANT_FAILED, "its step at 0.4 s took longer than 0.2 s", BAD_AFTER + 1)
    log = run(sensors=sensors_with(stall))
    check(log, Outcome.SENSORS_FAILED, "its read at 0.4 s took longer than 0.2 s", BAD_AFTER)
    assert time.monotonic() - began < 5.0


def test_lost_plant_and_errors_of_the_package_keep_the_log():
    check(run(plant_with(PlantLost("no reply"))), Outcome.PLANT_LOST, "no reply", BAD_AFTER + 1)
    refused = run(plant_with(InvalidInput("too fast")))
    check(refused, Outcome.PLANT_FAILED, "too fast", BAD_AFTER + 1)
    assert not refused.traceback
    unread = run(sensors=sensors_with(InvalidInput("no wheel 4")))
    check(unread, Outcome.SENSORS_FAILED, "no wheel 4", BAD_AFTER)


@pytest.mark.parametrize("method", ["reset", "step"])
def test_error_of_the_package_before_the_first_step_is_raised(method):
    """It concerns every run, such as a sample time that a simulator cannot make."""
    plant = plant_with(InvalidInput("not a multiple of the time step"), method)
    for _ in range(BAD_AFTER):
        plant.reset(START)
        plant.step(REST, DT)
    with pytest.raises(InvalidInput, match="not a multiple"):
        run(plant)


def test_interrupt_of_a_plant_is_not_swallowed():
    with pytest.raises(KeyboardInterrupt):
        run(plant_with(KeyboardInterrupt()))


@pytest.mark.parametrize(("value", "reason"), list(ERRORS.values())[:5])
def test_failed_start_has_one_row(value, reason):
    class Failing(KinematicPlant):
        def reset(self, pose):
            raise value

    log = run(Failing(SMALL))
    check(log, Outcome.PLANT_FAILED, reason, 1)

    class Silent(PerfectSensors):
        def reset(self, pose):
            raise value

    check(run(sensors=Silent()), Outcome.SENSORS_FAILED, reason, 1)


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        (SystemExit(3), "SystemExit: 3"),
        (InvalidInput("no map"), "no map"),
        (None, "AttributeError: 'NoneType' object has no attribute 'pose'"),
        (Setpoint((0.0, 0.0, 0.0), REST), "its setpoint holds a tuple, not a Pose"),
        (Setpoint(Pose("0", 0.0, "90"), REST), "TypeError: must be real number, not str"),
        (Setpoint(Pose(0.0, 0.0, inf), REST), "its pose at 0 s is not finite"),
        (time.sleep, "its pose at 0 s took longer than 0.2 s"),
    ],
)
def test_faulty_reference_ends_the_run_at_its_start(monkeypatch, target, reason):
    class Faulty:
        duration = 1.0

        def at(self, t):
            if isinstance(target, BaseException):
                raise target
            return target(60.0) if callable(target) else target

        def window(self, t, n, dt):
            raise NotImplementedError

    monkeypatch.setattr(guard, "PART_TIMEOUT", 0.2)
    check(run(reference=Faulty()), Outcome.REFERENCE_FAILED, reason, 1)


def test_stalled_reset_of_an_estimator_is_a_failure_of_the_estimator(monkeypatch):
    class Stalled(LatestFix):
        def reset(self, pose):
            time.sleep(60.0)

    monkeypatch.setattr(pipeline, "STEP_TIMEOUT", 0.01)
    log = run(estimator=Stalled())
    check(log, Outcome.ESTIMATOR_FAILED, "its reset took longer than 0.4 s", 1)


@pytest.mark.parametrize("duration", [nan, inf, -1.0, None, "1"])
def test_reference_without_a_duration_ends_the_run(duration):
    reference = Hold(START, 1.0)
    object.__setattr__(reference, "duration", duration)
    check(run(reference=reference), Outcome.REFERENCE_FAILED, "its duration is", 1)
