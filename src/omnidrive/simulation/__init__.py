"""The robot's answer to a command, and the loop that closes around it."""

from omnidrive.simulation.conditions import Conditions, Motor, Patch, Payload, SensorConditions
from omnidrive.simulation.faults import (
    FAULTS,
    Fault,
    Schedule,
    default_faults,
    parse_fault,
)
from omnidrive.simulation.identify import identify_lag
from omnidrive.simulation.kinematic import KinematicPlant
from omnidrive.simulation.loop import simulate
from omnidrive.simulation.mujoco_plant import MujocoPlant
from omnidrive.simulation.plant import DisturbablePlant, Measurement, Plant
from omnidrive.simulation.run import Outcome, Run
from omnidrive.simulation.sensing import Estimate, PaperNoise, PerfectSensor, Sensor

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
