"""Shares of the variance of a quantity that controllers, axes and random factors explain."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.evaluation.statistics.run_table import RunTable, Task

_BINS = 8  # of a factor with more different values
_RESAMPLES = 400
_SEED = 19_930_101

MIN_REPETITIONS = 10
"""Fewer repetitions have no intervals of the shares."""

CONTROLLER = "controller"
"""Name of the choice of the controller among the factors."""


class VarianceShare(NamedTuple):
    """Share of the variance that one factor explains alone."""

    factor: str
    """Path of the factor, or :data:`CONTROLLER`."""
    share: float
    """Share, 0 to 1."""
    low: float
    """Lower bound of its 95 % interval; NaN for fewer than 10 repetitions, as is ``high``."""
    high: float


def variance_shares(runs: RunTable, metric: str, task: Task) -> list[VarianceShare]:
    """Return the share of every factor, the largest first; empty without variance.

    First-order index of Sobol', "Sensitivity estimates for nonlinear mathematical models", 1993:
    the variance of the mean given the factor over the total variance, less what equal means would
    give by chance (Kelley, "An unbiased correlation ratio measure", 1935; for a random factor, the
    chance is that of the repetitions, which all its runs share). What is missing to 1 are
    interactions and the random numbers of the repetitions. A factor with more than 8 values is
    grouped into at most 8 bins of equal size, a random one with 5 repetitions in each at least;
    random factors need 10 repetitions, and those with many texts are omitted. Intervals: bootstrap
    over repetitions, percentiles. Factors should be combined with each other, as in a grid or a
    joint sample.

    Args:
        runs: The runs.
        metric: Name of the metric.
        task: The task.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    values = runs.values(metric)
    rows = (runs.task == runs.tasks.index(task)) & np.isfinite(values)
    y = values[rows]
    if len(y) < 3 or y.std() <= 1e-12 * np.abs(y).max():
        return []
    _, repetition = np.unique(runs.unit[rows], return_inverse=True)
    sample = _Sample(y - y.mean(), repetition.astype(np.int64))
    found = []
    if len(runs.controllers) > 1:
        found.append((CONTROLLER, runs.controller[rows], False))
    for path in runs.factors:
        is_random = path in runs.random_factors
        bins = min(_BINS, sample.repetitions // 5) if is_random else _BINS
        is_ordered = runs.factors[path].dtype != object
        if bins > 1 and (is_ordered or len(runs.levels(path)[0]) <= bins):
            found.append((path, _grouped(runs, path, bins)[rows], is_random))
    shares = [
        VarianceShare(path, *sample.share(codes, is_random))
        for path, codes, is_random in found
        if len(np.unique(codes)) > 1
    ]
    return sorted(shares, key=lambda each: -each.share)


def _grouped(runs: RunTable, path: str, bins: int) -> Int[Array, " runs"]:
    """Return codes of at most ``bins`` groups of equal size, in the order of the values."""
    levels, codes = runs.levels(path)
    if len(levels) <= bins:
        return codes
    edges = np.quantile(codes, np.linspace(0.0, 1.0, bins + 1)[1:-1])
    return np.searchsorted(edges, codes, side="right").astype(np.int64)


class _Sample(NamedTuple):
    """Values of a quantity and their repetitions."""

    y: Float[Array, " rows"]
    """Values less their mean."""
    repetition: Int[Array, " rows"]

    @property
    def repetitions(self) -> int:
        """Number of repetitions."""
        return int(self.repetition.max()) + 1

    def share(self, codes: Int[Array, " rows"], is_random: bool) -> tuple[float, float, float]:
        """Return the share of one factor and its interval, from sums per repetition and group."""
        _, group = np.unique(codes, return_inverse=True)
        shape = (self.repetitions, int(group.max()) + 1)
        cell = self.repetition * shape[1] + group
        counts, sums, squares = (
            np.bincount(cell, weights, minlength=shape[0] * shape[1]).reshape(shape).astype(float)
            for weights in (None, self.y, self.y**2)
        )
        share = float(_corrected(np.ones((1, shape[0])), counts, sums, squares, is_random)[0])
        if shape[0] < MIN_REPETITIONS:
            return share, nan, nan
        rng = np.random.default_rng([_SEED, shape[0]])
        draws = rng.integers(0, shape[0], (_RESAMPLES, shape[0]))
        weights = np.stack([np.bincount(row, minlength=shape[0]) for row in draws]).astype(float)
        resampled = _corrected(weights, counts, sums, squares, is_random)
        low, high = np.quantile(resampled, [0.025, 0.975]).tolist()
        return share, low, high


def _corrected(
    weights: Float[Array, "resamples repetitions"],
    counts: Float[Array, "repetitions groups"],
    sums: Float[Array, "repetitions groups"],
    squares: Float[Array, "repetitions groups"],
    is_random: bool,
) -> Float[Array, " resamples"]:
    """Return Kelley's corrected correlation ratio of each weighting of the repetitions."""
    n, s = weights @ counts, weights @ sums
    total_n, total_s = n.sum(axis=1), s.sum(axis=1)
    total = weights @ squares.sum(axis=1) - total_s**2 / total_n
    between = np.where(n > 0, s**2 / np.maximum(n, 1.0), 0.0).sum(axis=1) - total_s**2 / total_n
    groups = (n > 0).sum(axis=1)
    units, around = total_n, total
    if is_random:  # the units are the repetitions
        own_n, own_s = counts.sum(axis=1), sums.sum(axis=1)
        units, around = weights.sum(axis=1), weights @ (own_s**2 / own_n) - total_s**2 / total_n
    chance = (around - between) / np.maximum(units - groups, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (between - (groups - 1) * chance) / total
    clipped: Float[Array, " resamples"] = np.clip(np.nan_to_num(share), 0.0, 1.0)
    return clipped
