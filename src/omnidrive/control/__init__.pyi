from .controller import (
    Command,
    CommandLimits,
    CommandValue,
    Controller,
    DetailedController,
    LimitedController,
    PreparableController,
    ReducibleController,
    Retiming,
    RetimingController,
    Status,
    WheelSpeeds,
    WheelTorques,
)
from .feedforward import FeedforwardController, FeedforwardGains
from .nmpc import UnicycleController, unicycle_nmpc
from .nmpc.holonomic import (
    HolonomicController,
    HolonomicParameters,
    holonomic_nmpc,
)
from .pid import (
    FuzzyPidController,
    TrackingPidController,
    classical_pid,
    fuzzy_pid,
)
from .pipeline import Pipeline, PipelineStep
from .reduced_drive import ReducedDrive
from .reference_governor import ReferenceGovernor

__all__ = [
    "Command",
    "CommandLimits",
    "CommandValue",
    "Controller",
    "DetailedController",
    "FeedforwardController",
    "FeedforwardGains",
    "FuzzyPidController",
    "HolonomicController",
    "HolonomicParameters",
    "LimitedController",
    "Pipeline",
    "PipelineStep",
    "PreparableController",
    "ReducedDrive",
    "ReducibleController",
    "ReferenceGovernor",
    "Retiming",
    "RetimingController",
    "Status",
    "TrackingPidController",
    "UnicycleController",
    "WheelSpeeds",
    "WheelTorques",
    "classical_pid",
    "fuzzy_pid",
    "holonomic_nmpc",
    "unicycle_nmpc",
]
