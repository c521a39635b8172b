"""Latest readings of a robot, and what they say at the times of samples."""

from __future__ import annotations

from collections import deque
from math import inf, nan
from typing import NamedTuple

from omnidrive.estimation import PoseFix, SensorReadings

MAX_AHEAD = 0.1
"""Time by which a pose fix may be stamped after the deadline of a sample, s: clocks differ, and a
sample that begins late reads what was measured after its deadline. Such a fix counts as taken at
the deadline; estimators ignore later ones."""
_INSTANT = 1e-6  # s
_LATE = 0.001  # s; a fix taken later than this after the deadline waits for the next sample
_FAR = 5.0  # periods of the readings for which wheel angles are extrapolated
_BASE = 0.01
"""Time over which the speeds are measured with which wheel angles are extrapolated, s: at 500 Hz an
encoder resolves no speed between two readings."""


class _WheelAngles(NamedTuple):
    """Wheel angles at a time."""

    stamp: float
    """In s."""
    angles: tuple[float, ...]
    """In rad."""


class LatestReadings:
    """Latest readings of a robot.

    Attributes:
        arrived: Time of the sample in which they arrived, s on the clock.
    """

    def __init__(self) -> None:
        self.arrived = nan
        self._readings = SensorReadings(nan)
        self._before: deque[_WheelAngles] = deque()
        """Wheel angles of readings before, the first of which is the last that
        is older by at least ``_BASE``, if there is one."""
        self._read_at = nan
        """Time at which the readings were read, s on the clock."""
        self._later: tuple[PoseFix, ...] = ()
        """Fixes for the next sample: taken after the deadline of this one, which begins late."""
        self._zero: tuple[float, ...] = ()
        self._given: tuple[float, ...] = ()
        """Wheel angles of the last sample that was given, rad."""

    @property
    def stamp(self) -> float:
        """Time of the readings, s on the clock; NaN before the first."""
        return self._readings.stamp

    @property
    def fix(self) -> PoseFix | None:
        """Last pose fix of those that arrived with the last sample; None: none arrived."""
        fixes = self._readings.fixes
        return fixes[-1] if fixes else None

    def take(self, readings: SensorReadings | None, now: float, read_at: float) -> None:
        """Replace the readings by those that arrived; None: nothing arrived.

        Readings whose stamp is not finite, or more than :data:`MAX_AHEAD` in the future, count as
        not arrived.

        Args:
            readings: Readings, with stamps on the clock.
            now: Deadline of the sample on the clock, s.
            read_at: Time at which they were read, s: later than ``now`` if the sample is late.
        """
        if readings is not None and not -inf < readings.stamp <= max(now, read_at) + MAX_AHEAD:
            readings = None
        fixes = self._later + (readings.fixes if readings else ())
        self._later = tuple(fix for fix in fixes if now + _LATE < fix.stamp <= read_at)
        if readings is None:
            readings = self._readings
        else:
            if readings.stamp > self._readings.stamp:
                self._before.append(_WheelAngles(self._readings.stamp, self._readings.wheel_angles))
                latest = readings.stamp + _INSTANT - _BASE
                while len(self._before) > 1 and self._before[1].stamp <= latest:
                    self._before.popleft()
            self.arrived, self._read_at = now, read_at
        fixes = tuple(fix for fix in fixes if fix not in self._later)
        self._readings = readings._replace(fixes=fixes)

    def zero_wheels(self) -> None:
        """Count the wheel angles from the present ones."""
        self._zero = self._readings.wheel_angles

    def at(self, t: float, origin: float) -> SensorReadings:
        """Return the readings for the sample at ``t``.

        The wheel angles are extrapolated to it, see :meth:`_angles_at`; pose fixes keep the times
        at which they were taken.

        Args:
            t: Time of the sample since ``origin``, s.
            origin: Time on the clock from which the stamps of the result count, s.
        """
        angles = self._given = self._angles_at(origin + t)
        if len(angles) == len(self._zero):
            angles = tuple(a - zero for a, zero in zip(angles, self._zero, strict=True))
        minimum = -_INSTANT if origin != 0.0 else _INSTANT  # from 0, nothing was rounded
        stamps = [fix.stamp - origin for fix in self._readings.fixes]
        fixes = tuple(
            fix._replace(stamp=t if minimum < stamp - t <= MAX_AHEAD else stamp)
            for fix, stamp in zip(self._readings.fixes, stamps, strict=True)
        )
        return self._readings._replace(stamp=t, wheel_angles=angles, fixes=fixes)

    @property
    def turned(self) -> tuple[float, ...]:
        """Angles by which the wheels turned since the last sample that was given, rad; or empty."""
        latest = self._readings.wheel_angles
        if len(latest) != len(self._given):
            return ()
        return tuple(now - then for now, then in zip(latest, self._given, strict=True))

    def _angles_at(self, now: float) -> tuple[float, ...]:
        """Return the wheel angles at ``now``, with the speeds of the last readings.

        The readings are older than the sample by a part of their period, or newer where the sample
        begins late; estimators relate the angles to the time of the sample.
        """
        stamp, angles = self._readings.stamp, self._readings.wheel_angles
        late = now - stamp
        if not self._before or abs(late) <= _INSTANT:
            return angles
        period = stamp - self._before[-1].stamp
        since, before = self._before[0 if late > 0.0 else -1]
        step = stamp - since
        earliest = -step if stamp <= self._read_at else 0.0  # a clock that is ahead tells nothing
        known = len(before) == len(angles) and step > _INSTANT
        if not (known and earliest <= late < _FAR * period):
            return angles
        return tuple(b + (b - a) * late / step for a, b in zip(before, angles, strict=True))
