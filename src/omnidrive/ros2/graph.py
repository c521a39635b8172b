"""The graph of ROS 2: nodes, and publishers and subscriptions with their types."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from omnidrive.ros2.dds import cyclonedds, user_data
from omnidrive.ros2.names import ros_topic, ros_type_name
from omnidrive.ros2.qos import Qos, ros_qos


class Endpoint(NamedTuple):
    """A publisher or subscription of any process in the domain."""

    topic: str
    """Absolute name of the topic or service."""
    type: str
    """Full name of its type, such as ``nav_msgs/msg/Odometry``."""
    node: str
    """Full name of its node; empty: not announced."""
    publishes: bool
    """Whether it is a publisher."""
    qos: Qos
    """Quality of service that it offers or requests."""
    type_hash: str
    """Hash of the type; empty: not announced, as by Humble."""
    gid: bytes
    """Identity of the endpoint, 16 bytes."""
    participant: bytes
    """Identity of its participant, 16 bytes."""
    prefix: str = "rt"
    """``rt``: topic; ``rq``, ``rr``: requests and replies of a service."""


class Participant(NamedTuple):
    """A process in the domain."""

    gid: bytes
    """Identity, 16 bytes."""
    enclave: str | None
    """Security enclave; None: it is no process of ROS 2."""
    nodes: tuple[str, ...]
    """Full names of its nodes; empty: not announced."""
    local: bool
    """Whether it is the participant that looks."""


class Graph(NamedTuple):
    """What is seen of a domain at one instant."""

    domain: int
    """Number of the domain."""
    participants: tuple[Participant, ...]
    """All participants, also that which looks."""
    endpoints: tuple[Endpoint, ...]
    """All endpoints of ROS 2, also of services."""

    def publishers(self, topic: str, *, of_others: bool = False) -> tuple[Endpoint, ...]:
        """Return the publishers of a topic; ``of_others``: without those of this process."""
        local = {each.gid for each in self.participants if each.local} if of_others else set()
        return tuple(
            each
            for each in self.endpoints
            if each.publishes
            and each.topic == topic
            and each.prefix == "rt"
            and each.participant not in local
        )

    def subscriptions(self, topic: str) -> tuple[Endpoint, ...]:
        """Return the subscriptions of a topic."""
        return tuple(
            each
            for each in self.endpoints
            if not each.publishes and each.topic == topic and each.prefix == "rt"
        )

    def topics(self) -> dict[str, set[str]]:
        """Return the types of each topic."""
        found: dict[str, set[str]] = {}
        for each in self.endpoints:
            if each.prefix == "rt":
                found.setdefault(each.topic, set()).add(each.type)
        return dict(sorted(found.items()))

    def pairs(self) -> Iterator[tuple[Endpoint, Endpoint]]:
        """Yield every publisher with every subscription of the same topic."""
        subscriptions: dict[tuple[str, str], list[Endpoint]] = {}
        for each in self.endpoints:
            if not each.publishes:
                subscriptions.setdefault((each.topic, each.prefix), []).append(each)
        for publisher in self.endpoints:
            if publisher.publishes:
                for each in subscriptions.get((publisher.topic, publisher.prefix), ()):
                    yield publisher, each


def describe(endpoint: Endpoint) -> str:
    """Return the node of an endpoint for messages; without one the start of its identity."""
    return endpoint.node or f"participant {endpoint.participant[:12].hex()}"


def discovered(sample: Any, publishes: bool, owners: dict[bytes, str]) -> Endpoint | None:
    """Return the endpoint of a sample of discovery; None if it is not of ROS 2.

    Args:
        sample: Sample of the DDS topic of publications or subscriptions.
        publishes: Whether it is one of publications.
        owners: Full names of nodes by the identities of their endpoints.
    """
    found = ros_topic(sample.topic_name)
    if found is None:
        return None
    return Endpoint(
        topic=found[0],
        type=ros_type_name(sample.type_name),
        node=owners.get(sample.key.bytes, ""),
        publishes=publishes,
        qos=ros_qos(sample.qos, cyclonedds("core").Policy),
        type_hash=user_data(sample.qos).get("typehash", ""),
        gid=sample.key.bytes,
        participant=sample.participant_key.bytes,
        prefix=found[1],
    )
