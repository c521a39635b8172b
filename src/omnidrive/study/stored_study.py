"""A study as its folder holds it: definition and stored runs; its report, export and difference."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from hashlib import sha256
from importlib.metadata import version
from io import RawIOBase
from pathlib import Path
from shlex import quote
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from omnidrive.components.code import CodePermission
from omnidrive.errors import InvalidInput, one_line
from omnidrive.evaluation.evidence import StudyEvidence
from omnidrive.evaluation.run_table import RunTable
from omnidrive.evaluation.study_difference import StudyDifference, study_difference
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_report import study_tables, write_study_report
from omnidrive.evaluation.table import Table
from omnidrive.execution.versions import VERSIONS
from omnidrive.files.output_file import output_file, remove_abandoned
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.run_key import plan_digest
from omnidrive.study.run_plan import RunPlan
from omnidrive.study.setup_facts import controller_types, setup_facts
from omnidrive.study.store import Store
from omnidrive.study.stored_rows import Loss
from omnidrive.study.study_folder import (
    DEFINITION_FILE,
    SCENARIO_FILE,
    load_study,
    resume_command,
)

EXPORT_SUFFIXES = (".csv", ".parquet")
"""Suffixes of exported tables."""

_log = logging.getLogger("omnidrive")

_PAPER_TABLES = "paper-tables"  # study whose report checks the claims of the paper


class StoredStudy(NamedTuple):
    """Definition and stored runs of a study."""

    folder: Path
    definition: StudyDefinition
    text: str
    """Text of the study file."""
    table: pa.Table
    """Stored runs; see :meth:`Store.records`."""
    timing: pa.Table
    """Their computing times; see :meth:`Store.timing`."""
    until: str
    """Stop rule; empty: none."""
    is_comparison: bool = False
    """Whether it is the folder of ``omnidrive compare``, which has a report of its own."""
    loss: Loss = Loss(0, ())
    """Stored runs that are damaged; the tables lack them."""

    @property
    def evidence(self) -> StudyEvidence:
        """Evidence of the runs; always valid if the study has a stop rule."""
        return StudyEvidence(RunTable(self.table, self.timing), always_valid=bool(self.until))

    def facts(self) -> StudyFacts:
        """Return what the report states beside the results."""
        definition, plan = self.definition, RunPlan(self.definition)
        until = f" --until {quote(self.until)}" if self.until else ""
        code = " --allow-code" if definition.names_code else ""
        return StudyFacts(
            name=definition.name,
            question=definition.question,
            setup=setup_facts(definition),
            types=controller_types(definition.scenario),
            planned=0 if self.until else len(plan),
            definition=self.text,
            command=f"omnidrive compare {SCENARIO_FILE}{code} --out repeated"
            if self.is_comparison
            else f"omnidrive study {DEFINITION_FILE}{until}{code} --out repeated",
            resume=resume_command(self.folder, allow_code=definition.names_code),
            file=SCENARIO_FILE if self.is_comparison else DEFINITION_FILE,
            hashes={
                "Definition": sha256(self.text.encode()).hexdigest(),
                "Scenarios, seeds, components": plan_digest(self.table["key"].to_pylist()),
                "Results": results_digest(self.table),
            },
            versions=self._versions(plan),
            until=self.until,
            damaged=str(self.loss) if self.loss.runs else "",
            published=definition.name == _PAPER_TABLES,
        )

    def _versions(self, plan: RunPlan) -> dict[str, str]:
        """Return the versions that computed the runs, if they are the installed ones."""
        number, key = self.table["number"][0].as_py(), self.table["key"][0].as_py()
        if 0 <= number < len(plan) and plan.keys(number, number + 1) == [key]:
            return {name: version(name) for name in VERSIONS}
        fact = "other ones, or other files, than those that are installed now"
        if self.definition.names_code:
            fact += "; or the code of the study was not imported, which needs --allow-code"
        return {"Versions": fact}


def read_study(folder: StrPath, *, allow_code: bool | CodePermission = False) -> StoredStudy:
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
    with Store(path, read_only=True) as store:
        table, timing, lost = store.tables()
    name = one_line(str(path))
    if lost.runs:
        again = resume_command(path, allow_code=definition.names_code)
        _log.warning("%s: %s; compute them again with: %s", name, lost, one_line(again))
    if not table.num_rows:
        damaged = f" ({lost})" if lost.runs else ""
        raise InvalidInput(f"no run of the study in {name} is finished yet{damaged}")
    one = (path / SCENARIO_FILE).is_file()
    text = (path / (SCENARIO_FILE if one else DEFINITION_FILE)).read_text(encoding="utf-8")
    return StoredStudy(path, definition, text, table, timing, until, one, lost)


class StudyReport(NamedTuple):
    """Written report of a study."""

    page: Path
    """The HTML page."""
    tables: list[Table]
    """The tables, the answer first."""


def report_study(
    study: StoredStudy,
    metric: str | None = None,
    out: StrPath | None = None,
    done: Callable[[str], None] = lambda _: None,
    figures: Sequence[str] = ("svg",),
) -> StudyReport:
    """Write report.html, tables and figures of a study; older ones are replaced.

    Args:
        study: The study.
        metric: Compared quantity. None: the mean error, in step responses the settling time, with
            faults the worst error.
        out: Folder of the report. None: that of the study; of a comparison, ``evidence`` in it.
        done: Called with the name of each file after it is written.
        figures: Formats of the figures: some of svg, pdf and png, or none.

    Raises:
        InvalidInput: The runs have no such metric.
        CannotWrite: A file cannot be written.
    """
    chosen = None if out is None else to_path(out)
    evidence, facts = study.evidence, study.facts()
    folder = chosen or (study.folder / "evidence" if study.is_comparison else study.folder)
    remove_abandoned(folder)  # temporary files of killed reports
    tables = study_tables(evidence, facts, metric)
    page = folder
    for page in write_study_report(evidence, facts, tables, folder, metric, formats=figures):
        done(page.name)
    return StudyReport(page, tables.every)


def export_study(study: StoredStudy, path: StrPath, *, timing: bool = False) -> None:
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
        columns = study.timing.rename_columns(
            ["number", *(f"timing:{name}" for name in study.timing.column_names[1:])]
        )
        table = table.join(columns, "number").sort_by("number")
    remove_abandoned(path.parent, path.name)
    with output_file(path) as part, part.open("wb") as file:
        if suffix == ".csv":
            _write_csv(table, file)
        else:
            pq.write_table(table, file)


def compare_studies(first: StoredStudy, second: StoredStudy) -> StudyDifference:
    """Compare two studies run by run; see :func:`study_difference`."""
    return study_difference(first.table, second.table)


def results_digest(table: pa.Table) -> str:
    """Return the SHA-256 of the exported CSV file without computing times."""
    content = _Digest()
    _write_csv(table, content)
    return content.digest.hexdigest()


class _Digest(RawIOBase):
    """File that keeps the SHA-256 of what is written."""

    def __init__(self) -> None:
        self.digest = sha256()

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, content: Any) -> int:
        """Add bytes."""
        self.digest.update(content)
        return len(content)


def _write_csv(table: pa.Table, file: Any) -> None:
    """Write CSV with the shortest decimal numbers that are exact; no value is an empty cell."""
    columns = {
        name: pc.if_else(pc.is_finite(column), column, None)
        if pa.types.is_floating(column.type) else column
        for name, column in zip(table.column_names, table.columns, strict=True)
    }  # fmt: skip
    pa_csv.write_csv(pa.table(columns), file)
