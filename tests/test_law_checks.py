"""`omnidrive.testing`: every built-in part passes, and each broken law is found."""

from functools import partial

import pytest

import omnidrive as od
from omnidrive.components import find_component
from omnidrive.estimation import LatestFix
from omnidrive.geometry import to_body
from omnidrive.simulation import KinematicPlant
from omnidrive.testing import check_controller, check_estimator, check_plant


@pytest.mark.parametrize("name", ["feedforward", "holonomic-nmpc", "unicycle-nmpc", "pid"])
def test_controllers_of_this_package_pass(name):
    check_controller(find_component("controllers", name).factory)


@pytest.mark.parametrize("name", ["kinematic", "planar", "mujoco-balls"])
def test_plants_of_this_package_pass(name):
    check_plant(find_component("plants", name).factory)


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
        errors = (2.0 * (b - a) for a, b in zip(pose, target, strict=True))
        twist = to_body(od.WorldTwist(*errors), pose.yaw)
        if "world" in self.faults:
            twist = od.BodyTwist(target.x - pose.x, target.y - pose.y, 0.0)
        if "memory" in self.faults:
            twist = twist._replace(vx=twist.vx + 1e-9 * self.steps)
        if "nan" in self.faults and abs(pose.x) > 10.0:
            twist = twist._replace(vx=float("nan"))
        if "tuple" in self.faults:
            return (1.0, 0.0, 0.0)
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
        ("nan", "finite commands: at the pose"),
        ("tuple", "command: step returns a tuple, need Command"),
        ("still", "convergence: 15 s after a step"),
        ("twist", "command: it raises AttributeError: 'NoneType' object has no attribute 'vx'"),
    ],
)
def test_broken_law_is_found(fault, message):
    with pytest.raises(AssertionError, match="the controller breaks") as caught:
        check_controller(partial(Law, **{fault: True}))
    assert message in str(caught.value)


def test_object_that_is_no_controller_is_found():
    with pytest.raises(AssertionError, match=r"protocol: it is a dict, need reset\(state\) and"):
        check_controller(lambda: {})


class Drifting(KinematicPlant):
    """Plant with one broken law."""

    fault = ""

    def step(self, twist, dt):
        state = super().step(twist, dt)
        match self.fault:
            case "scale":
                return super().step(twist, 0.1 * dt)
            case "wrapped":
                yaw = state.pose.yaw if state.pose.yaw < 3.14 else state.pose.yaw - 6.28
                return state._replace(pose=state.pose._replace(yaw=yaw))
            case "twist":
                return state._replace(twist=od.BodyTwist(0.0, 0.0, 0.0))
            case "tuple":
                return tuple(state)
        return state


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("scale", "mean velocity: with the command"),
        ("wrapped", "continuous yaw: its yaw jumps by"),
        ("twist", "reported twist: its pose changes by"),
        ("tuple", "it raises AttributeError"),
    ],
)
def test_broken_plant_is_found(fault, message):
    class Broken(Drifting):
        pass

    Broken.fault = fault
    with pytest.raises(AssertionError, match="the plant breaks") as caught:
        check_plant(lambda context: Broken(context.robot))
    assert message in str(caught.value)


class Biased(LatestFix):
    """Estimator with an error of one metre."""

    def update(self, readings):
        state = super().update(readings)
        return replace_pose(state, x=state.pose.x + 1.0)


def replace_pose(state, **changes):
    return state._replace(pose=state.pose._replace(**changes))


def test_broken_estimator_is_found():
    with pytest.raises(AssertionError, match="accuracy: at 0 s it errs by 1 m"):
        check_estimator(Biased)
