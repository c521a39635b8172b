"""The interface of every plant: anything that executes commands and reports its true motion."""

from __future__ import annotations

from enum import IntFlag
from math import ceil
from typing import Any, NamedTuple, Protocol, runtime_checkable

from omnidrive.control.command_check import MAX_COMMAND
from omnidrive.control.controller import CommandValue, WheelSpeeds, WheelTorques
from omnidrive.errors import InvalidInput, kind_of, short_repr
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import (
    are_finite,
    are_numbers,
    check_sample_time,
    is_count,
    is_number,
    numbers_rule,
    record_fault,
)
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances


class Saturation(IntFlag):
    """Limits of a plant that were reached, as the sum of their values."""

    NONE = 0
    """No limit."""
    WHEEL_SPEED = 1
    """The largest wheel speed: all commanded speeds are scaled down, or a commanded torque is
    reduced because it would accelerate a wheel beyond it."""
    TORQUE = 2
    """The largest torque of a motor."""
    FRICTION = 4
    """The friction of a wheel on the floor: the wheel slips."""


class PlantState(NamedTuple):
    """True state of a plant at one instant; only plants and simulated sensors receive it."""

    pose: Pose
    """Pose of B in W; m, m, rad. The yaw is continuous, not wrapped."""
    twist: BodyTwist
    """Velocity of B in B; m/s, m/s, rad/s."""
    work: float
    """Mechanical work of the motors since ``reset``, the sum over wheels of the integral of
    |torque * speed|, J; NaN for a plant without forces."""
    wheel_angles: tuple[float, ...] = ()
    """Angle of each wheel since ``reset``, rad, with the signs of the wheel matrix; empty for a
    plant without wheels."""
    wheel_torques: tuple[float, ...] = ()
    """Mean torque of each motor at its wheel during the last step, N m; empty for a plant without
    forces."""
    collisions: int = 0
    """Number of contacts of the body with obstacles that began since ``reset``."""
    wheel_speeds: tuple[float, ...] = ()
    """Speed of each wheel, rad/s, with the signs of the wheel matrix; empty if not reported."""
    saturated: int = 0
    """Limits that were reached during the last step, a sum of :class:`Saturation`."""


class PlantCapabilities(NamedTuple):
    """What a plant supports, so that callers need neither its class nor its name."""

    disturbable: bool = False
    """Whether it is a :class:`DisturbablePlant`."""
    collides: bool = False
    """Whether obstacles stop it and are counted."""
    exclusive: bool = False
    """Whether only one instance can run at a time, as with a running simulator."""
    renders: bool = False
    """Whether it has a MuJoCo ``model`` and ``data`` to draw, and an ``observer`` hook."""
    forces: bool = False
    """Whether motors, masses and friction act; otherwise twists are executed exactly."""
    wheel_speeds: bool = False
    """Whether it executes commands of wheel speeds, as every plant executes body twists."""
    wheel_torques: bool = False
    """Whether it executes commands of wheel torques."""


@runtime_checkable
class Plant(Protocol):
    """A simulated robot."""

    @property
    def capabilities(self) -> PlantCapabilities:
        """What the plant supports."""
        ...

    def reset(self, pose: Pose) -> PlantState:
        """Start a run at rest at ``pose``."""
        ...

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Execute ``command`` for ``dt`` (s); return the state at the end.

        Without the capabilities ``wheel_speeds`` and ``wheel_torques`` it receives body twists
        only.

        Raises:
            InvalidInput: The plant cannot execute the command for this time, see
                :func:`check_step`.
            PlantLost: The simulator cannot be reached any more.
        """
        ...

    def close(self) -> None:
        """Release what the plant holds, such as a connection; it is not used afterwards."""
        ...


@runtime_checkable
class DisturbablePlant(Plant, Protocol):
    """A plant that disturbances act on."""

    def apply(self, disturbances: Disturbances) -> None:
        """Set the disturbances that act from now on; ``reset`` removes them.

        Raises:
            InvalidInput: A disturbance names a wheel that the robot does not have.
        """
        ...


def check_step(command: object, dt: Any, capabilities: PlantCapabilities, wheels: int) -> None:
    """Check that a plant can execute a command for ``dt`` (s).

    Every plant begins ``step`` with this check.

    Raises:
        InvalidInput: It cannot execute the command, see :func:`check_command`, or ``dt`` is not a
            number from 1e-9 to 3600.
    """
    check_sample_time(dt)
    check_command(command, capabilities, wheels)


def count_steps(dt: float, longest: float) -> int:
    """Return the smallest number of equal integration steps of at most ``longest`` (s) in ``dt``.

    A step may be longer by a rounding error.
    """
    return max(ceil(dt / longest - 1e-9), 1)


def check_command(command: object, capabilities: PlantCapabilities, wheels: int) -> None:
    """Check that a plant can execute a command.

    Args:
        command: The command.
        capabilities: Capabilities of the plant.
        wheels: Number of wheels of its robot; 0: unknown.

    Raises:
        InvalidInput: It is not a command, a number in it is not finite or beyond 1e9, the plant
            does not take wheel speeds or torques, or the number of values is not that of the
            wheels.
    """
    if not isinstance(command, BodyTwist | WheelSpeeds | WheelTorques):
        raise InvalidInput(
            f"a plant executes a BodyTwist, WheelSpeeds or WheelTorques, got {kind_of(command)}"
        )
    if not (are_finite(command) and max(map(abs, command), default=0.0) <= MAX_COMMAND):
        raise InvalidInput(
            f"a command must consist of numbers within +-{MAX_COMMAND:g}, got "
            f"{short_repr(command, 200)}"
        )
    if isinstance(command, BodyTwist):
        return
    speeds = isinstance(command, WheelSpeeds)
    if not (capabilities.wheel_speeds if speeds else capabilities.wheel_torques):
        raise InvalidInput(
            f"this plant does not execute {command.noun}: command a BodyTwist, or use a plant that "
            "does, such as planar"
        )
    if wheels and len(command) != wheels:
        raise InvalidInput(
            f"the command holds {len(command)} {command.noun}, but the robot has {wheels} wheels: "
            "give one value per wheel, in the order of robot.mounts"
        )


def plant_state_fault(state: Any) -> str | None:
    """Return what is wrong with the result of a plant, in one line; None: nothing."""
    fault = record_fault(state, PlantState, _STATE_RULES)
    if fault is None and not (are_finite(state.pose) and are_finite(state.twist)):
        return "its state is not finite"
    return fault


_STATE_RULES = {
    "pose": numbers_rule(Pose),
    "twist": numbers_rule(BodyTwist),
    "work": (is_number, "a number"),
    "wheel_angles": (are_numbers, "a tuple of numbers"),
    "wheel_torques": (are_numbers, "a tuple of numbers"),
    "collisions": (is_count, "a whole number from 0"),
    "wheel_speeds": (are_numbers, "a tuple of numbers"),
    "saturated": (is_count, "a sum of Saturation"),
}


def check_robot(robot: object, plant: str) -> None:
    """Raise :class:`InvalidInput` if ``robot`` is not a :class:`Robot`; ``plant``: its name."""
    if isinstance(robot, Robot):
        return
    way = f"od.named_robot('{robot}')" if isinstance(robot, str) else "the robot itself"
    raise InvalidInput(f"{plant} needs a Robot, got {kind_of(robot)}: pass {way}")
