"""The search for better parameters: generations of trials until the budget is used."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import floor, inf, isfinite, log10
from time import monotonic
from typing import NamedTuple

from omnidrive.components import Configured
from omnidrive.errors import InvalidInput
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.tuning.objective import Limit, Objective
from omnidrive.tuning.optimizers import CmaEs, Nsga2, Optimizer, Score, knee
from omnidrive.tuning.space import ParameterSpace

DIGITS = 4
"""Significant digits of tuned values: neither the result nor a resumed search depends on more."""

MAX_TRIALS = 100_000
"""Largest number of trials."""

Values = Mapping[str, float | int]


class Trial(NamedTuple):
    """One evaluated candidate."""

    number: int
    """Index from 0; trial 0 has the values before tuning."""
    values: Values
    """Values of the tuned parameters."""
    score: Score
    """Objectives and violation of the limits over the training runs."""
    failed: int
    """Number of training runs that did not reach the end of their reference."""


class Budget(NamedTuple):
    """When the search ends, whichever comes first."""

    trials: int
    """Number of trials, that of the values before tuning included."""
    seconds: float | None = None
    """Wall time, s; the generation that runs then is completed. None: no limit."""

    def check(self) -> None:
        """Raise :class:`~omnidrive.errors.InvalidInput` if the budget is out of range."""
        if not 2 <= self.trials <= MAX_TRIALS:
            raise InvalidInput(f"trials is {self.trials}, need 2 to {MAX_TRIALS}")
        if self.seconds is not None and not 0.0 < self.seconds < inf:
            raise InvalidInput(f"the time is {self.seconds:g} s, need a positive one")


Evaluate = Callable[[Sequence[Configured]], list[list[RunRecord]]]
"""Returns the training runs of each controller."""


class SearchResult(NamedTuple):
    """Trials of a search, and the best one."""

    trials: list[Trial]
    """All trials in their order."""
    best: Trial
    """Of one objective the best trial, of several the compromise of the front; the values before
    tuning if no other trial is better."""


def search(  # noqa: PLR0917
    space: ParameterSpace,
    objectives: Sequence[Objective],
    limits: Sequence[Limit],
    evaluate: Evaluate,
    budget: Budget,
    seed: int,
    *,
    axes: Sequence[str] = (),
    report: Callable[[Sequence[Trial]], None] = lambda trials: None,
) -> SearchResult:
    """Return the trials of a search that begins with the values before tuning.

    The trials depend on the seed and on the results of the runs, which have the same random numbers
    for all candidates. A candidate violates a hard limit if a run exceeds it, or ends early.

    Args:
        space: The parameters.
        objectives: What is minimised: with one by CMA-ES, with several by NSGA-II.
        limits: Hard limits.
        evaluate: Runs controllers on the training set.
        budget: When the search ends.
        seed: Seed of the optimiser.
        axes: Names of the axes of the training set.
        report: Called after each generation with all trials so far.

    Raises:
        InvalidInput: The budget is out of range.
        MissingExtra: The extra `tuning` is not installed.
    """
    budget.check()
    end = inf if budget.seconds is None else monotonic() + budget.seconds
    optimizer: Optimizer = (
        CmaEs(space, seed) if len(objectives) == 1 else Nsga2(space, len(objectives), seed)
    )
    seen: dict[tuple[tuple[str, float], ...], Score] = {}
    trials: list[Trial] = []
    measured: list[Objective] = []  # the objectives, relative to the runs of the first trial

    def try_all(candidates: Sequence[Values]) -> list[Score]:
        """Evaluate candidates that are new; return the scores of all."""
        keys = [tuple(values.items()) for values in candidates]
        new = {key: values for key, values in zip(keys, candidates, strict=True) if key not in seen}
        runs = _runs_of(space, list(new.values()), evaluate)
        if not trials:
            measured.extend(each.relative_to(runs[0], axes) for each in objectives)
        for (key, values), records in zip(new.items(), runs, strict=True):
            score = seen[key] = score_of(records, measured, limits)
            trials.append(Trial(len(trials), values, score, sum(not e.finished for e in records)))
        report(trials)
        return [seen[key] for key in keys]

    try_all([space.base])
    repeats = 0
    while repeats < _MAX_REPEATS and len(trials) < budget.trials and monotonic() < end:
        candidates = [rounded(space, space.values(point)) for point in optimizer.ask().tolist()]
        before = len(trials)
        optimizer.tell(try_all(candidates))
        repeats = repeats + 1 if len(trials) == before else 0
    return SearchResult(trials, best_trial(trials))


def _runs_of(
    space: ParameterSpace, candidates: Sequence[Values], evaluate: Evaluate
) -> list[list[RunRecord]]:
    """Return the training runs of candidates; none of one whose values are refused."""
    made = [space.controller_with(values) for values in candidates]
    runs = iter(evaluate([each for each in made if each is not None]))
    return [[] if each is None else next(runs) for each in made]


_MAX_REPEATS = 20  # generations in a row without a new candidate, as in a small discrete space


def score_of(
    records: Sequence[RunRecord], objectives: Sequence[Objective], limits: Sequence[Limit]
) -> Score:
    """Return the score of the training runs of one candidate; none: its values are refused."""
    if not records:
        return Score((inf,) * len(objectives), inf)
    values = tuple(each.value(records) for each in objectives)
    lost = sum(not each.finished for each in records)
    excess = sum(limit.violation(each) for limit in limits for each in records)
    excess += sum(each.excess(records) for each in objectives)
    if not all(map(isfinite, values)):
        lost += 1
    return Score(values, float(lost + (excess if isfinite(excess) else len(records))))


def best_trial(trials: Sequence[Trial]) -> Trial:
    """Return the best trial: of several objectives the compromise of the front.

    If no trial keeps the limits, the one that violates them least.
    """
    scores = [each.score for each in trials]
    if len(scores[0].objectives) > 1:
        found = knee(scores)
        if found is not None:
            return trials[found]
    return min(trials, key=lambda each: each.score.order)


def rounded(space: ParameterSpace, values: Values) -> dict[str, float | int]:
    """Return values with :data:`DIGITS` significant digits, within their ranges."""
    found: dict[str, float | int] = {}
    for each in space.dimensions:
        value = values[each.name]
        if not each.integer and value != 0.0:
            digits = DIGITS - 1 - floor(log10(abs(value)))
            value = min(max(round(value, digits), each.low), each.high)
        found[each.name] = value
    return found
