"""Paired comparison of controllers over several seeds of the noise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.mean_test import difference_tests, needed_differences
from omnidrive.evaluation.results import StudyResults, TrackResult
from omnidrive.evaluation.uncertainty import CONFIDENCE, MeanEstimate, estimate_mean, holm
from omnidrive.simulation import Outcome

MEASURES = {"me_measured": "m", "mae_measured": "rad", "me": "m", "mae": "rad"}
"""Compared fields of :class:`~omnidrive.evaluation.Metrics`, with their units."""

MEASURE_LABELS = {
    "me_measured": "ME measured",
    "mae_measured": "MAE measured",
    "me": "ME true",
    "mae": "MAE true",
}
"""Display name of each of :data:`MEASURES`."""


class RepeatedRuns(NamedTuple):
    """Runs of one controller for one duration, one per seed of the noise."""

    controller: str
    duration: float
    """Duration of the reference, s."""
    runs: dict[int, TrackResult]
    """Run by repeat; one repeat uses the same random numbers for every controller."""

    @property
    def finished(self) -> dict[int, TrackResult]:
        """Runs that reached the end of the reference, by repeat; only they have valid errors."""
        return {
            k: result for k, result in self.runs.items() if result.run.outcome is Outcome.FINISHED
        }

    def estimate_mean(self, measure: str) -> MeanEstimate:
        """Return mean and confidence interval of one of :data:`MEASURES` over the finished runs."""
        values = [getattr(result.metrics, measure) for result in self.finished.values()]
        return estimate_mean(np.array(values, dtype=float))


class PairedDifference(NamedTuple):
    """Mean difference of an error between two controllers under the same noise."""

    duration: float
    """Duration of the reference, s."""
    first: str
    second: str
    measure: str
    """One of :data:`MEASURES`."""
    difference: MeanEstimate
    """Mean over the seeds of the error of ``first`` minus the error of ``second``, m or rad."""
    p: float
    """p-value of zero mean difference, Holm-adjusted over all pairs of the measure and duration."""

    @property
    def verdict(self) -> str:
        """Result of the test for ``first``: better, worse or no difference shown."""
        if not self.p < 1.0 - CONFIDENCE:
            return "no difference shown"
        return "better" if self.difference.mean < 0.0 else "worse"


def group_runs(results: StudyResults, task: str) -> list[RepeatedRuns]:
    """Group the runs of the task `track` or `noise` by duration and controller."""
    every = results.select(task, repeat=None)
    keys = dict.fromkeys((r.duration, r.controller) for r in every)
    return [
        RepeatedRuns(name, seconds,
                     {r.repeat: r for r in every if (r.duration, r.controller) == (seconds, name)})
        for seconds, name in keys
    ]  # fmt: skip


def repeated_runs(results: StudyResults) -> list[RepeatedRuns]:
    """Group the runs with noise by duration and controller; empty if there is only one seed."""
    groups = group_runs(results, "noise")
    return groups if any(k for group in groups for k in group.runs) else []


def paired_differences(results: StudyResults) -> list[PairedDifference]:
    """Compare every pair of controllers: the later one of the scenario minus the earlier one.

    Only seeds for which both runs finished count; pairs with fewer than two such seeds are omitted.
    """
    groups = repeated_runs(results)
    found: list[PairedDifference] = []
    for seconds in dict.fromkeys(group.duration for group in groups):
        pairs = list(combinations([g for g in groups if g.duration == seconds], 2))
        for measure in MEASURES:
            found += _family(pairs, measure)
    return found


def needed_seeds(differences: Sequence[PairedDifference]) -> int:
    """Return the least number of seeds that can show one of several differences.

    Args:
        differences: At least one.
    """
    families = Counter((d.duration, d.measure) for d in differences)
    return needed_differences(max(families.values()))


def _family(pairs: list[tuple[RepeatedRuns, RepeatedRuns]], measure: str) -> list[PairedDifference]:
    """Compare all pairs by one measure, with p-values adjusted for the number of pairs."""
    tested = []
    for earlier, later in pairs:
        ours, theirs = later.finished, earlier.finished
        both = sorted(ours.keys() & theirs.keys())
        if len(both) >= 2:
            differences = _differences(ours, theirs, both, measure)
            tested.append((earlier, later, difference_tests(differences[:, None])[0]))
    adjusted = holm([each.p for _, _, each in tested])
    return [
        PairedDifference(later.duration, later.controller, earlier.controller, measure,
                         each.estimate, p)
        for (earlier, later, each), p in zip(tested, adjusted, strict=True)
    ]  # fmt: skip


def _differences(
    ours: dict[int, TrackResult], theirs: dict[int, TrackResult], seeds: list[int], measure: str
) -> np.ndarray:
    values = [getattr(ours[k].metrics, measure) - getattr(theirs[k].metrics, measure)
              for k in seeds]  # fmt: skip
    return np.array(values, dtype=float)
