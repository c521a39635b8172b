"""Verbs `omnidrive study status` and `resume`: the folder of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnidrive.cli.options import (
    FiguresOption,
    FullOption,
    JsonOption,
    figure_formats,
    flag,
    option,
)

FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of a study.")]
JobsOption = Annotated[
    int | None,
    option(
        "N",
        "Number of worker processes; affects no results but computing times [default: all cores].",
        minimum=1,
    ),
]
TimeoutOption = Annotated[
    float | None,
    option("S", "End a run that takes longer than this wall time, s [default: no limit]."),
]
SchedulerOption = Annotated[
    str | None,
    option(
        "ADDRESS",
        "Compute on the workers of a Dask scheduler, such as tcp://192.168.1.5:8786, with the same "
        "results; needs dask and distributed.",
    ),
]
CodeOption = Annotated[
    bool,
    flag(
        "Import code that the study file names, such as mine.py:MyController; only for files that "
        "you trust.",
        None,
        "--allow-code",
    ),
]
YesOption = Annotated[
    bool, flag("Compute a study of more than ten million runs, too.", None, "--yes")
]


def status(folder: FolderArgument, json: JsonOption = False) -> None:
    """Print how many runs of a study are planned, stored and at work.

    For example:

    * `omnidrive study status runs/friction`
    """
    from omnidrive.cli.terminal import count_text, print_json, show, warn
    from omnidrive.study.storage.leases import at_work
    from omnidrive.study.storage.store import Store
    from omnidrive.study.study_folder import resume_command, study_outline

    (name, planned, names_code), until = study_outline(folder)
    with Store(folder, read_only=True) as store:
        found, working = store.status(), at_work(store)
    if json:
        facts = {"name": name, "planned": planned, "until": until or None}
        print_json({
            **facts, **found._asdict(), "loss": found.loss._asdict(),
            "at_work": working._asdict(),
        })  # fmt: skip
        return
    show(f"study {name}: {planned:,} runs planned")
    if until:
        show(f"repetitions are added until {until}")
    share = f" ({100.0 * found.runs / planned:.3g} %)" if found.runs <= planned else ""
    show(f"stored: {found.runs:,}{share}: {count_text(found.outcomes)}")
    for number, reason in found.failures:
        show(f"  run {number}: {reason}")
    if found.loss.runs:
        warn(str(found.loss))
    show(f"at work: {working.runs:,} runs in {working.processes} processes")
    if found.runs < planned and not working.processes:
        command = resume_command(folder, allow_code=names_code)
        show(f"continue with: {command}")


def resume(
    folder: FolderArgument,
    jobs: JobsOption = None,
    run_timeout: TimeoutOption = None,
    scheduler: SchedulerOption = None,
    allow_code: CodeOption = False,
    yes: YesOption = False,
    figures: FiguresOption = None,
    full: FullOption = False,
) -> None:
    """Continue a study that was interrupted or killed; stored runs are not computed again.

    Several processes may continue one study at the same time and share its runs.

    For example:

    * `omnidrive study resume runs/friction`
    * `omnidrive study resume runs/paper-20260101-120000`
    """
    from omnidrive.cli.studies.execution import compute_and_print
    from omnidrive.study.study_folder import load_study

    definition, until = load_study(folder, allow_code=allow_code)
    compute_and_print(
        definition,
        folder,
        jobs=jobs,
        run_timeout=run_timeout,
        until=until or None,
        scheduler=scheduler,
        yes=yes,
        full=full,
        figures=figure_formats(figures),
    )
