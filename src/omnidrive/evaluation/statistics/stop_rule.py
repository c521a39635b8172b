"""Stop rule of sequential studies: repetitions are added until the intervals are narrow enough."""

from __future__ import annotations

from itertools import combinations
from math import ceil, inf, isfinite
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.evaluation.measures.quantities import QUANTITIES, Quantity, parse_value, quantity
from omnidrive.evaluation.statistics.confidence_sequence import always_valid_mean, values_needed
from omnidrive.evaluation.statistics.repetition_means import RepetitionMeans, repetition_means
from omnidrive.evaluation.statistics.run_table import RunTable
from omnidrive.evaluation.statistics.uncertainty import CONFIDENCE
from omnidrive.evaluation.tables.table import number_text


class StopState(NamedTuple):
    """How far a sequential study is."""

    reached: bool
    """Whether every interval is narrow enough."""
    repetitions: int
    """Number of complete repetitions."""
    half_width: float
    """Half the width of the widest interval, in the stored unit; inf: no bound yet."""
    needed: float
    """Expected number of repetitions in all; inf if it is not known yet."""
    text: str
    """The same as one line."""


class StopRule(NamedTuple):
    """Accuracy at which a sequential study ends."""

    measure: Quantity
    """The quantity whose intervals are watched."""
    half_width: float
    """Largest half width of an interval, in the stored unit."""

    @classmethod
    def parse(cls, text: str) -> StopRule:
        """Read a rule such as ``me:0.1mm``: quantity, and largest half width of its intervals.

        Raises:
            InvalidInput: The text has another form, or names no quantity.
        """
        name, colon, value = text.partition(":")
        if not colon:
            raise InvalidInput(
                f"{one_line(text, 60)!r} is not a stop rule; write QUANTITY:HALF_WIDTH, such as "
                "me:0.1mm"
            )
        if name not in QUANTITIES:
            raise InvalidInput(
                f"there is no quantity {one_line(name, 60)!r}{suggestion(name, QUANTITIES)}"
            )
        measure = quantity(name)
        half_width = parse_value(value, measure)
        if half_width <= 0.0:
            raise InvalidInput(f"the half width of {name} is {one_line(value, 60)}, need above 0")
        return cls(measure, half_width)

    def check(self, table: pa.Table) -> StopState:
        """Compute the intervals of the runs so far.

        Watched are the mean differences of all pairs of controllers in every task that has the
        quantity, or, with one controller, its means. All intervals hold together, at every number
        of repetitions, with a probability of 95 % (Bonferroni). Only complete repetitions before
        the first incomplete one count, so that the result does not depend on the order of the runs.

        Args:
            table: Finished and failed runs of the study.

        Raises:
            InvalidInput: No run has the quantity.
        """
        runs = leading_repetitions(table)
        if not len(runs):
            return StopState(False, 0, inf, inf, "no complete repetition")
        if not np.isfinite(runs.values(self.measure.name)).any():
            raise InvalidInput(
                f"no run has a value of {self.measure.name}, so that the study would not end"
                f"{suggestion(self.measure.name, runs.metrics)}"
            )
        samples = _watched(repetition_means(runs, self.measure.name))
        confidence = 1.0 - (1.0 - CONFIDENCE) / max(len(samples), 1)
        widths = [_half_width(values, confidence) for values in samples]
        widest = max(widths, default=inf)
        shares = [runs.repetitions / len(values) for values in samples]  # 1 without repeats
        needed = max(
            (share * self._needed(values, confidence)
             for share, values in zip(shares, samples, strict=True)), default=inf,
        )  # fmt: skip
        return StopState(
            widest <= self.half_width, runs.repetitions, widest, needed,
            self._text(runs.repetitions, widest, needed),
        )  # fmt: skip

    def _needed(self, values: Float[Array, " values"], confidence: float) -> float:
        """Return the expected number of repetitions of one comparison."""
        if len(values) < 2:
            return inf
        return values_needed(float(np.std(values)), self.half_width, confidence)

    def _text(self, repetitions: int, widest: float, needed: float) -> str:
        measure = self.measure
        unit = f" {measure.shown_unit}" if measure.shown_unit else ""
        now = f"±{number_text(measure.factor * widest)}{unit}" if isfinite(widest) else "no bound"
        goal = f"±{number_text(measure.factor * self.half_width)}{unit}"
        if widest <= self.half_width:
            return f"{measure.label} {now} after {repetitions} repetitions: reached {goal}"
        more = f", about {ceil(needed)} needed" if isfinite(needed) else ""
        return f"{measure.label} {now} after {repetitions} repetitions, goal {goal}{more}"


def leading_repetitions(table: pa.Table) -> RunTable:
    """Return the runs of the complete repetitions before the first incomplete one.

    A repetition is complete if it has as many runs as the largest one.
    """
    repetition = np.asarray(table["repetition"].to_numpy(), dtype=np.int64)
    counts = np.bincount(repetition) if len(repetition) else np.zeros(0, dtype=np.int64)
    partial = np.flatnonzero(counts < counts.max()) if len(counts) else np.zeros(0, np.int64)
    end = int(partial[0]) if len(partial) else len(counts)
    return RunTable(table.filter(pa.array(repetition < end)))


def _watched(tasks: list[RepetitionMeans]) -> list[Float[Array, " values"]]:
    """Return the differences of all pairs of controllers, or the values of a single one."""
    pairs = [
        each.difference(first, second)
        for each in tasks
        for second, first in combinations(range(len(each.controllers)), 2)
    ]
    alone = [each.means[:, k] for each in tasks for k in range(len(each.controllers))]
    samples = [values[np.isfinite(values)] for values in pairs or alone]
    return [values for values in samples if len(values)]


def _half_width(values: Float[Array, " values"], confidence: float) -> float:
    margin = always_valid_mean(values, confidence).margin
    return margin if isfinite(margin) else inf
