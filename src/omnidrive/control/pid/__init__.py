"""PID controllers with constant gains or gains tuned by a fuzzy system, and that system."""

from omnidrive.control.pid.channel import PidChannel
from omnidrive.control.pid.gain_tuning import gain_tuning_system
from omnidrive.control.pid.laws import (
    MemorylessParameters,
    SelfTuningParameters,
    TrackingParameters,
)
from omnidrive.control.pid.presets import classical_pid, fuzzy_pid
from omnidrive.control.pid.tracking_controller import TrackingPidController
from omnidrive.control.pid.tuners import Tuner, fuzzy_tuner, gain_inference, no_tuning
from omnidrive.control.pid.waypoint_controller import FuzzyPidController

__all__ = [
    "FuzzyPidController",
    "MemorylessParameters",
    "PidChannel",
    "SelfTuningParameters",
    "TrackingParameters",
    "TrackingPidController",
    "Tuner",
    "classical_pid",
    "fuzzy_pid",
    "fuzzy_tuner",
    "gain_inference",
    "gain_tuning_system",
    "no_tuning",
]
