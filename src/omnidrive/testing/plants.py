"""Check of a plant against the laws, the properties that all plants must have."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np

from omnidrive.components import Component
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation import Plant, PlantCapabilities, PlantState
from omnidrive.simulation.components import PlantContext
from omnidrive.testing.laws import Law, check_laws, rotated

_START = Pose(0.5, 0.2, 0.3)
_TWIST = BodyTwist(0.3, -0.2, 0.7)
_REST = BodyTwist(0.0, 0.0, 0.0)
_DT = 0.1


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
    component = Component("plants", "the plant", "", factory)
    laws = _Laws(component, robot or named_robot("small"), parameters, tolerance)
    applicable: dict[str, Law] = {
        "protocol": laws.protocol,
        "start": laws.start,
        "determinism": laws.determinism,
        "mean velocity": laws.mean_velocity,
        "rotation of the world": laws.rotation,
        "continuous yaw": laws.continuous_yaw,
        "reported twist": laws.reported_twist,
    }
    check_laws("plant", applicable)


class _Laws:
    """The laws for one factory."""

    def __init__(
        self, component: Component, robot: Robot, parameters: Any, tolerance: float
    ) -> None:
        self.component, self.robot = component, robot
        self.parameters, self.tolerance = parameters, tolerance

    def make(self) -> Any:
        """Return a new object from the factory; its type is not checked yet."""
        return self.component.make(PlantContext(self.robot), self.parameters)

    def drive(
        self, start: Pose, twist: BodyTwist, steps: int, plant: Plant | None = None
    ) -> list[PlantState]:
        own = plant is None
        plant = plant or self.make()
        plant.reset(start)
        states = [plant.step(twist, _DT) for _ in range(steps)]
        if own:
            plant.close()
        return states

    def protocol(self) -> str | None:
        plant = self.make()
        if not isinstance(plant, Plant):
            return f"it is a {type(plant).__name__}, need capabilities, reset, step and close"
        if not isinstance(plant.capabilities, PlantCapabilities):
            return f"its capabilities are a {type(plant.capabilities).__name__}"
        state: object = plant.reset(_START)
        plant.close()
        if not isinstance(state, PlantState):
            return f"reset returns a {type(state).__name__}, need PlantState(pose, twist, work)"
        if not (isinstance(state.pose, Pose) and isinstance(state.twist, BodyTwist)):
            return "its state needs a Pose and a BodyTwist"
        return None

    def start(self) -> str | None:
        plant = self.make()
        state = plant.reset(_START)
        if not np.allclose(state.pose, _START, rtol=0.0, atol=1e-9):
            return f"after reset at {tuple(_START)} its pose is {tuple(state.pose)}"
        if not np.allclose(state.twist, 0.0, rtol=0.0, atol=1e-9):
            return f"after reset its twist is {tuple(state.twist)}, need zero"
        later = plant.step(_REST, 1.0).pose
        plant.close()
        if not np.allclose(later, _START, rtol=0.0, atol=self.tolerance):
            return f"without a command it moves to {tuple(later)} in 1 s"
        return None

    def determinism(self) -> str | None:
        plant = self.make()
        once, again = (self.drive(_START, _TWIST, 10, plant) for _ in range(2))
        plant.close()
        fresh = self.drive(_START, _TWIST, 10)
        if repr(once) != repr(again):
            return "a second run after reset differs: reset keeps some memory"
        if repr(once) != repr(fresh):
            return "a new plant differs: randomness or global state"
        return None

    def mean_velocity(self) -> str | None:
        for twist in (BodyTwist(0.3, 0.0, 0.0), BodyTwist(0.0, 0.3, 0.0), BodyTwist(0.0, 0.0, 0.8)):
            states = self.drive(Pose(0.0, 0.0, 0.0), twist, 30)
            if not all(isfinite(v) for state in states for v in (*state.pose, *state.twist)):
                return f"with the command {tuple(twist)} its state is not finite"
            moved = np.subtract(states[-1].pose, states[9].pose) / (20 * _DT)
            yaw = states[9].pose.yaw
            c, s = np.cos(yaw), np.sin(yaw)
            mean = (c * moved[0] + s * moved[1], c * moved[1] - s * moved[0], moved[2])
            if not np.allclose(mean, twist, rtol=0.0, atol=self.tolerance):
                shown = tuple(round(float(v), 4) for v in mean)
                return f"with the command {tuple(twist)} its mean twist in B is {shown}"
        return None

    def rotation(self) -> str | None:
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
        start = Pose(0.0, 0.0, 3.0)
        states = self.drive(start, BodyTwist(0.0, 0.0, 2.0), 20)
        yaws = [start.yaw, *(state.pose.yaw for state in states)]
        jump = float(np.abs(np.diff(yaws)).max())
        return f"its yaw jumps by {jump:.3g} rad: it must not be wrapped" if jump > 1.0 else None

    def reported_twist(self) -> str | None:
        plant = self.make()
        self.drive(_START, _TWIST, 10, plant)
        a, b = plant.step(_TWIST, 0.01), plant.step(_TWIST, 0.01)
        plant.close()
        c, s = np.cos(a.pose.yaw), np.sin(a.pose.yaw)
        vx, vy, yaw_rate = a.twist
        world = (c * vx - s * vy, s * vx + c * vy, yaw_rate)
        moved = np.subtract(b.pose, a.pose) / 0.01
        if not np.allclose(moved, world, rtol=0.0, atol=max(self.tolerance, 0.05)):
            return f"its pose changes by {moved} per s in W, but its twist is {world} in W"
        return None
