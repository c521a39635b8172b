"""Cases of the gauntlet: plants that differ from the robot that the controllers know."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import floor, tan

import numpy as np

from omnidrive.control.controller import WheelSpeeds
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import ROBOTS, Robot
from omnidrive.simulation import MujocoPlant, PlantState
from omnidrive.simulation.disturbances.disturbances import Disturbances, Impulse, PoseOffset
from omnidrive.simulation.planar.plant import PlanarPlant

SLOPE = 0.1  # rad; the floor rises along y of W
DRAG = 0.981  # 1/s; viscous force per mass and speed: at 1 m/s that of a slope of 0.1
LAG = 0.08  # s, added to that of the motors
COM_SHARE = 0.3  # displacement of the centre of mass over the mean distance of the wheels
PERIOD = 2.0  # s; wind blows in every other one, encoders slip at the beginning of each
SLIPPING = 0.5  # s, of every period
TINY = 1e-9  # s, error of sums of sample times


def same(robot: Robot) -> Robot:
    return robot


@dataclass(frozen=True)
class Case:
    """A difference between the plant and the robot that the controllers know."""

    robot: Callable[[Robot], Robot] = same
    """The simulated robot, from the nominal one."""
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Executed over commanded twist along x, y and yaw of B."""
    late: float = 0.0
    """Samples by which every command is late; during the fraction of a sample the former acts."""
    slope: float = 0.0
    """Inclination of the floor, rad."""
    drag: float = 0.0
    """Viscous force through the origin of B per mass and speed, 1/s."""
    wind: float = 0.0
    """Force along x of W, as the rise of the floor per metre with the same force; it acts in every
    other :data:`PERIOD`."""
    wheel: float = 1.0
    """Executed over commanded speed of the first wheel."""
    slip: float = 0.0
    """Relative excess of the speed of the first wheel while its encoder slips."""

    def both(self, other: Case) -> Case:
        """Return the case with the differences of both."""
        x, y, yaw = (a * b for a, b in zip(self.gains, other.gains, strict=True))
        return Case(
            lambda robot: other.robot(self.robot(robot)),
            (x, y, yaw),
            self.late + other.late,
            self.slope + other.slope,
            self.drag + other.drag,
            self.wind + other.wind,
            self.wheel * other.wheel,
            self.slip + other.slip,
        )


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


LINK_CASES: dict[str, Case] = {
    "mass-1.6": Case(lambda r: replace(r, mass=1.6 * r.mass)),
    "wheel-0.96": Case(wheel=0.96),
    "gains-uneven": Case(gains=(1.08, 0.93, 1.0)),
    "lag-60ms": Case(lambda r: replace(r, motor_lag=r.motor_lag + 0.06)),
    "lag-120ms": Case(lambda r: replace(r, motor_lag=r.motor_lag + 0.12)),
    "late-0.5": Case(late=0.5),
    "late": CASES["late"],
    "late-2": Case(late=2.0),
    "late-3": Case(late=3.0),
    "friction-0.5": Case(lambda r: replace(r, friction=0.5 * r.friction)),
    "friction-0.25": Case(lambda r: replace(r, friction=0.25 * r.friction)),
    "slope-0.08": Case(slope=0.08),
    "wind": Case(wind=0.05),
    "com": CASES["com"],
    "slip": Case(slip=0.1),
}
"""What a radio, a bus, rollers or a wet floor add."""


def pairs_of(cases: dict[str, Case], count: int, seed: int) -> dict[str, Case]:
    """Return random pairs of cases that differ in kind, named "FIRST+SECOND"."""
    names = tuple(cases)
    possible = [
        (a, b)
        for i, a in enumerate(names)
        for b in names[i + 1 :]
        if a.split("-")[0] != b.split("-")[0]
    ]
    drawn = np.random.default_rng(seed).choice(len(possible), count, replace=False)
    chosen = [possible[i] for i in sorted(drawn.tolist())]
    return {f"{a}+{b}": cases[a].both(cases[b]) for a, b in chosen}


PAIRS = pairs_of(LINK_CASES, count=30, seed=34)
ALL_CASES = CASES | LINK_CASES | PAIRS


class CasePlant:
    """A plant whose commands are scaled or late, and which is disturbed from the start.

    Args:
        robot: The robot that the controllers know.
        case: Difference from it. Drag needs a MuJoCo plant.
        plant: `planar`, or wheels of the MuJoCo plant: `ball` or `rollers`.
    """

    def __init__(self, robot: Robot, case: Case, plant: str) -> None:
        self.robot = case.robot(robot)
        self.plant = (
            PlanarPlant(self.robot)
            if plant == "planar"
            else MujocoPlant(self.robot, "ball" if plant == "ball" else "rollers")
        )
        self.case = case
        self.queue: deque[BodyTwist] = deque(maxlen=2 + floor(case.late))
        self.time, self.lasting, self.blowing = 0.0, Disturbances(), False
        if case.drag:
            self._set_drag(case.drag * self.robot.mass)

    def _set_drag(self, drag: float) -> None:
        """Damp x, y and yaw of the body by ``drag`` (N s/m); MuJoCo integrates it implicitly."""
        model, distance = self.plant.model, self.robot.mean_wheel_distance
        first = int(model.body("base").dofadr[0])  # of a free joint: x, y, z, then rotations
        model.dof_damping[first : first + 2] = drag
        model.dof_damping[first + 5] = drag * distance**2

    @property
    def capabilities(self):
        return self.plant.capabilities

    def reset(self, pose: Pose) -> PlantState:
        self.queue.extend([BodyTwist(0.0, 0.0, 0.0)] * self.queue.maxlen)
        state = self.plant.reset(pose)
        self.time = 0.0
        self.apply(Disturbances())
        return state

    def step(self, command: BodyTwist, dt: float) -> PlantState:
        if not isinstance(command, BodyTwist):
            raise TypeError("the gauntlet scales body twists; this command is another one")
        if self.case.wind and self._blows() != self.blowing:
            self.apply(self.lasting)
        self.queue.append(command)
        fraction = self.case.late % 1.0
        if fraction:
            self._execute(self.queue[0], fraction * dt)
        state = self._execute(self.queue[1], (1.0 - fraction) * dt)
        self.time += dt
        return state

    def _execute(self, command: BodyTwist, dt: float) -> PlantState:
        gains = zip(command, self.case.gains, strict=True)
        twist = BodyTwist(*(value * gain for value, gain in gains))
        slipping = self.case.slip and self.time % PERIOD < SLIPPING - TINY
        factor = self.case.wheel * (1.0 + self.case.slip if slipping else 1.0)
        if factor == 1.0:
            return self.plant.step(twist, dt)
        speeds = self.robot.drive.wheel_speeds(twist)
        speeds[0] *= factor
        return self.plant.step(WheelSpeeds(speeds.tolist()), dt)

    def _blows(self) -> bool:
        return int((self.time + TINY) / PERIOD) % 2 == 1

    def apply(self, disturbances: Disturbances) -> None:
        """Set disturbances in addition to the slope and the wind of the case."""
        self.lasting = disturbances._replace(impulse=Impulse(), offset=PoseOffset())
        self.blowing = self._blows()
        x, y = disturbances.slope
        slope = (x + self.case.wind * self.blowing, y + tan(self.case.slope))
        self.plant.apply(disturbances._replace(slope=slope))

    def close(self) -> None:
        self.plant.close()


@cache
def case_plant(robot: str, case: str, plant: str) -> CasePlant:
    """Return a plant, one per process; a run resets it."""
    return CasePlant(ROBOTS[robot], ALL_CASES[case], plant)
