"""Tables of the results of each task, by controller."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np

from omnidrive.evaluation.measures.step_response import STEP_AXES
from omnidrive.evaluation.statistics.evidence import StudyEvidence, Summary
from omnidrive.evaluation.statistics.run_table import Task
from omnidrive.evaluation.study_logs import RecordedRun, StudyLogs
from omnidrive.evaluation.tables.published import PUBLISHED_ERRORS, PUBLISHED_STEPS
from omnidrive.evaluation.tables.table import NO_VALUE, Table, cell_text, number_text, percent
from omnidrive.simulation.disturbances import FAULTS


def result_tables(
    study: StudyEvidence, logs: StudyLogs | None = None, *, published: bool = False
) -> list[Table]:
    """Return one table per kind of task; tables without rows and empty columns are omitted.

    A cell is the value of a run; of several runs the mean over the repetitions ± half its 95 %
    interval, of the largest error and the clearance the worst value. Lengths are in mm and angles
    in mrad, with three significant digits. The best cell of each column is marked among the
    controllers of one task and duration.

    Args:
        study: The evidence.
        logs: Logs of the runs; None: they are not kept.
        published: Whether the scenario is the paper's, so that the published values are shown, too.
    """
    tables = [
        _tracking_table(study, logs, published),
        _noise_table(study, logs, published),
        _step_table(study, logs, published),
        _horizon_table(study, logs),
        _fault_table(study, logs),
    ]
    return [table.without_empty_columns() for table in tables if table.rows]


class _Cells:
    """Cells of one task: summaries of every controller by metric."""

    def __init__(self, study: StudyEvidence, task: Task, level: str = "") -> None:
        self._study, self._task, self._level = study, task, level
        self._found: dict[str, dict[str, Summary]] = {}

    def summary(self, metric: str, controller: str) -> Summary | None:
        """Return the summary of a metric of one controller; None: there is no value."""
        if metric not in self._found:
            self._found[metric] = self._summaries(metric)
        return self._found[metric].get(controller)

    def _summaries(self, metric: str) -> dict[str, Summary]:
        if metric not in {*self._study.runs.metrics, "finished"}:
            return {}
        if self._level:
            axis = "fault" if self._task.name == "faults" else "horizon"
            levels = self._study.along(metric, axis).get(self._task, [])
            every = [each.evidence for each in levels if each.level == self._level]
        else:
            every = [each for each in self._study.of(metric) if each.task == self._task]
        return {s.controller: s for evidence in every for s in evidence.summaries}

    def mean(self, metric: str, controller: str) -> str:
        """Return the mean ± half its interval; a dash without a finished run."""
        found = self.summary(metric, controller)
        return mean_cell(found) if found else NO_VALUE

    def worst(self, metric: str, controller: str) -> str:
        """Return the worst value of all runs; a dash without a valid one."""
        found = self.summary(metric, controller)
        return cell_text(found.measure.factor * found.worst) if found else NO_VALUE

    def count(self, metric: str, controller: str) -> str:
        """Return the mean of a number of steps."""
        found = self.summary(metric, controller)
        return f"{found.mean.mean:g}" if found and isfinite(found.mean.mean) else NO_VALUE

    def costs(self, controller: str) -> tuple[str, ...]:
        """Return the cells of ``_COST_COLUMNS``."""
        collisions = self.summary("collisions", controller)
        total = round(collisions.mean.mean * collisions.runs) if collisions else 0
        return (
            self.worst("max_error", controller),
            *(self.mean(name, controller) for name in _COSTS),
            self.worst("min_clearance", controller),
            str(total) if total else "",
        )

    def name(self, controller: str, logs: StudyLogs | None) -> str:
        """Return the label of a controller, with how many of its runs ended early, or when."""
        found = self.summary("finished", controller)
        if found is None or found.finished == found.runs:
            return controller
        if found.runs > 1:
            return f"{controller} ({found.runs - found.finished} of {found.runs} stopped)"
        run = _log_of(logs, self._task, controller)
        return f"{controller} (stopped{f' at {run.log.t[-1]:g} s' if run else ''})"


def mean_cell(summary: Summary) -> str:
    """Return the mean ± half its 95 % interval, if there is one."""
    mean, factor = summary.mean, summary.measure.factor
    if not isfinite(mean.margin) or mean.margin == 0.0:  # too few repetitions, or equal values
        return cell_text(factor * mean.mean)
    text, margin, _, _ = mean.text(factor)
    return f"{text.removeprefix('+')} ± {margin}"


def interval_note(rows: Sequence[Sequence[str]]) -> str:
    """Return the sentence on ± in the cells of a table; empty if there is none."""
    is_shown = any("±" in cell for row in rows for cell in row)
    return "Mean over the repetitions ± half its 95 % interval." if is_shown else ""


_COSTS = ("wheel_acceleration", "work", "step_time_median", "step_time_p99")
_COST_COLUMNS = (
    "max. error, mm", "effort, rad/s²", "work, J", "step time, µs", "p99, µs",
    "min. clearance, mm", "collisions",
)  # fmt: skip
_PATH_COLUMNS = ("path ME, mm", "path MAE, mrad", "arrival, s")
_LOW_COSTS = ("max. error, mm", "effort, rad/s²", "work, J", "step time, µs", "p99, µs")
_DETAILS = frozenset({"effort, rad/s²", "p99, µs", "min. clearance, mm"})
_WORST = (
    ("max. error, mm", "Maximum error: over all runs."),
    ("min. clearance, mm", "Minimum clearance: over all runs."),
)


def _tasks(study: StudyEvidence, name: str) -> list[tuple[Task, list[str], bool]]:
    """Return the tasks of a name with their controllers, and whether these have several runs."""
    found = []
    for each in study.of("finished"):
        if each.task.name == name:
            several = any(s.runs > 1 for s in each.summaries)
            found.append((each.task, [s.controller for s in each.summaries], several))
    return found


def _log_of(logs: StudyLogs | None, task: Task, controller: str) -> RecordedRun | None:
    """Return the run of a controller in a task whose log is kept; None: there is none."""
    every = logs.select(task.name, duration=task.duration) if logs else ()
    return next((each for each in every if each.controller == controller), None)


def _published_cells(published: bool, task: Task, controller: str) -> tuple[str, str]:
    """Return the published ME (mm) and MAE (mrad) of one row, or empty cells."""
    row = PUBLISHED_ERRORS.get((*task, controller)) if published else None
    return (number_text(1e3 * row.me), number_text(1e3 * row.mae)) if row else ("", "")


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


def _tracking_table(study: StudyEvidence, logs: StudyLogs | None, published: bool) -> Table:
    rows, late, several = [], logs.late_durations if logs else frozenset(), False
    for task, controllers, repeated in _tasks(study, "track"):
        cells, several = _Cells(study, task), several or repeated
        for name in controllers:
            me, mae = _published_cells(published, task, name)
            on_path = (cells.mean(metric, name) for metric in ("path_me", "path_mae", "arrival"))
            rows.append(
                (f"{task.duration:g} s", cells.name(name, logs),
                 cells.mean("me", name), me, cells.mean("mae", name), mae,
                 cells.mean("me_after_start", name), cells.mean("mae_after_start", name),
                 *(on_path if task.duration in late else ("", "", "")), *cells.costs(name))
            )  # fmt: skip
    return Table(
        "Tracking error without noise",
        ("time", "controller", "ME, mm", "paper ME, mm", "MAE, mrad", "paper MAE, mrad",
         "ME after 2 s, mm", "MAE after 2 s, mrad", *_PATH_COLUMNS, *_COST_COLUMNS),
        tuple(rows),
        interval_note(rows),
        definitions=(*_TRACKING_DEFINITIONS, *(_WORST if several else ())),
        keys=2,
        details=_DETAILS | {"MAE after 2 s, mrad"},
    ).mark_best(
        ("ME, mm", "MAE, mrad", "ME after 2 s, mm", "MAE after 2 s, mrad", *_PATH_COLUMNS[:2],
         *_LOW_COSTS),
        ("min. clearance, mm",), group=0,
    )  # fmt: skip


def _noise_table(study: StudyEvidence, logs: StudyLogs | None, published: bool) -> Table:
    rows, several = [], False
    for task, controllers, repeated in _tasks(study, "noise"):
        cells, several = _Cells(study, task), several or repeated
        for name in controllers:
            me, mae = _published_cells(published, task, name)
            rows.append(
                (f"{task.duration:g} s", cells.name(name, logs),
                 cells.mean("me_measured", name), me, cells.mean("mae_measured", name), mae,
                 cells.mean("me", name), cells.mean("mae", name), *cells.costs(name))
            )  # fmt: skip
    seeds = f" {study.runs.repeats} seeds." if study.runs.repeats > 1 else ""
    return Table(
        "Tracking error with the paper's noise",
        ("time", "controller", "ME measured, mm", "paper ME, mm", "MAE measured, mrad",
         "paper MAE, mrad", "ME true, mm", "MAE true, mrad", *_COST_COLUMNS),
        tuple(rows),
        interval_note(rows) + seeds,
        definitions=(
            ("ME measured, mm", _measured_note(logs)),
            ("ME true, mm", "True: error of the true pose."),
            *(_WORST if several else ()),
        ),
        keys=2,
        details=_DETAILS | {"MAE true, mrad"},
    ).mark_best(
        ("ME measured, mm", "MAE measured, mrad", "ME true, mm", "MAE true, mrad", *_LOW_COSTS),
        ("min. clearance, mm",), group=0,
    )  # fmt: skip


def _measured_note(logs: StudyLogs | None) -> str:
    """Return what the measured errors are errors of."""
    runs = logs.select("noise") if logs else ()
    if not runs:
        return "Measured: error of the pose that the controllers received."
    if any(isfinite(each.log.position_sigma[-1]) for each in runs):
        return "Measured: error of the estimated pose that the controllers received."
    return (
        "Measured: error of the noisy pose, as the paper's author computed it. The noise is "
        "biased; without an estimator, no controller can remove the resulting error."
    )


def _step_table(study: StudyEvidence, logs: StudyLogs | None, published: bool) -> Table:
    rows = []
    for task, controllers, _ in _tasks(study, "step"):
        cells = _Cells(study, task)
        for name in controllers:
            paper_responses = PUBLISHED_STEPS.get(name) if published else None
            for i, axis in enumerate(STEP_AXES):
                own = [cells.mean(f"{each}_{axis}", name) for each in _RESPONSE]
                paper = (
                    [number_text(v) for v in paper_responses[i]] if paper_responses else [""] * 3
                )
                pairs = [cell for pair in zip(own, paper, strict=True) for cell in pair]
                rows.append((cells.name(name, logs), axis, *pairs))
    return Table(
        "Step response",
        ("controller", "axis", "overshoot, %", "paper overshoot, %", "rise 10-90 %, s",
         "paper rise, s", "settling ±10 %, s", "paper settling, s"),
        tuple(rows),
        "Definitions of python-control's step_info, with the commanded value as final value. The "
        f"reference steps in x, y and heading at the same time. {interval_note(rows)}".rstrip(),
        keys=2,
    ).mark_best(("overshoot, %", "rise 10-90 %, s", "settling ±10 %, s"), group=1)  # fmt: skip


_RESPONSE = ("overshoot", "rise_time", "settling_time")


def _horizon_table(study: StudyEvidence, logs: StudyLogs | None) -> Table:
    rows = []
    for task, controllers, _ in _tasks(study, "horizon"):
        for level in _levels(study, task):
            cells = _Cells(study, task, level)
            for name in controllers:
                if cells.summary("finished", name):
                    rows.append(
                        (level, cells.mean("me", name), cells.mean("mae", name),
                         cells.count("fallbacks", name), _active_share(logs, task, level),
                         *cells.costs(name))
                    )  # fmt: skip
    return Table(
        "NMPC by prediction horizon",
        ("horizon", "ME, mm", "MAE, mrad", "fallbacks", "active limits, %", *_COST_COLUMNS),
        tuple(rows),
        f"The paper shows these results only as bars. {interval_note(rows)}".rstrip(),
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


def _levels(study: StudyEvidence, task: Task) -> list[str]:
    """Return the horizons or faults of a task, in the order of its runs."""
    runs = study.runs
    variants = runs.table["variant"].to_pylist()
    return list(
        dict.fromkeys(variants[k] for k in np.flatnonzero(runs.task == runs.tasks.index(task)))
    )


def _active_share(logs: StudyLogs | None, task: Task, level: str) -> str:
    """Return the share of steps with an active limit; a dash if the controller does not log it."""
    every = logs.select(task.name, duration=task.duration) if logs else ()
    run = next((each for each in every if each.record.variant == level), None)
    iterations = run.log.details.get("solver_iterations") if run else None
    if iterations is None:
        return NO_VALUE
    return number_text(100.0 * float(np.mean(iterations[:-1] > 0.0)))


def _fault_table(study: StudyEvidence, logs: StudyLogs | None) -> Table:
    rows = []
    for task, controllers, _ in _tasks(study, "faults"):
        for level in _levels(study, task)[1:] if "recovered" in study.runs.metrics else ():
            cells = _Cells(study, task, level)
            for name in controllers:
                found = cells.summary("recovered", name)
                if found is None:
                    continue
                run = _fault_log(logs, task, level, name)
                rows.append(
                    (_fault_text(logs, level), name, _recovered(found, run),
                     cells.worst("worst_error", name), cells.mean("time_to_recover", name),
                     cells.mean("me", name), _first_detection(run))
                )  # fmt: skip
    is_stopped = any(row[2].startswith("stopped") for row in rows)
    return Table(
        "Disturbances and faults",
        ("fault", "controller", "recovered", "max. error, mm", "time to recover, s", "ME, mm",
         "first detection"),
        tuple(rows),
        f"{interval_note(rows)}{' Stopped: by the watchdog.' if is_stopped else ''}".strip(),
        definitions=(
            (
                "recovered",
                "Recovered: from some time until the end, the position error exceeds that of the "
                "same controller without the fault by at most 0.05 m.",
            ),
            (
                "time to recover, s",
                "Time to recover: from the start of the fault; 0: this limit was never exceeded.",
            ),
            (
                "first detection",
                "First detection: the first event that the watchdog or the wheel monitor reported.",
            ),
        ),
        keys=2,
        prose=True,
    ).mark_best(("max. error, mm", "time to recover, s", "ME, mm"), group=0)  # fmt: skip


def _fault_log(
    logs: StudyLogs | None, task: Task, level: str, controller: str
) -> RecordedRun | None:
    every = logs.select(task.name, duration=task.duration) if logs else ()
    return next((e for e in every if (e.record.variant, e.controller) == (level, controller)), None)


def _fault_text(logs: StudyLogs | None, level: str) -> str:
    """Return number and kind of a fault, and if known its start and its wheel."""
    number, _, kind = level.partition("-")
    fault = logs.faults.get(level) if logs else None
    if fault is None:
        return f"{int(number)} {kind}"
    wheel = getattr(fault, "wheel", None)
    return f"{int(number)} {kind} at {fault.at:g} s" + ("" if wheel is None else f", wheel {wheel}")


def _recovered(summary: Summary, run: RecordedRun | None) -> str:
    """Return whether the robot recovered; of several runs the share."""
    if summary.runs > 1:
        return percent(summary.mean.mean)
    if summary.mean.mean == 1.0:
        return "yes"
    if run is None or run.record.finished:
        return "no"
    ending = "stopped" if run.record.outcome == "stopped" else "failed"
    return f"{ending} at {run.log.t[-1]:g} s"


def _first_detection(run: RecordedRun | None) -> str:
    """Return the first event that the supervision reported, with its time."""
    scheduled = {f"{kind} {change}" for kind in FAULTS for change in ("begins", "ends")}
    detected = [e for e in run.log.events if e.what not in scheduled] if run else []
    return f"{detected[0].t:.2f} s: {detected[0].what}" if detected else ""
