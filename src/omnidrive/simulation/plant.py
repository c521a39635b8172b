"""The interface of every plant: anything that accepts a body twist and reports its true motion."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.simulation.disturbances.disturbances import Disturbances


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

    def step(self, twist: BodyTwist, dt: float) -> PlantState:
        """Command ``twist`` for ``dt`` (s); return the state at the end.

        Raises:
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
