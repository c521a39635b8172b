"""Check of a plant against the laws, the properties that all plants must have."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np

from omnidrive.control.controller import STOP
from omnidrive.errors import kind_of
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, to_world
from omnidrive.robot import Robot
from omnidrive.simulation import Plant, PlantCapabilities, PlantState
from omnidrive.simulation.components import PlantContext
from omnidrive.simulation.plant import plant_state_fault
from omnidrive.testing.laws import Laws, rotated

_START = Pose(0.5, 0.2, 0.3)
_TWIST = BodyTwist(0.3, -0.2, 0.7)


def check_plant(
    factory: Callable[..., Any],
    *,
    robot: Robot | None = None,
    parameters: Any = None,
    tolerance: float = 0.02,
) -> None:
    """Check a plant against the laws of :class:`~omnidrive.simulation.Plant`.

    - It has ``capabilities``, ``reset``, ``step`` and ``close``, and its states are of the type
      ``PlantState``.
    - It starts at rest at the given pose and stays there without a command.
    - Two runs with the same commands are the same, bit for bit; ``reset`` clears all memory.
    - Its mean velocity is the commanded twist, after a second of acceleration.
    - Rotating the world rotates its motion; its yaw is continuous over whole turns.
    - The reported twist is the derivative of the pose.

    Args:
        factory: The class or function that makes the plant, as for the command-line option
            ``--plant``.
        robot: The robot. None: the built-in robot `small`.
        parameters: Parameters for the factory. None: the defaults.
        tolerance: Greatest error of a mean velocity, m/s and rad/s, and of a pose, m and rad.

    Raises:
        AssertionError: A law is broken; the message has one line for each.
    """
    laws = _PlantLaws(factory, robot, parameters, tolerance)
    try:
        laws.check(
            start=laws.start,
            mean_velocity=laws.mean_velocity,
            rotation_of_the_world=laws.rotation,
            continuous_yaw=laws.continuous_yaw,
            reported_twist=laws.reported_twist,
        )
    finally:
        laws.close()


class _PlantLaws(Laws):
    """The laws for one factory."""

    kind, row = "plant", "state"

    def __init__(
        self, factory: Callable[..., Any], robot: Robot | None, parameters: Any, tolerance: float
    ) -> None:
        super().__init__(factory, robot, parameters)
        self.tolerance = tolerance
        self._made: Any = None

    def make(self) -> Any:
        """Return a new plant; the one before is closed, because a plant may be exclusive."""
        self.close()
        self._made = super().make()
        return self._made

    def close(self) -> None:
        """Close the latest plant."""
        getattr(self._made, "close", lambda: None)()

    def context(self) -> PlantContext:
        """Return the context for the factory."""
        return PlantContext(self.robot)

    def protocol(self) -> str | None:
        """Return why the object is no plant or its state malformed; None: neither."""
        made = self.make()
        if not isinstance(made, Plant):
            return f"it is {kind_of(made)}, need capabilities, reset, step and close"
        if not isinstance(made.capabilities, PlantCapabilities):
            return f"its capabilities are {kind_of(made.capabilities)}, not PlantCapabilities"
        return plant_state_fault(made.reset(_START)) or plant_state_fault(made.step(STOP, self.dt))

    def record(self, part: Plant) -> list[PlantState]:
        """Return the states of ten steps after a reset."""
        return [part.reset(_START), *(part.step(_TWIST, self.dt) for _ in range(10))]

    def drive(self, start: Pose, twist: BodyTwist, steps: int) -> list[PlantState]:
        """Return the states of a new plant after each step with a constant command."""
        plant = self.make()
        plant.reset(start)
        return [plant.step(twist, self.dt) for _ in range(steps)]

    def start(self) -> str | None:
        """Return how the state after a reset differs from rest at the start; None: not at all."""
        plant = self.make()
        state = plant.reset(_START)
        if not np.allclose(state.pose, _START, rtol=0.0, atol=1e-9):
            return f"after reset at {tuple(_START)} its pose is {tuple(state.pose)}"
        if not np.allclose(state.twist, 0.0, rtol=0.0, atol=1e-9):
            return f"after reset its twist is {tuple(state.twist)}, need zero"
        later = plant.step(STOP, 1.0).pose
        if not np.allclose(later, _START, rtol=0.0, atol=self.tolerance):
            return f"without a command it moves to {tuple(later)} in 1 s"
        return None

    def mean_velocity(self) -> str | None:
        """Return the command whose mean twist in B differs from it; None: there is none."""
        for twist in (BodyTwist(0.3, 0.0, 0.0), BodyTwist(0.0, 0.3, 0.0), BodyTwist(0.0, 0.0, 0.8)):
            states = self.drive(Pose(0.0, 0.0, 0.0), twist, 30)
            if not all(isfinite(v) for state in states for v in (*state.pose, *state.twist)):
                return f"with the command {tuple(twist)} its state is not finite"
            moved = np.subtract(states[-1].pose, states[9].pose) / (20 * self.dt)
            mean = to_body(WorldTwist(*moved.tolist()), states[9].pose.yaw)
            if not np.allclose(mean, twist, rtol=0.0, atol=self.tolerance):
                shown = tuple(round(v, 4) for v in mean)
                return f"with the command {tuple(twist)} its mean twist in B is {shown}"
        return None

    def rotation(self) -> str | None:
        """Return how a turn of the world changes the motion; None: not at all."""
        angle = 2.0
        once = self.drive(_START, _TWIST, 10)[-1].pose
        other = self.drive(rotated(_START, angle), _TWIST, 10)[-1].pose
        if not np.allclose(rotated(once, angle), other, rtol=0.0, atol=self.tolerance):
            return (
                f"with the world turned by {angle} rad it ends at {tuple(other)} instead of "
                f"{tuple(rotated(once, angle))}: is the twist in B, and the pose in W?"
            )
        return None

    def continuous_yaw(self) -> str | None:
        """Return where the yaw jumps when it passes pi; None: nowhere."""
        start = Pose(0.0, 0.0, 3.0)
        states = self.drive(start, BodyTwist(0.0, 0.0, 2.0), 20)
        yaws = [start.yaw, *(state.pose.yaw for state in states)]
        jump = float(np.abs(np.diff(yaws)).max())
        return f"its yaw jumps by {jump:.3g} rad: it must not be wrapped" if jump > 1.0 else None

    def reported_twist(self) -> str | None:
        """Return how the twist differs from the rate of the pose in W; None: not at all."""
        plant = self.make()
        self.record(plant)
        a, b = plant.step(_TWIST, 0.01), plant.step(_TWIST, 0.01)
        world = to_world(a.twist, a.pose.yaw)
        moved = np.subtract(b.pose, a.pose) / 0.01
        if not np.allclose(moved, world, rtol=0.0, atol=max(self.tolerance, 0.05)):
            return (
                f"its pose changes by {tuple(moved.tolist())} per s in W, but its twist is "
                f"{tuple(world)} in W"
            )
        return None
