"""Times of ROS 2: stamps of messages and the time of a simulation."""

from __future__ import annotations

import time

from omnidrive.ros2.interface import Distribution
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.node import Node, Subscription

_STAMP = "builtin_interfaces/msg/Time"


def seconds(stamp: Message) -> float:
    """Return the time of a stamp, s."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def stamp(t: float, distribution: Distribution) -> Message:
    """Return the stamp of a time ``t`` (s from 0 to 2^31), rounded to nanoseconds."""
    whole, nanoseconds = divmod(round(t * 1e9), 10**9)
    return message_type(_STAMP, distribution)(sec=whole, nanosec=nanoseconds)


_ANOTHER_TIME = 3600.0
"""Difference of a stamp from the present time above which it is of another time, s."""


def other_time(stamped: float, now: float) -> str:
    """Return that a stamp is of another time than ``now`` (s), in one line; empty: it is not."""
    if abs(stamped - now) <= _ANOTHER_TIME:
        return ""
    return (
        f"its stamp is {stamped:.0f} s, but the time is {now:.0f} s: simulated and wall-clock time "
        "are mixed; set use_sim_time alike in all nodes"
    )


class RosClock:
    """The time in which messages are stamped: that of the computer, or of ``/clock``.

    Args:
        node: The node.
        simulated: Whether the time is that of the topic ``/clock`` (``use_sim_time`` of ROS).
    """

    def __init__(self, node: Node, *, simulated: bool = False) -> None:
        self._subscription: Subscription | None = None
        self._simulated: float | None = None
        if simulated:
            self._subscription = node.subscription("/clock", "rosgraph_msgs/msg/Clock")

    def now(self) -> float | None:
        """Return the time, s; None before the first message on ``/clock``."""
        if self._subscription is None:
            return time.time()
        message = self._subscription.latest()
        if message is not None:
            self._simulated = seconds(message.clock)
        return self._simulated


class SimulatedTimeClock:
    """The time of ``/clock`` as clock of a drive, which then runs at the speed of the simulation.

    Args:
        clock: The time of ROS.
        timeout: Time without progress of ``/clock`` after which waiting ends, s.
    """

    def __init__(self, clock: RosClock, timeout: float = 1.0) -> None:
        self._clock, self._timeout = clock, timeout

    def now(self) -> float:
        """Return the present time, s; 0 before the first message."""
        return self._clock.now() or 0.0

    def sleep_until(self, t: float) -> None:
        """Sleep until the time ``t`` (s); return earlier if the simulation is paused."""
        last, since = self.now(), time.monotonic()
        while (now := self.now()) < t and time.monotonic() - since < self._timeout:
            if now != last:
                last, since = now, time.monotonic()
            time.sleep(0.0005)
