"""A node as an independent peer sees it, in a process of its own, over loopback."""

import subprocess
import sys

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidMessage
from omnidrive.ros2 import Node, Qos, encode, message_type, type_hash
from omnidrive.ros2.names import dds_topic, dds_type_name, resolve, ros_topic, ros_type_name
from omnidrive.ros2.node import _ANNOUNCEMENTS
from omnidrive.ros2.qos import LATCHED_QOS
from tests.ros2.peer_process import new_domain, running_peer

TWIST, ODOMETRY = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"


@pytest.fixture(scope="module", params=["humble", "jazzy"])
def meeting(request):
    """A node and the peer, and what joins them."""
    domain = new_domain()
    with (
        running_peer(domain, request.param) as peer,
        Node("tracker", domain=domain, peers=["localhost"], namespace="/fleet") as node,
    ):
        commands = node.publisher("/cmd_vel", TWIST)
        odometry = node.subscription("/odom", ODOMETRY)
        assert node.wait_for(lambda: commands.matched and odometry.matched, 10.0)
        yield request.param, node, peer, commands, odometry


def test_it_takes_the_distribution_of_the_peer(meeting):
    distribution, node, *_ = meeting
    assert node.distribution == distribution


def test_the_peer_sees_a_node_with_its_endpoints(meeting):
    distribution, node, peer, commands, _ = meeting
    gid = node.gid.ljust(24 if distribution == "humble" else 16, b"\0").hex()
    assert node.wait_for(lambda: gid in peer.report()["nodes"], 5.0)
    report = peer.report()
    assert report["nodes"][gid] == [["/fleet", "tracker", 1, 1]]
    assert report["participants"][node.gid.hex()][2] == "enclave=/;"
    mark = "" if distribution == "humble" else f"typehash={type_hash(TWIST)};"
    assert report["publications"][commands.gid.hex()] == [
        "rt/cmd_vel",
        "geometry_msgs::msg::dds_::Twist_",
        mark,
    ]


DISCOVERY = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"
"""Hash of rmw_dds_common/msg/ParticipantEntitiesInfo that genuine nodes from Iron on announce."""


def test_discovery_announces_its_type_hash_as_genuine_nodes_do(meeting):
    """Without it a genuine process warns: Failed to parse type hash."""
    distribution, node, peer, *_ = meeting
    gid = node._info.gid.hex()
    assert node.wait_for(lambda: gid in peer.report()["publications"], 5.0)
    expected = "" if distribution == "humble" else f"typehash={DISCOVERY};"
    assert peer.report()["publications"][gid] == [
        "ros_discovery_info",
        "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
        expected,
    ]


def test_it_sees_the_peer_with_its_endpoints(meeting):
    distribution, node, *_ = meeting
    assert node.wait_for(
        lambda: any("/peer" in each.nodes for each in node.graph().participants), 5.0
    )
    graph = node.graph()
    (odometry,) = graph.publishers("/odom", of_others=True)
    assert (odometry.node, odometry.type, odometry.qos) == ("/peer", ODOMETRY, Qos())
    assert odometry.type_hash == ("" if distribution == "humble" else type_hash(ODOMETRY))
    assert {each.node for each in graph.subscriptions("/cmd_vel")} == {"/peer"}
    assert not graph.publishers("/cmd_vel", of_others=True)
    assert graph.publishers("/cmd_vel")[0].node == "/fleet/tracker"
    assert graph.topics() == {"/cmd_vel": {TWIST}, "/odom": {ODOMETRY}}


def test_a_command_comes_back_as_odometry(meeting):
    _, node, _, commands, odometry = meeting
    twist = commands.message()
    twist.linear.x, twist.linear.y, twist.angular.z = 0.25, -1.5, 3.0
    commands.publish(twist)
    assert node.wait(5.0)
    (received,) = odometry.take()
    answer = received.message
    assert answer.twist.twist == twist
    assert answer.header.frame_id == "odom"
    assert answer.header.stamp == message_type("builtin_interfaces/msg/Time")(1, 2)
    np.testing.assert_array_equal(answer.twist.covariance, 0.5)
    assert odometry.take() == []


def test_reliable_messages_arrive_once_and_in_order(meeting):
    _, node, _, commands, odometry = meeting
    values = []
    for number in range(300):
        commands.publish(
            commands.message(message_type("geometry_msgs/msg/Vector3")(x=number + 0.5))
        )
        while node.wait_for(odometry.matched.bit_length, 1.0) and node.wait(1.0):
            taken = [each.message.twist.twist.linear.x for each in odometry.take()]
            values += taken
            if taken:
                break
    assert values == [number + 0.5 for number in range(300)]


def test_messages_of_another_type_are_not_sent(meeting):
    _, _, _, commands, _ = meeting
    with pytest.raises(InvalidMessage, match="carries geometry_msgs/msg/Twist, not std_msgs"):
        commands.publish(message_type("std_msgs/msg/String")(data="stop"))


def test_late_subscriptions_receive_latched_messages_only():
    with Node("robot", domain=new_domain(), peers=["localhost"], distribution="jazzy") as node:
        text = message_type("std_msgs/msg/String")
        for topic, qos in (("/description", LATCHED_QOS), ("/news", Qos())):
            node.publisher(topic, "std_msgs/msg/String", qos).publish(text(data="first"))
        late = node.subscription("/description", "std_msgs/msg/String", LATCHED_QOS)
        news = node.subscription("/news", "std_msgs/msg/String")
        assert node.wait(5.0)
        assert late.latest() == text(data="first")
        assert news.latest() is None


def test_damaged_messages_do_not_arrive():
    with Node("robot", domain=new_domain(), peers=["localhost"], distribution="jazzy") as node:
        name = "nav_msgs/msg/Path"
        paths, received = node.publisher("/plan", name), node.subscription("/plan", name)
        good = encode(paths.message())
        for data in (good[:-2] + b"\xff\x7f", good[:9], b"\0\1\0\0"):
            try:
                paths.send(data)
            except Exception as error:
                assert "DDS" in type(error).__name__  # noqa: PT017
        paths.send(good)
        assert node.wait(5.0)
        assert len(received.take()) == 1


def test_a_publisher_that_leaves_leaves_no_message():
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    name = "nav_msgs/msg/Path"
    with Node("tracker", **options) as node:
        paths = node.subscription("/plan", name)
        with Node("planner", **options) as planner:
            publisher = planner.publisher("/plan", name)
            assert node.wait_for(lambda: paths.matched, 5.0)
            publisher.publish(publisher.message())
            assert node.wait(5.0)
            assert len(paths.take()) == 1
        assert node.wait_for(lambda: not paths.matched, 5.0)
        assert paths.take() == []


def test_names_are_those_of_ros():
    assert resolve("cmd_vel") == "/cmd_vel"
    assert resolve("cmd_vel", "/fleet/one") == "/fleet/one/cmd_vel"
    assert resolve("~/path", "/fleet", node="drive") == "/fleet/drive/path"
    assert dds_topic("/cmd_vel") == "rt/cmd_vel"
    assert dds_topic("/a/get_state", "rq") == "rq/a/get_stateRequest"
    assert ros_topic("rr/a/get_stateReply") == ("/a/get_state", "rr")
    assert ros_topic("DCPSTopic") is None
    assert dds_type_name(TWIST) == "geometry_msgs::msg::dds_::Twist_"
    assert ros_type_name("geometry_msgs::msg::dds_::Twist_") == TWIST
    assert ros_type_name("HelloWorldData::Msg") == "HelloWorldData::Msg"


@pytest.mark.parametrize("name", ["", "/", "a b", "1st", "a//b", "/a/", "a__b", "~/x", "ü"])
def test_other_names_are_refused(name):
    with pytest.raises(InvalidInput, match="not a name of ROS 2"):
        resolve(name)


def test_a_domain_out_of_range_is_refused(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "300")
    with pytest.raises(InvalidInput, match="ROS_DOMAIN_ID is '300', need a whole number from 0"):
        Node("robot")
    with pytest.raises(InvalidInput, match="the domain is '-1'"):
        Node("robot", domain=-1)


def test_without_the_package_the_extra_is_named():
    """The package is imported without cyclonedds; only a node needs it."""
    code = (
        "import sys; sys.modules['cyclonedds'] = None\n"
        "import omnidrive.ros2 as r\n"
        "try: r.Node('a')\n"
        "except r.node.MissingExtra as e: print(e)"
    ).replace("r.node.MissingExtra", "__import__('omnidrive.errors').errors.MissingExtra")
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert "pip install 'cyclonedds" in result.stdout


@pytest.mark.parametrize(
    "peer", ["not_a_host_", "", "two words", "x" * 300, "localhost:7400", "::1"]
)
def test_an_unknown_peer_is_refused(peer):
    with pytest.raises(InvalidInput, match="is an unknown host"):
        Node("robot", domain=new_domain(), peers=[peer])


def test_announcements_that_nobody_reads_are_bounded():
    """During a drive nothing looks at the graph; another node announces itself again and again."""
    domain = new_domain()
    with (
        Node("quiet", domain=domain, peers=["localhost"], distribution="jazzy") as quiet,
        Node("loud", domain=domain, peers=["localhost"], distribution="jazzy") as loud,
    ):
        assert quiet.wait_for(lambda: quiet._infos.matched >= 2, 20.0)
        for _ in range(_ANNOUNCEMENTS + 100):
            loud._announce()
        assert quiet.wait_for(lambda: "/loud" in str(quiet.graph()), 20.0)
        for _ in range(_ANNOUNCEMENTS + 100):
            loud._announce()
        assert len(quiet._infos.take_raw(3 * _ANNOUNCEMENTS)) <= _ANNOUNCEMENTS
