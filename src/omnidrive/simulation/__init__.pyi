from .conditions import Conditions, Motor, Patch, Payload, SensorConditions
from .faults import (
    FAULTS,
    Fault,
    Schedule,
    default_faults,
    parse_fault,
)
from .identify import identify_lag
from .kinematic import KinematicPlant
from .loop import simulate
from .mujoco_plant import MujocoPlant
from .plant import DisturbablePlant, Measurement, Plant
from .run import Outcome, Run
from .sensing import Estimate, PaperNoise, PerfectSensor, Sensor

__all__ = [
    "FAULTS",
    "Conditions",
    "DisturbablePlant",
    "Estimate",
    "Fault",
    "KinematicPlant",
    "Measurement",
    "Motor",
    "MujocoPlant",
    "Outcome",
    "PaperNoise",
    "Patch",
    "Payload",
    "PerfectSensor",
    "Plant",
    "Run",
    "Schedule",
    "Sensor",
    "SensorConditions",
    "default_faults",
    "identify_lag",
    "parse_fault",
    "simulate",
]
