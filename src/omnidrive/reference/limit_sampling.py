"""Samples of a motion whose cubic Hermite interpolation keeps its limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.maps import CostMap
from omnidrive.reference.reference import Reference
from omnidrive.reference.sampled_reference import MAX_SAMPLES, SampledReference
from omnidrive.reference.timing.limited_reference import LimitedReference
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.timed_reference import TimedReference
from omnidrive.reference.timing.zone_speeds import ZoneSpeeds

EXCESS = 0.01
"""Tolerated relative excess of a limit between samples."""

_ZONE_EXCESS = 0.005
"""The same for the limits of zones, at points that may miss their borders."""

_ZONE_SAMPLES = 10
"""Points of the motion for each even sample at which its speed in zones is evaluated."""

MIN_ADDED_STEP = 1e-5
"""Shortest time between samples that refinement makes, in s."""

_DOMINANT = 0.25
"""Share of all jumps between two samples from which the largest one counts as a switch."""


def sample_within_limits(
    reference: Reference,
    dt: float,
    limits: tuple[LimitRows, ...] | None = None,
    usage: dict[str, float] | None = None,
    min_step: float = MIN_ADDED_STEP,
    *,
    zones: CostMap | None = None,
) -> SampledReference:
    """Sample a reference at even steps of about ``dt`` s, and at further times for its limits.

    Where the cubic Hermite interpolation of even samples exceeds a limit by more than 1 %, samples
    are added: at the nodes of a :class:`TimedReference`, where its acceleration may jump, and
    between them by halving. Without the sample at a jump, the interpolated acceleration overshoots
    by up to half of the jump at any step.

    Args:
        reference: The motion.
        dt: Time between samples, in s.
        limits: Limits to keep; None: those of a :class:`LimitedReference`, but not of its jerk;
            none for others.
        usage: Peak use of each limit by the motion itself, as a share of the limit; where that is
            above 1, the samples keep it within 1 %. None: 1.
        min_step: Shortest time between an added sample and its neighbours, in s. The limits may be
            exceeded where the acceleration jumps twice within this time.
        zones: Map whose ``max_speed`` is kept likewise; where the motion itself exceeds it, the
            samples exceed it by less than 1 % more.

    Raises:
        InvalidReference: ``dt`` or the duration is not possible, or more than 100,000 samples are
            needed.
    """
    samples = SampledReference.of(reference, dt)
    nodes = _Nodes(np.zeros(0), np.zeros(0))
    if isinstance(reference, TimedReference):
        nodes = _Nodes.of(reference)
    if limits is None and isinstance(reference, LimitedReference):
        limits = tuple(group for group in reference.limits if group.kind != "jerk")
    zone_speeds = None if zones is None or zones.max_speed is None else zones.max_speeds
    limits = limits or ()
    if not limits and zone_speeds is None:
        return samples
    most = _zone_usage(reference, len(samples.times), zone_speeds)
    allowed = {g.name: (1.0 + EXCESS) * max((usage or {}).get(g.name, 1.0), 1.0) for g in limits}
    while True:
        shares = samples.interval_usage(limits)
        used = [shares[name] / maximum for name, maximum in allowed.items()]
        if zone_speeds is not None:
            used.append(samples.interval_zone_usage(zone_speeds) / most)
        over = np.max(used, axis=0) > 1.0
        times = _refined(samples.times, np.flatnonzero(over), nodes, min_step)
        if len(times) > MAX_SAMPLES:
            raise InvalidReference(
                f"the motion needs more than {MAX_SAMPLES:,} samples to keep its limits between "
                "them; choose a longer duration"
            )
        if np.array_equal(times, samples.times):
            return samples
        samples = _at(reference, times, samples)


def _zone_usage(reference: Reference, samples: int, zone_speeds: ZoneSpeeds | None) -> float:
    """Return the share of the speed limit of zones that samples may use."""
    if zone_speeds is None:
        return 1.0
    count = _ZONE_SAMPLES * samples
    rows = reference.window(0.0, count, reference.duration / (count - 1))
    own = float((np.hypot(rows[:, 3], rows[:, 4]) / zone_speeds(rows[:, :2])).max())
    return (1.0 + _ZONE_EXCESS) * max(own, 1.0)


class _Nodes(NamedTuple):
    """Inner nodes of a timed reference."""

    times: Float[Array, " nodes"]
    jumps: Float[Array, " nodes"]
    """Magnitude of the change of d2s/dt2 at each node, in 1/s^2."""

    @classmethod
    def of(cls, reference: TimedReference) -> _Nodes:
        """Return the nodes of a reference without its ends."""
        change = np.diff(reference.squared_speeds, 2) * (0.5 * len(reference.squared_speeds))
        return cls(reference.times[1:-1], np.abs(change))

    def within(self, start: float, end: float) -> float | None:
        """Return the node to add between two samples; None: there is none.

        It is the one with the largest jump if that dominates, otherwise that nearest to the middle.
        """
        here = slice(np.searchsorted(self.times, start, "right"), np.searchsorted(self.times, end))
        times, jumps = self.times[here], self.jumps[here]
        if not len(times):
            return None
        if jumps.max() > _DOMINANT * jumps.sum():
            return float(times[np.argmax(jumps)])
        return float(times[np.argmin(np.abs(times - 0.5 * (start + end)))])


def _refined(
    times: Float[Array, " samples"],
    intervals: Int[Array, " over"],
    nodes: _Nodes,
    min_step: float,
) -> Float[Array, " more"]:
    """Return the times with one time added in each of the given intervals, if there is room.

    The added time is a node or, without a node inside, the middle. An even sample that is too near
    to a node gives way to it. If that sample is a node itself, a time next to it is added, which
    keeps the interval that contains both nodes short.
    """
    removed: set[int] = set()
    added: list[float] = []
    is_node = np.isin(times, nodes.times)
    is_node[[0, -1]] = True  # the ends stay
    for i in intervals.tolist():
        start, end = times[i : i + 2].tolist()
        node = nodes.within(start, end)
        if node is None:
            if end - start >= 2.0 * min_step:
                added.append(0.5 * (start + end))
            continue
        crowded = [k for k in (i, i + 1) if abs(times[k] - node) < min_step]
        if not any(is_node[k] for k in crowded):
            removed.update(crowded)
            added.append(node)
        elif end - start > 3.0 * min_step:
            added.append(start + 1.5 * min_step if crowded[0] == i else end - 1.5 * min_step)
    kept = np.delete(times, sorted(removed))
    new = np.array(sorted(added))
    where = np.searchsorted(kept, new)
    new = new[np.minimum(new - kept[where - 1], kept[where] - new) >= min_step]
    apart = np.concatenate([[True], np.diff(new) >= min_step])[: len(new)]
    return np.sort(np.concatenate([kept, new[apart]]))


def _at(
    reference: Reference, times: Float[Array, " more"], known: SampledReference
) -> SampledReference:
    """Return the samples at ``times``, of which those in ``known`` are not evaluated again."""
    old = np.column_stack([known.poses, known.twists])
    where = np.searchsorted(known.times, times).clip(0, len(known.times) - 1)
    rows = old[where]
    for i in np.flatnonzero(known.times[where] != times).tolist():
        setpoint = reference.at(float(times[i]))
        rows[i] = *setpoint.pose, *setpoint.twist
    return SampledReference(times, rows[:, :3], rows[:, 3:], unwrapped=True)
