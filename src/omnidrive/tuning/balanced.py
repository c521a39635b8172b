"""The default objective: tracking errors and step responses relative to those before tuning."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp, inf, isfinite, log
from statistics import fmean
from typing import NamedTuple

from omnidrive.errors import InvalidInput
from omnidrive.evaluation.measures.step_response import STEP_AXES
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.tuning.objective import BALANCED, Objective, parse_objective
from omnidrive.tuning.task_metrics import compared_value

TOLERANCE = 0.02
"""Relative increase of an error, a settling time or a peak above which a candidate is worse."""

VALIDATION_TOLERANCE = 0.04
"""The same on the validation runs, whose robots are further from those of training."""


class _Part(NamedTuple):
    """A metric that is compared with its value before tuning."""

    name: str
    offset: float
    """Value that is added before and after, in the unit of the metric: much smaller ones are
    equal. Of an overshoot, which is in % of the step, 100 %: peaks of the response are compared."""


_TRACKING = (_Part("me", 5e-5), _Part("mae", 5e-5))
_STEP = tuple(
    part
    for axis in STEP_AXES
    for part in (_Part(f"settling_time_{axis}", 0.05), _Part(f"overshoot_{axis}", 100.0))
)


def objective_of(text: str) -> Objective:
    """Return the objective of a text: the balanced one by its name, or a sum of metrics.

    Raises:
        InvalidInput: See :func:`~omnidrive.tuning.objective.parse_objective`; or the balanced one
            is part of a sum.
    """
    if text.strip() == BALANCED:
        return BalancedObjective()
    if BALANCED in re.findall(r"\w+", text[:1000]):
        raise InvalidInput(
            f"{BALANCED} is an objective of its own, not a metric of a sum: give it alone, or both "
            "as two objectives for a front"
        )
    return parse_objective(text)


def motion_of(record: RunRecord, axes: Sequence[str]) -> str:
    """Return the label of the motion of a run: the values of the axes and, of none, the task."""
    return ", ".join(str(record.factors.get(each)) for each in axes) or record.task


@dataclass(frozen=True, slots=True)
class BalancedObjective(Objective):
    """Geometric mean of the changes of tracking and of step responses; 1 before tuning.

    Each of the motions (values of the axes) counts equally, and in it each of its parts: ME and MAE
    of a reference; settling times and peaks (1 + overshoot) of the axes of a step. The change of a
    part is the quotient of its means over the runs after and before tuning. Quotients have no unit,
    and the geometric mean is the one whose order does not depend on what they are relative to
    (Fleming & Wallace, "How not to lie with statistics", Commun. ACM 29, 1986).

    Attributes:
        text: The objective as the user writes it.
        terms: Empty.
        axes: Names of the axes of the study.
        before: Runs before tuning by their pairing.
        tolerance: Relative increase of a part above which a candidate is worse.
    """

    text: str = BALANCED
    terms: tuple[()] = ()
    axes: tuple[str, ...] = ()
    before: Mapping[int, RunRecord] = field(default_factory=dict, compare=False)
    tolerance: float = TOLERANCE

    def covers(self, task: str) -> bool:
        """Return True: all tasks have an error or a step response."""
        del task
        return True

    def counts(self, record: RunRecord) -> bool:
        """Return whether a run is compared: the one before tuning reached its end."""
        earlier = self.before.get(record.pairing)
        return earlier is not None and earlier.finished

    def relative_to(self, before: Sequence[RunRecord], axes: Sequence[str]) -> BalancedObjective:
        """Return the objective with its runs before tuning; see :meth:`Objective.relative_to`."""
        return replace(self, axes=tuple(axes), before={each.pairing: each for each in before})

    def excess(self, records: Sequence[RunRecord]) -> float:
        """Return the sum of the increases of parts beyond the tolerance; 0: none is worse."""
        changes = [each for motion in self._changes(records) for each in motion]
        return sum(max(0.0, each - 1.0 - self.tolerance) for each in changes)

    def value(self, records: Sequence[RunRecord]) -> float:
        """Return the mean change over the runs; infinite if one of them has no value.

        Runs that ended early before tuning are left out: to finish them is better at any value.
        """
        motions = self._changes(records)
        if not motions:
            return 1.0 if records and self.before else inf
        if not all(isfinite(each) for motion in motions for each in motion):
            return inf
        return exp(fmean(fmean(map(log, motion)) for motion in motions))

    def _changes(self, records: Sequence[RunRecord]) -> list[list[float]]:
        """Return the changes of the parts of each motion."""
        motions: dict[tuple[str, str], list[RunRecord]] = {}
        for each in records:
            if self.counts(each):
                kind = "step" if each.task == "step" else "tracking"
                motions.setdefault((motion_of(each, self.axes), kind), []).append(each)
        found = []
        for (_, kind), after in motions.items():
            before = [self.before[each.pairing] for each in after]
            parts = _STEP if kind == "step" else _TRACKING
            quotients = (_quotient(part, before, after) for part in parts)
            found.append([each for each in quotients if each is not None])
        return [each for each in found if each]

    def __str__(self) -> str:
        return "balanced objective"


def _quotient(part: _Part, before: Sequence[RunRecord], after: Sequence[RunRecord]) -> float | None:
    """Return the change of a part; None: it had no value before, as an axis without a step."""
    old, new = (
        fmean(compared_value(each, part.name) for each in runs) + part.offset
        for runs in (before, after)
    )
    if not isfinite(old):
        return None
    return new / old if isfinite(new) else inf
