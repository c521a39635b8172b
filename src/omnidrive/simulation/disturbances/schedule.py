"""Schedule of the disturbances and faults of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
    PLANT_FAULTS,
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
    """Disturbances and faults of one run of one robot.

    Attributes:
        faults: Faults in any order. Simultaneous impulses, offsets, slopes and payloads add up; of
            several faults of one motor the most severe acts, of several patches the last.
        robot: The robot; impulses and payloads are multiples of its mass and size.

    Raises:
        InvalidInput: A fault names a wheel that the robot does not have.
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
        """Check that every fault starts before the end of a run.

        Raises:
            InvalidInput: A fault starts at or after ``duration`` (s).
        """
        for fault in self.faults:
            if fault.at >= duration:
                raise InvalidInput(
                    f"fault {fault.kind} begins at {fault.at:g} s, but the run ends at "
                    f"{duration:g} s: choose an earlier start time (at=...)"
                )

    @property
    def plant_faults(self) -> tuple[str, ...]:
        """Kinds of the scheduled faults that act on the plant."""
        return tuple(fault.kind for fault in self.faults if fault.kind in PLANT_FAULTS)

    def disturbances(self, before: float, t: float, reference: Reference) -> Disturbances:
        """Return the disturbances that act on the plant from the sample at ``t`` on.

        Args:
            before: Time of the previous sample, s; negative at the first sample.
            t: Time of the sample, s.
            reference: Reference motion; its position is the centre of patches without one.
        """
        motors = [Motor.HEALTHY] * len(self.robot.mounts)
        slope = (0.0, 0.0)
        payload: Payload | None = None
        patch: Patch | None = None
        impulse, offset = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for fault in self.faults:
            begins = fault.is_active(t) and not fault.is_active(before)
            if isinstance(fault, Push) and begins:
                size = self.robot.mass * fault.speed
                impulse = _add(impulse, size * cos(fault.direction), size * sin(fault.direction))
            elif isinstance(fault, PoseJump) and begins:
                x, y = cos(fault.direction), sin(fault.direction)
                offset = _add(offset, fault.distance * x, fault.distance * y, fault.turn)
            elif not fault.is_active(t):
                continue
            elif isinstance(fault, DeadWheel | LockedWheel | WeakWheel):
                motors[fault.wheel] = max(motors[fault.wheel], _MOTORS[type(fault)])
            elif isinstance(fault, Slope):
                rise = tan(fault.angle)
                slope = (
                    slope[0] + rise * cos(fault.direction),
                    slope[1] + rise * sin(fault.direction),
                )
            elif isinstance(fault, PayloadShift):
                payload = _combined(payload, self._payload(fault))
            elif isinstance(fault, SlipperyPatch):
                patch = _patch(fault, reference)
        return Disturbances(
            tuple(motors) if any(motors) else (),
            slope,
            payload,
            patch,
            Impulse(*impulse),
            PoseOffset(*offset),
        )

    def _payload(self, fault: PayloadShift) -> Payload:
        distance = self.robot.mean_wheel_distance
        return Payload(fault.share * self.robot.mass, fault.x * distance, fault.y * distance)

    def sensor_faults(self, t: float) -> SensorFaults:
        """Return the sensor faults that act at ``t`` (s)."""
        active = [fault for fault in self.faults if fault.is_active(t)]
        return SensorFaults(
            tuple(sorted({f.wheel for f in active if isinstance(f, DeadEncoder)})),
            any(isinstance(f, SilentSensor) for f in active),
        )

    def overrun(self, t: float) -> bool:
        """Return whether the controller misses its deadline in the sample at ``t`` (s)."""
        return any(isinstance(f, SolverOverrun) and f.is_active(t) for f in self.faults)


def sample_times(
    duration: float,
    dt: float,
    faults: Sequence[Fault] = (),
    rng: np.random.Generator | None = None,
) -> Iterator[tuple[float, float, bool]]:
    """Yield the time of every sample (s), the time to the next (s), and whether it is the last.

    Args:
        duration: Duration of the run, s; the last sample is the nearest to it.
        dt: Nominal sample time, s.
        faults: Faults of the run; those of the kind ``period-jitter`` change the sample times.
        rng: Generator of the jitter; None: no jitter.
    """
    jitters = [fault for fault in faults if isinstance(fault, PeriodJitter)]
    # t = k dt + accumulated jitter: a sum of sample times would accumulate rounding errors
    accumulated, k = 0.0, 0
    last = round(duration / dt)
    while True:
        t = k * dt + accumulated
        is_last = t >= duration - 0.5 * dt if jitters else k >= last
        step = dt
        for jitter in jitters:
            if jitter.is_active(t) and rng is not None:
                step *= 1.0 + jitter.spread * rng.uniform(-1.0, 1.0)
        yield t, step, is_last
        if is_last:
            return
        accumulated, k = accumulated + (step - dt), k + 1


def _add(
    total: tuple[float, float, float], x: float, y: float, turn: float = 0.0
) -> tuple[float, float, float]:
    return total[0] + x, total[1] + y, total[2] + turn


def _combined(one: Payload | None, other: Payload) -> Payload:
    """Return the sum of two payloads at their common centre of mass."""
    if one is None:
        return other
    mass = one.mass + other.mass
    x, y = ((one.mass * a + other.mass * b) / mass for a, b in zip(one[1:], other[1:], strict=True))
    return Payload(mass, x, y)


def _patch(fault: SlipperyPatch, reference: Reference) -> Patch:
    default = reference.at(fault.at).pose
    return Patch(
        default.x if fault.x is None else fault.x,
        default.y if fault.y is None else fault.y,
        fault.radius,
        fault.friction,
    )
