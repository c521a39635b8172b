"""Times of ROS 2: stamps of messages and the time of a simulation."""

from __future__ import annotations

import time

from omnidrive.deploy.ros2.interface import Distribution
from omnidrive.deploy.ros2.message import Message, message_type
from omnidrive.deploy.ros2.node import Node, Subscription

_STAMP = "builtin_interfaces/msg/Time"


def seconds(stamp: Message) -> float:
    """Return the time of a stamp, s."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def stamp(t: float, distribution: Distribution) -> Message:
    """Return the stamp of a time ``t`` (s from 0 to 2^31), rounded to nanoseconds."""
    whole, nanoseconds = divmod(round(t * 1e9), 10**9)
    return message_type(_STAMP, distribution)(sec=whole, nanosec=nanoseconds)


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
