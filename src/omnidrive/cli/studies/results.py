"""Results of a study in a terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from omnidrive import study
from omnidrive.cli.options import available_cores
from omnidrive.cli.progress import LiveProgress
from omnidrive.cli.studies.execution import continued_by
from omnidrive.cli.tables import print_tables
from omnidrive.cli.terminal import conclude, show, warn
from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.scenario import Scenario
from omnidrive.study import Study
from omnidrive.study.definition import StudyDefinition


def run_and_print(
    scenario: Scenario,
    folder: Path,
    *,
    jobs: int | None = None,
    run_timeout: float | None = None,
    numbered: bool = False,
    json: bool = False,
    full: bool = False,
    figures: Sequence[str] = ("svg", "pdf"),
) -> None:
    """Run the study of a scenario, or continue it, and print its results.

    Args:
        scenario: The scenario.
        folder: Folder for the results.
        jobs: Number of worker processes. None: one per core.
        run_timeout: Largest wall time of a run, s. None: no limit.
        numbered: Whether to append -2, -3, ... to the name of a folder that exists.
        json: Print results.json instead of tables.
        full: Print all tables and columns.
        figures: Formats of the figures; empty: no figures.

    Raises:
        OmnidriveError: See :func:`~omnidrive.study.run_study`.
    """
    definition = StudyDefinition.from_scenario(scenario, series="all")
    with continued_by(folder, definition), LiveProgress() as progress:
        done = study.run_study(
            scenario,
            folder,
            processes=jobs or available_cores(),
            progress=progress,
            run_timeout=run_timeout,
            numbered=numbered,
            figures=figures,
        )
    parts = " + ".join(f"{name} {seconds:.1f} s" for name, seconds in done.timing.items())
    total = f"{parts} = {sum(done.timing.values()):.1f} s"
    print_results(done, json=json, full=full, lines=[total])


def print_results(done: Study, *, json: bool, full: bool, lines: Sequence[str]) -> None:
    """Print tables and events, or results.json; then the folder, and warnings of collisions.

    Args:
        done: A study that wrote a folder.
        json: Print results.json instead of tables.
        full: Print all tables and columns.
        lines: Lines after the tables.

    Raises:
        RunFailed: A run ended early.
    """
    folder = done.folder
    assert folder is not None
    if json:
        sys.stdout.write((folder / "results.json").read_text(encoding="utf-8"))
    else:
        print_tables(done.tables, full=full)
        _print_events(done)
        for line in lines:
            show(line)
    conclude(f"results: {folder} (open {folder / 'report.html'})", beside_json=json)
    _warn_of_collisions(done)
    done.raise_if_failed()


def _print_events(done: Study) -> None:
    """Print the events of tracking runs and step responses: faults, detections and reactions."""
    told = FALLS_BEHIND if len(done.facts.types) > 1 else None  # by the verdict
    for result in done.logs.runs if done.logs else ():
        events = [each for each in result.log.events if not (told and each.what.endswith(told))]
        if result.task == "faults":  # their table states them
            continue
        if events:
            show(f"{result.name}:")
        for event in events:
            show(f"  {event.t:6.2f} s  {event.what}")


def _warn_of_collisions(done: Study) -> None:
    """Warn of runs that collided with an obstacle, or overlapped one."""
    if done.collisions:
        counts = (f"{name} ({count})" for name, count in done.collisions.items())
        warn(f"runs with collisions: {', '.join(counts)}")
    if done.overlaps:
        warn(f"runs in which the robot overlaps an obstacle: {', '.join(done.overlaps)}")
