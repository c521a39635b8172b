"""PID controllers whose gains a fuzzy system tunes, and that system."""

from omnidrive.control.pid.channel import MemorylessChannel, SelfTuningChannel, Tuner
from omnidrive.control.pid.controller import FuzzyPidController
from omnidrive.control.pid.laws import MemorylessParameters, SelfTuningParameters
from omnidrive.control.pid.presets import fuzzy_pid
from omnidrive.control.pid.sets import INPUT_SETS, OUTPUT_SETS, Footprint
from omnidrive.control.pid.tuners import fuzzy_tuner

__all__ = [
    "INPUT_SETS",
    "OUTPUT_SETS",
    "Footprint",
    "FuzzyPidController",
    "MemorylessChannel",
    "MemorylessParameters",
    "SelfTuningChannel",
    "SelfTuningParameters",
    "Tuner",
    "fuzzy_pid",
    "fuzzy_tuner",
]
