"""Bad plants and state estimators of users in a study: they end their own run only.

All runs of a study have the same plant and estimator. Here these are good, except in the run of a
controller whose label names a kind of :data:`KINDS`.
"""

import logging
import time
from math import nan

import numpy as np
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.control import pipeline as pipeline_module
from omnidrive.errors import InvalidInput, PlantLost
from omnidrive.estimation import LatestFix, State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.scenario.sections import SensorsSection
from omnidrive.simulation import KinematicPlant, Outcome, PlantState, environment, guard
from tests.scenario.test_bad_parts import FAULT_TIME, assert_equal, logs

ORIGIN, REST = Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
active = []  # name of the part and what it does in the present run


class Labelled(FeedforwardController):
    """A good controller that sets the fault of the run for which it is made."""

    fault = ()

    def __init__(self, context):
        super().__init__(context.dt)
        active[:] = self.fault


class AnyPlant(KinematicPlant):
    """A good plant but for the active fault, without run-time type checks."""

    def __init__(self, context):
        super().__init__(context.robot)
        self.time = 0.0

    def reset(self, pose):
        self.time = 0.0
        good = super().reset(pose)
        return misbehave("plant.reset", good, self)

    def step(self, command, dt):
        self.time += dt
        good = super().step(command, dt)
        return misbehave("plant", good, self) if self.time > FAULT_TIME else good

    def close(self):
        misbehave("plant.close", None, self)


class AnyEstimator(LatestFix):
    def __init__(self, context):
        super().__init__()

    def reset(self, pose):
        super().reset(pose)
        misbehave("estimator.reset", None, self)

    def update(self, readings):
        good = super().update(readings)
        return misbehave("estimator", good, self) if readings.stamp > FAULT_TIME else good


def misbehave(part, good, owner):
    """Return ``good`` unless the active fault is one of this part of the ``owner``."""
    if not active or active[0] != part:
        return good
    value = active[1]
    if isinstance(value, BaseException):
        raise value
    return value(owner, good) if callable(value) else value


def sleep(owner, good):
    time.sleep(60.0)


def compute_forever(owner, good):
    while True:
        pass


def change_the_robot(owner, good):
    """Change what other runs would share, and go on."""
    owner.robot.chassis.jacobian[:] *= 1.5
    owner.robot.drive.jacobian[:] *= 1.5
    object.__setattr__(owner.robot, "max_wheel_speed", 0.1)
    return good


def state(**changes):
    """Return what replaces fields of a good state."""
    return lambda owner, good: good._replace(**changes)


PLANT, ESTIMATOR = "the plant failed: ", "the state estimator failed: "
KINDS = {
    "plant-exception": ("plant", OSError("no answer"), PLANT + "OSError: no answer"),
    "plant-exit": ("plant", SystemExit(0), PLANT + "SystemExit: 0"),
    "plant-lost": ("plant", PlantLost("no reply"), "the plant was lost: no reply"),
    "plant-refuses": ("plant", InvalidInput("too fast"), PLANT + "too fast"),
    "plant-none": ("plant", lambda *_: None, PLANT + "it returned None, not a PlantState"),
    "plant-tuple": ("plant", (0.0, 0.0), PLANT + "it returned a tuple, not a PlantState"),
    "plant-array": ("plant", np.zeros(3), PLANT + "it returned an ndarray, not a PlantState"),
    "plant-nan": ("plant", PlantState(Pose(nan, 0.0, 0.0), REST, 0.0), "its state is not finite"),
    "plant-text": ("plant", state(pose=Pose("0", 0, 0)), PLANT + "pose of its PlantState is Pose("),
    "plant-list": ("plant", state(wheel_speeds=[0.0] * 4), PLANT + "wheel_speeds of its PlantSt"),
    "plant-sleeps": ("plant", sleep, PLANT + "its step at 0.4 s took longer than 0.3 s"),
    "plant-endless": ("plant", compute_forever, PLANT + "its step at 0.4 s took longer than 0.3"),
    "plant-reset": ("plant.reset", RuntimeError("no scene"), PLANT + "RuntimeError: no scene"),
    "plant-reset-none": ("plant.reset", lambda *_: None, PLANT + "it returned None, not a Plant"),
    "plant-close": ("plant.close", OSError("no route"), "reached the end of the reference"),
    "plant-close-exit": ("plant.close", SystemExit(0), "reached the end of the reference"),
    "plant-changes": ("plant", change_the_robot, ""),
    "estimator-exception": ("estimator", KeyError("gyro"), ESTIMATOR + "KeyError: 'gyro'"),
    "estimator-exit": ("estimator", SystemExit(2), ESTIMATOR + "SystemExit: 2"),
    "estimator-none": ("estimator", lambda *_: None, ESTIMATOR + "it returned None, not a State"),
    "estimator-pose": ("estimator", ORIGIN, ESTIMATOR + "it returned a Pose, not a State"),
    "estimator-tuple": ("estimator", State(0.5, (0.0, 0.0)), ESTIMATOR + "pose of its State is (0"),
    "estimator-text": ("estimator", state(stamp="now"), "stamp of its State is 'now', need a numb"),
    "estimator-x": ("estimator", state(pose=Pose(None, 0.0, 0.0)), "State is Pose(x=None, y=0.0,"),
    "estimator-age": ("estimator", state(fix_age=None), "fix_age of its State is None, need a nu"),
    "estimator-twist": (
        "estimator",
        state(twist=(0.0, 0.0, 0.0)),
        "need a BodyTwist of numbers or",
    ),
    "estimator-list": ("estimator", state(covariance=[[1.0]]), "is [[1.0]], need a 3 x 3 array"),
    "estimator-covariance": ("estimator", state(covariance=np.eye(2)), "need a 3 x 3 array of num"),
    "estimator-sleeps": ("estimator", sleep, ESTIMATOR + "its call at 0.5 s took longer than"),
    "estimator-reset": ("estimator.reset", ValueError("no map"), ESTIMATOR + "ValueError: no map"),
}
AT_ONCE = {"plant-reset", "plant-reset-none", "estimator-reset"}
FINISHES = {"plant-close", "plant-close-exit", "plant-changes"}


def study(kinds):
    """Return the log of a good run, of one run of every kind, and of another good run."""
    bad = {
        name: type("Labelled", (Labelled,), {"fault": KINDS[name][:2]})  # its label names it
        for name in kinds
    }
    return logs(
        {"good": Labelled, **bad, "again": Labelled},
        plant=AnyPlant,
        sensors=SensorsSection(estimator=AnyEstimator),
    )


def test_bad_plants_and_estimators_end_their_own_run_only(monkeypatch, caplog):
    alone = study(())
    monkeypatch.setattr(pipeline_module, "STEP_TIMEOUT", 0.1)
    monkeypatch.setattr(guard, "PART_TIMEOUT", 0.3)
    monkeypatch.setattr(environment, "_SLOWEST", 0.0)
    with caplog.at_level(logging.WARNING):
        found = study(KINDS)
    for name in ("good", "again"):
        assert found[name].outcome is Outcome.FINISHED
        assert_equal(found[name], alone[name])
    for fact in ("OSError: no route", "SystemExit: 0"):
        assert f"the plant cannot be closed: {fact}" in caplog.text
    for name, (part, value, sentence) in KINDS.items():
        run = found[name]
        assert sentence in run.ending, (name, run.ending)
        assert "\n" not in run.reason
        is_traced = isinstance(value, Exception) and not isinstance(value, PlantLost | InvalidInput)
        assert bool(run.traceback) == (part != "plant.close" and (is_traced or "exit" in name))
        if name in FINISHES:
            continue
        if name in AT_ONCE:
            assert len(run.t) == 1
        else:
            assert run.t[-1] == pytest.approx(0.5 if part == "estimator" else 0.4), name
            assert run.pose[:4].tobytes() == alone["good"].pose[:4].tobytes()
