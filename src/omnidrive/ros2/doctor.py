"""What prevents nodes of ROS 2 from receiving each other's messages, and what to do about it."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Literal, NamedTuple

from omnidrive.ros2.graph import Endpoint, Graph, describe
from omnidrive.ros2.interface import Distribution, interfaces
from omnidrive.ros2.node import Node, Subscription
from omnidrive.ros2.qos import SENSOR_QOS
from omnidrive.ros2.ros_time import seconds
from omnidrive.ros2.type_hash import distributions_with, type_hash

STAMPED = {
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TwistStamped",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/LaserScan",
    "tf2_msgs/msg/TFMessage",
}
"""Types of frequent messages with a stamp."""
COMMANDS = "/cmd_vel"
COMMAND_TYPES = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")
CLOCK = "/clock"
MAX_SKEW = 0.1
"""Difference of clocks, s, from which it is reported: two samples of a pose at 20 Hz."""
_MAX_TOPICS = 16
_MIDDLEWARE = {b"\x01\x10": "Cyclone DDS", b"\x01\x0f": "Fast DDS", b"\x01\x01": "Connext"}


class Finding(NamedTuple):
    """One observation."""

    level: Literal["error", "warning", "note"]
    """Whether messages are lost, may be lost, or nothing is wrong."""
    fact: str
    """What is seen."""
    remedy: str = ""
    """What to do."""


@dataclass
class TopicTraffic:
    """Messages of one topic while the doctor listens.

    Attributes:
        count: Number of messages.
        skews: Time of arrival here minus time of sending by the sender's clock, s.
        ages: Time of arrival minus stamp, s; in simulated time if ``/clock`` is received.
    """

    count: int = 0
    skews: list[float] = field(default_factory=list)
    ages: list[float] = field(default_factory=list)


class Examination(NamedTuple):
    """What the doctor saw."""

    graph: Graph
    """The graph."""
    distribution: Distribution
    """Distribution that is seen or given."""
    traffic: Mapping[str, TopicTraffic]
    """Messages by topic."""
    duration: float
    """Time of listening, s."""
    peers: tuple[str, ...]
    """Hosts that were asked by unicast."""


def examine(node: Node, duration: float, peers: tuple[str, ...] = ()) -> Examination:
    """Look at the graph and listen to topics with stamps for ``duration`` (s)."""
    start = time.monotonic()
    end = start + duration
    listening: dict[str, Subscription] = {}
    traffic: dict[str, TopicTraffic] = {}
    simulated: float | None = None
    while time.monotonic() < end:
        for name, kind in _topics_to_hear(node.graph(), listening):
            listening[name] = node.subscription(name, kind, SENSOR_QOS)
            traffic[name] = TopicTraffic()
        node.wait(min(0.2, max(end - time.monotonic(), 0.0)))
        for name, subscription in listening.items():
            for received in subscription.take(1024):
                heard = traffic[name]
                heard.count += 1
                heard.skews.append(time.time() - 1e-9 * received.sent)
                if name == CLOCK:
                    simulated = seconds(received.message.clock)
                    continue
                now = time.time() if simulated is None else simulated
                heard.ages += [now - t for t in _stamps(received.message)]
    graph = node.graph()
    own = {each.gid for each in graph.participants if each.local}
    others = graph._replace(
        endpoints=tuple(each for each in graph.endpoints if each.participant not in own)
    )
    return Examination(others, node.distribution, traffic, duration, peers)


def _topics_to_hear(graph: Graph, known: Mapping[str, object]) -> list[tuple[str, str]]:
    found = [
        (each.topic, each.type)
        for each in graph.endpoints
        if each.publishes
        and each.prefix == "rt"
        and each.topic not in known
        and not each.qos.transient_local
        and (each.type in STAMPED or (each.topic, each.type) == (CLOCK, "rosgraph_msgs/msg/Clock"))
    ]
    return list(dict(found).items())[: _MAX_TOPICS - len(known)]


def _stamps(message: object) -> Iterator[float]:
    """Yield the stamps of a message."""
    headers = getattr(message, "transforms", None) or [message]
    yield from (seconds(each.header.stamp) for each in headers if hasattr(each, "header"))


def diagnose(seen: Examination) -> list[Finding]:
    """Return what is wrong in a domain, errors first."""
    graph = seen.graph
    others = [each for each in graph.participants if not each.local]
    if not others:
        return [_nobody(seen)]
    findings = [
        *_participants(seen),
        *_types(graph),
        *_hashes(graph, seen.distribution),
        *_qos(graph),
        *_commands(graph),
        *_clocks(seen),
        *_poses(graph),
    ]
    order = ("error", "warning", "note")
    return sorted(dict.fromkeys(findings), key=lambda each: order.index(each.level))


def _nobody(seen: Examination) -> Finding:
    port = 7400 + 250 * seen.graph.domain
    asked = f" and the peers {', '.join(seen.peers)}" if seen.peers else ""
    return Finding(
        "error",
        f"no other process in domain {seen.graph.domain} within {seen.duration:g} s{asked}",
        "check that ROS_DOMAIN_ID is the same everywhere; between computers without multicast, and "
        "if the others have ROS_LOCALHOST_ONLY=1 or ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, name "
        f"their hosts: --peer HOST; allow the UDP ports {port} to {port + 249} in firewalls",
    )


def middleware(gid: bytes) -> str:
    """Return the name of the middleware of an identity, by the vendor in its first two bytes."""
    return _MIDDLEWARE.get(gid[:2], "another middleware")


def _participants(seen: Examination) -> Iterator[Finding]:
    others = [each for each in seen.graph.participants if not each.local]
    nodes = [name for each in others for name in each.nodes]
    vendors = sorted({middleware(each.gid) for each in others})
    yield Finding("note", f"nodes: {len(nodes)}; processes: {len(others)}; {', '.join(vendors)}")
    ros = {e.participant for e in seen.graph.endpoints}
    silent = [each for each in others if each.gid in ros and not each.nodes]
    if silent:
        yield Finding(
            "warning",
            f"{len(silent)} processes with topics of ROS announce no nodes that this one can read",
            "they may be of another distribution: try --distribution humble or jazzy",
        )
    foreign = [v for v in vendors if v != "Cyclone DDS"]
    if foreign:
        yield Finding(
            "note",
            f"topics reach {', '.join(foreign)}; services and actions do not",
            "use RMW_IMPLEMENTATION=rmw_cyclonedds_cpp there for actions",
        )
    hashed = {bool(e.type_hash) for e in seen.graph.endpoints if e.prefix == "rt"}
    if len(hashed) == 2:
        yield Finding(
            "warning",
            "nodes of Humble (without type hashes) and of later distributions in one domain",
            "they do not see each other's nodes; give each its own ROS_DOMAIN_ID",
        )


def _types(graph: Graph) -> Iterator[Finding]:
    for topic, types in graph.topics().items():
        if len(types) > 1:
            users = [
                f"{kind} ({', '.join(sorted({describe(e) for e in _of(graph, topic, kind)}))})"
                for kind in sorted(types)
            ]
            yield Finding(
                "error",
                f"{topic} has the types {' and '.join(users)}",
                "publishers and subscriptions of different types do not match: remap or rename one",
            )


def _of(graph: Graph, topic: str, kind: str) -> Iterable[Endpoint]:
    return (e for e in graph.endpoints if (e.topic, e.type, e.prefix) == (topic, kind, "rt"))


def _hashes(graph: Graph, distribution: Distribution) -> Iterator[Finding]:
    known = interfaces(distribution)
    for each in graph.endpoints:
        if not each.type_hash or each.type not in known:
            continue
        own = type_hash(each.type, distribution)
        others = distributions_with(each.type, each.type_hash)
        if distribution in others:
            continue
        if others:
            yield Finding(
                "error",
                f"{describe(each)} has the definition of {each.type} of {', '.join(others)} on "
                f"{each.topic}, not that of {distribution}",
                f"use one distribution, or name that of the others: --distribution {others[0]}",
            )
        else:
            yield Finding(
                "warning",
                f"{describe(each)} has a definition of {each.type} on {each.topic} that is not "
                f"known: {each.type_hash}; that of {distribution} is {own}",
                "a later release may have other fields, and messages are then refused: report it "
                f"with the output of: ros2 interface show {each.type}",
            )


def _qos(graph: Graph) -> Iterator[Finding]:
    for publisher, subscription in graph.pairs():
        fault = subscription.qos.fault(publisher.qos)
        if fault and publisher.type == subscription.type:
            yield Finding(
                "error",
                f"{subscription.topic}: nothing from {describe(publisher)} arrives at "
                f"{describe(subscription)}: {fault}",
                "change the QoS of one of them",
            )


def _commands(graph: Graph) -> Iterator[Finding]:
    publishers, takers = graph.publishers(COMMANDS), graph.subscriptions(COMMANDS)
    if len(publishers) > 1:
        names = ", ".join(sorted(map(describe, publishers)))
        yield Finding(
            "warning",
            f"{len(publishers)} publishers on {COMMANDS}: {names}",
            "idle ones do not disturb, but only one may send: stop the others, or use a "
            "multiplexer such as twist_mux",
        )
    if not takers:
        yield Finding(
            "warning",
            f"nothing subscribes to {COMMANDS}",
            "start the robot's driver, or remap its topic",
        )
    for kind in sorted({each.type for each in takers} - set(COMMAND_TYPES)):
        yield Finding("error", f"{COMMANDS} is {kind}", "omnidrive sends Twist or TwistStamped")


def _clocks(seen: Examination) -> Iterator[Finding]:
    simulated = CLOCK in seen.traffic
    if simulated:
        heard = seen.traffic[CLOCK]
        rate = heard.count / seen.duration
        level: Literal["note", "error"] = "note" if heard.count else "error"
        yield Finding(
            level,
            f"{CLOCK} is published at {rate:.3g} Hz",
            "use --use-sim-time" if heard.count else "the simulation is paused",
        )
    for topic, heard in seen.traffic.items():
        skew = median(heard.skews) if heard.skews else 0.0
        age = median(heard.ages) if heard.ages else 0.0
        if abs(skew) > MAX_SKEW:
            yield Finding(
                "error",
                f"{topic}: the clock of its sender is {abs(skew):.3g} s "
                f"{'behind' if skew > 0.0 else 'ahead of'} that of this computer",
                "synchronise the computers' clocks: chrony or ptp",
            )
        elif abs(age) > MAX_SKEW:
            where = "in the simulated time" if simulated else "by this computer's clock"
            yield Finding(
                "warning",
                f"{topic}: stamps are {abs(age):.3g} s {'old' if age > 0.0 else 'in the future'} "
                f"{where}",
                "the sender is slow or uses another time: set use_sim_time in all nodes alike",
            )
        if heard.count == 0 and topic != CLOCK:
            yield Finding("warning", f"{topic}: no message within {seen.duration:g} s")


def _poses(graph: Graph) -> Iterator[Finding]:
    if not (graph.publishers("/odom") or graph.publishers("/tf")):
        yield Finding(
            "warning",
            "neither /odom nor /tf is published",
            "driving needs one of them: start the robot's driver or a localisation, or remap them",
        )
