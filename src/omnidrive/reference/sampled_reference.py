"""References that interpolate timed samples."""

from __future__ import annotations

from dataclasses import InitVar, dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.reference.motion import Motion, limit_shares
from omnidrive.reference.reference import Reference, WindowReference
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.zone_speeds import ZoneSpeeds

MIN_STEP = 1e-6
"""Shortest time between samples, in s; over a shorter one, rounding errors of the poses would
dominate the velocities."""

MAX_VALUE = 1e10
"""Largest magnitude of a value, in s, m, rad, m/s or rad/s; permits Unix times, 1.8e9 s."""

MAX_SAMPLES = 100_000
"""Largest number of samples of a reference that is read or written, and of steps of one that is
sampled."""

_CHECKS = np.linspace(0.0, 1.0, 5)
"""Points between two samples, as shares of the time between them, at which limits are
evaluated."""

_ZONE_CHECKS = np.linspace(0.0, 1.0, 17)
"""Such points at which the limits of zones are evaluated."""


@dataclass(frozen=True, eq=False)
class SampledReference(WindowReference):
    """Piecewise cubic motion through timed poses with given velocities.

    Between two samples x, y and yaw are the cubic Hermite polynomials of the two poses and twists
    (de Boor, "A Practical Guide to Splines", ch. IV). The twist is the exact derivative of the pose
    and is continuous from the first sample to the last; before and after them the robot is at rest.

    Attributes:
        times: Time of each sample, in s, at least 1 us after the previous one; stored relative to
            the first.
        poses: Poses of B in W; x and y in m, yaw in rad. The yaw is stored unwrapped.
        twists: Velocities of B at the samples, in W, in m/s, m/s and rad/s.
        unwrapped: Whether the given yaw is unwrapped and is used as it is. Otherwise multiples of
            2 pi are added, so that it changes by at most pi from one sample to the next.

    Raises:
        InvalidReference: There are fewer than two samples, shapes disagree, a time is less than
            1 us after the previous one, or a number is not finite or above 1e10 in magnitude.
    """

    times: Float[Array, " samples"]
    poses: Float[Array, "samples 3"]
    twists: Float[Array, "samples 3"]
    unwrapped: InitVar[bool] = False

    def __post_init__(self, unwrapped: bool) -> None:
        times, poses = _checked(self.times, self.poses)
        if not unwrapped:
            poses = _unwrapped(poses)
        twists = _checked_numbers("twists", self.twists, poses.shape)
        for name, value in (("times", times), ("poses", poses), ("twists", twists)):
            object.__setattr__(self, name, value)

    @classmethod
    def through(
        cls, times: Float[Array, " samples"], poses: Float[Array, "samples 3"]
    ) -> SampledReference:
        """Interpolate poses without given velocities, from rest to rest.

        The result is the cubic spline with zero velocity at both ends. Of all motions through the
        samples with such ends it has the least mean square acceleration (Holladay 1957). Its
        acceleration is continuous. A rotation of the samples rotates the spline. Between samples at
        very uneven times it can overshoot.

        Args:
            times: As for the class.
            poses: As for the class; the yaw is unwrapped.

        Raises:
            InvalidReference: As for the class.
        """
        times, poses = _checked(times, poses)
        poses = _unwrapped(poses)
        spline = CubicSpline(times, poses, bc_type="clamped")
        return cls(times, poses, spline(times, 1), unwrapped=True)

    @classmethod
    def of(cls, reference: Reference, dt: float) -> SampledReference:
        """Sample another reference at equal steps of about ``dt`` s from its start to its end.

        The yaw of the reference is kept, also if it changes by more than half a turn in one step.

        Raises:
            InvalidReference: ``dt`` is not positive and finite, the duration is below 1 us or above
                1e10 s, or there would be more than 100,000 steps.
        """
        duration = reference.duration
        if not 0.0 < dt < np.inf:
            raise InvalidReference(
                f"the time between samples must be positive and finite, got {dt:g} s"
            )
        if not MIN_STEP <= duration <= MAX_VALUE:
            raise InvalidReference(
                f"a reference with a duration of {duration:g} s cannot be sampled, only one of "
                f"{MIN_STEP:g} to {MAX_VALUE:g} s"
            )
        steps = max(1.0, round(duration / max(dt, MIN_STEP)))
        if steps > MAX_SAMPLES:
            raise InvalidReference(
                f"{duration:g} s in steps of {dt:g} s are {steps:.3g} steps, more than "
                f"{MAX_SAMPLES:,}; choose a step of {duration / MAX_SAMPLES:.2g} s or longer"
            )
        times = np.linspace(0.0, duration, int(steps) + 1)
        window = reference.window(0.0, int(steps) + 1, duration / int(steps))
        end = reference.at(duration)  # rounding may move the last time past it, where twists are 0
        window[-1] = *end.pose, *end.twist
        return cls(times, window[:, :3], window[:, 3:], unwrapped=True)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, in s."""
        return float(self.times[-1])

    @cached_property
    def _curves(self) -> tuple[PPoly, PPoly]:
        poses = CubicHermiteSpline(self.times, self.poses, self.twists)
        return poses, poses.derivative()

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        poses, twists = self._curves
        times = t + dt * np.arange(n)
        # rounding may move the time of the end past it
        inside = (times >= 0.0) & (times <= self.duration * (1.0 + 1e-12))
        times = np.clip(times, 0.0, self.duration)
        return np.hstack([poses(times), twists(times) * inside[:, None]])

    def interval_usage(
        self, limits: tuple[LimitRows, ...]
    ) -> dict[str, Float[Array, " intervals"]]:
        """Return the peak use of each limit between consecutive samples, by name.

        The use is a share of the limit, the largest at five evenly spaced times from one sample to
        the next. The accelerations are linear in time between samples.
        """
        cubic, square, linear, constant = self._curves[0].c
        usage = {group.name: np.zeros(len(cubic)) for group in limits}
        for share in _CHECKS.tolist():
            h = share * np.diff(self.times)[:, None]
            motion = Motion(
                ((cubic * h + square) * h + linear) * h + constant,
                (3.0 * cubic * h + 2.0 * square) * h + linear,
                6.0 * cubic * h + 2.0 * square,
            )
            for name, shares in limit_shares(motion, limits).items():
                usage[name] = np.maximum(usage[name], shares)
        return usage

    def interval_zone_usage(self, zone_speeds: ZoneSpeeds) -> Float[Array, " intervals"]:
        """Return the peak share of the speed limit of zones between consecutive samples.

        It is the largest at 17 evenly spaced times, because a zone may begin between two of them.

        Args:
            zone_speeds: Largest speed, m/s, at points (x, y) in W, m.
        """
        cubic, square, linear, constant = (each[:, :2] for each in self._curves[0].c)
        usage = np.zeros(len(cubic))
        for share in _ZONE_CHECKS.tolist():
            h = share * np.diff(self.times)[:, None]
            velocity = (3.0 * cubic * h + 2.0 * square) * h + linear
            place = ((cubic * h + square) * h + linear) * h + constant
            usage = np.maximum(usage, np.hypot(*velocity.T) / zone_speeds(place))
        return usage


def first_short_step(times: Float[Array, " samples"]) -> int | None:
    """Return the index of the first sample that is not at least 1 us after the previous one.

    None: there is none.
    """
    late = np.flatnonzero(~(np.diff(times) >= MIN_STEP))
    return int(late[0]) + 1 if len(late) else None


def _checked(
    times: Float[Array, " samples"], poses: Float[Array, "samples 3"]
) -> tuple[Float[Array, " samples"], Float[Array, "samples 3"]]:
    """Return the times relative to the first and the poses, or raise InvalidReference."""
    count = len(times)
    if count < 2:
        raise InvalidReference(f"a reference needs at least two samples, got {count}")
    times = _checked_numbers("times", times, (count,))
    poses = _checked_numbers("poses", poses, (count, 3))
    i = first_short_step(times)
    if i is not None:
        raise InvalidReference(
            f"times must increase by at least {MIN_STEP:g} s: sample {i} is at {times[i]:.9g} s, "
            f"the previous one at {times[i - 1]:.9g} s"
        )
    return times - times[0], poses


def _unwrapped(poses: Float[Array, "samples 3"]) -> Float[Array, "samples 3"]:
    """Return the poses with unwrapped yaw."""
    return np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])


def _checked_numbers(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    """Return a copy as floats, or raise InvalidReference for another shape or invalid number."""
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise InvalidReference(f"{name} have the shape {array.shape}, need {shape}")
    if not (np.abs(array) <= MAX_VALUE).all():  # also catches NaN
        raise InvalidReference(
            f"{name} must be finite numbers of at most {MAX_VALUE:g} in magnitude"
        )
    return array
