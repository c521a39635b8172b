"""The robot's answer to a command, and the loop that closes around it."""

from omnidrive.simulation.conditions import Conditions, Motor, Patch, Payload
from omnidrive.simulation.identify import identify_lag
from omnidrive.simulation.kinematic import KinematicPlant
from omnidrive.simulation.loop import Outcome, Run, simulate
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco_plant import MujocoPlant
from omnidrive.simulation.plant import DisturbablePlant, Measurement, Plant
from omnidrive.simulation.sensing import Estimate, PaperNoise, PerfectSensor, Sensor

__all__ = [
    "Conditions",
    "DisturbablePlant",
    "Estimate",
    "KinematicPlant",
    "Measurement",
    "Motor",
    "MovingObstacle",
    "MujocoPlant",
    "Outcome",
    "PaperNoise",
    "Patch",
    "Payload",
    "PerfectSensor",
    "Plant",
    "Run",
    "Sensor",
    "identify_lag",
    "simulate",
]
