"""Records of runs: what of a result is stored, with the labels of its planned run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from omnidrive.evaluation import Metrics, Recovery, StepResponse, StepResult, TrackResult
from omnidrive.evaluation.step_response import STEP_AXES
from omnidrive.scenario.run_settings import faults_of
from omnidrive.scenario.run_simulation import Result
from omnidrive.simulation import Outcome
from omnidrive.study.planned_run import PlannedRun
from omnidrive.study.run_record import MAX_DETAIL, TIMING, Factor, RunRecord

_FINISHED = Outcome.FINISHED.name.lower()

REFUSED = "refused"
"""Outcome of a run that its scenario does not allow."""


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
        variant=_variant(run),
        repeat=run.settings.repeat,
    )


def record_of(run: PlannedRun, result: Result, recovery: Recovery | None = None) -> RunRecord:
    """Return the record of a simulated run.

    Args:
        run: The planned run.
        result: Its result.
        recovery: Recovery from the fault; None: a run without a fault.
    """
    log = result.run
    metrics, timing = _metrics(result)
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
        variant=_variant(run),
        repeat=run.settings.repeat,
    )


def _metrics(result: Result) -> tuple[dict[str, float], dict[str, float]]:
    """Return the reproducible metrics of a result, and its computing times."""
    if isinstance(result, StepResult):
        return step_values(result.responses), {}
    clearance = result.min_clearance if isinstance(result, TrackResult) else None
    return tracking_values(result.metrics, int(result.run.collisions[-1]), clearance)


def step_values(responses: Sequence[StepResponse]) -> dict[str, float]:
    """Return the metrics of a step response by name."""
    return {
        f"{name}_{axis}": value
        for axis, response in zip(STEP_AXES, responses, strict=True)
        for name, value in response._asdict().items()
    }


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


def _variant(run: PlannedRun) -> str:
    """Return the horizon or the fault of a run, in tasks that vary them."""
    settings = run.settings
    if settings.task == "horizon":
        return f"N = {settings.horizon}"
    if settings.task != "faults":
        return ""
    faults = (None, *faults_of(run.scenario))
    fault = faults[settings.fault] if settings.fault < len(faults) else None
    return f"{settings.fault:02d}-{fault.kind if fault else 'none'}"


def _factors(run: PlannedRun) -> dict[str, Factor]:
    """Return the values of the factors for tables."""
    return {
        path: value if value is None or isinstance(value, float | int | str) else str(value)
        for path, value in run.factors.items()
    }
