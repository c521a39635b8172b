"""Which pairs of publishers and subscriptions match: as Cyclone DDS decides, policy by policy."""

from itertools import product
from math import inf

import pytest
from cyclonedds.core import Policy
from cyclonedds.core import Qos as DdsQos
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic

from omnidrive.ros2 import LATCHED_QOS, SENSOR_QOS, Node, Qos
from omnidrive.ros2.dds import dds_type
from tests.ros2.peer_process import new_domain

MS = 10**6
KEPT = Policy.Reliability.Reliable(10**9)
POLICIES = {
    "reliability": [[Policy.Reliability.BestEffort], [KEPT]],
    "durability": [
        [KEPT, each]
        for each in (
            Policy.Durability.Volatile,
            Policy.Durability.TransientLocal,
            Policy.Durability.Transient,
            Policy.Durability.Persistent,
        )
    ],
    "deadline": [[], [Policy.Deadline(100 * MS)], [Policy.Deadline(5000 * MS)]],
    "liveliness": [
        [],
        *(
            [kind(time)]
            for kind in (
                Policy.Liveliness.Automatic,
                Policy.Liveliness.ManualByParticipant,
                Policy.Liveliness.ManualByTopic,
            )
            for time in (500 * MS, 5000 * MS)
        ),
    ],
    "ownership": [[], [Policy.Ownership.Shared], [Policy.Ownership.Exclusive]],
    "destination order": [
        [],
        [Policy.DestinationOrder.ByReceptionTimestamp],
        [Policy.DestinationOrder.BySourceTimestamp],
    ],
    "presentation": [
        [kind(coherent_access=coherent, ordered_access=ordered)]
        for kind in (
            Policy.PresentationAccessScope.Instance,
            Policy.PresentationAccessScope.Topic,
            Policy.PresentationAccessScope.Group,
        )
        for coherent, ordered in product((False, True), repeat=2)
    ],
    "latency budget": [[], [Policy.LatencyBudget(5 * MS)], [Policy.LatencyBudget(50 * MS)]],
}
"""Policies of DDS that are requested and offered, with their values."""


@pytest.fixture(scope="module")
def node():
    with Node("looker", domain=new_domain(), peers=["localhost"], distribution="jazzy") as made:
        yield made


@pytest.mark.parametrize("policy", POLICIES)
def test_pairs_match_as_the_middleware_decides(node, policy):
    """Every publisher with every subscription of a topic, each of another value of the policy."""
    name = f"/{policy.replace(' ', '_')}"
    topic = Topic(node._participant, f"rt{name}", dds_type("std_msgs/msg/Bool", "jazzy"))
    writers, readers = [], []
    for values in POLICIES[policy]:
        qos, group = DdsQos(*values), DdsQos()
        if policy == "presentation":
            qos, group = group, qos
        writers.append(DataWriter(Publisher(node._participant, qos=group), topic, qos))
        readers.append(DataReader(Subscriber(node._participant, qos=group), topic, qos))
    handles = {each.guid.bytes: each.get_instance_handle() for each in (*writers, *readers)}
    matched = {
        (writer.guid.bytes, handle)
        for writer in writers
        for handle in writer.get_matched_subscriptions()
    }
    pairs = [pair for pair in node.graph().pairs() if pair[0].topic == name]
    assert len(pairs) == len(writers) * len(readers)
    faults = {
        (offering.gid, handles[requesting.gid]): requesting.qos.fault(offering.qos)
        for offering, requesting in pairs
    }
    assert {pair for pair, fault in faults.items() if fault is None} == matched
    assert 0 < len(matched) < len(pairs)
    words = {"liveliness": "lease duration"}.get(policy, policy)
    reasons = [each for each in faults.values() if each]
    assert all(policy in each or words in each for each in reasons)


@pytest.mark.parametrize(
    ("requested", "offered", "reason"),
    [
        (Qos(), SENSOR_QOS, "the reliability reliable, the publisher offers best effort"),
        (LATCHED_QOS, Qos(), "the durability transient local, the publisher offers volatile"),
        (Qos(deadline=0.1), Qos(), "the deadline 0.1 s, the publisher offers infinite"),
        (Qos(deadline=0.1), Qos(deadline=2.0), "the deadline 0.1 s, the publisher offers 2 s"),
        (Qos(lease=1.0), Qos(), "the lease duration 1 s, the publisher offers infinite"),
        (
            Qos(liveliness="manual by topic"),
            Qos(),
            "the liveliness manual by topic, the publisher offers automatic",
        ),
        (Qos(), Qos(exclusive=True), "the ownership shared, the publisher offers exclusive"),
    ],
)
def test_a_fault_names_what_is_requested_and_offered(requested, offered, reason):
    assert requested.fault(offered) == f"the subscription requests {reason}"


def test_the_qos_of_ros_and_of_sensors_are_compatible_with_better_ones():
    assert Qos().fault(Qos()) is None
    assert SENSOR_QOS.fault(Qos()) is None
    assert Qos().fault(LATCHED_QOS) is None
    assert Qos(deadline=inf).fault(Qos(deadline=0.1)) is None
