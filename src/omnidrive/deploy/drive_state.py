"""State machine of a drive."""

from __future__ import annotations

import logging
from enum import Enum
from typing import NamedTuple

REFERENCE_ENDS = "the reference ends"
"""Reason of the stop of a drive that is finished."""
EVENT = {"is_event": True}
"""Attribute of log records of what happens at a time: equal ones are no repetitions."""
_log = logging.getLogger("omnidrive")


class DriveState(Enum):
    """State of a drive; only ``RUNNING`` sends commands of the controller."""

    IDLE = "idle"
    """Connected; zero speed is commanded."""
    ARMED = "armed"
    """Enabled by the user; the run begins with the next usable readings."""
    RUNNING = "running"
    """The controller drives the robot."""
    HOLDING = "holding"
    """The robot was ramped to zero speed for a reason; arming it again goes on."""
    STOPPED = "stopped"
    """The end; another drive needs a new call."""


_NEXT = {
    DriveState.IDLE: {DriveState.ARMED, DriveState.STOPPED},
    DriveState.ARMED: {DriveState.RUNNING, DriveState.HOLDING, DriveState.STOPPED},
    DriveState.RUNNING: {DriveState.HOLDING, DriveState.STOPPED},
    DriveState.HOLDING: {DriveState.ARMED, DriveState.STOPPED},
    DriveState.STOPPED: set(),
}


class StateChange(NamedTuple):
    """One change of the state."""

    t: float
    """Time since the drive began, s."""
    state: DriveState
    """The state from then on."""
    reason: str
    """Why, in one line."""


_NEVER_ARMED = StateChange(0.0, DriveState.IDLE, "no user armed the robot")


class StateMachine:
    """The state of a drive and its history; every change has a reason and is logged.

    Attributes:
        state: Present state.
        changes: All changes, in order.
    """

    def __init__(self) -> None:
        self.state = DriveState.IDLE
        self.changes: list[StateChange] = []

    def change(self, t: float, state: DriveState, reason: str) -> None:
        """Change the state at ``t`` (s).

        Raises:
            ValueError: The present state is not followed by this one.
        """
        if state not in _NEXT[self.state]:
            raise ValueError(f"{self.state.value} is not followed by {state.value}")
        self.state = state
        self.changes.append(StateChange(t, state, reason))
        level = logging.WARNING if state is DriveState.HOLDING else logging.INFO
        _log.log(level, "%s at %.3f s: %s", state.value, t, reason, extra=EVENT)

    def waits_too_long(self, t: float, limit: float) -> str:
        """Return why a drive ends that has waited to be armed for more than ``limit`` (s) at ``t``.

        Empty: it has not. The text names the state, its begin and its reason.
        """
        since, _, reason = self.changes[-1] if self.changes else _NEVER_ARMED
        if t - since <= limit:
            return ""
        if self.state is DriveState.ARMED:
            return f"armed since {since:.2f} s, but no usable pose arrived within {limit:g} s"
        waited = f"{self.state.value} since {since:.2f} s, and not armed within {limit:g} s"
        return f"{waited}: {reason}"
