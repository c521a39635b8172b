from .controller import Command, Controller, DetailedController, Status
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

__all__ = [
    "Command",
    "Controller",
    "DetailedController",
    "FeedforwardController",
    "FeedforwardGains",
    "FuzzyPidController",
    "HolonomicController",
    "HolonomicParameters",
    "Status",
    "TrackingPidController",
    "UnicycleController",
    "classical_pid",
    "fuzzy_pid",
    "holonomic_nmpc",
    "unicycle_nmpc",
]
