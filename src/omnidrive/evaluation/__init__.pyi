from .figures import plot, write_figures
from .metrics import Metrics, heading_error, measure, position_error
from .page import write_page
from .paired import (
    MEASURES,
    PairedDifference,
    RepeatedRuns,
    paired_differences,
    repeated_runs,
)
from .path_error import PathErrors, path_errors
from .recovery import Recovery, recovery
from .results import (
    FaultResult,
    StepResult,
    StudyResults,
    TrackResult,
)
from .step_response import STEP_AXES, StepResponse, step_response
from .table import Table
from .table_files import write_tables
from .tables import study_tables
from .verdict import Verdict, headline, verdicts

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
    "plot",
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
