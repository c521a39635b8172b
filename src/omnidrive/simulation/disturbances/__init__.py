"""Disturbances and faults of a run, and their schedule."""

from omnidrive.simulation.disturbances.fault import (
    FAULTS,
    PLANT_FAULTS,
    DeadEncoder,
    DeadWheel,
    Fault,
    LockedWheel,
    PayloadShift,
    PeriodJitter,
    PoseJump,
    Push,
    SilentSensor,
    SlipperyPatch,
    Slope,
    SolverOverrun,
    WeakWheel,
    default_faults,
)
from omnidrive.simulation.disturbances.fault_text import parse_fault
from omnidrive.simulation.disturbances.schedule import Schedule

__all__ = [
    "FAULTS",
    "PLANT_FAULTS",
    "DeadEncoder",
    "DeadWheel",
    "Fault",
    "LockedWheel",
    "PayloadShift",
    "PeriodJitter",
    "PoseJump",
    "Push",
    "Schedule",
    "SilentSensor",
    "SlipperyPatch",
    "Slope",
    "SolverOverrun",
    "WeakWheel",
    "default_faults",
    "parse_fault",
]
