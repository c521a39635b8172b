"""Metrics, tables, figures and the HTML report of simulated runs."""

from omnidrive.evaluation.figures import write_figures
from omnidrive.evaluation.metrics import Metrics, heading_error, measure, position_error
from omnidrive.evaluation.page import write_page
from omnidrive.evaluation.paired import (
    MEASURES,
    PairedDifference,
    RepeatedRuns,
    paired_differences,
    repeated_runs,
)
from omnidrive.evaluation.path_error import PathErrors, path_errors
from omnidrive.evaluation.recovery import Recovery, recovery
from omnidrive.evaluation.results import (
    STEP_AXES,
    FaultResult,
    StepResult,
    StudyResults,
    TrackResult,
)
from omnidrive.evaluation.step_response import StepResponse, step_response
from omnidrive.evaluation.table import Table
from omnidrive.evaluation.table_files import write_tables
from omnidrive.evaluation.tables import study_tables
from omnidrive.evaluation.verdict import Verdict, headline, verdicts

__all__ = [
    "MEASURES",
    "STEP_AXES",
    "FaultResult",
    "Metrics",
    "PairedDifference",
    "PathErrors",
    "Recovery",
    "RepeatedRuns",
    "StepResponse",
    "StepResult",
    "StudyResults",
    "Table",
    "TrackResult",
    "Verdict",
    "heading_error",
    "headline",
    "measure",
    "paired_differences",
    "path_errors",
    "position_error",
    "recovery",
    "repeated_runs",
    "step_response",
    "study_tables",
    "verdicts",
    "write_figures",
    "write_page",
    "write_tables",
]
