"""Tables as data: the command line and the page draw the same ones."""

from __future__ import annotations

from collections.abc import Callable
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
    """The paper's tables, and the one it drew as bars; those without runs are left out.

    Args:
        results: The study.
        published: Whether it is the paper's own, so that the paper's numbers belong beside ours.
        published_rules: Whether the fuzzy controllers used the published code's rules.
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


_PRICE_COLUMNS = (
    "largest, m", "effort, rad/s²", "work, J", "step, µs", "p99, µs", "clearance, m", "collisions",
)  # fmt: skip


def _price(result: TrackResult) -> tuple[str, ...]:
    """Cells under ``_PRICE_COLUMNS``."""
    m = result.metrics
    return (
        _of(result, m.max_error, 4),
        _of(result, m.wheel_acceleration, 1),
        _of(result, m.work, 0),
        _number(m.step_time_median, 0),
        _number(m.step_time_p99, 0),
        _of(result, result.min_clearance, 3),
        _if_any(result.collisions),
    )


def _name(result: TrackResult | StepResult) -> str:
    """The controller, and when it stopped if it did so before the end."""
    run = result.run
    stopped = "" if run.outcome is Outcome.FINISHED else f" (stopped at {run.t[-1]:g} s)"
    return result.controller + stopped


def _of(result: TrackResult | StepResult, value: float, decimals: int) -> str:
    """A number about the whole run: none if the run stopped early."""
    return _number(value if result.run.outcome is Outcome.FINISHED else nan, decimals)


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if isfinite(value) else "–"


def _if_any(count: int) -> str:
    """A count; nothing for none, so that a column without any is left out."""
    return str(count) if count else ""


def _beside(published: bool, key: tuple[str, float, str]) -> tuple[str, str]:
    """The paper's ME and MAE for one of our rows, as it printed them."""
    row = PUBLISHED_ERRORS.get(key) if published else None
    return (f"{row.me:.4f}", f"{row.mae:.4f}") if row else ("", "")


def _tracking_table(results: StudyResults, published: bool) -> Table:
    rows = []
    for r in results.select("track"):
        m = r.metrics
        me, mae = _beside(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _name(r), _of(r, m.me, 4), me, _of(r, m.mae, 4), mae,
             _of(r, m.me_after_start, 4), _of(r, m.mae_after_start, 4), *_price(r))
        )  # fmt: skip
    return Table(
        "Tracking error without noise",
        ("time", "controller", "ME, m", "paper ME", "MAE, rad", "paper MAE",
         "ME after 2 s", "MAE after 2 s", *_PRICE_COLUMNS),
        tuple(rows),
        "ME: mean distance to the reference. MAE: mean |heading error|, wrapped. The robot starts "
        "from rest; where the reference does not, as the paper's, the first 2 s hold most of a "
        "good controller's mean.",
        keys=2,
    )  # fmt: skip


def _noise_table(results: StudyResults, published: bool) -> Table:
    repeated, rows = repeated_runs(results), []
    estimated = any(isfinite(r.run.position_sigma[-1]) for r in results.select("noise"))
    for r in () if repeated else results.select("noise"):
        m = r.metrics
        me, mae = _beside(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _name(r), _of(r, m.me_measured, 4), me,
             _of(r, m.mae_measured, 4), mae, _of(r, m.me, 4), _of(r, m.mae, 4), *_price(r))
        )  # fmt: skip
    for group in repeated:
        me, mae = _beside(published, ("noise", group.duration, group.controller))
        cells = [_mean(group, measure) for measure in ("me_measured", "mae_measured", "me", "mae")]
        rows.append(
            (f"{group.duration:g} s", _name_of_many(group), cells[0], me, cells[1], mae,
             *cells[2:], *_price_of_many(group))
        )  # fmt: skip
    return Table(
        "Tracking error with the paper's noise",
        ("time", "controller", "ME measured, m", "paper ME", "MAE measured, rad", "paper MAE",
         "ME true, m", "MAE true, rad", *_PRICE_COLUMNS),
        tuple(rows),
        (
            "Measured: against the estimate that controllers saw. True: against where the robot "
            "was."
            if estimated
            else "Measured: against the noisy pose, as the paper's author computed it. True: "
            "against where the robot was. The noise is biased, so no controller without an "
            "estimator can be right."
        )
        + (_OF_MANY.format(results.repeats) if repeated else ""),
        keys=2,
    )  # fmt: skip


_OF_MANY = (
    " Over {} seeds: mean ± half of its 95 % interval; the largest error and the least clearance "
    "are those of all runs."
)


def _name_of_many(group: RepeatedRuns) -> str:
    """The controller, and how many of its runs stopped before the end and count for nothing."""
    stopped = len(group.runs) - len(group.finished)
    return group.controller + (f" ({stopped} of {len(group.runs)} stopped)" if stopped else "")


def _mean(group: RepeatedRuns, measure: str) -> str:
    found = group.estimate_mean(measure)
    return f"{_number(found.mean, 5)} ± {_number(found.margin, 5)}"


def _price_of_many(group: RepeatedRuns) -> tuple[str, ...]:
    """Cells under ``_PRICE_COLUMNS``: the worst of distances, the mean of the others."""
    results = group.finished.values()

    def over(reduce: Callable[[Array], float], values: list[float], decimals: int) -> str:
        """The values in one number; a dash without any."""
        return _number(float(reduce(np.array(values))) if values else nan, decimals)

    metrics = [r.metrics for r in results]
    return (
        over(np.max, [m.max_error for m in metrics], 4),
        over(np.mean, [m.wheel_acceleration for m in metrics], 1),
        over(np.mean, [m.work for m in metrics], 0),
        over(np.mean, [m.step_time_median for m in metrics], 0),
        over(np.mean, [m.step_time_p99 for m in metrics], 0),
        over(np.min, [r.min_clearance for r in results], 3),
        _if_any(sum(r.collisions for r in group.runs.values())),
    )


def paired_table(results: StudyResults) -> Table:
    """Every two controllers under the same noise: by how much one is better, and is it sure."""
    found = paired_differences(results)
    order = {key: k for k, key in enumerate(dict.fromkeys(map(_pair, found)))}
    return Table(
        "Paired differences with noise",
        ("controllers", "time", "error", "mean difference", "95 % interval", "p", "seeds",
         "the first is"),
        tuple(_paired_row(d) for d in sorted(found, key=lambda d: order[_pair(d)])),
        "First minus second controller under the same random numbers, so negative where the first "
        "errs less. Intervals: Student's t on the differences, each by itself, not corrected for "
        "the number of pairs. p and verdict: its test, corrected for the number of pairs by Holm, "
        "for each error separately; no difference shown: p of 0.05 or more. Only seeds under "
        "which both reached the end count.",
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
        theirs = PUBLISHED_STEPS.get(r.controller) if published else None
        for i, (axis, ours) in enumerate(zip(STEP_AXES, r.responses, strict=True)):
            cells = [_of(r, ours[0], 2), _of(r, ours[1], 3), _of(r, ours[2], 3)]
            paper = [f"{v:.3f}" for v in theirs[i]] if theirs else [""] * 3
            pairs = [cell for pair in zip(cells, paper, strict=True) for cell in pair]
            rows.append((_name(r), axis, *pairs))
    return Table(
        "Step response",
        ("controller", "axis", "overshoot, %", "paper %", "rise 10-90 %, s", "paper rise",
         "settling ±10 %, s", "paper settling"),
        tuple(rows),
        "By the definitions of python-control's step_info, with the commanded value as final "
        "value. The reference jumps in x, y and heading at once.",
        keys=2,
    )  # fmt: skip


def _horizon_table(results: StudyResults) -> Table:
    rows = [
        (f"N = {r.horizon}", _of(r, r.metrics.me, 4), _of(r, r.metrics.mae, 4),
         str(r.metrics.fallbacks), _binding(r), *_price(r))
        for r in results.select("horizon")
    ]  # fmt: skip
    return Table(
        "NMPC by prediction horizon",
        ("horizon", "ME, m", "MAE, rad", "fallbacks", "limits bind, %", *_PRICE_COLUMNS),
        tuple(rows),
        "The paper drew these as bars without numbers. Fallbacks: steps without a converged "
        "solution. To the recommended NMPC the horizon matters only in steps in which a limit "
        "binds: in all others its terminal cost is what the rest of the way costs.",
    )  # fmt: skip


def _binding(result: TrackResult) -> str:
    """Share of the steps in which a limit held the plan back, of a controller that tells."""
    iterations = result.run.details.get("solver_iterations")
    return "–" if iterations is None else f"{100.0 * np.mean(iterations[:-1] > 0.0):.1f}"


def rule_table(*, published_rules: bool) -> Table:
    """The fuzzy rules in use, the paper's beside each that differs."""
    paper, ours = paper_rules(), code_rules() if published_rules else paper_rules()

    def cell(consequents: Array) -> str:
        """Labels of a rule's consequents."""
        return "/".join(LABELS[i] for i in consequents)

    rows = []
    for i, error in enumerate(LABELS):
        cells = [cell(ours[i, j]) for j in range(len(LABELS))]
        for j in np.flatnonzero((ours[i] != paper[i]).any(axis=1)).tolist():
            cells[j] += f" (paper {cell(paper[i, j])})"
        rows.append((error, *cells))
    return Table(
        "Fuzzy rules: change of kp/ki/kd",
        ("error \\ its change", *LABELS),
        tuple(rows),
        "N negative, P positive; B big, M medium, S small; ZO zero.",
    )


def _without_empty_columns(table: Table) -> Table:
    """Drop columns in which no row says anything."""
    keep = [
        i for i in range(len(table.columns)) if any(row[i] not in {"", "–"} for row in table.rows)
    ]
    return Table(
        table.title,
        tuple(table.columns[i] for i in keep),
        tuple(tuple(row[i] for i in keep) for row in table.rows),
        table.note,
        table.keys,
    )
