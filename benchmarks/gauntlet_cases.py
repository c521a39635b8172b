"""Cases of the gauntlet: plants that differ from the robot that the controllers know."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import tan

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import ROBOTS, Robot
from omnidrive.simulation import MujocoPlant, PlantState
from omnidrive.simulation.disturbances.disturbances import Disturbances

SLOPE = 0.1  # rad; the floor rises along y of W
DRAG = 0.981  # 1/s; viscous force per mass and speed: at 1 m/s that of a slope of 0.1
LAG = 0.08  # s, added to that of the motors
COM_SHARE = 0.3  # displacement of the centre of mass over the mean distance of the wheels


def same(robot: Robot) -> Robot:
    return robot


@dataclass(frozen=True)
class Case:
    """A difference between the plant and the robot that the controllers know."""

    robot: Callable[[Robot], Robot] = same
    """The simulated robot, from the nominal one."""
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Executed over commanded twist along x, y and yaw of B."""
    late: int = 0
    """Samples by which every command is late."""
    slope: float = 0.0
    """Inclination of the floor, rad."""
    drag: float = 0.0
    """Viscous force through the origin of B per mass and speed, 1/s."""


CASES: dict[str, Case] = {
    "nominal": Case(),
    "mass-0.7": Case(lambda r: replace(r, mass=0.7 * r.mass)),
    "mass-1.4": Case(lambda r: replace(r, mass=1.4 * r.mass)),
    "friction-0.4": Case(lambda r: replace(r, friction=0.4 * r.friction)),
    "com": Case(lambda r: replace(r, com=(COM_SHARE * r.mean_wheel_distance, 0.0))),
    "lag": Case(lambda r: replace(r, motor_lag=r.motor_lag + LAG)),
    "gains-low": Case(gains=(0.95, 0.95, 0.90)),
    "gains-high": Case(gains=(1.05, 1.05, 1.10)),
    "late": Case(late=1),
    "servo-0.3": Case(lambda r: replace(r, servo_gain=0.3 * r.servo_gain)),
    "slope": Case(slope=SLOPE),
    "drag": Case(drag=DRAG),
}


class CasePlant:
    """A MuJoCo plant whose commands are scaled or late, and which is disturbed from the start."""

    def __init__(self, robot: Robot, case: Case, wheels: str) -> None:
        self.plant = MujocoPlant(case.robot(robot), "ball" if wheels == "ball" else "rollers")
        self.case = case
        self.queue: deque[BodyTwist] = deque()
        if case.drag:
            self._set_drag(case.drag * self.plant.robot.mass)

    def _set_drag(self, drag: float) -> None:
        """Damp x, y and yaw of the body by ``drag`` (N s/m); MuJoCo integrates it implicitly."""
        model, distance = self.plant.model, self.plant.robot.mean_wheel_distance
        first = int(model.body("base").dofadr[0])  # of a free joint: x, y, z, then rotations
        model.dof_damping[first : first + 2] = drag
        model.dof_damping[first + 5] = drag * distance**2

    @property
    def capabilities(self):
        return self.plant.capabilities

    def reset(self, pose: Pose) -> PlantState:
        self.queue = deque([BodyTwist(0.0, 0.0, 0.0)] * self.case.late)
        state = self.plant.reset(pose)
        self.apply(Disturbances())
        return state

    def step(self, command: BodyTwist, dt: float) -> PlantState:
        if not isinstance(command, BodyTwist):
            raise TypeError("the gauntlet scales body twists; this command is another one")
        self.queue.append(command)
        executed = self.queue.popleft()
        gains = zip(executed, self.case.gains, strict=True)
        return self.plant.step(BodyTwist(*(value * gain for value, gain in gains)), dt)

    def apply(self, disturbances: Disturbances) -> None:
        """Set disturbances in addition to the slope of the case."""
        x, y = disturbances.slope
        slope = (x, y + tan(self.case.slope))
        self.plant.apply(disturbances._replace(slope=slope))

    def close(self) -> None:
        self.plant.close()


@cache
def case_plant(robot: str, case: str, wheels: str) -> CasePlant:
    """Return a plant, one per process; a run resets it."""
    return CasePlant(ROBOTS[robot], CASES[case], wheels)
