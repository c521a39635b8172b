"""Set points of the wheel servos, with the motor lag that a robot shows."""

from __future__ import annotations

from math import exp, nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

_LONGER = (0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4)  # s, by which a lag is longer than known
_SHORTER = (0.0, 0.5)  # as shares of the known lag
_MEMORY = 10.0  # s; time constant with which squared differences are forgotten
_BETTER = 0.5  # share of the squared difference up to which another lag replaces the known one
_DOUBT_TIME = 1.0  # s; time constant with which a difference of a wheel shares
_LINEAR = 0.95  # share of the largest torque up to which the servo is linear


class SetPoints(NamedTuple):
    """Mean set points of the servos in one sample; the last dimension is that of the wheels."""

    values: Array
    """With the lag that the robot shows, rad/s."""
    before: Array
    """With the same lag, in the sample before."""
    doubt: Array
    """Error of ``values`` for each wheel, as shown by the other wheels, rad/s."""


class ServoResponse:
    """Set points of the servos for several motor lags, and the lag that the robot shows.

    Below its limit, the mean torque of a velocity servo is ``gain (set point - speed)``: speed and
    torque give the mean set point of each wheel, whatever its load. The chosen lag has the least
    sum of squared differences between modelled and measured set points, in which the median over
    the wheels counts: a slow drive delays all wheels, and a defect of one wheel does not change the
    median.

    What no lag explains, such as a wrong wheel radius or a delay, is the doubt about a wheel: the
    median over the other wheels of their largest recent differences.

    All arrays may have dimensions of runs before that of the wheels.

    Args:
        lag: Time constant of the robot file, s.
        limit: Largest torque over the servo gain, rad/s.
        shape: Shape of the arrays of a sample.
    """

    def __init__(self, lag: float, limit: float, shape: tuple[int, ...]) -> None:
        lags = [lag, *(lag + more for more in _LONGER), *(share * lag for share in _SHORTER)]
        self._lags, self._limit = np.array(lags if lag > 0.0 else lags[: 1 + len(_LONGER)]), limit
        self._ends = np.zeros((len(self._lags), *shape))
        self._scores = np.zeros((len(self._lags), *shape[:-1], 1))
        self._means, self._before, self._differences = (self._ends.copy() for _ in range(3))
        wheels = range(shape[-1])
        self._others = np.array([[j for j in wheels if j != i] for i in wheels])
        self._constants = _Constants(nan, self._lags, self._lags, 1.0, 1.0)

    @property
    def lag(self) -> Array:
        """Time constant that the robot shows, s; one for all wheels of a run."""
        return np.asarray(self._lags[self._best()[0, ..., 0]])

    def restart(self, speeds: Array) -> None:
        """Set all set points to the present speeds, rad/s, after samples without set points."""
        self._ends[:] = speeds
        self._means = self._ends.copy()

    def update(
        self, target: Array, dt: float, speeds: Array, droop: Array, resolution: float
    ) -> tuple[Array, Array]:
        """Return the mean set points with the lag of the robot file in a sample and before, rad/s.

        Args:
            target: Commanded wheel speeds, rad/s.
            dt: Duration of the sample, s.
            speeds: Mean measured speeds, rad/s.
            droop: Mean torques over the servo gain, rad/s; NaN: unknown.
            resolution: Smallest speed that the encoders resolve, rad/s.
        """
        if self._constants.dt != dt:
            self._constants = _Constants.of(self._lags, dt, target.ndim)
        _, decay, share, forgetting, fading = self._constants
        difference, limit = self._ends - target, self._limit
        before, means = self._means, target + share * difference
        self._ends = target + decay * difference
        self._before, self._means = before, means
        linear = (np.abs(droop) < _LINEAR * limit) & (np.abs(means[0] - before[0]) < limit)
        errors = np.where(linear, np.abs(means - (speeds + droop)), 0.0)
        np.minimum(errors, limit, out=errors)
        middle = (errors.shape[-1] - 1) // 2
        self._scores *= forgetting
        self._scores += np.sort(errors, axis=-1)[..., middle : middle + 1] ** 2
        self._differences *= fading
        np.maximum(self._differences, errors - resolution, out=self._differences)
        return means[0], before[0]

    def set_points(self) -> SetPoints:
        """Return the set points of the latest sample with the lag that the robot shows."""
        best = self._best()
        values, before, differences = (
            np.take_along_axis(each, best, axis=0)[0]
            for each in (self._means, self._before, self._differences)
        )
        return SetPoints(values, before, np.median(differences[..., self._others], axis=-1))

    def _best(self) -> Array:
        """Return the index of the chosen lag, with the dimensions of the scores."""
        best = np.argmin(self._scores, axis=0, keepdims=True)
        minimum = np.take_along_axis(self._scores, best, axis=0)
        return np.where(minimum < _BETTER * self._scores[:1], best, 0)


class _Constants(NamedTuple):
    """What depends on the duration of a sample."""

    dt: float
    decay: Array
    """Share of a difference from the target that is left after ``dt``, for each lag."""
    share: Array
    """Its mean share in that time."""
    forgetting: float
    """Factor on the scores."""
    fading: float
    """Factor on the differences of the wheels."""

    @classmethod
    def of(cls, lags: Float[Array, " lags"], dt: float, dimensions: int) -> _Constants:
        """Return the constants for ``dt`` (s) and arrays of lags before that many dimensions."""
        safe = np.maximum(lags, 1e-9)
        decay = np.exp(-dt / safe)
        share = np.where(lags > 0.0, safe / dt * (1.0 - decay), 0.0)
        wide = (slice(None), *(None,) * dimensions)
        return cls(dt, decay[wide], share[wide], exp(-dt / _MEMORY), exp(-dt / _DOUBT_TIME))
