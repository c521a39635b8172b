"""Means of a metric per controller and repetition, the independent units of a study."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.evaluation.statistics.run_table import RunTable, Task


@dataclass(frozen=True, eq=False, slots=True)
class RepetitionMeans:
    """A metric in one task, by pairing, repetition and controller.

    Runs of one repetition have the same random numbers, also at different values of the axes: they
    are not independent. A repetition therefore gives one value: its mean over the axis values. The
    repeats of a task have random numbers of their own; each counts as a repetition unless random
    factors, whose sample they share, vary; see :attr:`RunTable.unit`.

    Attributes:
        task: The task.
        controllers: Labels of the controllers that have runs in it.
        values: Metric by pairing and controller; NaN: no valid run.
        planned: Whether there is a run, valid or not.
        finished: Whether the run reached its end.
        repetition: Index of the repetition of each pairing, from 0 without gaps.
    """

    task: Task
    controllers: tuple[str, ...]
    values: Float[Array, "pairings controllers"]
    planned: Bool[Array, "pairings controllers"]
    finished: Bool[Array, "pairings controllers"]
    repetition: Int[Array, " pairings"]

    @property
    def means(self) -> Float[Array, "repetitions controllers"]:
        """Mean over the valid runs of every repetition; NaN without any."""
        return self._average(self.values)

    def difference(self, first: int, second: int) -> Float[Array, " repetitions"]:
        """Return the mean of ``first`` minus ``second`` over the pairings where both are valid.

        NaN for a repetition without any.
        """
        return self._average((self.values[:, first] - self.values[:, second])[:, None])[:, 0]

    def _average(
        self, values: Float[Array, "pairings columns"]
    ) -> Float[Array, "repetitions columns"]:
        count = int(self.repetition.max()) + 1 if len(self.repetition) else 0
        known = np.isfinite(values)
        sums, counts = np.empty((count, values.shape[1])), np.empty((count, values.shape[1]))
        for k, column in enumerate(np.where(known, values, 0.0).T):
            sums[:, k] = np.bincount(self.repetition, column, count)
            counts[:, k] = np.bincount(self.repetition, known[:, k], count)
        with np.errstate(invalid="ignore"):
            means: Float[Array, "repetitions columns"] = sums / np.where(counts > 0, counts, np.nan)
        return means


def repetition_means(
    runs: RunTable, metric: str, rows: Bool[Array, " runs"] | None = None
) -> list[RepetitionMeans]:
    """Return a metric by task, pairing and controller; tasks without any value are omitted.

    Args:
        runs: The runs.
        metric: Name of the metric.
        rows: The rows that count, such as those of one axis value. None: all.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    values = runs.values(metric)
    found = []
    for k, task in enumerate(runs.tasks):
        chosen = runs.task == k if rows is None else (runs.task == k) & rows
        if np.isfinite(values[chosen]).any():
            found.append(_of_task(runs, task, chosen, values))
    return found


def _of_task(
    runs: RunTable, task: Task, chosen: Bool[Array, " runs"], values: Float[Array, " runs"]
) -> RepetitionMeans:
    labels, controller = np.unique(runs.controller[chosen], return_inverse=True)
    pairings, first, pairing = np.unique(
        runs.pairing[chosen], return_index=True, return_inverse=True
    )
    _, repetition = np.unique(runs.unit[chosen][first], return_inverse=True)
    shape = (len(pairings), len(labels))
    grid, planned, finished = np.full(shape, np.nan), np.zeros(shape, bool), np.zeros(shape, bool)
    grid[pairing, controller] = values[chosen]
    planned[pairing, controller] = True
    finished[pairing, controller] = runs.finished[chosen]
    names = tuple(runs.controllers[k] for k in labels)
    return RepetitionMeans(task, names, grid, planned, finished, repetition.astype(np.int64))
