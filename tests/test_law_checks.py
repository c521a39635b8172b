"""`omnidrive.testing`: estimators of this package pass, and each broken law is found.

Its controllers and plants are checked in tests/laws.
"""

from functools import partial
from math import nan

import numpy as np
import pytest

import omnidrive as od
from omnidrive.components import find_component
from omnidrive.errors import InvalidInput
from omnidrive.estimation import LatestFix
from omnidrive.geometry import to_body
from omnidrive.simulation import Disturbances, KinematicPlant, PoseOffset
from omnidrive.testing import check_controller, check_estimator, check_plant


@pytest.mark.parametrize("name", ["kalman", "latest-fix"])
def test_estimators_of_this_package_pass(name):
    check_estimator(find_component("estimators", name).factory)


class Law:
    """Proportional law, which tests break."""

    def __init__(self, **faults):
        self.faults, self.steps = faults, 0

    def reset(self, state):
        if "memory" not in self.faults:
            self.steps = 0

    def step(self, t, state, reference):
        self.steps += 1
        pose, target = state.pose, reference.at(t).pose
        x, y, yaw = (b - a for a, b in zip(pose, target, strict=True))
        errors = (2.0 * x, 2.0 * y, 2.0 * (yaw if "unwrapped" in self.faults else od.wrap(yaw)))
        twist = to_body(od.WorldTwist(*errors), pose.yaw)
        if "world" in self.faults:
            twist = od.BodyTwist(target.x - pose.x, target.y - pose.y, 0.0)
        if "memory" in self.faults:
            twist = twist._replace(vx=twist.vx + 1e-9 * self.steps)
        if "nan" in self.faults and abs(pose.x) > 10.0:
            twist = twist._replace(vx=float("nan"))
        if "tuple" in self.faults:
            return (1.0, 0.0, 0.0)
        if "exit" in self.faults:
            raise SystemExit("two\nlines")
        if "still" in self.faults:
            return od.Command(od.BodyTwist(0.0, 0.0, 0.0))
        if "twist" in self.faults and state.twist.vx > 0.0:
            return od.Command(twist)
        return od.Command(twist)


def test_correct_law_passes():
    check_controller(Law)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("memory", "determinism: after reset, the command at 0 s differs"),
        ("world", "rotation of the world: with the world turned by"),
        ("unwrapped", "wrapped heading: with the headings of the reference one turn greater"),
        ("nan", "finite commands: at the pose"),
        ("tuple", "protocol: it returned a tuple, not a Command: return Command(BodyTwist(vx, vy,"),
        ("exit", r"protocol: it raises SystemExit: two\nlines"),
        ("still", "convergence: 15 s after a step"),
        ("twist", "protocol: it raises AttributeError: 'NoneType' object has no attribute 'vx'"),
    ],
)
def test_broken_law_is_found(fault, message):
    with pytest.raises(AssertionError, match="the controller breaks") as caught:
        check_controller(partial(Law, **{fault: True}))
    assert message in str(caught.value)


def test_message_names_the_class_that_is_no_controller():
    class NoReset:
        def step(self, t, state, reference):
            """Return nothing."""

    with pytest.raises(InvalidInput, match=r"^the class NoReset is no controller: it has no"):
        check_controller(NoReset)


def test_object_that_is_no_controller_is_found():
    with pytest.raises(AssertionError, match=r"protocol: it is a dict, need reset\(state\) and"):
        check_controller(lambda: {})


class Faulty(KinematicPlant):
    """Plant with one broken law."""

    fault = ""
    steps = 0
    """Number of steps of all plants of the class."""

    def reset(self, pose):
        state = super().reset(pose)
        self.pose = pose
        if self.fault == "offset":
            return state._replace(pose=state.pose._replace(x=pose.x + 0.1))
        return state

    def step(self, twist, dt):
        type(self).steps += 1
        if self.fault == "scale":
            dt *= 1.1
        if self.fault == "world":
            twist = to_body(od.WorldTwist(*twist), self.pose.yaw)
        state = super().step(twist, dt)
        pose = state.pose
        match self.fault:
            case "wrapped":
                state = state._replace(pose=pose._replace(yaw=od.wrap(pose.yaw)))
            case "twist":
                state = state._replace(twist=od.BodyTwist(0.0, 0.0, 0.0))
            case "memory":
                state = state._replace(work=float(self.steps))
            case "drift":
                self.apply(Disturbances(offset=PoseOffset(x=dt)))
                state = state._replace(pose=pose._replace(x=pose.x + dt))
            case "tuple":
                state = tuple(state)
        self.pose = pose
        return state


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("tuple", "protocol: it returned a tuple, not a PlantState"),
        ("memory", "determinism: after reset, the state at 0.1 s differs"),
        ("offset", "start: after reset at"),
        ("drift", "start: without a command it moves to"),
        ("scale", "mean velocity: with the command"),
        ("world", "rotation of the world: with the world turned by"),
        ("wrapped", "continuous yaw: its yaw jumps by"),
        ("twist", "reported twist: its pose changes by"),
    ],
)
def test_broken_plant_is_found(fault, message):
    class Broken(Faulty):
        pass

    Broken.fault = fault
    with pytest.raises(AssertionError, match="the plant breaks") as caught:
        check_plant(lambda context: Broken(context.robot))
    assert message in str(caught.value)


def test_plants_are_closed_one_after_the_other():
    """Also that of a law that is broken; a plant may be exclusive."""
    opened, closed = [], []

    class Counted(Faulty):
        fault = "offset"

        def __init__(self, robot):
            super().__init__(robot)
            assert len(opened) == len(closed)
            opened.append(self)

        def close(self):
            closed.append(self)

    with pytest.raises(AssertionError, match=r"breaks 1 law\(s\)\n  start"):
        check_plant(lambda context: Counted(context.robot))
    assert opened == closed


class Broken(LatestFix):
    """Estimator with one broken law."""

    def __init__(self, fault):
        super().__init__()
        self.fault, self.updates = fault, 0

    def update(self, readings):
        state, self.updates = super().update(readings), self.updates + 1
        match self.fault:
            case "tuple":
                return tuple(state)
            case "bias":
                return state._replace(pose=state.pose._replace(x=state.pose.x + 1.0))
            case "memory":  # beyond the digits that an array is shown with
                return state._replace(covariance=np.eye(3) * (1.0 + 1e-13 * self.updates))
            case "covariance":
                return state._replace(covariance=-np.eye(3))
            case "absent" if not readings.fixes:
                return state._replace(pose=od.Pose(nan, nan, nan))
        return state


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("tuple", "protocol: it returned a tuple, not a State"),
        ("memory", "determinism: after reset, the estimate at 0 s differs"),
        ("bias", "start: after reset at"),
        ("bias", "accuracy: at 0 s it errs by 1 m"),
        ("covariance", "accuracy: its covariance at 0 s is not symmetric and positive"),
        ("absent", "absent readings: without any reading its pose is not finite"),
    ],
)
def test_broken_estimator_is_found(fault, message):
    with pytest.raises(AssertionError, match="the estimator breaks") as caught:
        check_estimator(partial(Broken, fault))
    assert message in str(caught.value)
