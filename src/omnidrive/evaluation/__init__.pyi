from .figures import plot
from .measures.loop_margins import LoopAxis, LoopMargins, loop_margins
from .measures.metrics import Metrics, heading_error, measure, position_error
from .measures.path_error import PathErrors, path_errors
from .measures.recovery import Recovery, recovery
from .measures.step_response import STEP_AXES, StepResponse, step_response
from .run_record import RunRecord
from .study_logs import RecordedRun, StudyLogs
from .study_report import StudyReport
from .study_verdicts import study_verdicts
from .tables.table import Table
from .tables.table_files import write_tables
from .verdict import TaskVerdict

__all__ = [
    "STEP_AXES",
    "LoopAxis",
    "LoopMargins",
    "Metrics",
    "PathErrors",
    "RecordedRun",
    "Recovery",
    "RunRecord",
    "StepResponse",
    "StudyLogs",
    "StudyReport",
    "Table",
    "TaskVerdict",
    "heading_error",
    "loop_margins",
    "measure",
    "path_errors",
    "plot",
    "position_error",
    "recovery",
    "step_response",
    "study_verdicts",
    "write_tables",
]
