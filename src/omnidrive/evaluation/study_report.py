"""Report of a study: HTML page, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

from omnidrive.evaluation.figures.catalogue import Drawing, drawings, write_figures
from omnidrive.evaluation.page import PageFigure, StudyPage
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.evaluation.study_verdicts import study_verdicts
from omnidrive.evaluation.tables.study_tables import study_tables
from omnidrive.evaluation.tables.table import Table
from omnidrive.evaluation.tables.table_files import write_tables
from omnidrive.evaluation.verdict import TaskVerdict
from omnidrive.files.output_file import create_folder, output_file
from omnidrive.files.str_path import StrPath, to_path

REPORT_FILE = "report.html"
"""Report in the folder of a study, which is written last."""


class StudyReport:
    """What is reported of a study: verdicts, tables and figures, each computed once.

    Equal runs and computing times give identical files.

    Attributes:
        study: The evidence.
        facts: What the study is, and how to repeat it.
        logs: Logs of the study; None: they are not kept.
    """

    def __init__(
        self,
        study: StudyEvidence,
        facts: StudyFacts,
        logs: StudyLogs | None = None,
        metric: str | None = None,
    ) -> None:
        """Compute the verdicts.

        Args:
            study: See the attribute.
            facts: See the attribute.
            logs: See the attribute.
            metric: Compared quantity; None: see :func:`study_verdicts`.

        Raises:
            InvalidInput: The runs have no such metric.
        """
        self.study, self.facts, self.logs = study, facts, logs
        self.verdicts: list[TaskVerdict] = study_verdicts(study, metric, logs)

    @cached_property
    def tables(self) -> list[Table]:
        """Tables, that of the verdict first."""
        return study_tables(self.study, self.facts, self.verdicts, self.logs)

    @property
    def styles(self) -> dict[str, ControllerStyle]:
        """Style of every controller, by its label."""
        return self.facts.styles(self.study.runs.controllers)

    @cached_property
    def figures(self) -> dict[str, Drawing]:
        """Figures by the stems of their files; they are drawn on demand."""
        return drawings(self.study, self.verdicts, self.styles, self.logs)

    def write(
        self,
        folder: StrPath,
        *,
        formats: Sequence[str] = ("svg",),
        figures: Mapping[str, Drawing] = {},
        tables: Sequence[Table] = (),
    ) -> Iterator[Path]:
        """Write ``figures/*``, ``tables/*`` and ``report.html``.

        The page contains the tables and those figures that have a caption.

        Args:
            folder: Output folder; created if it does not exist. Files of these names are replaced.
            formats: Formats of the figures, some of svg, pdf and png; empty: no figures, also in
                the page.
            figures: Further figures.
            tables: Further tables, which come first.

        Yields:
            Path of each file after it is written.

        Raises:
            CannotWrite: A file cannot be written.
        """
        folder, shown = to_path(folder), []
        create_folder(folder)
        known = {**self.figures, **figures}
        wanted = list(dict.fromkeys(("svg", *formats))) if formats else []
        for name, path in write_figures(known if formats else {}, folder / "figures", wanted):
            drawing = known[name]
            if path.suffix == ".svg" and drawing.caption:
                shown.append(PageFigure(drawing.title, drawing.caption, path.read_bytes()))
            if path.suffix.removeprefix(".") in formats:
                yield path
            else:
                path.unlink()
        every = [*tables, *self.tables]
        yield from write_tables(every, folder / "tables")
        page = StudyPage(
            self.facts, self.study, self.verdicts, every, shown, self.styles, self.logs
        )
        path = folder / REPORT_FILE
        with output_file(path) as part:
            part.write_text(page.text(), encoding="utf-8", errors="backslashreplace")
        yield path
