"""Run folder of a drive in real time, with the files that simulations have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from omnidrive.deploy.drive import DriveResult
from omnidrive.evaluation import RecordedRun, Table
from omnidrive.evaluation.figures.catalogue import Drawing
from omnidrive.evaluation.statistics.run_table import tables_of
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.study.computation.run_recording import record_of
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.design.run_plan import RunPlan
from omnidrive.study.folder import RunFolder
from omnidrive.study.results_data import save_results
from omnidrive.study.study import Study, study_logs

_ESTIMATED = (
    "The true pose of a robot is not known: poses, speeds and errors are those of the estimate."
)
_CAPTION = (
    "Time from the deadline of each sample to its begin (jitter), and from there until its command "
    "is sent. A sample whose command is sent later than the sample time after its deadline is a "
    "miss; the samples in between are skipped."
)


def save_drive(
    result: DriveResult,
    planned: PlannedScenario,
    link: str,
    folder: RunFolder,
    figures: Sequence[str] = ("svg",),
) -> Path:
    """Write time series, results, figures, tables and report of a drive; return the report.

    Args:
        result: The drive.
        planned: Its scenario, with one controller and the task ``track`` with one duration.
        link: Name of the link.
        folder: The folder, which holds the inputs.
        figures: Formats of the figures: some of svg, pdf and png, or none.

    Raises:
        CannotWrite: A file cannot be written.
    """
    scenario = planned.scenario
    definition = StudyDefinition.from_scenario(scenario, series="all")
    (run,) = RunPlan(definition)
    record = record_of(run, planned, result.run)
    logs = study_logs(planned, [RecordedRun(record, result.run)])
    study = Study(None, definition, "", *tables_of([record]), planned=planned)
    study.logs = replace(logs, plant=f"robot over the link {link}, in real time")
    title = f"{scenario.name}: drive over the link {link}"
    study.facts = StudyFacts(title, types=logs.types)
    folder.save_series(record.name, result.run)
    figures_of_drive = {"punctuality": _punctuality(result, scenario.sample_time)}
    *_, page = study.report.write(
        folder.path, formats=figures, figures=figures_of_drive, tables=drive_tables(result)
    )
    save_results(study, folder.path, drive=_drive_data(result, link))
    return page


def drive_tables(result: DriveResult) -> list[Table]:
    """Return the history of the state, and the punctuality of the loop."""
    changes = tuple(
        (f"{change.t:.3f}", change.state.value, change.reason) for change in result.changes
    )
    timing = result.timing.summary()
    rows = (
        ("samples", f"{timing.samples}", "1"),
        ("missed deadlines", f"{timing.misses}", "1"),
        ("share of missed deadlines", f"{100.0 * timing.miss_share:.3g}", "%"),
        ("skipped samples", f"{timing.skipped}", "1"),
        ("jitter, median", f"{1e6 * timing.jitter_median:.0f}", "us"),
        ("jitter, 99th percentile", f"{1e6 * timing.jitter_p99:.0f}", "us"),
        ("jitter, largest", f"{1e6 * timing.jitter_max:.0f}", "us"),
        ("until the command is sent, median", f"{1e6 * timing.busy_median:.0f}", "us"),
        ("until the command is sent, 99th percentile", f"{1e6 * timing.busy_p99:.0f}", "us"),
        ("commands scaled down to the limits", f"{result.limited}", "1"),
        *((measure.name, measure.refusal or "yes", "") for measure in result.measures),
    )
    return [
        Table("States", ("t, s", "state", "reason"), changes, note=_ESTIMATED, prose=True),
        Table("Punctuality", ("quantity", "value", "unit"), rows),
    ]


def _punctuality(result: DriveResult, dt: float) -> Drawing:
    """Return the figure of the punctuality."""

    def draw() -> Figure:
        """Draw it."""
        from omnidrive.evaluation.figures.punctuality import (  # noqa: PLC0415 - takes a second
            punctuality_figure,
        )

        return punctuality_figure(result.timing.lateness, result.timing.busy, dt)

    return Drawing(draw, "Punctuality of the loop", _CAPTION)


def _drive_data(result: DriveResult, link: str) -> dict[str, object]:
    """Return the entry ``drive`` of results.json."""
    return {
        "link": link,
        "finished": result.finished,
        "ending": result.ending,
        "changes": [
            {"t": each.t, "state": each.state.value, "reason": each.reason}
            for each in result.changes
        ],
        "timing": result.timing.summary()._asdict(),
        "measures": {each.name: each.refusal or "yes" for each in result.measures},
        "limited": result.limited,
    }
