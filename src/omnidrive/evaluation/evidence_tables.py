"""Tables of the evidence of a study, for the terminal, the report and files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import inf, isfinite

import pyarrow as pa

from omnidrive.evaluation.confidence_sequence import MIN_ALWAYS_VALID
from omnidrive.evaluation.evidence import (
    PairEvidence,
    StudyEvidence,
    Summary,
    TaskEvidence,
    signed_percent,
)
from omnidrive.evaluation.mean_test import needed_differences
from omnidrive.evaluation.quantities import quantity
from omnidrive.evaluation.run_table import RunTable, Task
from omnidrive.evaluation.study_answer import (
    TaskAnswer,
    percent,
    study_answers,
    value_text,
)
from omnidrive.evaluation.table import NO_VALUE, Table, level_text, number_text
from omnidrive.evaluation.uncertainty import p_text
from omnidrive.evaluation.variance_shares import MIN_REPETITIONS, variance_shares

SECONDARY = (
    "mae", "max_error", "min_clearance", "collisions", "work", "wheel_acceleration", "recovered",
    "time_to_recover", "step_time_median",
)  # fmt: skip
"""Quantities that are shown beside the compared one."""

_MAX_REASONS = 20


def evidence_tables(study: StudyEvidence, metric: str | None = None) -> list[Table]:
    """Return the tables of a study, the answer first; tables without rows are omitted.

    Args:
        study: The evidence.
        metric: Compared quantity; None: that of :func:`main_metric` in each task.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    answers = study_answers(study, metric)
    tables = [
        answer_table(answers, _shortage(study, answers)),
        *_summary_tables(answers),
        _secondary_table(study, answers),
        _pair_table(study, answers),
        *(_axis_table(study, answers, path) for path in study.runs.shown_axes),
        _share_table(study.runs, answers),
        _failure_table(study.runs),
    ]
    return [table for table in tables if table.rows]


def answer_table(answers: Sequence[TaskAnswer], remark: str = "") -> Table:
    """Return the best controller of every task with its comparison to the next one.

    Args:
        answers: The answers.
        remark: What follows the note of the table.
    """
    rows = []
    for each in answers:
        best = each.evidence.best
        first = each.sentences[0] if each.sentences else "no other controller"
        leader = each.evidence.leader
        value = value_text(leader) if leader else NO_VALUE
        rows.append((each.evidence.task.label, ", ".join(best) or NO_VALUE,
                     each.evidence.measure.label, value, first))  # fmt: skip
    return Table(
        "Answer",
        ("task", "best", "quantity", "mean", "against the next"),
        tuple(rows),
        "Best: the controller with the best mean that is not shown to be worse than another in the "
        "same runs, and those from which no difference is shown. " + INTERVAL_NOTE + remark,
        keys=2,
        prose=True,
        lead=" ".join(each.lead for each in answers),
    )


INTERVAL_NOTE = (
    "Brackets: 95 % confidence interval over the repetitions. p: Holm-corrected over the pairs of "
    "controllers."
)


def _shortage(study: StudyEvidence, answers: Sequence[TaskAnswer]) -> str:
    """Return the number of repetitions that a difference needs, if a task has fewer."""
    pairs = max((len(each.evidence.pairs) for each in answers), default=0)
    if not pairs:
        return ""
    count = max(p.difference.sample_size for each in answers for p in each.evidence.pairs)
    needed = needed_differences(pairs)
    if study.always_valid:
        needed = max(needed, MIN_ALWAYS_VALID)
    if count >= needed:
        return ""
    plural = "" if count == 1 else "s"
    compared = "one pair" if pairs == 1 else f"{pairs} pairs"
    return (
        f" With {count} repetition{plural} no difference between runs that vary can be shown at "
        f"5 %: {compared} of controllers need at least {needed}."
    )


def _summary_tables(answers: Sequence[TaskAnswer]) -> list[Table]:
    """Return one table per compared quantity: distributions of all controllers by task."""
    measures = dict.fromkeys(each.evidence.measure for each in answers)
    tables = []
    for measure in measures:
        found = [each.evidence for each in answers if each.evidence.measure == measure]
        unit = f", {measure.shown_unit}" if measure.shown_unit else ""
        rows = tuple(row for evidence in found for row in _summary_rows(evidence))
        values = tuple(f"{name}{unit}" for name in ("mean", "median", "p95", "worst"))
        table = Table(
            f"Distribution of {measure.label}",
            ("task", "controller", "rank", *values, "success rate", "runs"),
            rows,
            f"{measure.meaning.capitalize() or measure.label}, over the finished runs. "
            f"Mean: over the repetitions{_interval_note(rows)}. p95: 95 % of the runs are at least "
            "as good. Rank 1: the best, and all from which no difference is shown.",
            keys=2,
        )
        lower = measure.lower_is_better
        tables.append(table.mark_best(values if lower else (), () if lower else values, group=0))
    return tables


def _summary_rows(evidence: TaskEvidence) -> list[tuple[str, ...]]:
    """Return one row per controller, by rank; those without a valid run are last."""
    best = evidence.best
    order = [*best, *(s.controller for s in evidence.ranking if s.controller not in best)]
    ranks = {name: "1" if name in best else str(k) for k, name in enumerate(order, 1)}
    known = {s.controller: s for s in evidence.summaries}
    names = [*order, *(name for name in known if name not in ranks)]
    return [_summary_row(known[name], ranks.get(name, NO_VALUE)) for name in names]


def _summary_row(summary: Summary, rank: str) -> tuple[str, ...]:
    factor = summary.measure.factor
    return (
        summary.task.label,
        summary.controller,
        rank,
        _mean_cell(summary),
        *(number_text(factor * v) for v in (summary.median, summary.p95, summary.worst)),
        percent(summary.success_rate),
        str(summary.runs),
    )


def _interval_note(rows: Sequence[Sequence[str]]) -> str:
    """Return what follows ± in the cells of a table; empty if there is none."""
    is_shown = any("±" in cell for row in rows for cell in row)
    return " ± half its 95 % interval" if is_shown else ""


def _mean_cell(summary: Summary) -> str:
    """Return the mean ± half its interval."""
    mean, factor = summary.mean, summary.measure.factor
    if not 0.0 < mean.margin < inf:  # too few repetitions, or equal values
        return number_text(factor * mean.mean)
    text, margin, _, _ = mean.text(factor)
    return f"{text.removeprefix('+')} ± {margin}"


def _secondary_table(study: StudyEvidence, answers: Sequence[TaskAnswer]) -> Table:
    """Return the means of the other quantities by task and controller."""
    compared = {each.evidence.measure.name for each in answers}
    names = [n for n in ("me", *SECONDARY) if n in study.runs.metrics and n not in compared]
    cells = {
        (evidence.task, s.controller, name): _mean_cell(s)
        for name in names
        for evidence in study.of(name)
        for s in evidence.summaries
    }
    rows = []
    for each in answers:
        for s in each.evidence.summaries:
            row = [cells.get((s.task, s.controller, name), NO_VALUE) for name in names]
            rows.append((s.task.label, s.controller, *row))
    headings = [quantity(name).heading for name in names]
    better = [h for h, n in zip(headings, names, strict=True) if quantity(n).lower_is_better]
    worse = [h for h in headings if h not in better]
    return Table(
        "Other quantities",
        ("task", "controller", *headings),
        tuple(rows) if names else (),
        f"Mean over the finished runs of the repetitions{_interval_note(rows)}.",
        keys=2,
    ).mark_best(better, worse, group=0)


def _pair_table(study: StudyEvidence, answers: Sequence[TaskAnswer]) -> Table:
    """Return all pairs of controllers, by task and quantity."""
    rows = []
    for answer in answers:
        measured = [answer.evidence, *([answer.success] if answer.success else [])]
        others = [n for n in SECONDARY[:2] if n in study.runs.metrics]
        task, shown = answer.evidence.task, answer.evidence.measure.name
        measured += [e for n in others if n != shown for e in study.of(n) if e.task == task]
        pairs = [pair for each in measured for pair in each.pairs]
        equal = [p.measure.name == "finished" and p.difference.mean == 0.0 for p in pairs]
        rows += [_pair_row(pair) for pair, skip in zip(pairs, equal, strict=True) if not skip]
    return Table(
        "Paired differences",
        ("task", "controllers", "quantity", "difference", "95 % interval", "p", "effect d",
         "first better", "relative", "pairs", "first is"),
        tuple(rows),
        "First minus second controller under the same random numbers. Interval: of each pair by "
        "itself, over the repetitions. p and result: Holm-corrected over the pairs of one task and "
        "quantity, so that an interval without 0 may stand beside “no difference shown”. Effect d: "
        "mean over standard deviation of the differences. First better: share of the pairs of "
        f"runs. Pairs: repetitions.{_shortage(study, answers)}",
        keys=3,
        is_detail=True,
    )  # fmt: skip


def _pair_row(pair: PairEvidence) -> tuple[str, ...]:
    mean, _, low, high = pair.difference.text(pair.measure.factor)
    known = isfinite(pair.difference.margin)
    return (
        pair.task.label,
        f"{pair.first} − {pair.second}",
        pair.measure.heading,
        mean,
        f"{low} to {high}" if known else NO_VALUE,
        p_text(pair.p).removeprefix("= ") if isfinite(pair.p) else NO_VALUE,
        number_text(pair.effect).replace("-", "\N{MINUS SIGN}"),
        percent(pair.share_better),
        signed_percent(pair.relative),
        str(pair.difference.sample_size),
        pair.verdict,
    )


def _axis_table(study: StudyEvidence, answers: Sequence[TaskAnswer], path: str) -> Table:
    """Return the means and success rates at every value of an axis, and the best controllers."""
    rows = []
    for answer in answers:
        task, measure = answer.evidence.task, answer.evidence.measure
        found = {e.level: e.evidence for e in study.along(measure.name, path).get(task, [])}
        for each in study.along("finished", path).get(task, []) if found else ():
            level = level_text(each.level)
            if each.level in found:
                rows += _level_rows(task, level, found[each.level])
            elif not any(s.success_rate for s in each.evidence.summaries):
                lost_cells = {s.controller: f"{NO_VALUE} (0 %)" for s in each.evidence.summaries}
                rows.append((task.label, level, measure.heading, lost_cells, NO_VALUE))
    controllers = list(dict.fromkeys(s.controller for a in answers for s in a.evidence.summaries))
    lost = not study.runs.finished.all()
    shown = tuple(
        (task, level, label, *(cells.get(name, NO_VALUE) for name in controllers), best)
        for task, level, label, cells, best in rows
    )
    return Table(
        f"By {path}",
        ("task", path, "quantity", *controllers, "best"),
        shown,
        f"Mean over the repetitions{_interval_note(shown)}; other axes are averaged. Best: by the "
        "differences of runs that both have; several if no difference between them is shown, a "
        "dash if none is shown at all (Holm-corrected over all pairs and values)."
        + (" In parentheses: success rate, if a run failed." if lost else ""),
        keys=3,
    )


def _level_rows(
    task: Task, level: str, evidence: TaskEvidence
) -> list[tuple[str, str, str, dict[str, str], str]]:
    cells = {}
    for s in evidence.summaries:
        rate = f" ({percent(s.success_rate)})" if s.finished < s.runs else ""
        cells[s.controller] = _mean_cell(s) + rate
    best = ", ".join(evidence.best) if len(evidence.best) < len(cells) else NO_VALUE
    return [(task.label, level, evidence.measure.heading, cells, best)]


def _share_table(runs: RunTable, answers: Sequence[TaskAnswer]) -> Table:
    """Return the variance shares of all factors."""
    rows = []
    for answer in answers:
        task, measure = answer.evidence.task, answer.evidence.measure
        for each in variance_shares(runs, measure.name, task):
            known = isfinite(each.low)
            interval = f"{percent(each.low)} to {percent(each.high)}" if known else NO_VALUE
            rows.append((task.label, measure.label, each.factor, percent(each.share), interval))
    return Table(
        "What matters",
        ("task", "quantity", "factor", "share of variance", "95 % interval"),
        tuple(rows),
        "Share of the variance over the runs that a factor explains alone (first-order Sobol' "
        "index). What is missing to 100 % are interactions and random numbers. Intervals and "
        f"random factors need {MIN_REPETITIONS} repetitions.",
        keys=3,
    )


def _failure_table(runs: RunTable) -> Table:
    """Return the number of runs that ended early, by controller, task and outcome."""
    rows = (~runs.finished).nonzero()[0]
    outcomes = runs.table["outcome"].take(pa.array(rows)).to_pylist()
    lost = [
        (runs.controllers[runs.controller[k]], runs.tasks[runs.task[k]].label, str(outcome))
        for k, outcome in zip(rows, outcomes, strict=True)
    ]
    counts = Counter(lost).most_common(_MAX_REASONS)
    note = (
        f"{runs.refused} more runs were not simulated: their values are not possible together."
        if runs.refused
        else ""
    )
    return Table(
        "Runs that ended early",
        ("controller", "task", "outcome", "runs"),
        tuple((*key, str(count)) for key, count in counts),
        note,
        keys=3,
    )
