"""Fuzzy gain tuning: type-1 and interval type-2 inference, and the PID controllers it tunes."""

from omnidrive.control.fuzzy.channel import MemorylessChannel, SelfTuningChannel, Tuner
from omnidrive.control.fuzzy.controller import FuzzyPidController
from omnidrive.control.fuzzy.pid import MemorylessParameters, SelfTuningParameters
from omnidrive.control.fuzzy.presets import fuzzy_pid, fuzzy_tuner
from omnidrive.control.fuzzy.sets import INPUT_SETS, OUTPUT_SETS, Footprint

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
