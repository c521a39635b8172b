"""Claims of the paper, checked against the evidence of a study over many seeds.

The paper: see :mod:`omnidrive.evaluation.tables.published`; its sections 5.1 to 5.3.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import NamedTuple

import numpy as np

from omnidrive.evaluation.measures.quantities import quantity
from omnidrive.evaluation.measures.step_response import STEP_AXES
from omnidrive.evaluation.statistics.evidence import (
    BETTER,
    WORSE,
    PairEvidence,
    StudyEvidence,
    Summary,
    TaskEvidence,
)
from omnidrive.evaluation.statistics.mean_test import difference_tests
from omnidrive.evaluation.statistics.repetition_means import repetition_means
from omnidrive.evaluation.statistics.run_table import RunTable
from omnidrive.evaluation.statistics.uncertainty import CONFIDENCE, holm
from omnidrive.evaluation.tables.published import PUBLISHED_ERRORS, PUBLISHED_STEPS
from omnidrive.evaluation.tables.table import NO_VALUE, Table, number_text
from omnidrive.evaluation.verdict import value_text

HOLDS, FAILS, OPEN = "holds", "does not hold", "not shown"
"""Verdicts of a claim."""

_T1, _T2, _NMPC = "fuzzy_t1", "fuzzy_t2", "unicycle-nmpc"
_SIMILAR = 0.1  # relative difference of two controllers that the paper calls similar, at most
_ORDER = (FAILS, OPEN, HOLDS)


class Claim(NamedTuple):
    """One statement of the paper, as comparisons."""

    text: str
    """The statement."""
    tasks: tuple[tuple[str, float | None], ...]
    """Task and duration (s; None: any) of each comparison."""
    metrics: tuple[str, ...]
    """Compared quantities."""
    better: str
    """Controller that the paper finds better; for ``similar``, one of the two."""
    others: tuple[str, ...]
    """Controllers that the paper finds worse."""
    similar: bool = False
    """Whether the paper finds them similar instead."""


_TRACKS, _NOISE, _STEP = (("track", 20.0), ("track", 30.0)), (("noise", 30.0),), (("step", None),)
_MEASURED = ("me_measured", "mae_measured")

CLAIMS = (
    Claim("Without noise, NMPC has lower errors than both fuzzy PIDs.",
          _TRACKS, ("me", "mae"), _NMPC, (_T1, _T2)),
    Claim("Without noise, the two fuzzy PIDs have similar errors.",
          _TRACKS, ("me", "mae"), _T2, (_T1,), similar=True),
    Claim("The fuzzy PIDs need less computing time than NMPC.",
          (*_TRACKS, *_NOISE), ("step_time_median",), _T1, (_NMPC,)),
    Claim("NMPC is more robust to noise than both fuzzy PIDs.",
          _NOISE, _MEASURED, _NMPC, (_T1, _T2)),
    Claim("The type-2 fuzzy PID rejects noise better than the type-1 one.",
          _NOISE, _MEASURED, _T2, (_T1,)),
    Claim("NMPC has the smallest overshoot in the step response.",
          _STEP, tuple(f"overshoot_{axis}" for axis in STEP_AXES), _NMPC, (_T1, _T2)),
    Claim("NMPC has the shortest rise time in the step response.",
          _STEP, tuple(f"rise_time_{axis}" for axis in STEP_AXES), _NMPC, (_T1, _T2)),
    Claim("NMPC has the shortest settling time in the step response.",
          _STEP, tuple(f"settling_time_{axis}" for axis in STEP_AXES), _NMPC, (_T1, _T2)),
    Claim("The type-2 fuzzy PID has a faster step response than the type-1 one.",
          _STEP, tuple(f"{name}_{axis}" for name in ("rise_time", "settling_time")
                       for axis in STEP_AXES), _T2, (_T1,)),
)  # fmt: skip
"""Claims of the paper about pairs of controllers."""

_TIME_CLAIM = "With 30 s instead of 20 s, both kinds have lower errors."


class ClaimResult(NamedTuple):
    """A claim and what the study shows of it."""

    text: str
    verdict: str
    """:data:`HOLDS` if every comparison shows it, :data:`FAILS` if one shows the opposite."""
    findings: tuple[str, ...]
    """One sentence per comparison."""


def check_claims(study: StudyEvidence) -> list[ClaimResult]:
    """Return what the study shows of every claim about which it has runs.

    The comparisons are those of :class:`StudyEvidence`: paired, Holm-corrected over the pairs of
    controllers. "Similar" holds if the 95 % interval of the difference is within 10 %.
    """
    results = [_result(claim.text, list(_findings(claim, study))) for claim in CLAIMS]
    results.insert(2, _result(_TIME_CLAIM, _time_findings(study.runs)))
    return [each for each in results if each.findings]


def claims_tables(study: StudyEvidence) -> list[Table]:
    """Return the tables of the claims, and of the published values."""
    return [claims_table(check_claims(study)), published_table(study)]


def claims_table(results: list[ClaimResult]) -> Table:
    """Return the claims with their verdicts as a table."""
    rows = tuple((each.text, each.verdict, ". ".join(each.findings) + ".") for each in results)
    count = sum(each.verdict == HOLDS for each in results)
    return Table(
        "Claims of the paper",
        ("claim", "verdict", "evidence"),
        rows,
        "Holds: every comparison shows it (5 %, Holm-corrected); does not hold: one shows the "
        "opposite; not shown: otherwise. Similar: the interval of the difference is within 10 %.",
        keys=2,
        prose=True,
        lead=f"{count} of {len(results)} claims of the paper hold.",
    )


class _Published(NamedTuple):
    """One number of the paper."""

    task: str
    duration: float | None
    """Duration of the task, s; None: any."""
    controller: str
    metric: str
    value: float
    """In the stored unit of the metric."""


_PUBLISHED = (
    *(
        _Published(task, duration, name, metric, value)
        for (task, duration, name), row in PUBLISHED_ERRORS.items()
        for metric, value in zip(_MEASURED if task == "noise" else ("me", "mae"), row, strict=True)
    ),
    *(
        _Published("step", None, name, f"{key}_{axis}", value)
        for name, responses in PUBLISHED_STEPS.items()
        for axis, response in zip(STEP_AXES, responses, strict=True)
        for key, value in response._asdict().items()
    ),
)


def published_table(study: StudyEvidence) -> Table:
    """Return the published values beside those of the study."""
    rows = []
    for each in _PUBLISHED:
        summary, measure = _reproduced(study, each), quantity(each.metric)
        if summary is not None:
            mean = summary.mean.mean
            rows.append((
                summary.task.label, each.controller, measure.heading,
                number_text(measure.factor * each.value), value_text(summary),
                number_text(each.value / mean) if mean else NO_VALUE,
            ))  # fmt: skip
    return Table(
        "Published values",
        ("task", "controller", "quantity", "paper", "this study", "paper / study"),
        tuple(rows),
        "This study: mean with its 95 % interval over the repetitions.",
        keys=3,
        is_detail=True,
    )


def _reproduced(study: StudyEvidence, published: _Published) -> Summary | None:
    """Return the summary of the runs with which a published value is compared; None: no run."""
    if published.metric not in study.runs.metrics:
        return None
    return next(
        (
            summary
            for each in study.of(published.metric)
            if _matches(each, published.task, published.duration)
            for summary in each.summaries
            if summary.controller == published.controller and isfinite(summary.mean.mean)
        ),
        None,
    )


def _findings(claim: Claim, study: StudyEvidence) -> Iterator[tuple[str, str]]:
    """Yield verdict and sentence of each comparison of a claim."""
    for metric in claim.metrics:
        for each in study.of(metric) if metric in study.runs.metrics else ():
            if not any(_matches(each, *task) for task in claim.tasks):
                continue
            for other in claim.others:
                pair = each.pair(claim.better, other)
                if pair and pair.difference.sample_size > 1 and isfinite(pair.p):
                    verdict = _similarity(pair) if claim.similar else _order(pair)
                    yield verdict, f"{each.measure.label}, {each.task.label}: {pair.sentence}"


def _matches(evidence: TaskEvidence, name: str, duration: float | None) -> bool:
    return evidence.task.name == name and duration in {None, evidence.task.duration}


def _order(pair: PairEvidence) -> str:
    return {BETTER: HOLDS, WORSE: FAILS}.get(pair.verdict, OPEN)


def _similarity(pair: PairEvidence) -> str:
    """Return whether the interval of the relative difference is within the margin."""
    mean = pair.difference.mean
    scale = abs(mean / pair.relative) if pair.relative else 0.0
    if scale == 0.0:
        return HOLDS if mean == 0.0 else OPEN
    low, high = pair.difference.low / scale, pair.difference.high / scale
    if max(abs(low), abs(high)) <= _SIMILAR:
        return HOLDS
    return FAILS if low > _SIMILAR or high < -_SIMILAR else OPEN


def _time_findings(runs: RunTable) -> list[tuple[str, str]]:
    """Compare the errors of 30 s and 20 s, by controller, over the same repetitions."""
    found = []
    for metric in ("me", "mae"):
        if metric not in runs.metrics:
            continue
        grids = {g.task.duration: g for g in repetition_means(runs, metric)
                 if g.task.name == "track"}  # fmt: skip
        if {20.0, 30.0} <= grids.keys():
            fast, slow = grids[20.0], grids[30.0]
            both = [n for n in (_T1, _T2, _NMPC) if n in fast.controllers and n in slow.controllers]
            columns = [slow.means[:, slow.controllers.index(n)]
                       - fast.means[:, fast.controllers.index(n)] for n in both
                       if len(slow.means) == len(fast.means)]  # fmt: skip
            found += [(metric, name, values) for name, values in zip(both, columns, strict=False)]
    if not found:
        return []
    tested = difference_tests(np.column_stack([values for _, _, values in found]))
    known = [t for t in tested if isfinite(t.p)]
    adjusted = holm([t.p for t in known]) if len(known) == len(tested) else []
    results = []
    for (metric, name, _), each, p in zip(found, tested, adjusted, strict=False):
        measure = quantity(metric)
        mean, _, low, high = each.estimate.text(measure.factor)
        shown = p < 1.0 - CONFIDENCE
        verdict = (HOLDS if each.estimate.mean < 0.0 else FAILS) if shown else OPEN
        text = f"{measure.label} of {name}: {mean} {measure.shown_unit} [{low}, {high}]"
        results.append((verdict, text))
    return results


def _result(text: str, findings: list[tuple[str, str]]) -> ClaimResult:
    verdict = min((v for v, _ in findings), key=_ORDER.index, default=OPEN)
    return ClaimResult(text, verdict, tuple(sentence for _, sentence in findings))
