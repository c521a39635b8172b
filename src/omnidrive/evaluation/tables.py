"""Tables as data: the command line and the page draw the same ones."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, nan

import numpy as np

from omnidrive.control.pid.rules import LABELS, paper_rules
from omnidrive.control.pid.rules import published_rules as code_rules
from omnidrive.evaluation.published import PUBLISHED_ERRORS, PUBLISHED_STEPS
from omnidrive.evaluation.results import STEP_AXES, StepResult, StudyResults, TrackResult
from omnidrive.simulation import Outcome

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text, ready to draw.

    Attributes:
        title: What it shows.
        columns: Heading of each column, with its unit.
        rows: Cells, row by row.
        note: One sentence under the table; may be empty.
        keys: Leading columns that together name a row.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    keys: int = 1


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
        _step_table(results, published),
        _horizon_table(results),
    ]
    if any(r.controller.startswith("fuzzy") for r in results.runs):
        tables.append(rule_table(published_rules=published_rules))
    return [_without_empty_columns(table) for table in tables if table.rows]


_PRICE_COLUMNS = (
    "largest, m", "effort, rad/s²", "work, J", "step, µs", "p99, µs", "clearance, m",
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
        "from rest into a moving reference: the first 2 s hold most of a good controller's mean.",
        keys=2,
    )  # fmt: skip


def _noise_table(results: StudyResults, published: bool) -> Table:
    rows = []
    for r in results.select("noise"):
        m = r.metrics
        me, mae = _beside(published, (r.task, r.duration, r.controller))
        rows.append(
            (f"{r.duration:g} s", _name(r), _of(r, m.me_measured, 4), me,
             _of(r, m.mae_measured, 4), mae, _of(r, m.me, 4), _of(r, m.mae, 4), *_price(r))
        )  # fmt: skip
    return Table(
        "Tracking error with the paper's noise",
        ("time", "controller", "ME measured, m", "paper ME", "MAE measured, rad", "paper MAE",
         "ME true, m", "MAE true, rad", *_PRICE_COLUMNS),
        tuple(rows),
        "Measured: against the noisy pose, as the paper's author computed it. True: against where "
        "the robot was. The noise is biased, so no controller without an estimator can be right.",
        keys=2,
    )  # fmt: skip


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
         str(r.metrics.fallbacks), *_price(r))
        for r in results.select("horizon")
    ]  # fmt: skip
    return Table(
        "NMPC by prediction horizon",
        ("horizon", "ME, m", "MAE, rad", "fallbacks", *_PRICE_COLUMNS),
        tuple(rows),
        "The paper drew these as bars without numbers. Fallbacks: steps without a converged "
        "solution.",
    )  # fmt: skip


def rule_table(*, published_rules: bool) -> Table:
    """The fuzzy rules in use, the paper's beside each that differs."""
    paper, ours = paper_rules(), code_rules() if published_rules else paper_rules()

    def cell(consequents: Array) -> str:
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
