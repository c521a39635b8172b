"""Report of a study: HTML page, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from omnidrive.evaluation.evidence import StudyEvidence
from omnidrive.evaluation.evidence_tables import evidence_tables
from omnidrive.evaluation.figures.study_catalogue import study_figures
from omnidrive.evaluation.figures.style import save
from omnidrive.evaluation.page import PageFigure
from omnidrive.evaluation.page.evidence import EvidencePage
from omnidrive.evaluation.published_claims import check_claims, claims_table, published_table
from omnidrive.evaluation.study_answer import study_answers
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.table import Table
from omnidrive.evaluation.table_files import write_tables
from omnidrive.files.output_file import create_folder, output_file
from omnidrive.files.str_path import StrPath, to_path


class StudyTables(NamedTuple):
    """Tables of a study."""

    evidence: list[Table]
    """Tables of the evidence, the answer first."""
    claims: list[Table]
    """Tables of the paper's claims; may be empty."""

    @property
    def every(self) -> list[Table]:
        """The answer, the claims, and the other tables."""
        return [*self.evidence[:1], *self.claims, *self.evidence[1:]]


def study_tables(study: StudyEvidence, facts: StudyFacts, metric: str | None = None) -> StudyTables:
    """Return the tables of a study.

    Args:
        study: The evidence.
        facts: What the study is.
        metric: Compared quantity; None: that of :func:`main_metric` in each task.

    Raises:
        InvalidInput: The runs have no such metric.
    """
    claims = []
    if facts.published:
        claims = [claims_table(check_claims(study)), published_table(study)]
    return StudyTables(evidence_tables(study, metric), [table for table in claims if table.rows])


def write_study_report(
    study: StudyEvidence,
    facts: StudyFacts,
    tables: StudyTables,
    folder: StrPath,
    metric: str | None = None,
    *,
    formats: Sequence[str] = ("svg",),
) -> Iterator[Path]:
    """Write ``figures/*``, ``tables/*`` and ``report.html``, which contains all of them.

    Equal runs and computing times give identical files.

    Args:
        study: The evidence.
        facts: What the study is, and how to repeat it.
        tables: Its tables.
        folder: Output folder; created if it does not exist. Files of these names are replaced.
        metric: Compared quantity; None: that of :func:`main_metric` in each task.
        formats: Formats of the figures, some of svg, pdf and png; empty: no figures, also in the
            page.

    Yields:
        Path of each file after it is written.

    Raises:
        InvalidInput: The runs have no such metric.
        CannotWrite: A file cannot be written.
    """
    folder = to_path(folder)
    answers = study_answers(study, metric)
    styles = facts.styles(study.runs.controllers)
    figures = []
    for each in study_figures(study, answers, styles) if formats else ():
        create_folder(folder / "figures")
        path = folder / "figures" / f"{each.name}.svg"
        save(each.figure, path)
        figures.append(PageFigure(each.title, each.caption, path.read_bytes()))
        if "svg" not in formats:
            path.unlink()
        for suffix in formats:
            written = path.with_suffix(f".{suffix}")
            if suffix != "svg":
                save(each.figure, written)
            yield written
    yield from write_tables(tables.every, folder / "tables")
    page = EvidencePage(facts, study, answers, tables.evidence, tables.claims, figures, styles)
    path = folder / "report.html"
    with output_file(path) as part:
        part.write_text(page.text(), encoding="utf-8", errors="backslashreplace")
    yield path
