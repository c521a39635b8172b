from .block_runner import run_block
from .definition import StudyDefinition
from .definition_file import (
    definition_data,
    load_definition,
    parse_definition,
    save_definition,
    study_names,
)
from .folder import RunFolder
from .jobs import (
    Job,
    faults_of,
    jobs_of,
    make_controller,
    make_estimator,
    make_sensors,
    make_supervisor,
    run_job,
)
from .output_paths import (
    check_figure,
    check_new_file,
    check_new_folder,
    check_plan_targets,
    check_study_folder,
)
from .plan import Fact, plan_facts, planned_duration, save_figure, save_plan
from .planned_run import PlannedRun
from .planned_scenario import PlannedScenario, plan_and_check, plan_scenario
from .plants import make_plant
from .queries import solve_queries
from .run_experiment import run_experiment
from .run_plan import RunPlan, check_size
from .run_record import RunRecord
from .scenario import Scenario, map_scenario, paper_scenario
from .scenario_file import load_scenario, save_scenario
from .scenario_sections import MapSection, RobotSection, SensorsSection, robot_section
from .stored_study import StoredStudy, compare_studies, export_study, read_study, report_study
from .study import ProgressListener, Study, run_study
from .study_folder import load_study
from .tasks import Tasks, study_tasks
from .timing import lengthen, one_task, plan_at, retime, with_task
from .warm_up import warm_up

__all__ = [
    "Fact",
    "Job",
    "MapSection",
    "PlannedRun",
    "PlannedScenario",
    "ProgressListener",
    "RobotSection",
    "RunFolder",
    "RunPlan",
    "RunRecord",
    "Scenario",
    "SensorsSection",
    "StoredStudy",
    "Study",
    "StudyDefinition",
    "Tasks",
    "check_figure",
    "check_new_file",
    "check_new_folder",
    "check_plan_targets",
    "check_size",
    "check_study_folder",
    "compare_studies",
    "definition_data",
    "export_study",
    "faults_of",
    "jobs_of",
    "lengthen",
    "load_definition",
    "load_scenario",
    "load_study",
    "make_controller",
    "make_estimator",
    "make_plant",
    "make_sensors",
    "make_supervisor",
    "map_scenario",
    "one_task",
    "paper_scenario",
    "parse_definition",
    "plan_and_check",
    "plan_at",
    "plan_facts",
    "plan_scenario",
    "planned_duration",
    "read_study",
    "report_study",
    "retime",
    "robot_section",
    "run_block",
    "run_experiment",
    "run_job",
    "run_study",
    "save_definition",
    "save_figure",
    "save_plan",
    "save_scenario",
    "solve_queries",
    "study_names",
    "study_tasks",
    "warm_up",
    "with_task",
]
