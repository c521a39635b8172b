"""Controls of a drive: arming, holding and stopping, from threads, signals and file descriptors."""

from __future__ import annotations

import select
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from omnidrive.reference import Reference, SplicedReference


class Tracked(NamedTuple):
    """Motion that a drive tracks at present."""

    reference: Reference
    """The motion since the present segment began."""
    governed: Reference
    """The motion that the controller tracks instead."""
    t: float
    """Time since the segment began, s."""


class Continuation(NamedTuple):
    """Request to track another motion from a given time on, without a stop."""

    tracked: Reference
    """The motion that is tracked until then; if it is another one, nothing changes."""
    spliced: SplicedReference
    """That motion, and the other one from then on."""
    files: Mapping[str, bytes] = {}
    """File of the other motion by its name, for the log."""


class DriveControls:
    """What the user asks for; every method may be called from any thread or signal handler.

    A request to stop is final and has priority over all others.

    Attributes:
        stop_reason: Reason of the request to stop; None: there is none.
        hold_reason: Reason of the request to hold; None: there is none.
        arm_requested: Whether the robot is to be armed.
        held: Reason for which the robot is held, set by the loop; None: it is not held.
        connected: Whether samples are processed, so that the robot can be armed; set by the loop.
        interrupted: Number of the first signal that stopped the drive; 0: none.
        starts: Whether the controller has not driven yet.
        tracked: What the drive tracks; set by the loop. None: the controller does not drive.
        continuation: Other motion to track. The loop removes it in the next sample, whether it
            tracks it or not.
    """

    def __init__(self, *, arm: bool = False) -> None:
        """Begin without a request.

        Args:
            arm: Whether to arm the robot as soon as it is connected.
        """
        self.stop_reason: str | None = None
        self.hold_reason: str | None = None
        self.arm_requested = arm
        self.held: str | None = None
        self.connected = False
        self.interrupted = 0
        self.starts = True
        self.tracked: Tracked | None = None
        self.continuation: Continuation | None = None
        self._watched: dict[int, str] = {}

    def arm(self) -> None:
        """Let the drive begin, or go on after it was held."""
        self.hold_reason, self.arm_requested = None, True

    def hold(self, reason: str = "requested") -> None:
        """Ramp the robot to zero speed until :meth:`arm` is called."""
        self.arm_requested, self.hold_reason = False, reason

    def stop(self, reason: str = "emergency stop") -> None:
        """End the drive: zero speed at once."""
        if self.stop_reason is None:
            self.stop_reason = reason

    def watch(self, descriptor: int, reason: str = "emergency stop") -> None:
        """Stop when a file descriptor is readable or closed, such as that of a stop button."""
        self._watched[descriptor] = reason

    def poll(self) -> None:
        """Read the watched file descriptors; the loop calls this in every sample."""
        if not self._watched:
            return
        try:
            ready = select.select(list(self._watched), [], [], 0.0)[0]
        except (OSError, ValueError):  # one is closed
            self.stop("the file descriptor of the emergency stop is closed")
            return
        for descriptor in ready:
            self.stop(self._watched[descriptor])

    @contextmanager
    def of_signals(self) -> Iterator[None]:
        """Stop at SIGINT, SIGTERM and SIGHUP within the context; only in the main thread."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def handle(number: int, _frame: FrameType | None) -> None:
            """Stop for a signal."""
            self.interrupted = self.interrupted or number
            self.stop(f"signal {signal.Signals(number).name}")

        names = ("SIGINT", "SIGTERM", "SIGHUP")
        numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
        before = {number: signal.signal(number, handle) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
