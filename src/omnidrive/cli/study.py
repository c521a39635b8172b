"""Command `omnidrive study`: general studies and their evidence."""

from __future__ import annotations

from omnidrive.cli.options import verb_group
from omnidrive.cli.study_evidence import diff, export, report

study = verb_group("Show, export and compare the results of studies.")

for _verb in (report, export, diff):
    study.command()(_verb)
