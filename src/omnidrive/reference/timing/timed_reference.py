"""References along a path whose squared speed is linear between nodes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.timing.limited_reference import LimitedReference
from omnidrive.reference.timing.limits import LimitRows, SectionLimit
from omnidrive.reference.timing.piecewise_path import (
    PathDerivatives,
    PiecewisePath,
    body_derivatives,
)

_CHECKS = 8
"""Number of points per interval, besides its start, at which limits are evaluated."""


@dataclass(frozen=True, eq=False)
class TimedReference(LimitedReference):
    """Motion along a path, with ``(ds/dt)^2`` linear in s between equal nodes.

    The path acceleration d2s/dt2 is constant between nodes, and the pose at any time has a closed
    form. The velocity is continuous; the acceleration may jump at nodes.

    Attributes:
        path: Poses as a function of s.
        limits: Limits that :attr:`limit_usage` evaluates.
        squared_speeds: (ds/dt)^2 at the nodes, in 1/s^2; a whole number of intervals per piece.
        section_limits: Limits of parts of the path, which :attr:`limit_usage` evaluates there.
        times: Time of each node, in s, by the mean of the speeds at the ends of each interval.
    """

    path: PiecewisePath
    limits: tuple[LimitRows, ...]
    squared_speeds: Float[Array, " nodes"]
    section_limits: tuple[SectionLimit, ...] = ()
    times: Float[Array, " nodes"] = field(init=False, repr=False)

    @property
    def _width(self) -> float:
        """Width of an interval in s."""
        return len(self.path.pieces) / (len(self.squared_speeds) - 1)

    def __post_init__(self) -> None:
        speeds = np.sqrt(self.squared_speeds)
        steps = 2.0 * self._width / (speeds[:-1] + speeds[1:])
        object.__setattr__(self, "times", np.concatenate([[0.0], np.cumsum(steps)]))

    def _along(self, k: Array, since: Array) -> tuple[PathDerivatives, Array]:
        """Evaluate path and ds/dt at a time after the start of each interval."""
        before, after = self.squared_speeds[k], self.squared_speeds[k + 1]
        u = (after - before) / (2.0 * self._width)
        speed = np.maximum(np.sqrt(before) + u * since, 0.0)
        share = np.clip((np.sqrt(before) + 0.5 * u * since) * since / self._width, 0.0, 1.0)
        return self._derivatives(k, share), speed

    def _derivatives(self, interval: Array, share: Array) -> PathDerivatives:
        """Evaluate the path at a share of the width of the given intervals."""
        per_piece = round(1.0 / self._width)
        return self.path.at(interval // per_piece, (interval % per_piece + share) * self._width)

    @cached_property
    def interval_usage(self) -> dict[str, Float[Array, " intervals"]]:
        """Peak usage of each limit in each interval, as a share of the limit.

        Evaluated at both ends of each interval and at seven points between.
        """
        count = len(self.squared_speeds) - 1
        parts = [(each.limit, each.intervals(count, self._width)) for each in self.section_limits]
        everywhere = np.ones(count, bool)
        groups = [*((group, everywhere) for group in self.limits), *parts]
        usage = {group.name: np.zeros(count) for group, _ in groups}
        before, after = self.squared_speeds[:-1], self.squared_speeds[1:]
        u = ((after - before) / (2.0 * self._width))[:, None]
        for share in np.arange(_CHECKS + 1) / _CHECKS:
            body = body_derivatives(self._derivatives(np.arange(count), np.full(count, share)))
            x = (before + share * (after - before))[:, None]
            for group, inside in groups:
                shares = np.where(inside, _usage(group, body, u, x), 0.0)
                usage[group.name] = np.maximum(usage[group.name], shares)
        return usage

    @cached_property
    def limit_usage(self) -> dict[str, float]:
        """Peak usage of each limit, between nodes as well, as a share of the limit."""
        return {name: float(shares.max()) for name, shares in self.interval_usage.items()}

    def slowed(self, rate: float) -> TimedReference:
        """Return the same motion with all speeds multiplied by ``rate``, at most 1."""
        return replace(self, squared_speeds=self.squared_speeds * rate**2)


def _usage(
    group: LimitRows, body: tuple[Array, Array, Array], u: Array, x: Array
) -> Float[Array, " n"]:
    """Return the share of a limit that is used, at many points."""
    first, change, second = body
    if group.kind == "speed":
        vectors = first * np.sqrt(x)
    else:
        vectors = first * u + (change if group.kind == "twist rate" else second) * x
    return group.shares(vectors.T)
