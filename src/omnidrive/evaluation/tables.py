"""Result tables, shared by the command line and the report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite, nan

import numpy as np

from omnidrive.arrays import Array
from omnidrive.control.pid.rules import LABELS, paper_rules
from omnidrive.control.pid.rules import published_rules as code_rules
from omnidrive.evaluation.fault_table import fault_table
from omnidrive.evaluation.paired import (
    MEASURE_LABELS,
    MEASURES,
    PairedDifference,
    RepeatedRuns,
    paired_differences,
    repeated_runs,
)
from omnidrive.evaluation.published import PUBLISHED_ERRORS, PUBLISHED_STEPS
from omnidrive.evaluation.results import STEP_AXES, StepResult, StudyResults, TrackResult
from omnidrive.evaluation.table import Table
from omnidrive.simulation import Outcome


def study_tables(
    results: StudyResults, *, published: bool, published_rules: bool = False
) -> list[Table]:
    """Return the tables of a study; tables without rows and columns without values are omitted.

    Args:
        results: Results of the study.
        published: Whether the scenario is the paper's, so that the published values are shown, too.
        published_rules: Whether the fuzzy controllers used the rules of the published code.
    """
    tables = [
        _tracking_table(results, published),
        _noise_table(results, published),
        paired_table(results),
        _step_table(results, published),
        _horizon_table(results),
        fault_table(results),
    ]
    if any(r.controller.startswith("fuzzy") for r in results.runs):
        tables.append(rule_table(published_rules=published_rules))
    return [_without_empty_columns(table) for table in tables if table.rows]


_COST_COLUMNS = (
    "max. error, m", "effort, rad/s²", "work, J", "step time, µs", "p99, µs", "min. clearance, m",
    "collisions",
)  # fmt: skip


def _cost_cells(result: TrackResult) -> tuple[str, ...]:
    """Return the cells of ``_COST_COLUMNS`` for one run."""
    m = result.metrics
    return (
        _cell(result, m.max_error, 4),
        _cell(result, m.wheel_acceleration, 1),
        _cell(result, m.work, 0),
        _format(m.step_time_median, 0),
        _format(m.step_time_p99, 0),
        _cell(result, result.min_clearance, 3),
        _count_text(result.collisions),
    )


def _run_name(result: TrackResult | StepResult) -> str:
    """Return the name of the controller, with the time of an early stop."""
    run = result.run
    stopped = "" if run.outcome is Outcome.FINISHED else f" (stopped at {run.t[-1]:g} s)"
    return result.controller + stopped


def _cell(result: TrackResult | StepResult, value: float, decimals: int) -> str:
    """Format a value of a whole run; a dash if the run stopped early."""
    return _format(value if result.run.outcome is Outcome.FINISHED else nan, decimals)


def _format(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if isfinite(value) else "–"


def _count_text(count: int) -> str:
    """Format a count; 0 becomes empty, so that a column of zeros is omitted."""
    return str(count) if count else ""


def _published_cells(published: bool, key: tuple[str, float, str]) -> tuple[str, str]:
    """Return the published ME and MAE of one row, or empty cells."""
    row = PUBLISHED_ERRORS.get(key) if published else None
    return (f"{row.me:.4f}", f"{row.mae:.4f}") if row else ("", "")


def _tracking_table(results: StudyResults, published: bool) -> Table:
    rows = []
    for r in results.select("track"):
        m = r.metrics
        me, mae = _published_cells(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _run_name(r), _cell(r, m.me, 4), me, _cell(r, m.mae, 4), mae,
             _cell(r, m.me_after_start, 4), _cell(r, m.mae_after_start, 4), *_cost_cells(r))
        )  # fmt: skip
    return Table(
        "Tracking error without noise",
        ("time", "controller", "ME, m", "paper ME", "MAE, rad", "paper MAE",
         "ME after 2 s", "MAE after 2 s", *_COST_COLUMNS),
        tuple(rows),
        "ME: mean distance to the reference. MAE: mean absolute heading error, wrapped. The robot "
        "starts from rest. If the reference starts with a nonzero speed, as in the paper, the "
        "first 2 s cause most of the mean error of an accurate controller.",
        keys=2,
    )  # fmt: skip


def _noise_table(results: StudyResults, published: bool) -> Table:
    repeated, rows = repeated_runs(results), []
    estimated = any(isfinite(r.run.position_sigma[-1]) for r in results.select("noise"))
    for r in () if repeated else results.select("noise"):
        m = r.metrics
        me, mae = _published_cells(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _run_name(r), _cell(r, m.me_measured, 4), me,
             _cell(r, m.mae_measured, 4), mae, _cell(r, m.me, 4), _cell(r, m.mae, 4),
             *_cost_cells(r))
        )  # fmt: skip
    for group in repeated:
        me, mae = _published_cells(published, ("noise", group.duration, group.controller))
        cells = [_mean(group, measure) for measure in ("me_measured", "mae_measured", "me", "mae")]
        rows.append(
            (f"{group.duration:g} s", _repeated_name(group), cells[0], me, cells[1], mae,
             *cells[2:], *_mean_cost_cells(group))
        )  # fmt: skip
    return Table(
        "Tracking error with the paper's noise",
        ("time", "controller", "ME measured, m", "paper ME", "MAE measured, rad", "paper MAE",
         "ME true, m", "MAE true, rad", *_COST_COLUMNS),
        tuple(rows),
        (
            "Measured: error of the estimated pose that the controllers received. True: error of "
            "the true pose."
            if estimated
            else "Measured: error of the noisy pose, as the paper's author computed it. True: "
            "error of the true pose. The noise is biased; without an estimator, no controller can "
            "remove the resulting error."
        )
        + (_SEEDS_NOTE.format(results.repeats) if repeated else ""),
        keys=2,
    )  # fmt: skip


_SEEDS_NOTE = (
    " Over {} seeds: mean ± half the width of its 95 % confidence interval; maximum error and "
    "minimum clearance are over all runs."
)


def _repeated_name(group: RepeatedRuns) -> str:
    """Return the name of the controller, with the number of excluded runs that stopped early."""
    stopped = len(group.runs) - len(group.finished)
    return group.controller + (f" ({stopped} of {len(group.runs)} stopped)" if stopped else "")


def _mean(group: RepeatedRuns, measure: str) -> str:
    estimate = group.estimate_mean(measure)
    return f"{_format(estimate.mean, 5)} ± {_format(estimate.margin, 5)}"


def _mean_cost_cells(group: RepeatedRuns) -> tuple[str, ...]:
    """Return the cells of ``_COST_COLUMNS``: extremes of the distances, means of the others."""
    results = group.finished.values()

    def reduced(reduce: Callable[[Array], float], values: list[float], decimals: int) -> str:
        """Format the reduced values; a dash if there are none."""
        return _format(float(reduce(np.array(values))) if values else nan, decimals)

    metrics = [r.metrics for r in results]
    return (
        reduced(np.max, [m.max_error for m in metrics], 4),
        reduced(np.mean, [m.wheel_acceleration for m in metrics], 1),
        reduced(np.mean, [m.work for m in metrics], 0),
        reduced(np.mean, [m.step_time_median for m in metrics], 0),
        reduced(np.mean, [m.step_time_p99 for m in metrics], 0),
        reduced(np.min, [r.min_clearance for r in results], 3),
        _count_text(sum(r.collisions for r in group.runs.values())),
    )


def paired_table(results: StudyResults) -> Table:
    """Return a table of the mean error differences of all pairs of controllers."""
    differences = paired_differences(results)
    order = {key: k for k, key in enumerate(dict.fromkeys(map(_pair, differences)))}
    return Table(
        "Paired differences with noise",
        ("controllers", "time", "error", "mean difference", "95 % interval", "p", "seeds",
         "first is"),
        tuple(_paired_row(d) for d in sorted(differences, key=lambda d: order[_pair(d)])),
        "Error of the first minus error of the second controller for the same random numbers; "
        "negative if the first is more accurate. Intervals: Student's t for the differences, "
        "separately for each pair, without correction for the number of pairs. p and result: "
        "paired t-test, Holm-corrected for the number of pairs, separately for each error; no "
        "difference shown: p >= 0.05. Only seeds for which both runs finished count.",
        keys=3,
    )  # fmt: skip


def _pair(difference: PairedDifference) -> tuple[float, str, str]:
    return difference.duration, difference.first, difference.second


def _paired_row(d: PairedDifference) -> tuple[str, ...]:
    mean, _, low, high = d.difference.text(1e3)
    return (
        f"{d.first} − {d.second}",
        f"{d.duration:g} s",
        f"{MEASURE_LABELS[d.measure]}, m{MEASURES[d.measure]}",
        mean,
        f"{low} to {high}",
        f"{d.p:.3f}" if d.p >= 1e-3 else "< 0.001",
        str(d.difference.sample_size),
        d.verdict,
    )


def _step_table(results: StudyResults, published: bool) -> Table:
    rows = []
    for r in results.steps:
        paper_responses = PUBLISHED_STEPS.get(r.controller) if published else None
        for i, (axis, response) in enumerate(zip(STEP_AXES, r.responses, strict=True)):
            cells = [
                _cell(r, response[0], 2),
                _cell(r, response[1], 3),
                _cell(r, response[2], 3),
            ]
            paper = [f"{v:.3f}" for v in paper_responses[i]] if paper_responses else [""] * 3
            pairs = [cell for pair in zip(cells, paper, strict=True) for cell in pair]
            rows.append((_run_name(r), axis, *pairs))
    return Table(
        "Step response",
        ("controller", "axis", "overshoot, %", "paper %", "rise 10-90 %, s", "paper rise",
         "settling ±10 %, s", "paper settling"),
        tuple(rows),
        "Definitions of python-control's step_info, with the commanded value as final value. The "
        "reference steps in x, y and heading at the same time.",
        keys=2,
    )  # fmt: skip


def _horizon_table(results: StudyResults) -> Table:
    rows = [
        (f"N = {r.horizon}", _cell(r, r.metrics.me, 4), _cell(r, r.metrics.mae, 4),
         str(r.metrics.fallbacks), _active_share(r), *_cost_cells(r))
        for r in results.select("horizon")
    ]  # fmt: skip
    return Table(
        "NMPC by prediction horizon",
        ("horizon", "ME, m", "MAE, rad", "fallbacks", "active limits, %", *_COST_COLUMNS),
        tuple(rows),
        "The paper shows these results only as bars. Fallbacks: steps without a converged "
        "solution. Active limits: share of the steps with an active inequality constraint. Only "
        "in these steps does the horizon affect the holonomic NMPC: otherwise its terminal cost "
        "equals the cost of the remaining path.",
    )  # fmt: skip


def _active_share(result: TrackResult) -> str:
    """Return the share of steps with an active limit; a dash if the controller does not log it."""
    iterations = result.run.details.get("solver_iterations")
    return "–" if iterations is None else f"{100.0 * np.mean(iterations[:-1] > 0.0):.1f}"


def rule_table(*, published_rules: bool) -> Table:
    """Return the fuzzy rules in use, with the paper's rule where it differs."""
    paper, ours = paper_rules(), code_rules() if published_rules else paper_rules()

    def cell(consequents: Array) -> str:
        """Return the labels of the consequents of one rule."""
        return "/".join(LABELS[i] for i in consequents)

    rows = []
    for i, error in enumerate(LABELS):
        cells = [cell(ours[i, j]) for j in range(len(LABELS))]
        for j in np.flatnonzero((ours[i] != paper[i]).any(axis=1)).tolist():
            cells[j] += f" (paper {cell(paper[i, j])})"
        rows.append((error, *cells))
    return Table(
        "Fuzzy rules: change of kp/ki/kd",
        ("error \\ change of error", *LABELS),
        tuple(rows),
        "N: negative, P: positive; B: big, M: medium, S: small; ZO: zero.",
    )


def _without_empty_columns(table: Table) -> Table:
    """Return the table without the columns whose cells are all empty or dashes."""
    last = len(table.columns) - 1
    keep = [i for i in range(last + 1) if any(row[i] not in {"", "–"} for row in table.rows)]
    return replace(
        table,
        columns=tuple(table.columns[i] for i in keep),
        rows=tuple(tuple(row[i] for i in keep) for row in table.rows),
        prose=table.prose and last in keep,
    )
