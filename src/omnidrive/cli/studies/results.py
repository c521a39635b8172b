"""Results of a study in a terminal."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence

from omnidrive.cli.tables import print_tables
from omnidrive.cli.terminal import conclude, count_text, show, warn
from omnidrive.control.controller import FALLS_BEHIND
from omnidrive.study import Study


def print_results(done: Study, *, json: bool, full: bool, lines: Sequence[str]) -> None:
    """Print tables and events, or results.json; then the folder, and warnings of collisions.

    Args:
        done: A study that wrote a folder.
        json: Print results.json of a comparison instead of tables.
        full: Print all tables and columns.
        lines: Lines after the tables.

    Raises:
        RunFailed: A run of a comparison ended early.
    """
    folder = done.folder
    assert folder is not None
    if json:
        sys.stdout.write((folder / "results.json").read_text(encoding="utf-8"))
    else:
        print_tables(done.tables, full=full)
        _print_events(done)
        if not done.definition.is_comparison:
            _print_outcomes(done)
        for line in lines:
            show(line)
    conclude(f"results: {folder} (open {folder / 'report.html'})", beside_json=json)
    if done.definition.is_comparison:
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


def _print_outcomes(done: Study) -> None:
    """Print the number of runs of each outcome, and why the first ones ended early."""
    show(f"runs: {count_text(Counter(done.table['outcome'].to_pylist()))}")
    for number, reason in done.failures:
        show(f"  run {number}: {reason}")


def _warn_of_collisions(done: Study) -> None:
    """Warn of runs that collided with an obstacle, or overlapped one."""
    if done.collisions:
        counts = (f"{name} ({count})" for name, count in done.collisions.items())
        warn(f"runs with collisions: {', '.join(counts)}")
    if done.overlaps:
        warn(f"runs in which the robot overlaps an obstacle: {', '.join(done.overlaps)}")
