"""The robot's answer to a command, and the loop that closes around it."""

from omnidrive.simulation.identify import identify_lag
from omnidrive.simulation.kinematic import KinematicPlant
from omnidrive.simulation.loop import Outcome, Run, simulate
from omnidrive.simulation.mujoco_plant import MujocoPlant
from omnidrive.simulation.plant import Measurement, Plant
from omnidrive.simulation.sensing import PaperNoise, PerfectSensor, Sensor

__all__ = [
    "KinematicPlant",
    "Measurement",
    "MujocoPlant",
    "Outcome",
    "PaperNoise",
    "PerfectSensor",
    "Plant",
    "Run",
    "Sensor",
    "identify_lag",
    "simulate",
]
