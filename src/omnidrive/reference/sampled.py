"""References through timed samples, such as a file holds."""

from __future__ import annotations

from dataclasses import InitVar, dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference.reference import Reference, Setpoint

SHORTEST_STEP = 1e-6  # s between samples; below, differences of poses over time are rounding
LARGEST_NUMBER = 1e10  # in s, m, rad, m/s or rad/s; a clock's time since 1970 is 1.8e9 s
MOST_SAMPLES = 100_000


@dataclass(frozen=True, eq=False)
class SampledReference:
    """A motion through timed poses with given velocities: piecewise cubic, velocity continuous.

    Between two samples x, y and yaw each follow the cubic Hermite polynomial of the two poses and
    twists (de Boor, "A Practical Guide to Splines", ch. IV), so that the twist is the exact
    derivative of the pose everywhere.

    Attributes:
        times: In s, each at least 1 us after the one before; kept relative to the first.
        poses: Poses of B in W; x and y in m, yaw in rad. From one sample to the next the robot
            turns the short way: the yaw is kept unwrapped.
        twists: Velocities at the samples, in W; m/s, m/s, rad/s.
        unwrapped: The yaw is as far as the robot turns already, also if that is the long way.

    Raises:
        InvalidReference: Fewer than two samples, shapes that disagree, times that do not grow, or
            a number that is not finite or beyond 1e10.
    """

    times: Float[Array, " samples"]
    poses: Float[Array, "samples 3"]
    twists: Float[Array, "samples 3"]
    unwrapped: InitVar[bool] = False

    def __post_init__(self, unwrapped: bool) -> None:
        times, poses = _checked(self.times, self.poses)
        if not unwrapped:
            poses = _unwrapped(poses)
        twists = _numbers("twists", self.twists, poses.shape)
        for name, value in (("times", times), ("poses", poses), ("twists", twists)):
            object.__setattr__(self, name, value)

    @classmethod
    def through(
        cls, times: Float[Array, " samples"], poses: Float[Array, "samples 3"]
    ) -> SampledReference:
        """Motion from rest to rest through poses whose velocities are not known.

        They are those of the cubic spline with zero velocity at both ends. Of all curves through
        the samples it has the least mean square acceleration (Holladay 1957), its acceleration is
        continuous as well, and turning the world turns the curve. Between samples at very uneven
        times it can swing wider than they do.

        Args:
            times: As for the class.
            poses: As for the class.

        Raises:
            InvalidReference: As for the class.
        """
        times, poses = _checked(times, poses)
        poses = _unwrapped(poses)
        spline = CubicSpline(times, poses, bc_type="clamped")
        return cls(times, poses, spline(times, 1))

    @classmethod
    def of(cls, reference: Reference, dt: float) -> SampledReference:
        """Samples of another reference, evenly spaced by about ``dt`` s from its start to its end.

        They turn as the other does, also where that is more than half a turn from one to the next.

        Raises:
            InvalidReference: ``dt`` is not a positive number, or the reference has no duration.
        """
        duration = reference.duration
        if not 0.0 < dt < np.inf:
            raise InvalidReference(f"the time between samples must be positive, got {dt:g} s")
        if not SHORTEST_STEP <= duration <= LARGEST_NUMBER:
            raise InvalidReference(f"a reference of {duration:g} s cannot be sampled")
        steps = max(1.0, round(duration / max(dt, SHORTEST_STEP)))
        if steps > MOST_SAMPLES:
            raise InvalidReference(
                f"{duration:g} s in steps of {dt:g} s are {steps:.3g} samples, more than "
                f"{MOST_SAMPLES:,}; choose a step of {duration / MOST_SAMPLES:.2g} s or longer"
            )
        times = np.linspace(0.0, duration, int(steps) + 1)
        window = reference.window(0.0, int(steps) + 1, duration / int(steps))
        end = reference.at(duration)  # the window's last row may have rounded past it
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

    def at(self, t: float) -> Setpoint:
        """Setpoint at time ``t`` in s; outside [0, duration] an end pose, at rest."""
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Setpoints at ``t + k * dt`` for k = 0..n-1, columns as in :class:`Reference`."""
        poses, twists = self._curves
        at = t + dt * np.arange(n)
        # k * dt may round past the end
        inside = (at >= 0.0) & (at <= self.duration * (1.0 + 1e-12))
        at = np.clip(at, 0.0, self.duration)
        return np.hstack([poses(at), twists(at) * inside[:, None]])


def first_step_back(times: Float[Array, " samples"]) -> int | None:
    """Index of the first sample that does not come at least 1 us after the one before it."""
    late = np.flatnonzero(~(np.diff(times) >= SHORTEST_STEP))
    return int(late[0]) + 1 if len(late) else None


def _checked(
    times: Float[Array, " samples"], poses: Float[Array, "samples 3"]
) -> tuple[Float[Array, " samples"], Float[Array, "samples 3"]]:
    """Times from zero and poses, or a refusal."""
    count = len(times)
    if count < 2:
        raise InvalidReference(f"a reference needs at least two samples, got {count}")
    times = _numbers("times", times, (count,))
    poses = _numbers("poses", poses, (count, 3))
    i = first_step_back(times)
    if i is not None:
        raise InvalidReference(
            f"times must grow by at least {SHORTEST_STEP:g} s: sample {i} is at {times[i]:.9g} s, "
            f"the one before it at {times[i - 1]:.9g} s"
        )
    return times - times[0], poses


def _unwrapped(poses: Float[Array, "samples 3"]) -> Float[Array, "samples 3"]:
    """Poses that turn the short way from one to the next."""
    return np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])


def _numbers(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise InvalidReference(f"{name} have the shape {array.shape}, need {shape}")
    if not (np.abs(array) <= LARGEST_NUMBER).all():  # also catches NaN
        raise InvalidReference(f"{name} must be finite numbers of at most {LARGEST_NUMBER:g}")
    return array
