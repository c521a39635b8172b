from .computation.block_runner import run_block
from .design.definition import StudyDefinition
from .design.definition_file import (
    definition_data,
    load_definition,
    parse_definition,
    save_definition,
    study_names,
)
from .design.planned_run import PlannedRun
from .design.run_plan import RunPlan, check_size
from .folder import RunFolder
from .motion_plan import Fact, plan_facts, planned_duration, save_figure, save_plan, save_plan_page
from .output_paths import (
    check_figure,
    check_new_file,
    check_new_folder,
    check_plan_targets,
    check_study_folder,
)
from .progress import ProgressListener, RunProgress
from .queries import solve_queries
from .run_study import run_study
from .stored_study import compare_studies, export_study, read_study, report_study
from .study import Study
from .study_folder import load_study
from .warm_up import warm_up

__all__ = [
    "Fact",
    "PlannedRun",
    "ProgressListener",
    "RunFolder",
    "RunPlan",
    "RunProgress",
    "Study",
    "StudyDefinition",
    "check_figure",
    "check_new_file",
    "check_new_folder",
    "check_plan_targets",
    "check_size",
    "check_study_folder",
    "compare_studies",
    "definition_data",
    "export_study",
    "load_definition",
    "load_study",
    "parse_definition",
    "plan_facts",
    "planned_duration",
    "read_study",
    "report_study",
    "run_block",
    "run_study",
    "save_definition",
    "save_figure",
    "save_plan",
    "save_plan_page",
    "solve_queries",
    "study_names",
    "warm_up",
]
