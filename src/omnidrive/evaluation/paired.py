"""Controllers compared under the same noise, seed by seed."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.results import StudyResults, TrackResult
from omnidrive.evaluation.uncertainty import CONFIDENCE, MeanEstimate, estimate_mean, holm, p_value
from omnidrive.simulation import Outcome

MEASURES = {"me_measured": "m", "mae_measured": "rad", "me": "m", "mae": "rad"}
"""Errors that are compared, as they are called in :class:`~omnidrive.evaluation.Metrics`."""

MEASURE_LABELS = {
    "me_measured": "ME measured",
    "mae_measured": "MAE measured",
    "me": "ME true",
    "mae": "MAE true",
}
"""What to print for them."""


class RepeatedRuns(NamedTuple):
    """One controller's runs with noise over one duration."""

    controller: str
    duration: float
    """Of the reference, in s."""
    runs: dict[int, TrackResult]
    """By repeat; the same repeat has the same random numbers for every controller."""

    @property
    def finished(self) -> dict[int, TrackResult]:
        """Those that reached the end of the reference: an error of half a run is none."""
        return {
            k: result for k, result in self.runs.items() if result.run.outcome is Outcome.FINISHED
        }

    def estimate_mean(self, measure: str) -> MeanEstimate:
        """Mean of one of :data:`MEASURES` over the finished runs, with its interval."""
        values = [getattr(result.metrics, measure) for result in self.finished.values()]
        return estimate_mean(np.array(values, dtype=float))


class PairedDifference(NamedTuple):
    """How much more or less one controller errs than another under the same noise."""

    duration: float
    """Of the reference, in s."""
    first: str
    second: str
    measure: str
    """One of :data:`MEASURES`."""
    difference: MeanEstimate
    """Mean over the seeds of the error of ``first`` minus that of ``second``; m or rad."""
    p: float
    """Of a true mean difference of 0, after Holm over all pairs of this measure and duration."""

    @property
    def verdict(self) -> str:
        """What that says of ``first``."""
        if not self.p < 1.0 - CONFIDENCE:
            return "no difference shown"
        return "better" if self.difference.mean < 0.0 else "worse"


def repeated_runs(results: StudyResults) -> list[RepeatedRuns]:
    """Runs with noise, gathered by duration and controller; none if there was one seed only."""
    every = results.select("noise", repeat=None)
    if not any(r.repeat for r in every):
        return []
    keys = dict.fromkeys((r.duration, r.controller) for r in every)
    return [
        RepeatedRuns(name, seconds,
                 {r.repeat: r for r in every if (r.duration, r.controller) == (seconds, name)})
        for seconds, name in keys
    ]  # fmt: skip


def paired_differences(results: StudyResults) -> list[PairedDifference]:
    """Every two controllers against each other, the later one minus the earlier.

    Only seeds under which both finished count; pairs with fewer than two are left out.
    """
    groups = repeated_runs(results)
    found: list[PairedDifference] = []
    for seconds in dict.fromkeys(group.duration for group in groups):
        pairs = list(combinations([g for g in groups if g.duration == seconds], 2))
        for measure in MEASURES:
            found += _family(pairs, measure)
    return found


def _family(pairs: list[tuple[RepeatedRuns, RepeatedRuns]], measure: str) -> list[PairedDifference]:
    """All pairs by one measure, their p-values adjusted for their number."""
    tested = []
    for earlier, later in pairs:
        ours, theirs = later.finished, earlier.finished
        both = sorted(ours.keys() & theirs.keys())
        if len(both) >= 2:
            tested.append((earlier, later, _differences(ours, theirs, both, measure)))
    adjusted = holm([p_value(differences) for _, _, differences in tested])
    return [
        PairedDifference(later.duration, later.controller, earlier.controller, measure,
                         estimate_mean(differences), p)
        for (earlier, later, differences), p in zip(tested, adjusted, strict=True)
    ]  # fmt: skip


def _differences(
    ours: dict[int, TrackResult], theirs: dict[int, TrackResult], seeds: list[int], measure: str
) -> np.ndarray:
    values = [getattr(ours[k].metrics, measure) - getattr(theirs[k].metrics, measure)
              for k in seeds]  # fmt: skip
    return np.array(values, dtype=float)
