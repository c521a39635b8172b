from .batch import BatchResults, run_generators, simulate_batch
from .coppeliasim import CoppeliaSimPlant, CoppeliaSimScene
from .disturbances import FAULTS, Fault, Schedule, default_faults, parse_fault
from .disturbances.disturbances import (
    Disturbances,
    Impulse,
    Motor,
    Patch,
    Payload,
    PoseOffset,
    SensorFaults,
)
from .identification.identify_lag import identify_lag
from .kinematic import KinematicPlant
from .loop import simulate
from .moving_obstacle import MovingObstacle
from .mujoco.plant import MujocoPlant
from .planar import PlanarPlant, simulate_commands
from .plant import (
    DisturbablePlant,
    Plant,
    PlantCapabilities,
    PlantState,
    Saturation,
    check_command,
    check_robot,
)
from .run import Outcome, Run
from .saved_run import load_run
from .sensors import (
    Lidar,
    LidarSettings,
    PaperNoise,
    PerfectSensors,
    Sensors,
    SensorSuite,
)

__all__ = [
    "FAULTS",
    "BatchResults",
    "CoppeliaSimPlant",
    "CoppeliaSimScene",
    "DisturbablePlant",
    "Disturbances",
    "Fault",
    "Impulse",
    "KinematicPlant",
    "Lidar",
    "LidarSettings",
    "Motor",
    "MovingObstacle",
    "MujocoPlant",
    "Outcome",
    "PaperNoise",
    "Patch",
    "Payload",
    "PerfectSensors",
    "PlanarPlant",
    "Plant",
    "PlantCapabilities",
    "PlantState",
    "PoseOffset",
    "Run",
    "Saturation",
    "Schedule",
    "SensorFaults",
    "SensorSuite",
    "Sensors",
    "check_command",
    "check_robot",
    "default_faults",
    "identify_lag",
    "load_run",
    "parse_fault",
    "run_generators",
    "simulate",
    "simulate_batch",
    "simulate_commands",
]
