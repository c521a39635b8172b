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
from .planned_scenario import PlannedScenario, plan_and_check, plan_scenario
from .plants import make_plant
from .scenario import Scenario, map_scenario, paper_scenario
from .scenario_file import load_scenario, save_scenario
from .sections import MapSection, RobotSection, SensorsSection, robot_section
from .tasks import Tasks, study_tasks
from .timing import lengthen, one_task, plan_at, retime, with_task

__all__ = [
    "Job",
    "MapSection",
    "PlannedScenario",
    "RobotSection",
    "Scenario",
    "SensorsSection",
    "Tasks",
    "faults_of",
    "jobs_of",
    "lengthen",
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
    "plan_scenario",
    "retime",
    "robot_section",
    "run_job",
    "save_scenario",
    "study_tasks",
    "with_task",
]
