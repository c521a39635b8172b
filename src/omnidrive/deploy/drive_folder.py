"""Run folder of a drive in real time, with the files that simulations have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from omnidrive.deploy.drive import DriveResult
from omnidrive.evaluation import Table, study_tables, write_figures, write_page, write_tables
from omnidrive.evaluation.page import PageFigure
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.run_settings import settings_of_runs
from omnidrive.scenario.run_simulation import evaluate
from omnidrive.study.folder import RunFolder
from omnidrive.study.output_paths import REPORT_FILE
from omnidrive.study.scenario_execution import collect_results

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
    figures: Sequence[str] = ("svg", "pdf"),
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
    (settings,) = settings_of_runs(planned.scenario)
    done = evaluate(planned, settings, result.run)
    results = replace(
        collect_results(planned, [settings], {settings: done}),
        title=f"{planned.scenario.name}: drive over the link {link}",
        plant=f"robot over the link {link}, in real time",
    )
    tables = [*drive_tables(result), *study_tables(results, published=False)]
    folder.save_series(done.name, result.run)
    shown = []
    if figures:
        list(write_figures(results, folder.path / "figures", figures))
        dt = planned.scenario.sample_time
        shown = [_punctuality(result, dt, folder.path / "figures", figures)]
    list(write_tables(tables, folder.path / "tables"))
    folder.save_results(planned, results, {}, _drive_data(result, link))
    write_page(results, tables, folder.path / REPORT_FILE, shown)
    return folder.path / REPORT_FILE


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


def _punctuality(
    result: DriveResult, dt: float, folder: Path, formats: Sequence[str]
) -> PageFigure:
    """Write the figure of the punctuality; return it for the report."""
    from omnidrive.evaluation.figures.punctuality import (  # noqa: PLC0415 - takes a second
        punctuality_figure,
    )
    from omnidrive.evaluation.figures.style import save  # noqa: PLC0415

    figure = punctuality_figure(result.timing.lateness, result.timing.busy, dt)
    path = folder / "punctuality.svg"
    save(figure, path)
    shown = PageFigure("Punctuality of the loop", _CAPTION, path.read_bytes())
    if "svg" not in formats:
        path.unlink()
    for suffix in set(formats) - {"svg"}:
        save(figure, path.with_suffix(f".{suffix}"))
    return shown


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
