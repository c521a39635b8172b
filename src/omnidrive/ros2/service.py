"""Services of ROS 2 as rmw_cyclonedds transmits them, and the lifecycle of a node."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from typing import Any, NamedTuple

from omnidrive.errors import InvalidMessage
from omnidrive.ros2.cdr import decode, encode
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.names import dds_topic, resolve
from omnidrive.ros2.node import Node

_log = logging.getLogger("omnidrive")
_IDENTITY = 16
"""Length of the identity of a request, bytes: handle of the client's writer and number, 64 bits
each, which the reply repeats."""


class Service:
    """A service that other nodes call; Cyclone DDS as middleware (rmw_cyclonedds) is needed.

    Args:
        node: The node.
        name: Name of the service.
        type_name: Type of the service, such as ``lifecycle_msgs/srv/GetState``.
        handle: Returns the response to a request; None: :meth:`reply` gives it later. It receives
            the request and its identity.
        head: Type, of fixed size, of the first field of the request, which alone is decoded then;
            the handler receives it, and the bytes from :attr:`data`.

    Attributes:
        response: Class of the responses.
        data: Bytes of the request that is handled.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        type_name: str,
        handle: Callable[[Any, bytes], Message | None],
        head: str | None = None,
    ) -> None:
        self._handle, self._node, self._request = handle, node, f"{type_name}_Request"
        full = resolve(name, node.namespace, node=node.name)
        number = os.urandom(15)  # both endpoints have it, so that clients find the pair
        mark = "serviceid=" + ".".join(["10", *(f"{each:x}" for each in number)]) + ";"
        self._requests = node.request_subscription(dds_topic(full, "rq"), self._request, mark)
        self._replies = node.request_publisher(dds_topic(full, "rr"), f"{type_name}_Response", mark)
        self._head, self.data = head or self._request, b""
        self._length = None if head is None else len(self._encoded(head)) + _IDENTITY
        self.response = self._replies.message

    def poll(self) -> None:
        """Answer the requests that arrived; those that are not of the type are left out."""
        for raw in self._requests.take_raw():
            try:
                request = self._decoded(raw.data[: self._length], self._head)
            except InvalidMessage as error:
                _log.warning("a request is refused: %s", error)
                continue
            self.data = raw.data
            identity = raw.data[4 : 4 + _IDENTITY]
            response = self._handle(request, identity)
            if response is not None:
                self.reply(response, identity)

    def request(self, data: bytes) -> Any:
        """Return the whole request of bytes of :attr:`data`.

        Raises:
            InvalidMessage: They hold something else.
        """
        return self._decoded(data, self._request)

    def _encoded(self, name: str) -> bytes:
        return encode(message_type(name, self._node.distribution)())

    def _decoded(self, data: bytes, name: str) -> Any:
        return decode(data, name, self._node.distribution, skip=_IDENTITY)

    def reply(self, response: Message, identity: bytes) -> None:
        """Send the response to the request with an identity."""
        self._replies.publish(response, prefix=identity)


class _Transition(NamedTuple):
    """A transition of the lifecycle."""

    label: str
    start: int
    goal: int


UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = 1, 2, 3, 4
_STATES = {1: "unconfigured", 2: "inactive", 3: "active", 4: "finalized"}
_TRANSITIONS = {
    1: _Transition("configure", UNCONFIGURED, INACTIVE),
    2: _Transition("cleanup", INACTIVE, UNCONFIGURED),
    3: _Transition("activate", INACTIVE, ACTIVE),
    4: _Transition("deactivate", ACTIVE, INACTIVE),
    5: _Transition("shutdown", UNCONFIGURED, FINALIZED),
    6: _Transition("shutdown", INACTIVE, FINALIZED),
    7: _Transition("shutdown", ACTIVE, FINALIZED),
}
"""Transitions by their number in ``lifecycle_msgs/msg/Transition``."""


class Lifecycle:
    """Lifecycle of a node, which a lifecycle manager controls by services.

    Args:
        node: The node.

    Attributes:
        state: Number of the state in ``lifecycle_msgs/msg/State``.
    """

    def __init__(self, node: Node) -> None:
        self.state = UNCONFIGURED
        self._distribution = node.distribution
        services = (
            ("ChangeState", "change_state", self._change),
            ("GetState", "get_state", self._get),
            ("GetAvailableStates", "get_available_states", self._states),
            ("GetAvailableTransitions", "get_available_transitions", self._transitions),
        )
        self._services = {
            kind: Service(node, f"~/{name}", f"lifecycle_msgs/srv/{kind}", handle)
            for kind, name, handle in services
        }

    def poll(self) -> None:
        """Answer the requests that arrived."""
        for each in self._services.values():
            each.poll()

    def _change(self, request: Any, _identity: bytes) -> Message:
        """Change the state by the number of the transition, or its label if that is given."""
        asked = request.transition
        found = [
            each
            for number, each in _TRANSITIONS.items()
            if each.start == self.state
            and (each.label == asked.label if asked.label else number == asked.id)
        ]
        if found:
            self.state = found[0].goal
            _log.info("lifecycle: %s", _STATES[self.state])
        return self._services["ChangeState"].response(success=bool(found))

    def _get(self, _request: Any, _identity: bytes) -> Message:
        return self._services["GetState"].response(current_state=self._state(self.state))

    def _states(self, _request: Any, _identity: bytes) -> Message:
        states = [self._state(number) for number in _STATES]
        return self._services["GetAvailableStates"].response(available_states=states)

    def _transitions(self, _request: Any, _identity: bytes) -> Message:
        make = message_type("lifecycle_msgs/msg/TransitionDescription", self._distribution)
        name = message_type("lifecycle_msgs/msg/Transition", self._distribution)
        found = [
            make(name(number, each.label), self._state(each.start), self._state(each.goal))
            for number, each in _TRANSITIONS.items()
            if each.start == self.state
        ]
        return self._services["GetAvailableTransitions"].response(available_transitions=found)

    def _state(self, number: int) -> Message:
        make = message_type("lifecycle_msgs/msg/State", self._distribution)
        return make(id=number, label=_STATES[number])
