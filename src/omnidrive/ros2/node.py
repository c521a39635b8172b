"""A node of ROS 2 over Cyclone DDS, without a ROS installation."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, NamedTuple, cast, get_args

from omnidrive.errors import InvalidMessage
from omnidrive.parameter import check_choice
from omnidrive.ros2.cdr import decode, encode
from omnidrive.ros2.dds import (
    cyclonedds,
    dds_qos,
    dds_type,
    domain_number,
    endpoint_data,
    join_domain,
    user_data,
)
from omnidrive.ros2.graph import Graph, Participant, discovered
from omnidrive.ros2.interface import LATEST, Distribution
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.names import dds_topic, resolve, ros_topic, ros_type_name
from omnidrive.ros2.qos import LATCHED_QOS, Qos
from omnidrive.ros2.type_hash import distribution_of

_log = logging.getLogger("omnidrive")
_DISCOVERY_TOPIC = "ros_discovery_info"
_ENTITIES = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_DISCOVERY_QOS = LATCHED_QOS
_DETECTION_TIME = 1.0
"""Time for which a node waits for others to learn their distribution, s."""
_ANNOUNCEMENTS = 1024
"""Greatest number of announcements of other nodes that are kept until they are read: they have no
key, so that the depth holds for all processes together."""
_SETTLING_TIME = 0.1
"""Time for which further endpoints are waited for after the first one, s."""
_MAX = 4096
"""Greatest number of samples that are read at once."""


class Received(NamedTuple):
    """A message with its facts from the middleware."""

    message: Message
    """The message."""
    sent: int
    """Time at which it was sent by the clock of the sender, ns since 1970."""
    publisher: int
    """Handle of its publisher in this process."""


class Publisher:
    """Publisher of one topic; made by :meth:`Node.publisher`."""

    def __init__(self, writer: Any, topic: str, type_name: str, distribution: Distribution) -> None:
        self._writer, self._make = writer, writer.topic.data_type
        self.topic, self.type = topic, type_name
        self.message = message_type(type_name, distribution)
        self.gid: bytes = writer.get_guid().bytes

    def publish(self, message: Message, *, prefix: bytes = b"") -> None:
        """Send a message.

        Args:
            message: The message.
            prefix: Identity of a request, before the message.

        Raises:
            InvalidMessage: It has another type, or a value that its type cannot hold.
        """
        if message.interface != self.message.interface:
            raise InvalidMessage(f"{self.topic} carries {self.type}, not {message.interface.name}")
        self.send(encode(message, prefix=prefix))

    def send(self, data: bytes) -> None:
        """Send a message that is encoded."""
        self._writer.write(self._make(data))

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive the messages."""
        return len(self._writer.get_matched_subscriptions())

    def wait_until_received(self, timeout: float) -> bool:
        """Return whether all reliable subscriptions acknowledge all messages in ``timeout`` (s)."""
        try:
            return bool(self._writer.wait_for_acks(round(timeout * 1e9)))
        except AttributeError:  # cyclonedds 11.0 looks for the code of a timeout in a wrong place
            return False


class Subscription:
    """Subscription of one topic; made by :meth:`Node.subscription`.

    Attributes:
        refused: Number of messages that were not of the type.
    """

    def __init__(self, reader: Any, topic: str, type_name: str, distribution: Distribution) -> None:
        self._reader, self._distribution = reader, distribution
        self.topic, self.type = topic, type_name
        self.gid: bytes = reader.get_guid().bytes
        self.refused = 0

    def take(self, maximum: int = 64) -> list[Received]:
        """Return the messages that arrived since the last call, oldest first; never wait."""
        received = []
        for raw in self.take_raw(maximum):
            try:
                message = decode(raw.data, self.type, self._distribution)
            except InvalidMessage as error:
                if not self.refused:
                    _log.warning("%s: a message is refused: %s", self.topic, error)
                self.refused += 1
                continue
            info = raw.sample_info
            received.append(Received(message, info.source_timestamp, info.publication_handle))
        return received

    def take_raw(self, maximum: int = 64) -> list[Any]:
        """Return the messages that arrived as bytes (``data``, ``sample_info``)."""
        samples = self._reader.take(maximum)
        return [each for each in samples if each.sample_info.valid_data]

    def latest(self) -> Message | None:
        """Return the newest message that arrived since the last call; None: none arrived."""
        received = self.take()
        return received[-1].message if received else None

    def publisher_gid(self, handle: int) -> bytes:
        """Return the identity of a publisher by its handle; empty: it has left."""
        found = self._reader.get_matched_publication_data(handle)
        return found.key.bytes if found is not None else b""

    @property
    def matched(self) -> int:
        """Number of publishers from which messages come."""
        return len(self._reader.get_matched_publications())


class Node:
    """A node that other processes of the domain see as one of ROS 2.

    Use it in a ``with`` statement, or call :meth:`close`.

    Args:
        name: Name of the node.
        namespace: Its namespace.
        domain: Number of the domain; None: ROS_DOMAIN_ID, or 0.
        peers: Hosts that are asked by unicast, such as ``localhost``; by default multicast finds
            all hosts of the network.
        distribution: Distribution of the other nodes; None: ROS_DISTRO, or that whose definitions
            have the hashes which nodes announce in the first second, or :data:`LATEST`.

    Raises:
        InvalidInput: A name, the domain or the distribution is not valid.
        MissingExtra: The package cyclonedds is not installed.
    """

    def __init__(
        self,
        name: str,
        *,
        namespace: str = "/",
        domain: int | None = None,
        peers: Sequence[str] = (),
        distribution: Distribution | None = None,
    ) -> None:
        if distribution is not None:
            check_choice("distribution", distribution, get_args(Distribution))
        self.full_name = resolve(name, namespace)
        self.namespace, _, self.name = self.full_name.rpartition("/")
        self.namespace = self.namespace or "/"
        self.domain = domain_number(domain)
        core, builtin = cyclonedds("core"), cyclonedds("builtin")
        join_domain(self.domain, peers)
        enclave = core.Qos(core.Policy.Userdata(b"enclave=/;"))
        self._participant = cyclonedds("domain").DomainParticipant(self.domain, enclave)
        self._views = [
            builtin.BuiltinDataReader(self._participant, each)
            for each in (
                builtin.BuiltinTopicDcpsParticipant,
                builtin.BuiltinTopicDcpsPublication,
                builtin.BuiltinTopicDcpsSubscription,
            )
        ]
        self._alive = [
            core.ReadCondition(
                view, core.ViewState.Any | core.SampleState.Any | core.InstanceState.Alive
            )
            for view in self._views
        ]
        self._waitset = core.WaitSet(self._participant)
        self.gid: bytes = self._participant.get_guid().bytes
        self._endpoints: list[tuple[bytes, bool]] = []
        self._announced: dict[bytes, tuple[tuple[str, bytes], ...]] = {}
        self._topics: dict[str, Any] = {}
        self._held: list[Any] = []  # a writer that is collected leaves the domain
        self.distribution: Distribution = distribution or self._detect()
        data = endpoint_data(_ENTITIES, self.distribution)
        self._info = self._publisher(_DISCOVERY_TOPIC, _ENTITIES, _DISCOVERY_QOS, data)
        self._infos = self._subscription(
            _DISCOVERY_TOPIC, _ENTITIES, _DISCOVERY_QOS._replace(depth=_ANNOUNCEMENTS), data
        )
        self._announce()

    def publisher(self, topic: str, type_name: str, qos: Qos = Qos()) -> Publisher:  # noqa: B008
        """Return a new publisher.

        Args:
            topic: Name of the topic; relative names are below the namespace.
            type_name: Full name of its type, such as ``geometry_msgs/msg/Twist``.
            qos: Quality of service that it offers.
        """
        name = dds_topic(resolve(topic, self.namespace, node=self.name))
        made = self._publisher(name, type_name, qos, endpoint_data(type_name, self.distribution))
        self._add(made.gid, publishes=True)
        return made

    def subscription(self, topic: str, type_name: str, qos: Qos = Qos()) -> Subscription:  # noqa: B008
        """Return a new subscription; arguments as of :meth:`publisher`."""
        name = dds_topic(resolve(topic, self.namespace, node=self.name))
        made = self._subscription(name, type_name, qos, endpoint_data(type_name, self.distribution))
        self._add(made.gid, publishes=False)
        return made

    def request_publisher(self, topic: str, type_name: str, identity: str) -> Publisher:
        """Return the publisher of requests or replies on a DDS topic."""
        data = endpoint_data(type_name, self.distribution, identity)
        made = self._publisher(topic, type_name, Qos(), data, request=True)
        self._add(made.gid, publishes=True)
        return made

    def request_subscription(self, topic: str, type_name: str, identity: str) -> Subscription:
        """Return the subscription of requests or replies on a DDS topic."""
        data = endpoint_data(type_name, self.distribution, identity)
        made = self._subscription(topic, type_name, Qos(), data, request=True)
        self._add(made.gid, publishes=False)
        return made

    def wait(self, timeout: float) -> bool:
        """Wait until a message arrives for a subscription; return whether one did.

        Args:
            timeout: Longest time to wait, s.
        """
        return bool(self._waitset.wait(round(max(timeout, 0.0) * 1e9)))

    def wait_for(self, holds: Callable[[], Any], timeout: float) -> bool:
        """Return whether a condition holds within ``timeout`` (s); it is tried every 5 ms."""
        end = time.monotonic() + timeout
        while not holds():
            if time.monotonic() > end:
                return False
            time.sleep(0.005)
        return True

    def graph(self) -> Graph:
        """Return what is seen of the domain."""
        participants, publications, subscriptions = (
            [each for each in view.read(_MAX, condition=alive) if each.sample_info.valid_data]
            for view, alive in zip(self._views, self._alive, strict=True)
        )
        self._read_announcements({each.key.bytes for each in participants})
        owners = {gid: name for each in self._announced.values() for name, gid in each if gid}
        return Graph(
            self.domain,
            tuple(map(self._seen, participants)),
            tuple(
                found
                for endpoints, publishes in ((publications, True), (subscriptions, False))
                for each in endpoints
                if (found := discovered(each, publishes, owners)) is not None
            ),
        )

    def close(self) -> None:
        """Leave the domain; the node and all that it made are not used afterwards."""
        participant = self._participant
        if participant is None:
            return
        participant.__del__()  # deletes the entity now, with all that it contains
        self._participant = None

    def __enter__(self) -> Node:
        """Return the node."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the node."""
        self.close()

    def _topic(self, name: str, type_name: str, request: bool) -> Any:
        key = f"{name} {type_name}"
        if key not in self._topics:
            made = dds_type(type_name, self.distribution, request=request)
            self._topics[key] = cyclonedds("topic").Topic(self._participant, name, made)
        return self._topics[key]

    def _publisher(
        self, name: str, type_name: str, qos: Qos, data: bytes, *, request: bool = False
    ) -> Publisher:
        topic = self._topic(name, type_name, request)
        writer = cyclonedds("pub").DataWriter(self._participant, topic, dds_qos(qos, data))
        self._held.append(writer)
        return Publisher(writer, name, type_name, self.distribution)

    def _subscription(
        self, name: str, type_name: str, qos: Qos, data: bytes, *, request: bool = False
    ) -> Subscription:
        core = cyclonedds("core")
        topic = self._topic(name, type_name, request)
        reader = cyclonedds("sub").DataReader(self._participant, topic, dds_qos(qos, data))
        if name != _DISCOVERY_TOPIC:
            state = core.ViewState.Any | core.SampleState.NotRead | core.InstanceState.Any
            reader.arrived = core.ReadCondition(reader, state)
            self._waitset.attach(reader.arrived)
        self._held.append(reader)
        return Subscription(reader, name, type_name, self.distribution)

    def _add(self, gid: bytes, *, publishes: bool) -> None:
        self._endpoints.append((gid, publishes))
        self._announce()

    def _announce(self) -> None:
        """Announce the node and its endpoints, as rmw_dds_common defines it."""

        def identity(gid: bytes) -> Message:
            """Return the message of a GID, padded to its length."""
            made = message_type("rmw_dds_common/msg/Gid", self.distribution)
            length = made.interface.fields[0].length
            return made(data=list(gid.ljust(length, b"\0")))

        node = message_type("rmw_dds_common/msg/NodeEntitiesInfo", self.distribution)(
            node_namespace=self.namespace,
            node_name=self.name,
            reader_gid_seq=[identity(gid) for gid, publishes in self._endpoints if not publishes],
            writer_gid_seq=[identity(gid) for gid, publishes in self._endpoints if publishes],
        )
        self._info.publish(
            self._info.message(gid=identity(self.gid), node_entities_info_seq=[node])
        )

    def _read_announcements(self, alive: set[bytes]) -> None:
        """Update nodes and endpoints of each participant, and forget those that left."""
        for received in self._infos.take(_MAX):
            message = received.message
            entities: list[tuple[str, bytes]] = []
            for node in message.node_entities_info_seq[:1000]:
                name = f"{node.node_namespace.rstrip('/')}/{node.node_name}"
                entities.append((name, b""))
                for gid in (*node.reader_gid_seq, *node.writer_gid_seq):
                    entities.append((name, gid.data.tobytes()[:16]))
            self._announced[message.gid.data.tobytes()[:16]] = tuple(entities)
        self._announced = {gid: each for gid, each in self._announced.items() if gid in alive}

    def _seen(self, sample: Any) -> Participant:
        gid = sample.key.bytes
        nodes = dict.fromkeys(name for name, _ in self._announced.get(gid, ()))
        enclave = user_data(sample.qos).get("enclave")
        return Participant(gid, enclave, tuple(nodes), gid == self.gid)

    def _detect(self) -> Distribution:
        """Return the distribution of ROS_DISTRO, or of the nodes that are seen."""
        named = os.environ.get("ROS_DISTRO", "")
        if named in get_args(Distribution):
            return cast(Distribution, named)
        if self.wait_for(self._hashes_of_others, _DETECTION_TIME):
            time.sleep(_SETTLING_TIME)
        return distribution_of(self._hashes_of_others()) or LATEST

    def _hashes_of_others(self) -> list[tuple[str, str]]:
        """Return the types of other nodes' topics with their hashes, empty ones for Humble."""
        return [
            (ros_type_name(each.type_name), user_data(each.qos).get("typehash", ""))
            for view, alive in zip(self._views[1:], self._alive[1:], strict=True)
            for each in view.read(_MAX, condition=alive)
            if each.sample_info.valid_data
            and each.participant_key.bytes != self.gid
            and ros_topic(each.topic_name)
        ]
