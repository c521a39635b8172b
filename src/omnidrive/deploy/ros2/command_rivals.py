"""Other nodes that send commands to the robot of a drive."""

from __future__ import annotations

import time
from collections.abc import Collection

from omnidrive.errors import one_line
from omnidrive.ros2.graph import Endpoint, describe
from omnidrive.ros2.node import Node, Publisher
from omnidrive.ros2.qos import SENSOR_QOS

_DEPTH = 64
_NAMING_TIME = 1.0
"""Time in which a publisher whose node is not announced yet may turn out to be allowed, s."""


class CommandRivals:
    """The publishers of a topic of commands besides that of a drive.

    A publisher is a rival when it sends a command, not when it exists: the servers of Nav2 for
    behaviours and docking have an idle one in every bringup.

    Args:
        node: The node.
        own: Publisher of the drive.
        allowed: Full names of the nodes that may send commands, such as ``/behavior_server``.
    """

    def __init__(self, node: Node, own: Publisher, allowed: Collection[str] = ()) -> None:
        self._node, self._own = node, own
        self._allowed = frozenset(allowed)
        qos = SENSOR_QOS._replace(depth=_DEPTH)  # any publisher satisfies it
        self._subscription = node.subscription(own.topic.removeprefix("rt"), own.type, qos)
        self._gids: dict[int, bytes] = {}
        self._permitted = {own.gid}
        self._unnamed: dict[bytes, float] = {}

    def forget(self) -> None:
        """Discard the commands that arrived before a drive."""
        self._subscription.take_raw(_DEPTH)
        self._unnamed.clear()

    def names(self) -> list[str]:
        """Return the nodes with a publisher that is not allowed to send commands, sorted."""
        return sorted({_name(each) for each in self._others() if each.node not in self._allowed})

    def heard(self) -> str:
        """Return the node that sent a command since the last call; empty: none did."""
        handles = {
            each.sample_info.publication_handle for each in self._subscription.take_raw(_DEPTH)
        }
        for handle in handles:
            if handle not in self._gids:
                self._gids[handle] = self._subscription.publisher_gid(handle)
        senders = {self._gids[each] for each in handles} - self._permitted
        if not senders:
            return ""
        known = {each.gid: each for each in self._others()}
        for gid in senders:
            found = known.get(gid)
            if found is None:
                return "a node that has left"
            if found.node in self._allowed:
                self._permitted.add(gid)
            elif not self._may_be_allowed(found):
                return _name(found)
        return ""

    def _may_be_allowed(self, sender: Endpoint) -> bool:
        """Return whether the name of a sender may still arrive, and be that of an allowed node."""
        if sender.node or not self._allowed:
            return False
        now = time.monotonic()
        return now - self._unnamed.setdefault(sender.gid, now) < _NAMING_TIME

    def _others(self) -> tuple[Endpoint, ...]:
        topic = self._own.topic.removeprefix("rt")
        found = self._node.graph().publishers(topic)
        return tuple(each for each in found if each.gid != self._own.gid)


def _name(endpoint: Endpoint) -> str:
    return one_line(describe(endpoint), 80)
