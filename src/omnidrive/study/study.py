"""A study: its definition, its stored runs, and what is reported of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from shlex import quote
from typing import Any, Literal

import pyarrow as pa

from omnidrive.components import configure
from omnidrive.errors import InvalidLog, RunFailed
from omnidrive.evaluation import RunRecord, StudyLogs, StudyReport, Table, TaskVerdict
from omnidrive.evaluation.figures.catalogue import Drawing
from omnidrive.evaluation.run_record import TIMING
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.statistics.run_table import FACTOR_PREFIX, IDENTITY, RunTable
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_logs import RecordedRun
from omnidrive.evaluation.tables.published import PUBLISHED_ERRORS
from omnidrive.execution.versions import VERSIONS
from omnidrive.notebook import facts_html, table_html
from omnidrive.scenario.planned_scenario import PlannedScenario, plan_scenario
from omnidrive.scenario.run_settings import faults_of
from omnidrive.scenario.scenario import Scenario, paper_scenario
from omnidrive.simulation import Run
from omnidrive.simulation.saved_run import load_run
from omnidrive.study.computation.numbered_runs import series_file
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.design.run_key import plan_digest
from omnidrive.study.design.run_plan import RunPlan
from omnidrive.study.motion_plan import plan_view, planned_duration
from omnidrive.study.output_paths import DEFINITION_FILE
from omnidrive.study.run_export import results_digest
from omnidrive.study.setup_facts import controller_types, setup_facts
from omnidrive.study.storage.stored_rows import Loss
from omnidrive.study.study_folder import SCENARIO_FILE, resume_command

MAX_LOGS = 500
"""Largest number of logs that a report reads."""

_PAPER_TABLES = "paper-tables"  # study whose report checks the claims of the paper
_MAX_TABLES = 2  # in notebooks


@dataclass(eq=False, repr=False)
class Study:
    """A study as its folder holds it, which may still run.

    Attributes:
        folder: The folder; None: it was temporary.
        definition: The definition.
        text: Text of the study file.
        table: Stored runs, one row each; see :meth:`Store.records`.
        step_times: Their computing times; see :meth:`Store.timing`.
        failures: Number and reason of the first runs that ended early.
        until: Stop rule; empty: none.
        loss: Stored runs that are damaged; the tables lack them.
        timing: Wall time of each part of the execution, s; empty: it was read from its folder.
        planned: The planned scenario of a study of one scenario; None: it is planned on demand.
    """

    folder: Path | None
    definition: StudyDefinition
    text: str
    table: pa.Table
    step_times: pa.Table
    failures: tuple[tuple[int, str], ...] = ()
    until: str = ""
    loss: Loss = field(default_factory=lambda: Loss(0, ()))
    timing: dict[str, float] = field(default_factory=dict)
    planned: PlannedScenario | None = None

    @property
    def file(self) -> str:
        """Name of the study file."""
        return SCENARIO_FILE if self.definition.is_comparison else DEFINITION_FILE

    @cached_property
    def plan(self) -> RunPlan:
        """The planned runs."""
        return RunPlan(self.definition)

    @cached_property
    def records(self) -> tuple[RunRecord, ...]:
        """The stored runs, in the order of the plan."""
        times = {row.pop("number"): row for row in self.step_times.to_pylist()}
        return tuple(_record(row, times.get(row["number"], {})) for row in self.table.to_pylist())

    @cached_property
    def logs(self) -> StudyLogs | None:
        """Logs of the runs of one scenario; None: the study has several, or keeps no logs."""
        if not self.definition.is_one_scenario or self.folder is None:
            return None
        runs: list[RecordedRun] = []
        for record in self.records:
            if record.repeat == 0 and len(runs) < MAX_LOGS:
                log = self.log_of(record)
                if log is not None:
                    runs.append(RecordedRun(record, log))
        if not runs:
            return None
        planned = self.planned or plan_scenario(self.definition.scenario)
        repeats = 1 + max((record.repeat for record in self.records), default=0)
        return study_logs(planned, runs, repeats)

    def log_of(self, record: RunRecord) -> Run | None:
        """Return the log of a run in the folder; None: it is lost with its process, or removed."""
        if self.folder is None or record.is_lost:
            return None
        file = series_file(self.definition, self.plan[record.number])
        try:
            return load_run(self.folder / "series" / file)
        except InvalidLog:
            return None

    def without_folder(self) -> Study:
        """Return the study with its logs in memory, before its folder is removed."""
        changed = replace(self, folder=None)
        changed.logs = self.logs
        return changed

    @cached_property
    def evidence(self) -> StudyEvidence:
        """Evidence of the runs; always valid if the study has a stop rule."""
        return StudyEvidence(RunTable(self.table, self.step_times), always_valid=bool(self.until))

    @cached_property
    def report(self) -> StudyReport:
        """Verdicts, tables and figures."""
        return self.report_by(None)

    def report_by(self, metric: str | None) -> StudyReport:
        """Return the report that compares another quantity; None: the usual ones.

        Raises:
            InvalidInput: The runs have no such metric.
        """
        return StudyReport(self.evidence, self.facts, self.logs, metric)

    @property
    def verdicts(self) -> list[TaskVerdict]:
        """The verdict of each task."""
        return self.report.verdicts

    @property
    def tables(self) -> list[Table]:
        """Tables, that of the verdict first."""
        return self.report.tables

    @property
    def figures(self) -> Mapping[str, Drawing]:
        """Figures by the stems of their files; see :func:`omnidrive.plot`."""
        return self.report.figures

    @property
    def overlaps(self) -> list[str]:
        """Names of runs in which the body overlaps an obstacle without a simulated collision."""
        return [
            record.name
            for record in self.records
            if record.metrics.get("min_clearance", 0.0) < 0.0 and record.name not in self.collisions
        ]

    @cached_property
    def collisions(self) -> dict[str, int]:
        """Number of simulated collisions, by the name of the run; only runs with collisions."""
        tracks = [each for each in self.records if each.task != "faults"]
        counts = {each.name: int(each.metrics.get("collisions", 0.0)) for each in tracks}
        return {name: count for name, count in counts.items() if count}

    def raise_if_failed(self) -> Study:
        """Return self; raise :class:`RunFailed` if a run, except those of `faults`, ended early."""
        reasons = dict(self.failures)
        failed = [
            f"{each.name} ({reasons.get(each.number, each.outcome.replace('_', ' '))})"
            for each in self.records
            if not each.finished and each.task != "faults"
        ]
        if failed:
            raise RunFailed(f"stopped early: {'; '.join(failed)}")
        return self

    @cached_property
    def facts(self) -> StudyFacts:
        """What the report states beside the results."""
        definition = self.definition
        scenario = definition.scenario
        until = f" --until {quote(self.until)}" if self.until else ""
        code = " --allow-code" if definition.names_code else ""
        verb = "compare" if definition.is_comparison else "study"
        return StudyFacts(
            name=scenario_title(scenario) if definition.is_comparison else definition.name,
            question=definition.question,
            setup=setup_facts(definition),
            types=controller_types(scenario),
            planned=0 if self.until else len(self.plan),
            definition=self.text,
            command=f"omnidrive {verb} {self.file}{until}{code} --out repeated",
            resume=resume_command(self.folder or "FOLDER", allow_code=definition.names_code),
            file=self.file,
            hashes={
                "Definition": sha256(self.text.encode()).hexdigest(),
                "Scenarios, seeds, components": plan_digest(self.table["key"].to_pylist()),
                "Results": results_digest(self.table),
            },
            versions=self._versions(),
            until=self.until,
            damaged=str(self.loss) if self.loss.runs else "",
            published=self._published,
            failures=self._named_failures,
        )

    @property
    def _published(self) -> Literal["", "values", "claims"]:
        if self.definition.name == _PAPER_TABLES and not self.definition.is_one_scenario:
            return "claims"
        one = self.definition.is_one_scenario
        return "values" if one and is_published_study(self.definition.scenario) else ""

    @property
    def _named_failures(self) -> tuple[tuple[str, str], ...]:
        """Name and reason of each run that ended early; empty if only some are known."""
        lost = self.table.num_rows - sum(self.table["finished"].to_pylist())
        if not self.definition.is_one_scenario or len(self.failures) < lost:
            return ()
        names = {each.number: each.name for each in self.records}
        return tuple((names[number], reason) for number, reason in self.failures if number in names)

    def _versions(self) -> dict[str, str]:
        """Return the versions that computed the runs, if they are the installed ones."""
        number, key = self.table["number"][0].as_py(), self.table["key"][0].as_py()
        if 0 <= number < len(self.plan) and self.plan.keys(number, number + 1) == [key]:
            return {name: version(name) for name in VERSIONS}
        fact = "other ones, or other files, than those that are installed now"
        if self.definition.names_code:
            fact += "; or the code of the study was not imported, which needs --allow-code"
        return {"Versions": fact}

    def __repr__(self) -> str:
        runs = self.table.num_rows
        return f"<Study {self.facts.name!r}: {runs} runs, folder {str(self.folder)!r}>"

    def _repr_html_(self) -> str:
        """Return verdict, failed runs and main tables for notebooks."""
        finished = self.table["finished"].to_pylist()
        tables = [table.brief() for table in self.tables if not table.is_detail]
        leads = " ".join(table.lead for table in tables if table.lead)
        ended = [name for name, _ in self._named_failures] or [f"{finished.count(False)}"]
        facts = {
            **({"verdict": leads} if leads else {}),
            "runs": f"{len(finished)}",
            "ended early": "none" if all(finished) else ", ".join(ended),
            "results": str(self.folder) if self.folder else "not written",
        }
        shown = (table_html(t.title, t.columns, t.rows) for t in tables[:_MAX_TABLES])
        return facts_html(self.facts.name, facts) + "".join(shown)


def study_logs(planned: PlannedScenario, runs: list[RecordedRun], repeats: int = 1) -> StudyLogs:
    """Return logs with the place where they were recorded.

    Args:
        planned: The planned scenario.
        runs: The runs.
        repeats: Number of noise seeds per controller.
    """
    scenario = planned.scenario
    return StudyLogs(
        title=scenario_title(scenario),
        robot=planned.robot,
        plant=scenario.plant.type,
        dt=scenario.sample_time,
        obstacles=planned.obstacles,
        free_space=planned.free_space,
        grid_path=planned.plan.grid_path if planned.plan else None,
        spline=planned.path,
        runs=tuple(runs),
        faults={
            f"{number:02d}-{fault.kind}": fault
            for number, fault in enumerate(faults_of(scenario), 1)
        },
        types=controller_types(scenario),
        repeats=repeats,
        plan=plan_view(planned, planned.reference(planned_duration(planned)))
        if planned.plan
        else None,
    )


def _record(row: dict[str, Any], times: dict[str, Any]) -> RunRecord:
    """Return the record of a row of a table of runs, without its detail."""
    factors = {name: value for name, value in row.items() if name.startswith(FACTOR_PREFIX)}
    metrics = {name: value for name, value in row.items() if name not in {*IDENTITY, *factors}}
    return RunRecord(
        **{name: row[name] for name in IDENTITY},
        factors={name.removeprefix(FACTOR_PREFIX): value for name, value in factors.items()},
        metrics={name: value for name, value in metrics.items() if value is not None},
        timing={name: times[name] for name in TIMING if times.get(name) is not None},
    )


def scenario_title(scenario: Scenario) -> str:
    """Return the title of a study: its preset, or the controller if there is only one."""
    facts = [f"preset {scenario.preset}", f"plant {scenario.plant.type}"]
    if len(scenario.controllers) == 1:
        facts[:1] = [*scenario.controllers, *(facts[:1] if scenario.preset != "paper" else ())]
    return f"{scenario.name}: {', '.join(facts)}"


_PUBLISHED_SETTINGS = ("reference", "map", "start", "goal", "path", "timing", "sample_time")
"""Sections that must equal those of the paper for a comparison with its numbers."""

_PUBLISHED_CONTROLLERS = {controller for _, _, controller in PUBLISHED_ERRORS}


def is_published_study(scenario: Scenario) -> bool:
    """Return whether the results are comparable with the numbers in the paper."""
    paper = paper_scenario(scenario.preset)
    return (
        all(getattr(scenario, name) == getattr(paper, name) for name in _PUBLISHED_SETTINGS)
        and all(
            scenario.controllers[label] == configure("controllers", label)
            for label in _PUBLISHED_CONTROLLERS & scenario.controllers.keys()
        )
        and scenario.robot.name == paper.robot.name
        and scenario.tasks.step in {None, paper.tasks.step}
    )
