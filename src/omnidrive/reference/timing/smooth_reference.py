"""References along a path with continuous acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.timing.limited_reference import LimitedReference
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.piecewise_path import (
    PathDerivatives,
    PiecewisePath,
    body_derivatives,
    rotate_into_body,
)

_CHECKS = 8
"""Intervals between the points of an interval at which limits are evaluated."""
_ZOOMS, _NEAR = 8, 0.97
"""Number of times that the neighbourhood of a peak is divided, and usage, as a share of the peak,
of the intervals whose peaks are refined."""
POWERS = {"speed": 1.0, "twist rate": 2.0, "acceleration": 2.0, "jerk": 3.0}
"""Power of the speed along the path with which each kind of limited vector grows."""


def jerk_terms(
    motion: PathDerivatives, third: Float[Array, "n 3"]
) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Return q''', 3 q'' and q' in B: the jerk is q''' v^3 + 3 q'' v dv/dt + q' d2v/dt2.

    Here v = ds/dt.

    Args:
        motion: Derivatives of the path.
        third: Third derivatives q''' of the path in W.
    """
    yaw = motion.poses[:, 2]
    return (
        rotate_into_body(third, yaw),
        3.0 * rotate_into_body(motion.second_derivatives, yaw),
        rotate_into_body(motion.first_derivatives, yaw),
    )


@dataclass(frozen=True, eq=False)
class SmoothReference(LimitedReference):
    """Motion along a path on which s is a polynomial of degree 5 in time between nodes.

    Speed and acceleration are continuous.

    Attributes:
        path: Poses as a function of s.
        limits: Limits that :attr:`limit_usage` evaluates.
        times: Time of each node, in s, from 0.
        nodes: s at each node, where the pieces of the path end and in between.
        coefficients: Coefficients of 1, r .. r^5 of s on each interval, with r from 0 to 1.
    """

    path: PiecewisePath
    limits: tuple[LimitRows, ...]
    times: Float[Array, " nodes"]
    nodes: Float[Array, " nodes"]
    coefficients: Float[Array, "intervals 6"]

    @classmethod
    def of(
        cls,
        path: PiecewisePath,
        limits: tuple[LimitRows, ...],
        nodes: Float[Array, " nodes"],
        squared_speeds: Float[Array, " nodes"],
        accelerations: Float[Array, " nodes"],
    ) -> SmoothReference:
        """Return the motion with given (ds/dt)^2 and d2s/dt2 at nodes.

        The time between two nodes is that of a motion whose d2s/dt2 is linear in s; from or to
        rest, that of a motion with constant d3s/dt3.
        """
        v, width = np.sqrt(squared_speeds), np.diff(nodes)
        mean = 0.5 * (v[:-1] + v[1:])
        slope = np.diff(accelerations) / width
        bend = slope * (width / (2.0 * mean)) ** 2
        root = np.sqrt(np.abs(bend))
        small = root < 1e-4
        safe = np.where(small, 1.0, root)
        area = np.where(bend > 0.0, np.arctanh(np.minimum(safe, 1.0 - 1e-12)), np.arctan(safe))
        step = width / mean * np.where(small, 1.0 + bend / 3.0, area / safe)
        rest = (v[:-1] == 0.0) | (v[1:] == 0.0)
        step = np.where(rest, 1.5 * width / mean, step)
        p0, v0, a0 = nodes[:-1], v[:-1] * step, accelerations[:-1] * step**2
        v1, a1 = v[1:] * step, accelerations[1:] * step**2
        coefficients = np.stack(
            [
                p0,
                v0,
                0.5 * a0,
                10.0 * width - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
                -15.0 * width + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
                6.0 * width - 3.0 * (v0 + v1) - 0.5 * a0 + 0.5 * a1,
            ],
            axis=1,
        )
        times = np.concatenate([[0.0], np.cumsum(step)])
        return cls(path, limits, times, nodes, coefficients)

    def _along(self, k: Array, since: Array) -> tuple[PathDerivatives, Array]:
        """Evaluate path and ds/dt at a time after the start of each interval."""
        s, v, _, _ = self._progress(k, since / (self.times[k + 1] - self.times[k]))
        return self._derivatives(k, s), v

    def _progress(self, k: Array, r: Array) -> tuple[Array, Array, Array, Array]:
        """Return s and its first three derivatives with respect to time, on intervals k."""
        c = self.coefficients[k].T
        step = np.diff(self.times)[k]
        s = c[0] + r * (c[1] + r * (c[2] + r * (c[3] + r * (c[4] + r * c[5]))))
        v = c[1] + r * (2 * c[2] + r * (3 * c[3] + r * (4 * c[4] + r * 5 * c[5])))
        u = 2 * c[2] + r * (6 * c[3] + r * (12 * c[4] + r * 20 * c[5]))
        j = 6 * c[3] + r * (24 * c[4] + r * 60 * c[5])
        return s, np.maximum(v / step, 0.0), u / step**2, j / step**3

    def _derivatives(self, k: Array, s: Array) -> PathDerivatives:
        """Evaluate the path at s within intervals k."""
        return self.path.at(self._pieces[k], np.clip(s - self._pieces[k], 0.0, 1.0))

    @cached_property
    def _pieces(self) -> Array:
        pieces: Array = np.floor(0.5 * (self.nodes[:-1] + self.nodes[1:])).astype(int)
        return pieces

    def _usage(self, k: Array, r: Array) -> Float[Array, "limits n"]:
        """Return the used share of each limit at shares r of the duration of intervals k."""
        s, v, u, j = (part[:, None] for part in self._progress(k, r))
        motion = self._derivatives(k, s[:, 0])
        first, change, second = body_derivatives(motion)
        q3, q2, q1 = jerk_terms(motion, self.path.third_derivatives(self._pieces[k]))
        vectors = {
            "speed": first * v,
            "twist rate": first * u + change * v**2,
            "acceleration": first * u + second * v**2,
            "jerk": q3 * v**3 + q2 * v * u + q1 * j,
        }
        return np.stack([group.shares(vectors[group.kind].T) for group in self.limits])

    @cached_property
    def _sampled_usage(self) -> Float[Array, "limits intervals points"]:
        count, points = len(self.coefficients), _CHECKS + 1
        k = np.repeat(np.arange(count), points)
        r = np.tile(np.arange(points) / _CHECKS, count)
        return self._usage(k, r).reshape(len(self.limits), count, points)

    @cached_property
    def interval_usage(self) -> dict[str, Float[Array, " intervals"]]:
        """Peak usage of each limit in each interval, as a share of the limit, at nine points."""
        peaks = self._sampled_usage.max(axis=2)
        return {group.name: peak for group, peak in zip(self.limits, peaks, strict=True)}

    @property
    def scaled_usage(self) -> Float[Array, " intervals"]:
        """Factor by which (ds/dt)^2 exceeds what the limits permit, in each interval."""
        powers = np.array([2.0 / POWERS[group.kind] for group in self.limits])[:, None]
        scaled: Float[Array, " intervals"] = (self._sampled_usage.max(axis=2) ** powers).max(axis=0)
        return scaled

    @cached_property
    def limit_usage(self) -> dict[str, float]:
        """Peak usage of each limit, between nodes as well, as a share of the limit.

        The neighbourhood of every sample near the peak is divided again and again.
        """
        usage = {}
        for row, group in enumerate(self.limits):
            values = self._sampled_usage[row]
            peak = float(values.max())
            k, point = np.nonzero(values >= _NEAR * peak)
            r, width = point / _CHECKS, 1.0 / _CHECKS
            for _ in range(_ZOOMS if peak > 0.0 else 0):
                near = np.clip(r[:, None] + width * np.linspace(-1.0, 1.0, _CHECKS + 1), 0.0, 1.0)
                found = self._usage(np.repeat(k, _CHECKS + 1), near.ravel())[row]
                found = found.reshape(near.shape)
                best = found.argmax(axis=1)
                r, width = near[np.arange(len(r)), best], 2.0 * width / _CHECKS
                peak = max(peak, float(found.max()))
            usage[group.name] = peak
        return usage

    def within_limits(self) -> SmoothReference:
        """Return the motion, slowed evenly where a limit is exceeded."""
        excess = max(self.limit_usage[g.name] ** (1.0 / POWERS[g.kind]) for g in self.limits)
        return self.slowed((1.0 - 1e-12) / excess) if excess > 1.0 else self

    def slowed(self, rate: float) -> SmoothReference:
        """Return the same motion with all speeds multiplied by ``rate``, at most 1."""
        return SmoothReference(
            self.path, self.limits, self.times / rate, self.nodes, self.coefficients
        )
