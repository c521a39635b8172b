"""Execution of a study with its progress, and its results in a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from omnidrive import study
from omnidrive.cli.options import available_cores
from omnidrive.cli.progress import LiveProgress
from omnidrive.cli.studies.results import print_results
from omnidrive.cli.terminal import note
from omnidrive.errors import WorkerLost
from omnidrive.evaluation.statistics.stop_rule import StopRule
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.output_paths import STORE_FILE
from omnidrive.study.study_folder import resume_command


def compute_and_print(
    definition: StudyDefinition,
    folder: Path,
    *,
    jobs: int | None = None,
    run_timeout: float | None = None,
    until: str | None = None,
    scheduler: str | None = None,
    yes: bool = False,
    numbered: bool = False,
    json: bool = False,
    full: bool = False,
    figures: Sequence[str] = ("svg",),
) -> None:
    """Compute the runs that the folder does not hold yet; write the report, and print results.

    Args:
        definition: The study.
        folder: New folder, or that of the same study.
        jobs: Number of worker processes. None: one per core.
        run_timeout: Largest wall time of a run, s. None: no limit.
        until: Stop rule, such as me:0.1mm. None: the repetitions of the definition.
        scheduler: Address of a Dask scheduler. None: processes of this computer.
        yes: Whether the study may have more than ten million runs.
        numbered: Whether to append -2, -3, ... to the name of a folder that exists.
        json: Print results.json of a comparison instead of tables.
        full: Print all tables and columns.
        figures: Formats of the figures; empty: no figures.

    Raises:
        OmnidriveError: See :func:`~omnidrive.study.run_study`.
    """
    rule = StopRule.parse(until) if until else None
    with continued_by(folder, definition), LiveProgress() as progress:
        done = study.run_study(
            definition,
            folder,
            processes=jobs or available_cores(),
            progress=progress,
            run_timeout=run_timeout,
            until=rule,
            scheduler=scheduler,
            confirmed=yes,
            numbered=numbered,
            figures=figures,
        )
    parts = " + ".join(f"{name} {seconds:.1f} s" for name, seconds in done.timing.items())
    total = f"{parts} = {sum(done.timing.values()):.1f} s"
    print_results(done, json=json, full=full, lines=[total])


@contextmanager
def continued_by(folder: Path, definition: StudyDefinition) -> Iterator[None]:
    """Print how a study is continued that is interrupted, or loses its workers, in the context."""
    try:
        yield
    except (KeyboardInterrupt, WorkerLost):
        if (folder / STORE_FILE).is_file():
            command = resume_command(folder, allow_code=definition.names_code)
            note(f"continue with: {command}")
        raise
