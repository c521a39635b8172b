"""Recorded runs with changed values, and reports of them."""

from dataclasses import replace

from omnidrive.evaluation import RunRecord, StudyReport
from omnidrive.evaluation.page import StudyPage
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.statistics.run_table import RunTable, tables_of
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_logs import RecordedRun


def record(task, controller, metrics, timing=None, *, duration=20.0, variant="", repeat=0):
    """Return the record of a finished run."""
    return RunRecord(
        0, "", 0, controller, task, 0, {}, "finished", True, metrics, timing or {},
        duration=duration, variant=variant, repeat=repeat,
    )  # fmt: skip


def labelled(run, **changes):
    """Return a recorded run with other fields of its record."""
    return run._replace(record=replace(run.record, **changes))


def with_metrics(run, log=None, **metrics):
    """Return a recorded run with other metrics, and another log."""
    timing = {name: metrics.pop(name) for name in list(metrics) if name.startswith("step_time")}
    record = run.record
    changed = replace(
        record, metrics={**record.metrics, **metrics}, timing={**record.timing, **timing}
    )
    return RecordedRun(changed, log or run.log)


def ended(run, log):
    """Return a recorded run that ended early, with its log."""
    return labelled(run._replace(log=log), outcome=log.outcome.name.lower(), finished=False)


def numbered(records):
    """Return records with numbers and pairings as in a plan."""
    pairings = {}
    return [
        replace(
            each,
            number=k,
            key=f"{k:064x}",
            pairing=pairings.setdefault(
                (each.task, each.duration, each.variant, each.repeat), len(pairings)
            ),
        )
        for k, each in enumerate(records)
    ]


def reported(logs, records=None, metric=None, **facts):
    """Return the report of logs; of several seeds with the records of all runs."""
    every = numbered(records or [each.record for each in logs.runs])
    evidence = StudyEvidence(RunTable(*tables_of(every)))
    return StudyReport(evidence, StudyFacts(logs.title, types=logs.types, **facts), logs, metric)


def tables_by_title(report):
    """Return the tables of a report by their titles."""
    return {table.title: table for table in report.tables}


def page_text(report, tables=None, figures=()):
    """Return the page of a report."""
    shown = report.tables if tables is None else tables
    return StudyPage(
        report.facts, report.study, report.verdicts, shown, figures, report.styles, report.logs
    ).text()
