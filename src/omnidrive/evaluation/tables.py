"""Result tables, shared by the command line and the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite, nan

import numpy as np

from omnidrive.arrays import Array
from omnidrive.evaluation.drive_table import drive_table
from omnidrive.evaluation.fault_table import fault_table
from omnidrive.evaluation.mean_test import needed_differences
from omnidrive.evaluation.paired import (
    MEASURE_LABELS,
    MEASURES,
    PairedDifference,
    RepeatedRuns,
    needed_seeds,
    paired_differences,
    repeated_runs,
)
from omnidrive.evaluation.published import PUBLISHED_ERRORS, PUBLISHED_STEPS
from omnidrive.evaluation.results import StepResult, StudyResults, TrackResult
from omnidrive.evaluation.rule_tables import rule_tables
from omnidrive.evaluation.step_response import STEP_AXES
from omnidrive.evaluation.table import NO_VALUE, Table, cell_text, number_text
from omnidrive.evaluation.uncertainty import p_text
from omnidrive.evaluation.verdict import limit_notes, verdicts
from omnidrive.evaluation.verdict_table import verdict_table
from omnidrive.simulation import Outcome


def study_tables(results: StudyResults, *, published: bool) -> list[Table]:
    """Return the tables of a study, the verdict first.

    Tables without rows and columns without values are omitted. Lengths are in mm and angles in
    mrad, with three significant digits. The best cell of each column is marked among the
    controllers of one task and duration.

    Args:
        results: Results of the study.
        published: Whether the scenario is the paper's, so that the published values are shown, too.
    """
    tables = [
        verdict_table(verdicts(results), limit_notes(results)),
        _tracking_table(results, published),
        _noise_table(results, published),
        paired_table(results),
        _step_table(results, published),
        _horizon_table(results),
        fault_table(results),
        drive_table(results),
        _ended_table(results),
        _controller_table(results),
        *rule_tables(results.fuzzy_systems),
    ]
    return [_without_empty_columns(table) for table in tables if table.rows]


_COST_COLUMNS = (
    "max. error, mm", "effort, rad/s²", "work, J", "step time, µs", "p99, µs",
    "min. clearance, mm", "collisions",
)  # fmt: skip
_PATH_COLUMNS = ("path ME, mm", "path MAE, mrad", "arrival, s")
_LOW_COSTS = ("max. error, mm", "effort, rad/s²", "work, J", "step time, µs", "p99, µs")
_DETAILS = frozenset({"effort, rad/s²", "p99, µs", "min. clearance, mm"})


def _cost_cells(result: TrackResult) -> tuple[str, ...]:
    """Return the cells of ``_COST_COLUMNS`` for one run."""
    m = result.metrics
    return (
        _cell(result, m.max_error, 1e3),
        _cell(result, m.wheel_acceleration),
        _cell(result, m.work),
        _cell(result, m.step_time_median),
        _cell(result, m.step_time_p99),
        _cell(result, result.min_clearance, 1e3),
        _count_text(result.collisions),
    )


def _run_name(result: TrackResult | StepResult) -> str:
    """Return the name of the controller, with the time of an early stop."""
    run = result.run
    stopped = "" if run.outcome is Outcome.FINISHED else f" (stopped at {run.t[-1]:g} s)"
    return result.controller + stopped


def _cell(result: TrackResult | StepResult, value: float, factor: float = 1.0) -> str:
    """Format a value of a whole run, times ``factor``; a dash if the run stopped early."""
    return cell_text(factor * value) if result.run.outcome is Outcome.FINISHED else NO_VALUE


def _count_text(count: int) -> str:
    """Format a count; 0 becomes empty, so that a column of zeros is omitted."""
    return str(count) if count else ""


def _published_cells(published: bool, key: tuple[str, float, str]) -> tuple[str, str]:
    """Return the published ME (mm) and MAE (mrad) of one row, or empty cells."""
    row = PUBLISHED_ERRORS.get(key) if published else None
    return (number_text(1e3 * row.me), number_text(1e3 * row.mae)) if row else ("", "")


def _path_cells(result: TrackResult, shown: bool) -> tuple[str, ...]:
    """Return the cells of ``_PATH_COLUMNS``; empty unless some run is late on purpose."""
    m = result.metrics
    values = ((m.path_me, 1e3), (m.path_mae, 1e3), (m.arrival, 1.0))
    return tuple(_cell(result, *each) if shown else "" for each in values)


_TRACKING_DEFINITIONS = (
    ("ME, mm", "ME: mean distance to the reference."),
    ("MAE, mrad", "MAE: mean absolute heading error, wrapped."),
    (
        "ME after 2 s, mm",
        "The robot starts from rest. If the reference starts with a nonzero speed, as in the "
        "paper, the first 2 s cause most of the mean error of an accurate controller.",
    ),
    (
        "path ME, mm",
        "Path ME and MAE: at the nearest point of the path of a reference that is too fast.",
    ),
    ("arrival, s", "Arrival: within 0.05 m of its end."),
)


def _tracking_table(results: StudyResults, published: bool) -> Table:
    rows = []
    late = {r.duration for r in results.select("track") if r.is_late}
    for r in results.select("track"):
        m = r.metrics
        me, mae = _published_cells(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _run_name(r), _cell(r, m.me, 1e3), me, _cell(r, m.mae, 1e3), mae,
             _cell(r, m.me_after_start, 1e3), _cell(r, m.mae_after_start, 1e3),
             *_path_cells(r, r.duration in late), *_cost_cells(r))
        )  # fmt: skip
    return Table(
        "Tracking error without noise",
        ("time", "controller", "ME, mm", "paper ME, mm", "MAE, mrad", "paper MAE, mrad",
         "ME after 2 s, mm", "MAE after 2 s, mrad", *_PATH_COLUMNS, *_COST_COLUMNS),
        tuple(rows),
        definitions=_TRACKING_DEFINITIONS,
        keys=2,
        details=_DETAILS | {"MAE after 2 s, mrad"},
    ).mark_best(
        ("ME, mm", "MAE, mrad", "ME after 2 s, mm", "MAE after 2 s, mrad", *_PATH_COLUMNS[:2],
         *_LOW_COSTS),
        ("min. clearance, mm",), group=0,
    )  # fmt: skip


def _noise_table(results: StudyResults, published: bool) -> Table:
    repeated, rows = repeated_runs(results), []
    estimated = any(isfinite(r.run.position_sigma[-1]) for r in results.select("noise"))
    for r in () if repeated else results.select("noise"):
        m = r.metrics
        me, mae = _published_cells(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _run_name(r), _cell(r, m.me_measured, 1e3), me,
             _cell(r, m.mae_measured, 1e3), mae, _cell(r, m.me, 1e3), _cell(r, m.mae, 1e3),
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
        ("time", "controller", "ME measured, mm", "paper ME, mm", "MAE measured, mrad",
         "paper MAE, mrad", "ME true, mm", "MAE true, mrad", *_COST_COLUMNS),
        tuple(rows),
        _SEEDS_NOTE.format(results.repeats) if repeated else "",
        definitions=(
            ("ME measured, mm", _MEASURED_ESTIMATE if estimated else _MEASURED_NOISE),
            ("ME true, mm", "True: error of the true pose."),
            *(_SEEDS_DEFINITIONS if repeated else ()),
        ),
        keys=2,
        details=_DETAILS | {"MAE true, mrad"},
    ).mark_best(
        ("ME measured, mm", "MAE measured, mrad", "ME true, mm", "MAE true, mrad", *_LOW_COSTS),
        ("min. clearance, mm",), group=0,
    )  # fmt: skip


_MEASURED_ESTIMATE = "Measured: error of the estimated pose that the controllers received."
_MEASURED_NOISE = (
    "Measured: error of the noisy pose, as the paper's author computed it. The noise is biased; "
    "without an estimator, no controller can remove the resulting error."
)
_SEEDS_NOTE = "Over {} seeds: mean ± half the width of its 95 % confidence interval."
_SEEDS_DEFINITIONS = (
    ("max. error, mm", "Maximum error: over all runs."),
    ("min. clearance, mm", "Minimum clearance: over all runs."),
)


def _repeated_name(group: RepeatedRuns) -> str:
    """Return the name of the controller, with the number of excluded runs that stopped early."""
    stopped = len(group.runs) - len(group.finished)
    return group.controller + (f" ({stopped} of {len(group.runs)} stopped)" if stopped else "")


def _mean(group: RepeatedRuns, measure: str) -> str:
    """Format the mean in mm or mrad and half the width of its confidence interval."""
    estimate = group.estimate_mean(measure)
    if not isfinite(estimate.margin):
        return number_text(1e3 * estimate.mean)
    mean, margin, _, _ = estimate.text(1e3)
    return f"{mean.removeprefix('+')} ± {margin}"


def _mean_cost_cells(group: RepeatedRuns) -> tuple[str, ...]:
    """Return the cells of ``_COST_COLUMNS``: extremes of the distances, means of the others."""
    results = group.finished.values()

    def reduced(reduce: Callable[[Array], float], values: list[float]) -> str:
        """Format the reduced values; a dash if there are none."""
        return cell_text(float(reduce(np.array(values))) if values else nan)

    metrics = [r.metrics for r in results]
    return (
        reduced(np.max, [1e3 * m.max_error for m in metrics]),
        reduced(np.mean, [m.wheel_acceleration for m in metrics]),
        reduced(np.mean, [m.work for m in metrics]),
        reduced(np.mean, [m.step_time_median for m in metrics]),
        reduced(np.mean, [m.step_time_p99 for m in metrics]),
        reduced(np.min, [1e3 * r.min_clearance for r in results]),
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
        "negative if the first is more accurate. Intervals: of each pair by itself. p and "
        "result: Holm-corrected for the number of pairs, separately for each error, so that an "
        "interval without 0 may stand beside “no difference shown” (p >= 0.05). "
        f"{_min_seeds(differences)}Only seeds for which both runs finished count.",
        keys=3,
        is_detail=True,
    )  # fmt: skip


def _min_seeds(differences: Sequence[PairedDifference]) -> str:
    """Return the sentence on the least numbers of seeds; empty without differences."""
    if not differences:
        return ""
    alone, needed = needed_differences(1), needed_seeds(differences)
    if needed == alone:
        return f"Fewer than {alone} seeds show no difference and have no interval. "
    return (
        f"Fewer than {alone} seeds have no interval, and fewer than {needed} show no difference "
        "between this number of controllers. "
    )


def _pair(difference: PairedDifference) -> tuple[float, str, str]:
    return difference.duration, difference.first, difference.second


def _paired_row(d: PairedDifference) -> tuple[str, ...]:
    mean, _, low, high = d.difference.text(1e3)
    return (
        f"{d.first} − {d.second}",
        f"{d.duration:g} s",
        f"{MEASURE_LABELS[d.measure]}, m{MEASURES[d.measure]}",
        mean,
        f"{low} to {high}" if isfinite(d.difference.margin) else NO_VALUE,
        p_text(d.p).removeprefix("= "),
        str(d.difference.sample_size),
        d.verdict,
    )


def _step_table(results: StudyResults, published: bool) -> Table:
    rows = []
    for r in results.steps:
        paper_responses = PUBLISHED_STEPS.get(r.controller) if published else None
        for i, (axis, response) in enumerate(zip(STEP_AXES, r.responses, strict=True)):
            cells = [_cell(r, value) for value in response]
            paper = [number_text(v) for v in paper_responses[i]] if paper_responses else [""] * 3
            pairs = [cell for pair in zip(cells, paper, strict=True) for cell in pair]
            rows.append((_run_name(r), axis, *pairs))
    return Table(
        "Step response",
        ("controller", "axis", "overshoot, %", "paper overshoot, %", "rise 10-90 %, s",
         "paper rise, s", "settling ±10 %, s", "paper settling, s"),
        tuple(rows),
        "Definitions of python-control's step_info, with the commanded value as final value. The "
        "reference steps in x, y and heading at the same time.",
        keys=2,
    ).mark_best(("overshoot, %", "rise 10-90 %, s", "settling ±10 %, s"), group=1)  # fmt: skip


def _horizon_table(results: StudyResults) -> Table:
    rows = [
        (f"N = {r.horizon}", _cell(r, r.metrics.me, 1e3), _cell(r, r.metrics.mae, 1e3),
         str(r.metrics.fallbacks), _active_share(r), *_cost_cells(r))
        for r in results.select("horizon")
    ]  # fmt: skip
    return Table(
        "NMPC by prediction horizon",
        ("horizon", "ME, mm", "MAE, mrad", "fallbacks", "active limits, %", *_COST_COLUMNS),
        tuple(rows),
        "The paper shows these results only as bars.",
        definitions=(
            ("fallbacks", "Fallbacks: steps without a converged solution."),
            (
                "active limits, %",
                "Active limits: share of the steps with an active inequality constraint. Only in "
                "these steps does the horizon affect the holonomic NMPC: otherwise its terminal "
                "cost equals the cost of the remaining path.",
            ),
        ),
        details=_DETAILS,
    ).mark_best(("ME, mm", "MAE, mrad", *_LOW_COSTS), ("min. clearance, mm",))  # fmt: skip


def _active_share(result: TrackResult) -> str:
    """Return the share of steps with an active limit; a dash if the controller does not log it."""
    iterations = result.run.details.get("solver_iterations")
    if iterations is None:
        return NO_VALUE
    return number_text(100.0 * float(np.mean(iterations[:-1] > 0.0)))


def _ended_table(results: StudyResults) -> Table:
    """Return time and reason of the end of every run that did not finish."""
    ended = [r for r in (*results.runs, *results.faults) if r.run.outcome is not Outcome.FINISHED]
    rows = [(r.name, f"{r.run.t[-1]:g}", r.run.ending) for r in ended]
    columns = ("run", "end, s", "reason")
    return Table("Runs that ended early", columns, tuple(rows), prose=True, is_detail=True)


def _controller_table(results: StudyResults) -> Table:
    rows = [
        (label, kind.name, kind.parameters or "defaults", kind.description)
        for label, kind in results.types.items()
    ]
    return Table(
        "Controllers", ("controller", "type", "parameters", "description"), tuple(rows),
        keys=4, is_detail=True,
    )  # fmt: skip


def _without_empty_columns(table: Table) -> Table:
    """Return the table without the columns whose cells are all empty or dashes."""
    last = len(table.columns) - 1
    keep = [i for i in range(last + 1) if any(row[i] not in {"", NO_VALUE} for row in table.rows)]
    return table.select(keep)
