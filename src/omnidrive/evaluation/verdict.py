"""Verdict of a study: the best controller of each task, how sure that is, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite, nan
from typing import NamedTuple

from omnidrive.evaluation.statistics.evidence import (
    WORSE,
    PairEvidence,
    Summary,
    TaskEvidence,
)
from omnidrive.evaluation.tables.table import (
    MIN_RESULT,
    cell_text,
    is_negligible,
    number_text,
    percent,
)

_CHECK_SEEDS = 20  # that a sentence on one run with noise recommends
_SMALL = 0.01  # relative difference of two runs that counts as none


class Cost(NamedTuple):
    """What the control of one contender costs in a task."""

    work: float = nan
    """Mean mechanical work of the motors, J; NaN: unknown."""
    step_time: float = nan
    """Mean of the median computing times of a controller step, us; NaN: unknown."""

    def __str__(self) -> str:
        """Return both with units; empty if neither is known."""
        parts = ((self.work, "J"), (self.step_time, "µs per step"))
        return ", ".join(f"{number_text(value)} {unit}" for value, unit in parts if isfinite(value))


class TaskVerdict(NamedTuple):
    """Verdict of one task.

    The contenders are the controllers; in the task ``horizon`` the horizons of its controller.
    """

    evidence: TaskEvidence
    """Evidence of the compared quantity, by contender."""
    success: TaskEvidence | None = None
    """Evidence of the success rate; None if all runs are finished."""
    costs: Mapping[str, Cost] = {}
    """Cost by contender."""
    recovered: Mapping[str, int] = {}
    """Number of runs in which the robot recovered from a fault, by controller of one repetition of
    the task ``faults``; otherwise empty."""
    faults: int = 0
    """Number of faults of one repetition."""
    along: tuple[str, ...] = ()
    """Sentences on axes along which another controller than the leader is shown to be better."""
    lost: tuple[str, ...] = ()
    """Sentences on axes with values at which no run is finished."""
    swept: str = ""
    """Controller whose horizons are the contenders; empty: the contenders are controllers."""

    @property
    def name(self) -> str:
        """Name of the task with its duration, such as ``track 20 s``."""
        return f"N of {self.swept}" if self.swept else self.evidence.task.label

    @property
    def is_tested(self) -> bool:
        """Whether there are several repetitions, so that differences are tested."""
        return max((s.mean.sample_size for s in self.evidence.summaries), default=0) > 1

    @property
    def ranking(self) -> tuple[Summary, ...]:
        """Contenders with a valid value, the best first.

        With several repetitions the leader of the evidence is first. In one repetition of the task
        ``faults`` the number of recoveries counts, then the worst error.
        """
        found = self.evidence.ranking
        if self.is_tested:
            leader = self.evidence.leader
            return tuple(sorted(found, key=lambda each: each != leader))
        if self.recovered:
            return tuple(sorted(found, key=lambda s: (-self.recovered[s.controller], s.worst)))
        return found

    @property
    def unranked(self) -> tuple[str, ...]:
        """Contenders without a valid value, because a run ended early or did not settle."""
        ranked = {each.controller for each in self.ranking}
        return tuple(s.controller for s in self.evidence.summaries if s.controller not in ranked)

    @property
    def leader(self) -> Summary | None:
        """The best contender; None: there is no valid value."""
        return (*self.ranking, None)[0]

    @property
    def following(self) -> Summary | None:
        """The second contender; None: there is none."""
        return (*self.ranking, None, None)[1]

    @property
    def best(self) -> tuple[str, ...]:
        """The best contender, and those that share the first place with it."""
        if self.leader is None:
            return ()
        if self.is_tested:
            return self.evidence.best
        tied = (each.controller for each in self.ranking[1:] if self._is_equal(each))
        return (self.leader.controller, *tied)

    @property
    def factor(self) -> float:
        """Value of the second over that of the best contender; NaN: they are not comparable."""
        return self._ratio(self.following) if self.following else nan

    @property
    def more(self) -> int:
        """Number of faults by which the best contender recovered from more than the second."""
        if not self.recovered or self.leader is None or self.following is None:
            return 0
        return self.recovered[self.leader.controller] - self.recovered[self.following.controller]

    @property
    def factor_text(self) -> str:
        """The factor, or by how many faults more the best contender recovered."""
        return f"{self.more} more" if self.more else number_text(self.factor)

    def value_text(self, contender: Summary) -> str:
        """Return the compared value of a contender with its name, unit and interval."""
        label, name = self.evidence.measure.label, contender.controller
        if not self.recovered:
            return f"{label} {value_text(contender)}"
        value = cell_text(contender.measure.factor * contender.worst)
        return (
            f"recovered from {self.recovered[name]} of {self.faults} faults, {label} {value} "
            f"{contender.measure.shown_unit}"
        )

    @property
    def advantage(self) -> str:
        """By how much the best value differs from that of the second one; empty: no second."""
        if self.following is None:
            return ""
        value = f"{self.following.controller} ({self.value_text(self.following)})"
        if self.more:
            return f"{self.more} more than {value}"
        if not isfinite(self.factor):
            return f"next: {value}"
        return f"{number_text(self.factor)} times lower than {value}"

    @property
    def confidence(self) -> str:
        """How sure it is that the best contender is better than the second one."""
        if self.leader is None or self.following is None:
            return "no other result"
        if self.is_tested:
            pair = self.evidence.pair(self.leader.controller, self.following.controller)
            return _with_detail(pair) if pair else "not tested"
        if not self.more and self._is_equal(self.following):
            return self._equality
        return f"one {'run' if self.leader.runs == 1 else 'repetition'}: no interval"

    @property
    def lead(self) -> str:
        """Best contender, or those that share the first place, as one sentence."""
        evidence, best, first = self.evidence, self.best, self.leader
        label, task = evidence.measure.label, self.name[0].upper() + self.name[1:]
        if first is None:
            return f"{task}: no run has a valid {label}."
        if self.swept:
            return f"Best {self.name}: {first.controller}."
        value = value_text(first)
        if len(evidence.summaries) == 1:
            return f"{task}: {first.controller} has {label} {value}."
        if not self.is_tested:
            return f"{task}: {self._untested(first)}."
        if len(best) == 1:
            where = " on average" if self.along else ""
            return (
                f"{task}: {first.controller} is best{where}, {label} {value}."
                f"{self._along}{self._failing(best)}"
            )
        rest = len(evidence.ranking) > len(best)
        return (
            f"{task}: no difference in {label} is shown between {first.controller}, {value}, and "
            f"{listed(best[1:])}{'; the others are worse' if rest else ''}."
            f"{self._along}{self._failing(best)}"
        )

    def _untested(self, first: Summary) -> str:
        """Return the sentence of one repetition without task and full stop."""
        if len(self.best) > 1:
            return f"{listed(self.best)} are {self._equality}"
        if first.runs == 1 and self.evidence.task.name == "noise":
            return (
                f"{first.controller} is best in one run; check with --noise-seeds {_CHECK_SEEDS} "
                "or more repetitions"
            )
        if first.runs > 1 and not self.recovered:
            return (
                f"{first.controller} has the best {self.evidence.measure.label}, "
                f"{value_text(first)}, in one repetition, too few for an interval; more of them "
                "show whether the difference is real"
            )
        return f"{first.controller} is best"

    @property
    def sentences(self) -> tuple[str, ...]:
        """Tested comparison of the leader with each other controller, in the order of the means."""
        leader = self.evidence.leader
        if leader is None or not self.is_tested:
            return ()
        others = (each.controller for each in self.evidence.ranking)
        pairs = (self.evidence.pair(leader.controller, other) for other in others)
        return tuple(_with_detail(pair) for pair in pairs if pair)

    @property
    def _along(self) -> str:
        return "".join(f" {each}" for each in (*self.along, *self.lost))

    def _ratio(self, other: Summary) -> float:
        """Return another value over that of the best contender; 1 if both are negligible."""
        best, measure = self.leader, self.evidence.measure
        if best is None or not measure.lower_is_better or self.more:
            return nan
        below, above = (s.worst if self.recovered else s.mean.mean for s in (best, other))
        if not is_negligible(measure.factor * below):
            return above / below
        return 1.0 if is_negligible(measure.factor * above) else inf

    def _is_equal(self, other: Summary) -> bool:
        """Return whether another value of one repetition differs by less than 1 %."""
        leader, found = self.leader, self.recovered
        if leader and found and found[leader.controller] != found[other.controller]:
            return False
        return self._ratio(other) < 1.0 + _SMALL

    @property
    def _equality(self) -> str:
        """In which sense the first values of one repetition are equal."""
        measure = self.evidence.measure
        if self.following is not None and is_negligible(measure.factor * self.following.mean.mean):
            return f"both below {MIN_RESULT:g} {measure.shown_unit}"
        return "equal within 1 %"

    def _failing(self, best: Sequence[str]) -> str:
        """Return a warning of the best controllers that finish fewer runs than another."""
        if self.success is None:
            return ""
        warnings = []
        for name in best:
            others = (s.controller for s in self.success.summaries if s.controller != name)
            pairs = (self.success.pair(name, other) for other in others)
            worse = next((pair for pair in pairs if pair and pair.verdict == WORSE), None)
            if worse:
                rates = {s.controller: s.success_rate for s in self.success.summaries}
                warnings.append(
                    f" But {name} finishes {percent(rates[name])} of its runs, "
                    f"{worse.second} {percent(rates[worse.second])}."
                )
        return "".join(warnings)


def headline(verdicts: Sequence[TaskVerdict], notes: Sequence[str] = ()) -> str:
    """Return the verdicts as sentences; tasks with the same best controller share one.

    Args:
        verdicts: The verdicts.
        notes: Sentences that follow.
    """
    wins: dict[str, list[str]] = {}
    others = []
    for each in verdicts:
        first = each.leader
        is_win = first is not None and each.lead.endswith(f": {first.controller} is best.")
        if first is not None and is_win:
            wins.setdefault(first.controller, []).append(each.name)
        else:
            others.append(each.lead)
    best = [f"Best in {listed(tasks)}: {name}." for name, tasks in wins.items()]
    return " ".join([*best, *others, *notes])


def value_text(summary: Summary) -> str:
    """Return the mean with unit and interval, such as ``50.0 mm [49.2, 50.8]``."""
    measure, mean = summary.measure, summary.mean
    unit = f" {measure.shown_unit}" if measure.shown_unit else ""
    if not isfinite(mean.margin):
        return f"{cell_text(measure.factor * mean.mean)}{unit}"
    text, _, low, high = (part.removeprefix("+") for part in mean.text(measure.factor))
    return f"{text}{unit} [{low}, {high}]" if low != high else f"{text}{unit}"


def _with_detail(pair: PairEvidence) -> str:
    detail = f" ({pair.detail})" if pair.detail else ""
    left = f"; {pair.left_out} pairs without two valid runs are left out" if pair.left_out else ""
    return f"{pair.sentence}{detail}{left}"


def listed(words: Sequence[str]) -> str:
    """Return words as an enumeration, such as ``a, b and c``."""
    return " and ".join((", ".join(words[:-1]), words[-1])) if len(words) > 1 else words[0]
