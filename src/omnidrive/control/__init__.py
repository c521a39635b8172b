"""Controllers: each law a pure function, each controller a thin shell with its memory."""

from omnidrive.control.controller import Command, Controller, DetailedController, Status
from omnidrive.control.feedforward import FeedforwardController, FeedforwardGains
from omnidrive.control.nmpc import NmpcController, unicycle_nmpc
from omnidrive.control.nmpc.holonomic import (
    HolonomicController,
    HolonomicParameters,
    holonomic_nmpc,
)
from omnidrive.control.pid import (
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
    "NmpcController",
    "Status",
    "TrackingPidController",
    "classical_pid",
    "fuzzy_pid",
    "holonomic_nmpc",
    "unicycle_nmpc",
]
