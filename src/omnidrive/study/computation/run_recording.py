"""Records of runs: what of a result is stored, with the labels of its planned run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from omnidrive.evaluation import Metrics, Recovery, StepResponse, measure, step_response
from omnidrive.evaluation.measures.metrics import step_time_percentiles
from omnidrive.evaluation.measures.step_response import STEP_AXES
from omnidrive.evaluation.run_record import MAX_DETAIL, TIMING, Factor, RunRecord
from omnidrive.evaluation.statistics.run_table import REFUSED
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.run_settings import task_variant
from omnidrive.scenario.run_simulation import reference_of
from omnidrive.simulation import Outcome, Run
from omnidrive.study.design.planned_run import PlannedRun

_FINISHED = Outcome.FINISHED.name.lower()


def relabelled(record: RunRecord, run: PlannedRun) -> RunRecord:
    """Return a result for another planned run with the same key."""
    return replace(
        record,
        number=run.number,
        pairing=run.pairing,
        controller=run.settings.controller,
        task=run.settings.task,
        repetition=run.repetition,
        factors=_factors(run),
        duration=run.settings.duration,
        variant=task_variant(run.scenario, run.settings),
        repeat=run.settings.repeat,
    )


def record_of(
    run: PlannedRun, planned: PlannedScenario, log: Run, recovery: Recovery | None = None
) -> RunRecord:
    """Evaluate the log of a run.

    Args:
        run: The planned run.
        planned: Its planned scenario.
        log: Its log.
        recovery: Recovery from the fault; None: a run without a fault.
    """
    metrics, timing = _metrics(run, planned, log)
    if recovery is not None:
        metrics |= {
            "recovered": float(recovery.recovered),
            "time_to_recover": recovery.time_to_recover,
            "worst_error": recovery.max_error,
        }
    finished = log.outcome is Outcome.FINISHED
    reason = "" if finished else f"at {log.t[-1]:g} s: {log.ending}"
    detail = "\n".join(each for each in (reason, log.traceback) if each)
    return _labelled(run, log.outcome.name.lower(), metrics, timing, detail)


def finished_record(
    run: PlannedRun, metrics: dict[str, float], timing: dict[str, float]
) -> RunRecord:
    """Return the record of a run that reached the end of its reference."""
    return _labelled(run, _FINISHED, metrics, timing, "")


def lost_record(run: PlannedRun, outcome: Outcome, reason: str) -> RunRecord:
    """Return the record of a run whose log is lost."""
    return _labelled(run, outcome.name.lower(), {}, {}, f"{outcome.value}: {reason}")


def refused_record(run: PlannedRun, reason: str) -> RunRecord:
    """Return the record of a run that cannot be simulated, with the outcome ``refused``."""
    return _labelled(run, REFUSED, {}, {}, reason)


def _labelled(
    run: PlannedRun, outcome: str, metrics: dict[str, float], timing: dict[str, float], detail: str
) -> RunRecord:
    """Return a record with the labels of a planned run."""
    return RunRecord(
        number=run.number,
        key=run.key,
        pairing=run.pairing,
        controller=run.settings.controller,
        task=run.settings.task,
        repetition=run.repetition,
        factors=_factors(run),
        outcome=outcome,
        finished=outcome == _FINISHED,
        metrics=metrics,
        timing=timing,
        detail=detail[:MAX_DETAIL],
        duration=run.settings.duration,
        variant=task_variant(run.scenario, run.settings),
        repeat=run.settings.repeat,
    )


def _metrics(
    run: PlannedRun, planned: PlannedScenario, log: Run
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the reproducible metrics of a run, and its computing times."""
    settings = run.settings
    if settings.task == "step":
        start, goal = planned.start, reference_of(planned, settings).at(0.0).pose
        responses = [
            step_response(log.t, log.pose[:, i], start[i], goal[i]) for i in range(len(goal))
        ]
        timing = zip(TIMING, step_time_percentiles(log), strict=True)
        return step_values(responses, float(log.work[-1])), dict(timing)
    clearance = planned.clearance(log.pose) if settings.task != "faults" else None
    metrics = measure(log, planned.robot.drive)
    return tracking_values(metrics, int(log.collisions[-1]), clearance)


def step_values(responses: Sequence[StepResponse], work: float) -> dict[str, float]:
    """Return the metrics of a step response by name.

    Args:
        responses: Responses of x, y and heading.
        work: Work of the motors, J; NaN: unknown.
    """
    return {
        f"{name}_{axis}": value
        for axis, response in zip(STEP_AXES, responses, strict=True)
        for name, value in response._asdict().items()
    } | {"work": work}


def tracking_values(
    metrics: Metrics, collisions: int, clearance: float | None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the reproducible metrics of a run along a path, and its computing times.

    Args:
        metrics: Metrics of the run.
        collisions: Number of its collisions.
        clearance: Minimum distance to obstacles, m; None: not computed in this task.
    """
    values = {name: float(value) for name, value in metrics._asdict().items()}
    timing = {name: values.pop(name) for name in TIMING}
    if clearance is not None:
        values["min_clearance"] = clearance
    return values | {"collisions": float(collisions)}, timing


def _factors(run: PlannedRun) -> dict[str, Factor]:
    """Return the values of the factors for tables."""
    return {
        path: value if value is None or isinstance(value, float | int | str) else str(value)
        for path, value in run.factors.items()
    }
