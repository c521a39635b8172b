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
from .output_paths import check_figure, check_new_file, check_new_folder, check_plan_targets
from .plan import Fact, plan_facts, planned_duration, save_figure, save_plan
from .planned_scenario import PlannedScenario, plan_and_check, plan_scenario
from .plants import make_plant
from .queries import solve_queries
from .scenario import Scenario, map_scenario, paper_scenario
from .scenario_file import load_scenario, save_scenario
from .scenario_sections import MapSection, RobotSection, SensorsSection, robot_section
from .study import ProgressListener, Study, run_study
from .tasks import Tasks, study_tasks
from .timing import one_task, plan_at, retime, with_task
from .warm_up import warm_up

__all__ = [
    "Fact",
    "Job",
    "MapSection",
    "PlannedScenario",
    "ProgressListener",
    "RobotSection",
    "RunFolder",
    "Scenario",
    "SensorsSection",
    "Study",
    "Tasks",
    "check_figure",
    "check_new_file",
    "check_new_folder",
    "check_plan_targets",
    "faults_of",
    "jobs_of",
    "load_scenario",
    "make_controller",
    "make_estimator",
    "make_plant",
    "make_sensors",
    "make_supervisor",
    "map_scenario",
    "one_task",
    "paper_scenario",
    "plan_and_check",
    "plan_at",
    "plan_facts",
    "plan_scenario",
    "planned_duration",
    "retime",
    "robot_section",
    "run_job",
    "run_study",
    "save_figure",
    "save_plan",
    "save_scenario",
    "solve_queries",
    "study_tasks",
    "warm_up",
    "with_task",
]
