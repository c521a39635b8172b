"""Verbs of `omnidrive study` that show results: report, export and diff."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnidrive.cli.options import (
    RESULTS_PANEL,
    FiguresOption,
    FullOption,
    JsonOption,
    figure_formats,
    flag,
    option,
)
from omnidrive.cli.terminal import conclude, print_json

StudyArgument = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder of a study, which may still run.")
]
AllowCodeOption = Annotated[
    bool,
    flag("Describe code that the study file names, too, which is imported; only for files that "
         "you trust.", None, "--allow-code"),
]  # fmt: skip


def report(
    folder: StudyArgument,
    metric: Annotated[
        str | None,
        option(
            "NAME",
            "Compared quantity, such as mae, max_error or work [default: me; in step responses "
            "settling_time, with faults worst_error].",
        ),
    ] = None,
    out: Annotated[
        Path | None, option("FOLDER", "Folder of the report [default: that of the study].")
    ] = None,
    figures: FiguresOption = None,
    allow_code: AllowCodeOption = False,
    full: FullOption = False,
) -> None:
    """Print the verdict of a study with its uncertainty, and write its report.

    The report is one HTML file, report.html, that needs no network: question, verdict, playback of
    the runs of one scenario, figures, tables, set-up, and how to repeat the study. Tables are
    written as CSV and LaTeX, too, and figures in the formats of `--figures`. A study that is not
    finished gives a report of its finished runs.

    For example:

    * `omnidrive study report runs/friction`
    * `omnidrive study report runs/friction --metric max_error`
    """
    from omnidrive.cli.progress import LiveProgress
    from omnidrive.cli.tables import print_tables
    from omnidrive.study.stored_study import read_study, report_study

    formats = figure_formats(figures)
    with LiveProgress() as progress:
        progress.part("report", 0)
        found = read_study(folder, allow_code=allow_code)
        page, tables = report_study(found, metric, out, progress.done, formats)
    print_tables(tables, full=full)
    conclude(f"report: {page}")


def export(
    folder: StudyArgument,
    out: Annotated[Path, option("FILE", "Table to write: .csv or .parquet; it is replaced.")],
    timing: Annotated[
        bool, flag("Add the computing times, which differ from study to study.", RESULTS_PANEL)
    ] = False,
) -> None:
    """Write all runs of a study as one table, one row per run.

    Columns: number, key, pairing, controller, task, duration (s), variant, repetition, repeat (of
    `--noise-seeds`), outcome, finished, `factor:PATH` of every axis and random factor, and the
    metrics in m, rad, s and J. Equal studies give identical files.

    For example:

    * `omnidrive study export runs/friction --out friction.csv`
    * `omnidrive study export runs/friction --out friction.parquet --timing`
    """
    from omnidrive.study.stored_study import export_study, read_study

    found = read_study(folder)
    export_study(found, out, timing=timing)
    conclude(f"{found.table.num_rows} runs written to {out}")


def diff(
    first: StudyArgument,
    second: StudyArgument,
    json: JsonOption = False,
) -> None:
    """Compare two studies run by run.

    Runs are matched by controller, task, repetition and the values of all factors; the table shows
    how much every quantity has changed from the first to the second study, and whether that is
    more than chance. Runs with the same key, which depend on equal scenarios, seeds and versions,
    should have equal results.

    For example:

    * `omnidrive study diff runs/before runs/after`
    """
    from omnidrive.cli.tables import print_tables
    from omnidrive.evaluation.statistics.study_difference import difference_record, difference_table
    from omnidrive.study.stored_study import compare_studies, read_study

    studies = [read_study(folder) for folder in (first, second)]
    found = compare_studies(*studies)
    if json:
        print_json(difference_record(found))
    else:
        table = difference_table(found)
        print_tables([table] if table.rows else [])
    conclude(found.summary, beside_json=json)
