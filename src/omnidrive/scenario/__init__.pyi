from .planned_scenario import PlannedScenario, plan_and_check, plan_scenario
from .plants import make_plant
from .run_parts import make_controller, make_estimator, make_sensors, make_supervisor
from .run_settings import RunSettings, faults_of, settings_of_runs
from .run_simulation import simulate_run
from .scenario import Scenario, map_scenario, paper_scenario
from .scenario_file import load_scenario, save_scenario
from .sections import MapSection, RobotSection, SensorsSection, robot_section
from .tasks import Tasks, study_tasks
from .timing import lengthen, one_task, plan_at, retime, with_task

__all__ = [
    "MapSection",
    "PlannedScenario",
    "RobotSection",
    "RunSettings",
    "Scenario",
    "SensorsSection",
    "Tasks",
    "faults_of",
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
    "save_scenario",
    "settings_of_runs",
    "simulate_run",
    "study_tasks",
    "with_task",
]
