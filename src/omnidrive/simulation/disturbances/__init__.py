"""What goes wrong in a run, and when."""

from omnidrive.simulation.disturbances.fault import (
    FAULTS,
    ON_THE_PLANT,
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
from omnidrive.simulation.disturbances.schedule import Schedule
from omnidrive.simulation.disturbances.words import parse_fault

__all__ = [
    "FAULTS",
    "ON_THE_PLANT",
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
