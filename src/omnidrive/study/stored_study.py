"""Studies in folders: reading, report, export and difference."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path

import pyarrow.parquet as pq

from omnidrive.components.code import CodePermission
from omnidrive.errors import InvalidInput, one_line
from omnidrive.evaluation import Table
from omnidrive.evaluation.statistics.study_difference import StudyDifference, study_difference
from omnidrive.files.output_file import output_file, remove_abandoned
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.results_data import save_results
from omnidrive.study.run_export import write_csv
from omnidrive.study.storage.store import Store
from omnidrive.study.study import Study
from omnidrive.study.study_folder import load_study, resume_command

EXPORT_SUFFIXES = (".csv", ".parquet")
"""Suffixes of exported tables."""

MAX_NAMED_FAILURES = 20
"""Number of runs that ended early up to which each is named."""

_log = logging.getLogger("omnidrive")


def read_study(folder: StrPath, *, allow_code: bool | CodePermission = False) -> Study:
    """Read the study in a folder, which may still run.

    Damaged runs are left out, and logged as a warning.

    Args:
        folder: Folder of the study.
        allow_code: Whether code may be imported that the study names and that is not installed.
            Without it, the report does not describe that code.

    Raises:
        InvalidStore: There is no study, or no usable store.
        InvalidInput: The study file is invalid, or no run is stored.
        CannotWrite: The store cannot be read.
    """
    path = to_path(folder)
    definition, until = load_study(path, allow_code=allow_code or CodePermission.UNREAD)
    return stored_study(path, definition, until)


def stored_study(
    path: Path, definition: StudyDefinition, until: str = "", *, read_only: bool = True
) -> Study:
    """Return the study with a definition whose runs a folder holds.

    Args:
        path: The folder.
        definition: The definition.
        until: Stop rule; empty: none.
        read_only: Whether the folder may be read-only; the files of the database for its readers
            then remain until the next process that may write.

    Raises:
        InvalidStore: There is no usable store.
        InvalidInput: No run is stored.
        CannotWrite: The store cannot be read.
    """
    with Store(path, read_only=read_only) as store:
        table, step_times, lost = store.tables()
        failures = store.failures(MAX_NAMED_FAILURES)
    name = one_line(str(path))
    if lost.runs:
        again = resume_command(path, allow_code=definition.names_code)
        _log.warning("%s: %s; compute them again with: %s", name, lost, one_line(again))
    if not table.num_rows:
        damaged = f" ({lost})" if lost.runs else ""
        raise InvalidInput(f"no run of the study in {name} is finished yet{damaged}")
    found = Study(path, definition, "", table, step_times, tuple(failures), until, lost)
    found.text = (path / found.file).read_text(encoding="utf-8")
    return found


def report_study(
    study: Study,
    metric: str | None = None,
    out: StrPath | None = None,
    done: Callable[[str], None] = lambda _: None,
    figures: Sequence[str] = ("svg",),
) -> tuple[Path, list[Table]]:
    """Write report.html, tables and figures of a study; older ones are replaced.

    Args:
        study: The study.
        metric: Compared quantity. None: the mean error, in step responses the settling time, with
            faults the worst error.
        out: Folder of the report. None: that of the study.
        done: Called with the name of each file after it is written.
        figures: Formats of the figures: some of svg, pdf and png, or none.

    Returns:
        The HTML page; the tables, that of the verdict first.

    Raises:
        InvalidInput: The runs have no such metric, or the study has no folder.
        CannotWrite: A file cannot be written.
    """
    if out is None and study.folder is None:
        raise InvalidInput("the study has no folder for its report; choose one with out=")
    folder = to_path(study.folder if out is None else out)
    report = study.report if metric is None else study.report_by(metric)
    remove_abandoned(folder)  # temporary files of killed reports
    page = folder
    for page in report.write(folder, formats=figures):
        done(page.name)
    if study.definition.is_comparison:
        save_results(study, folder)
    return page, report.tables


def export_study(study: Study, path: StrPath, *, timing: bool = False) -> None:
    """Write the runs as one table, by number; equal runs give identical files.

    Args:
        study: The study.
        path: File with the suffix .csv or .parquet; it is replaced.
        timing: Whether to add the computing times, which differ from study to study.

    Raises:
        InvalidInput: The suffix is another one.
        CannotWrite: The file cannot be written.
    """
    path = to_path(path)
    suffix = path.suffix.lower()
    if suffix not in EXPORT_SUFFIXES:
        raise InvalidInput(
            f"{one_line(str(path))}: the suffix of an exported table is "
            f"{' or '.join(EXPORT_SUFFIXES)}"
        )
    table = study.table
    if timing:
        columns = study.step_times.rename_columns(
            ["number", *(f"timing:{name}" for name in study.step_times.column_names[1:])]
        )
        table = table.join(columns, "number").sort_by("number")
    remove_abandoned(path.parent, path.name)
    with output_file(path) as part, part.open("wb") as file:
        if suffix == ".csv":
            write_csv(table, file)
        else:
            pq.write_table(table, file)


def compare_studies(first: Study, second: Study) -> StudyDifference:
    """Compare two studies run by run; see :func:`study_difference`."""
    return study_difference(first.table, second.table)
