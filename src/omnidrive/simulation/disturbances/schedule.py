"""From faults and the time to what holds now."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, sin, tan

import numpy as np

from omnidrive.errors import InvalidInput
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import (
    Disturbances,
    Impulse,
    Motor,
    Patch,
    Payload,
    PoseOffset,
    SensorFaults,
)
from omnidrive.simulation.disturbances.fault import (
    ON_THE_PLANT,
    DeadEncoder,
    DeadWheel,
    Fault,
    LockedWheel,
    PayloadShift,
    PeriodJitter,
    PoseJump,
    Push,
    SilentSensor,
    SlipperyPatch,
    Slope,
    SolverOverrun,
    WeakWheel,
)

_MOTORS = {DeadWheel: Motor.DEAD, LockedWheel: Motor.LOCKED, WeakWheel: Motor.WEAK}


@dataclass(frozen=True, slots=True)
class Schedule:
    """The faults of one run of one robot.

    Attributes:
        faults: In any order; those that hold at one time add up.
        robot: Whom they befall: sizes are multiples of its own.
    """

    faults: tuple[Fault, ...]
    robot: Robot

    def __post_init__(self) -> None:
        wheels = len(self.robot.mounts)
        for fault in self.faults:
            wheel = getattr(fault, "wheel", 0)
            if wheel >= wheels:
                raise InvalidInput(
                    f"fault {fault.kind}: there is no wheel {wheel}; robot {self.robot.name} has "
                    f"the wheels 0 to {wheels - 1}"
                )

    def check(self, duration: float) -> None:
        """Refuse what would never happen.

        Raises:
            InvalidInput: A fault begins when a run of ``duration`` seconds has ended.
        """
        for fault in self.faults:
            if fault.at >= duration:
                raise InvalidInput(
                    f"fault {fault.kind} begins at {fault.at:g} s, but the run ends at "
                    f"{duration:g} s: let it begin earlier (at=...)"
                )

    @property
    def on_the_plant(self) -> tuple[str, ...]:
        """Kinds of those faults that act on the robot itself."""
        return tuple(fault.kind for fault in self.faults if fault.kind in ON_THE_PLANT)

    def samples(
        self, duration: float, dt: float, rng: np.random.Generator | None = None
    ) -> Iterator[tuple[float, float, bool]]:
        """Time of every sample, time until the next one, both in s, and whether it is the last.

        Samples are ``dt`` apart but for jitter, which is drawn from ``rng``; the last is the one
        nearest to ``duration`` (s).
        """
        late, k = 0.0, 0  # time is counted, never summed, but for what jitter adds
        last = round(duration / dt)
        while True:
            t = k * dt + late
            jittered = any(isinstance(fault, PeriodJitter) for fault in self.faults)
            ends = t >= duration - 0.5 * dt if jittered else k >= last
            step = dt
            for fault in self.faults:
                if isinstance(fault, PeriodJitter) and fault.holds(t) and rng is not None:
                    step *= 1.0 + fault.spread * rng.uniform(-1.0, 1.0)
            yield t, step, ends
            if ends:
                return
            late, k = late + (step - dt), k + 1

    def disturbances(self, before: float, t: float, reference: Reference) -> Disturbances:
        """What acts on the robot from the sample at ``t`` on.

        Args:
            before: Time of the sample before, in s; anything negative at the first.
            t: In s.
            reference: Where the robot shall be, for patches without a place.
        """
        motors = [Motor.HEALTHY] * len(self.robot.mounts)
        rise = (0.0, 0.0)
        payload: Payload | None = None
        patch: Patch | None = None
        impulse, offset = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for fault in self.faults:
            begins = fault.holds(t) and not fault.holds(before)
            if isinstance(fault, Push) and begins:
                blow = self.robot.mass * fault.speed
                impulse = _plus(impulse, blow * cos(fault.direction), blow * sin(fault.direction))
            elif isinstance(fault, PoseJump) and begins:
                x, y = cos(fault.direction), sin(fault.direction)
                offset = _plus(offset, fault.distance * x, fault.distance * y, fault.turn)
            elif not fault.holds(t):
                continue
            elif isinstance(fault, DeadWheel | LockedWheel | WeakWheel):
                motors[fault.wheel] = max(motors[fault.wheel], _MOTORS[type(fault)])
            elif isinstance(fault, Slope):
                up = tan(fault.angle)
                rise = (rise[0] + up * cos(fault.direction), rise[1] + up * sin(fault.direction))
            elif isinstance(fault, PayloadShift):
                payload = _heaped(payload, self._payload(fault))
            elif isinstance(fault, SlipperyPatch):
                patch = _placed(fault, reference)
        return Disturbances(
            tuple(motors) if any(motors) else (),
            rise,
            payload,
            patch,
            Impulse(*impulse),
            PoseOffset(*offset),
        )

    def _payload(self, fault: PayloadShift) -> Payload:
        reach = self.robot.mean_wheel_distance
        return Payload(fault.share * self.robot.mass, fault.x * reach, fault.y * reach)

    def sensor_faults(self, t: float) -> SensorFaults:
        """What is wrong with the sensors at ``t`` (s)."""
        holding = [fault for fault in self.faults if fault.holds(t)]
        return SensorFaults(
            tuple(sorted({f.wheel for f in holding if isinstance(f, DeadEncoder)})),
            any(isinstance(f, SilentSensor) for f in holding),
        )

    def overrun(self, t: float) -> bool:
        """Whether the command of the sample at ``t`` (s) comes too late for it."""
        return any(isinstance(f, SolverOverrun) and f.holds(t) for f in self.faults)


def _plus(
    sum_: tuple[float, float, float], x: float, y: float, turn: float = 0.0
) -> tuple[float, float, float]:
    return sum_[0] + x, sum_[1] + y, sum_[2] + turn


def _heaped(one: Payload | None, other: Payload) -> Payload:
    """Both in one place: their common centre of mass."""
    if one is None:
        return other
    mass = one.mass + other.mass
    x, y = ((one.mass * a + other.mass * b) / mass for a, b in zip(one[1:], other[1:], strict=True))
    return Payload(mass, x, y)


def _placed(fault: SlipperyPatch, reference: Reference) -> Patch:
    there = reference.at(fault.at).pose
    return Patch(
        there.x if fault.x is None else fault.x,
        there.y if fault.y is None else fault.y,
        fault.radius,
        fault.friction,
    )
