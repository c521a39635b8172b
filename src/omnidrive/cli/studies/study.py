"""Command `omnidrive study`: general studies and their evidence."""

from __future__ import annotations

from omnidrive.cli.options import verb_group
from omnidrive.cli.studies.definition import list_studies, run
from omnidrive.cli.studies.evidence import diff, export, report
from omnidrive.cli.studies.store import resume, status

study = verb_group(
    "Vary anything in a scenario; show the differences and their uncertainty.\n\n"
    "`omnidrive study STUDY` is `omnidrive study run STUDY`.",
    default="run",
)

study.command(name="list")(list_studies)
for _verb in (run, status, resume, report, export, diff):
    study.command()(_verb)
