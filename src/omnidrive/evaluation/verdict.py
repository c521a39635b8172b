"""The best controller of each task, its advantage over the next one, and its cost."""

from __future__ import annotations

from collections.abc import Iterable
from math import exp, inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.evaluation.mean_test import needed_differences
from omnidrive.evaluation.paired import (
    PairedDifference,
    RepeatedRuns,
    group_runs,
    paired_differences,
)
from omnidrive.evaluation.results import FaultResult, StepResult, StudyResults, TrackResult
from omnidrive.evaluation.table import (
    MIN_RESULT,
    NO_VALUE,
    cell_text,
    is_negligible,
    number_text,
)
from omnidrive.evaluation.uncertainty import CONFIDENCE, estimate_mean, p_text
from omnidrive.simulation import Outcome, Run

_CHECK_SEEDS = 20  # seeds that a headline recommends
_SMALL = 0.01  # relative difference of two runs that counts as none


class Contender(NamedTuple):
    """One compared controller, or one prediction horizon, in a task."""

    name: str
    """Label of the controller, or the horizon as ``N = 15``."""
    value: float
    """Compared value, in m or s; smaller is better. A mean if there are several runs."""
    work: float
    """Mechanical work of the motors, J; NaN if the plant does not simulate forces."""
    step_time: float
    """Median computing time of a controller step, us."""
    recovered: int | None = None
    """Number of faults from which the robot recovered; None in other tasks."""

    @property
    def cost_text(self) -> str:
        """Work and computing time with units; empty if neither is known."""
        parts = ((self.work, "J"), (self.step_time, "µs per step"))
        return ", ".join(f"{number_text(value)} {unit}" for value, unit in parts if isfinite(value))


class Advantage(NamedTuple):
    """Advantage of the best contender over the next one."""

    factor: float
    """Value of the next one over that of the best one; NaN if it is not comparable. Over several
    seeds: the geometric mean."""
    low: float
    """Lower bound of the 95 % confidence interval of the factor; NaN for one run."""
    high: float
    """Upper bound of that interval."""
    p: float
    """p-value of equal means, Holm-adjusted over all pairs of controllers; NaN for one run."""
    seeds: int
    """Number of seeds for which both runs finished."""
    needed: int = 0
    """Least number of seeds with which Holm's correction leaves a difference; 0 for one run."""

    @property
    def is_tied(self) -> bool:
        """Whether no difference is shown: p >= 0.05 over several seeds, below 1 % for one run."""
        if self.seeds > 1:
            return not self.p < 1.0 - CONFIDENCE
        return self.factor < 1.0 + _SMALL


class Verdict(NamedTuple):
    """Ranking of the controllers in one task."""

    task: str
    """Task of the study: track, noise, step, horizon or faults."""
    name: str
    """Name with the duration, such as ``track 20 s``."""
    measure: str
    """Compared value: ``me``, ``path_me``, ``settling_time`` or ``max_error``."""
    ranking: tuple[Contender, ...]
    """Contenders, the best first."""
    unranked: tuple[str, ...]
    """Contenders without a valid value, because a run stopped early or did not settle."""
    advantage: Advantage | None
    """None if only one contender is ranked."""
    tests: int = 0
    """Number of faults; 0 in other tasks."""

    @property
    def best(self) -> Contender:
        """The best contender."""
        return self.ranking[0]

    @property
    def following(self) -> Contender | None:
        """The second best contender; None if only one is ranked."""
        return self.ranking[1] if len(self.ranking) > 1 else None

    def value_text(self, contender: Contender) -> str:
        """Format the compared value of a contender, with its name and unit."""
        name, unit, factor = MEASURE_NAMES[self.measure]
        value = f"{cell_text(factor * contender.value)} {unit}"
        if contender.recovered is None:
            return f"{name} {value}"
        return f"{contender.recovered} of {self.tests} faults, {name} {value}"

    @property
    def factor_text(self) -> str:
        """Factor, or the number of faults by which the best contender recovered from more."""
        if self.advantage is None or self.following is None:
            return NO_VALUE
        if self.best.recovered is not None and self.following.recovered is not None:
            more = self.best.recovered - self.following.recovered
            if more:
                return f"{more} more"
        return number_text(self.advantage.factor)

    @property
    def advantage_text(self) -> str:
        """By how much the best result differs from the next one; empty if there is none."""
        if self.following is None:
            return ""
        factor, name = self.factor_text, self.following.name
        value = f"{name} ({self.value_text(self.following)})"
        if factor == NO_VALUE:
            return f"next: {value}"
        return f"{factor} {'than' if factor.endswith('more') else 'times lower than'} {value}"

    @property
    def tie_text(self) -> str:
        """In which sense the two best results of one run each are equal."""
        _, unit, factor = MEASURE_NAMES[self.measure]
        if self.following is not None and is_negligible(factor * self.following.value):
            return f"both below {MIN_RESULT:g} {unit}"
        return "equal within 1 %"

    @property
    def confidence_text(self) -> str:
        """Confidence interval of the factor with p-value, or why there is none."""
        if self.advantage is None:
            return "no other result"
        _, low, high, p, seeds, needed = self.advantage
        if seeds < 2:
            return self.tie_text if self.advantage.is_tied else "one run: no interval"
        if self.advantage.is_tied:
            few = f" ({seeds} seeds, at least {needed} needed)" if seeds < needed else ""
            return f"no difference shown, p {p_text(p)}{few}"
        return f"{number_text(low)} to {number_text(high)}, p {p_text(p)}"


MEASURE_NAMES = {
    "me": ("ME", "mm", 1e3),
    "path_me": ("path ME", "mm", 1e3),
    "settling_time": ("settling", "s", 1.0),
    "max_error": ("max. error", "mm", 1e3),
}
"""Name of each compared value, its unit of display, and the factor to that unit."""


def verdicts(results: StudyResults) -> list[Verdict]:
    """Rank the contenders of every task and duration with at least two of them.

    Compared are: in the tasks ``track``, ``noise`` and ``horizon`` the ME of the true pose, with
    several seeds its mean; in ``track`` the mean distance to the path, if a controller follows a
    reference that is too fast late on purpose; in ``step`` the settling time of the slowest axis;
    in ``faults`` the number of faults from which the robot recovers, then the largest error.
    Contenders with a run that stopped early are not ranked, except in ``faults`` and, with several
    seeds, in ``noise``.
    """
    found = [
        *_tracking(results, "track"), *_tracking(results, "noise"), _steps(results.steps),
        *_horizons(results), _faults(results),
    ]  # fmt: skip
    return [each for each in found if each.ranking and len(each.ranking) + len(each.unranked) > 1]


def headline(found: Iterable[Verdict]) -> list[str]:
    """Return sentences that name the best controller of each task."""
    wins: dict[str, list[str]] = {}
    others = []
    for each in found:
        one_noise = each.task == "noise" and each.advantage is not None and each.advantage.seeds < 2
        if each.task == "horizon":
            others.append(f"Best {each.name}: {each.best.name}.")
        elif each.following and each.advantage and each.advantage.is_tied:
            others.append(_tie(each, each.advantage, each.best.name, each.following.name))
        elif one_noise:
            others.append(
                f"{each.name.capitalize()}: {each.best.name} is best in one run; check with "
                f"--noise-seeds {_CHECK_SEEDS}."
            )
        else:
            wins.setdefault(each.best.name, []).append(each.name)
    best = [f"Best in {_listed(tasks)}: {name}." for name, tasks in wins.items()]
    return [*best, *others]


def limit_notes(results: StudyResults) -> list[str]:
    """Return sentences on references that exceed the limits of controllers, each with its labels.

    Of each controller the shortest reference counts, which is the fastest.
    """
    fastest: dict[str, TrackResult | FaultResult] = {}
    driven: list[TrackResult | FaultResult] = [*results.tracks, *results.faults]
    for result in sorted(driven, key=lambda each: each.duration):
        fastest.setdefault(result.controller, result)
    notes: dict[str, list[str]] = {}
    for label, result in fastest.items():
        for event in result.run.events:
            if event.what.endswith(FALLS_BEHIND):
                notes.setdefault(f"In {result.duration:g} s, {event.what}", []).append(label)
    return [f"{text} ({', '.join(labels)})." for text, labels in notes.items()]


def _tie(verdict: Verdict, advantage: Advantage, first: str, second: str) -> str:
    task = verdict.name.capitalize()
    if advantage.seeds > 1:
        text = f"{task}: no difference shown between {first} and {second}"
        if advantage.seeds >= advantage.needed:
            return f"{text}."
        least = max(_CHECK_SEEDS, advantage.needed)
        return (
            f"{text}, and none can be with {advantage.seeds} seeds and this number of controllers: "
            f"at least {advantage.needed} are needed; check with --noise-seeds {least}."
        )
    return f"{task}: {first} and {second} are {verdict.tie_text}."


def _listed(words: list[str]) -> str:
    return " and ".join((", ".join(words[:-1]), words[-1])) if len(words) > 1 else words[0]


def _ranked(
    task: str, name: str, measure: str, contenders: Iterable[Contender], tests: int = 0
) -> Verdict:
    """Sort the contenders; those without a finite value are not ranked."""
    every = list(contenders)
    ranking = sorted(
        (c for c in every if isfinite(c.value)), key=lambda c: (-(c.recovered or 0), c.value)
    )
    unranked = tuple(c.name for c in every if not isfinite(c.value))
    advantage = None
    if len(ranking) > 1:
        comparable = ranking[0].recovered == ranking[1].recovered
        factor = _ratio(ranking[1].value, ranking[0].value, measure) if comparable else nan
        advantage = Advantage(factor, nan, nan, nan, 1)
    return Verdict(task, name, measure, tuple(ranking), unranked, advantage, tests)


def _ratio(above: float, below: float, measure: str) -> float:
    """Return the ratio of two values that are not negative; 1 if both are negligible."""
    factor = MEASURE_NAMES[measure][2]
    if not is_negligible(factor * below):
        return above / below
    return 1.0 if is_negligible(factor * above) else inf


def _tracking(results: StudyResults, task: str) -> list[Verdict]:
    differences = paired_differences(results) if task == "noise" else []
    groups = group_runs(results, task)
    found = []
    for seconds in dict.fromkeys(group.duration for group in groups):
        compared = {g.controller: g for g in groups if g.duration == seconds}
        late = any(r.is_late for g in compared.values() for r in g.runs.values())
        measure = "path_me" if task == "track" and late else "me"
        contenders = (_mean(group, measure) for group in compared.values())
        verdict = _ranked(task, f"{task} {seconds:g} s", measure, contenders)
        if verdict.advantage is not None and any(len(g.runs) > 1 for g in compared.values()):
            first, second = (compared[c.name] for c in verdict.ranking[:2])
            verdict = verdict._replace(advantage=_paired(first, second, differences))
        found.append(verdict)
    return found


def _mean(group: RepeatedRuns, measure: str) -> Contender:
    """Return the means of a metric and the costs over the finished runs of one controller."""
    metrics = [result.metrics for result in group.finished.values()]
    if not metrics:
        return Contender(group.controller, nan, nan, nan)
    value, work, step_time = (
        float(np.mean([getattr(m, name) for m in metrics]))
        for name in (measure, "work", "step_time_median")
    )
    return Contender(group.controller, value, work, step_time)


def _paired(
    best: RepeatedRuns, following: RepeatedRuns, differences: Iterable[PairedDifference]
) -> Advantage:
    """Compare two controllers over the seeds for which both runs finished.

    The interval is that of the mean logarithm of the ratio, by Student's t. Without an error of the
    best one in some seed, there is no ratio.
    """
    ours, theirs = best.finished, following.finished
    seeds = sorted(ours.keys() & theirs.keys())
    ratios = [_ratio(theirs[k].metrics.me, ours[k].metrics.me, "me") for k in seeds]
    are_equal = all(ratio == 1.0 for ratio in ratios)
    if not np.isfinite(ratios).all():
        ratios = []
    log = estimate_mean(np.log(np.array(ratios, dtype=float)))
    pair = {best.controller, following.controller}
    tested = [d for d in differences if d.measure == "me" and d.duration == best.duration]
    p = next((1.0 if are_equal else d.p for d in tested if {d.first, d.second} == pair), nan)
    needed = needed_differences(max(len(tested), 1))
    return Advantage(exp(log.mean), exp(log.low), exp(log.high), p, len(seeds), needed)


def _steps(steps: tuple[StepResult, ...]) -> Verdict:
    contenders = [
        Contender(s.controller, _slowest(s), float(s.run.work[-1]), _step_time([s.run]))
        for s in steps
    ]
    return _ranked("step", "step response", "settling_time", contenders)


def _slowest(step: StepResult) -> float:
    """Return the settling time of the slowest axis with a step; NaN if one does not settle."""
    if step.run.outcome is not Outcome.FINISHED:
        return nan
    times = [each.settling_time for each in step.responses if isfinite(each.overshoot)]
    return float(np.max(times)) if times else nan


def _step_time(runs: list[Run]) -> float:
    """Return the median computing time of the controller steps of some runs, us."""
    times = np.concatenate([run.step_time for run in runs]) if runs else np.array([])
    times = times[np.isfinite(times)]
    return float(np.median(times)) if len(times) else nan


def _horizons(results: StudyResults) -> list[Verdict]:
    runs = results.select("horizon")
    found = []
    for controller, seconds in dict.fromkeys((r.controller, r.duration) for r in runs):
        swept = [r for r in runs if (r.controller, r.duration) == (controller, seconds)]
        contenders = [
            Contender(f"N = {r.horizon}", r.metrics.me, r.metrics.work, r.metrics.step_time_median)
            if r.run.outcome is Outcome.FINISHED
            else Contender(f"N = {r.horizon}", nan, nan, nan)
            for r in swept
        ]
        found.append(_ranked("horizon", f"N of {controller}", "me", contenders))
    return found


def _faults(results: StudyResults) -> Verdict:
    every = results.recoveries
    contenders = []
    for name in dict.fromkeys(result.controller for result, _ in every):
        mine = [(result, r) for result, r in every if result.controller == name]
        runs: list[FaultResult] = [result for result, _ in mine]
        contenders.append(
            Contender(
                name,
                float(np.max([r.max_error for _, r in mine])),
                float(np.mean([result.run.work[-1] for result in runs])),
                _step_time([result.run for result in runs]),
                sum(r.recovered for _, r in mine),
            )
        )
    tests = len({result.number for result, _ in every})
    return _ranked("faults", "faults", "max_error", contenders, tests)
