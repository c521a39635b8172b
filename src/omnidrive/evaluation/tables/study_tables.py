"""Tables of the evidence of a study, for the terminal, the report and files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isfinite

import pyarrow as pa

from omnidrive.evaluation.statistics.confidence_sequence import MIN_ALWAYS_VALID
from omnidrive.evaluation.statistics.evidence import (
    PairEvidence,
    StudyEvidence,
    Summary,
    TaskEvidence,
    signed_percent,
)
from omnidrive.evaluation.statistics.mean_test import needed_differences
from omnidrive.evaluation.statistics.run_table import RunTable, Task
from omnidrive.evaluation.statistics.uncertainty import p_text
from omnidrive.evaluation.statistics.variance_shares import MIN_REPETITIONS, variance_shares
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_logs import ControllerType, StudyLogs
from omnidrive.evaluation.study_verdicts import has_evidence, table_axes
from omnidrive.evaluation.tables.drive_table import drive_table
from omnidrive.evaluation.tables.published_claims import claims_tables
from omnidrive.evaluation.tables.result_tables import interval_note, mean_cell, result_tables
from omnidrive.evaluation.tables.rule_tables import rule_tables
from omnidrive.evaluation.tables.table import NO_VALUE, Table, level_text, number_text, percent
from omnidrive.evaluation.verdict import Cost, TaskVerdict, headline

_ALSO_COMPARED = ("mae", "max_error")
"""Quantities whose paired differences are shown beside the compared one."""
_NOISY = ("me_measured", "mae_measured")
"""Further ones of the task ``noise``."""

_MAX_REASONS = 20


def study_tables(
    study: StudyEvidence,
    facts: StudyFacts,
    verdicts: Sequence[TaskVerdict],
    logs: StudyLogs | None = None,
) -> list[Table]:
    """Return the tables of a study, the verdict first; tables without rows are omitted.

    Args:
        study: The evidence.
        facts: What the study is.
        verdicts: The verdict of each task.
        logs: Logs of the study; None: they are not kept.
    """
    tables = [
        verdict_table(verdicts, logs.limit_notes if logs else (), _shortage(study, verdicts)),
        *(claims_tables(study) if facts.published == "claims" else ()),
        *result_tables(study, logs, published=facts.published == "values"),
        *(_evidence_tables(study, verdicts) if has_evidence(study, verdicts) else ()),
        _failure_table(study.runs, facts.failures),
        *([drive_table(logs)] if logs else ()),
        controller_table(facts.types),
        *rule_tables({name: each.fuzzy for name, each in facts.types.items() if each.fuzzy}),
    ]
    return [table for table in tables if table.rows]


def _evidence_tables(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> list[Table]:
    """Return distributions, differences, and effects of axes."""
    return [
        *_summary_tables(verdicts),
        _pair_table(study, verdicts),
        *(_axis_table(study, verdicts, path) for path in table_axes(study, verdicts)),
        _share_table(study.runs, verdicts),
    ]


def verdict_table(
    verdicts: Sequence[TaskVerdict], notes: Sequence[str] = (), remark: str = ""
) -> Table:
    """Return a table with the best controller of each task, its advantage and its cost.

    Tasks with one run of one controller are omitted.

    Args:
        verdicts: The verdicts.
        notes: Sentences after those that name the best controllers.
        remark: What follows the note of the table.
    """
    shown = [v for v in verdicts if len(v.evidence.summaries) > 1 or v.is_tested]
    measures = dict.fromkeys(v.evidence.measure for v in shown)
    meanings = [f"{m.label[0].upper()}{m.label[1:]}: {m.meaning}." for m in measures if m.meaning]
    unranked = [f"{', '.join(v.unranked)} ({v.name})" for v in shown if v.unranked]
    if unranked:
        meanings.append(
            f"Not ranked, because a run stopped early or did not settle: {'; '.join(unranked)}."
        )
    if any(v.is_tested for v in shown):
        meanings.append(_TESTED_NOTE)
    note = " ".join(meanings) + remark
    compact = Table(
        "Verdict", ("task", "best", "result"),
        tuple((v.name, ", ".join(v.best) or NO_VALUE, _verdict_text(v)) for v in shown),
        note, keys=2, prose=True,
    )  # fmt: skip
    return Table(
        "Verdict",
        ("task", "best", "result", "next", "result of next", "factor", "confidence",
         "work, J", "work of next, J", "step time, µs", "step time of next, µs"),
        tuple(map(_verdict_row, shown)),
        note,
        definitions=(("factor", "Factor: result of the next over that of the best."),),
        keys=2,
        compact=compact,
        lead=headline(verdicts, notes) if shown else "",
    )  # fmt: skip


_TESTED_NOTE = (
    "Best: the controller with the best mean that is not shown to be worse than another in the "
    "same runs, and those from which no difference is shown. Brackets: 95 % confidence interval "
    "over the repetitions. p: Holm-corrected over the pairs of controllers."
)


def _verdict_text(verdict: TaskVerdict) -> str:
    """Return result, advantage, confidence and cost as one sentence."""
    best, following = verdict.leader, verdict.following
    if best is None:
        return NO_VALUE
    cost = str(verdict.costs.get(best.controller, ""))
    next_cost = str(verdict.costs.get(following.controller, "")) if following else ""
    if cost and next_cost:
        cost += f" (next: {next_cost})"
    parts = (verdict.value_text(best), verdict.advantage, verdict.confidence, cost)
    return "; ".join(part for part in parts if part)


def _verdict_row(verdict: TaskVerdict) -> tuple[str, ...]:
    best, following = verdict.leader, verdict.following
    costs = [verdict.costs.get(each.controller, Cost()) if each else Cost()
             for each in (best, following)]  # fmt: skip
    return (
        verdict.name,
        ", ".join(verdict.best) or NO_VALUE,
        verdict.value_text(best) if best else NO_VALUE,
        following.controller if following else NO_VALUE,
        verdict.value_text(following) if following else NO_VALUE,
        verdict.factor_text,
        verdict.confidence,
        *(number_text(each.work) for each in costs),
        *(number_text(each.step_time) for each in costs),
    )


def _shortage(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> str:
    """Return the number of repetitions that a difference needs, if a task has fewer."""
    pairs = max((len(each.evidence.pairs) for each in verdicts), default=0)
    if not pairs or not any(each.is_tested for each in verdicts):
        return ""
    count = max(p.difference.sample_size for each in verdicts for p in each.evidence.pairs)
    needed = needed_differences(pairs)
    if study.always_valid:
        needed = max(needed, MIN_ALWAYS_VALID)
    if count >= needed:
        return ""
    plural = "" if count == 1 else "s"
    compared = (
        "one pair of controllers needs" if pairs == 1 else f"{pairs} pairs of controllers need"
    )
    return (
        f" With {count} repetition{plural} no difference between runs that vary can be shown at "
        f"5 %: {compared} at least {needed}."
    )


def _summary_tables(verdicts: Sequence[TaskVerdict]) -> list[Table]:
    """Return one table per compared quantity: distributions of all controllers by task."""
    measures = dict.fromkeys(each.evidence.measure for each in verdicts)
    tables = []
    for measure in measures:
        found = [each.evidence for each in verdicts if each.evidence.measure == measure]
        unit = f", {measure.shown_unit}" if measure.shown_unit else ""
        rows = tuple(row for evidence in found for row in _summary_rows(evidence))
        values = tuple(f"{name}{unit}" for name in ("mean", "median", "p95", "worst"))
        table = Table(
            f"Distribution of {measure.label}",
            ("task", "controller", "rank", *values, "success rate", "runs"),
            rows,
            f"{measure.meaning.capitalize() or measure.label}, over the finished runs. "
            f"{interval_note(rows)} p95: 95 % of the runs are at least "
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
        mean_cell(summary),
        *(number_text(factor * v) for v in (summary.median, summary.p95, summary.worst)),
        percent(summary.success_rate),
        str(summary.runs),
    )


def _pair_table(study: StudyEvidence, verdicts: Sequence[TaskVerdict]) -> Table:
    """Return all pairs of controllers, by task and quantity."""
    rows = []
    for verdict in verdicts:
        measured = [verdict.evidence, *([verdict.success] if verdict.success else [])]
        task, shown = verdict.evidence.task, verdict.evidence.measure.name
        others = [*_ALSO_COMPARED, *(_NOISY if task.name == "noise" else ())]
        others = [name for name in others if name in study.runs.metrics]
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
        f"runs. Pairs: repetitions.{_shortage(study, verdicts)}",
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


def _axis_table(study: StudyEvidence, verdicts: Sequence[TaskVerdict], path: str) -> Table:
    """Return the means and success rates at every value of an axis, and the best controllers."""
    rows = []
    for verdict in verdicts:
        task, measure = verdict.evidence.task, verdict.evidence.measure
        found = {e.level: e.evidence for e in study.along(measure.name, path).get(task, [])}
        for each in study.along("finished", path).get(task, []) if found else ():
            level = level_text(each.level)
            if each.level in found:
                rows += _level_rows(task, level, found[each.level])
            elif not any(s.success_rate for s in each.evidence.summaries):
                lost_cells = {s.controller: f"{NO_VALUE} (0 %)" for s in each.evidence.summaries}
                rows.append((task.label, level, measure.heading, lost_cells, NO_VALUE))
    controllers = list(dict.fromkeys(s.controller for a in verdicts for s in a.evidence.summaries))
    lost = not study.runs.finished.all()
    shown = tuple(
        (task, level, label, *(cells.get(name, NO_VALUE) for name in controllers), best)
        for task, level, label, cells, best in rows
    )
    return Table(
        f"By {path}",
        ("task", path, "quantity", *controllers, "best"),
        shown,
        f"{interval_note(shown)} Other axes are averaged. Best: by the "
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
        cells[s.controller] = mean_cell(s) + rate
    best = ", ".join(evidence.best) if len(evidence.best) < len(cells) else NO_VALUE
    return [(task.label, level, evidence.measure.heading, cells, best)]


def _share_table(runs: RunTable, verdicts: Sequence[TaskVerdict]) -> Table:
    """Return the variance shares of all factors."""
    rows = []
    for verdict in verdicts:
        task, measure = verdict.evidence.task, verdict.evidence.measure
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


def _failure_table(runs: RunTable, failures: Sequence[tuple[str, str]]) -> Table:
    """Return the runs that ended early by name and reason; of many the numbers of each outcome.

    Args:
        runs: The runs.
        failures: Name and reason of each run that ended early; empty: there are many, or none.
    """
    if failures:
        return Table(
            "Runs that ended early", ("run", "reason"), tuple(failures), prose=True, is_detail=True
        )
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


def controller_table(types: Mapping[str, ControllerType]) -> Table:
    """Return type, parameters and description of each controller."""
    rows = [
        (label, kind.name, kind.parameters or "defaults", kind.description)
        for label, kind in types.items()
    ]
    return Table(
        "Controllers", ("controller", "type", "parameters", "description"), tuple(rows),
        keys=4, is_detail=True,
    )  # fmt: skip
