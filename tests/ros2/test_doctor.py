"""Findings of the doctor: on graphs made by hand, and on a graph of real nodes."""

import threading

import pytest

from omnidrive.ros2 import Endpoint, Graph, Node, Participant, Qos, type_hash
from omnidrive.ros2.doctor import Examination, TopicTraffic, diagnose, examine
from omnidrive.ros2.qos import SENSOR_QOS
from tests.ros2.peer_process import new_domain, running_peer

TWIST, ODOMETRY = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"
CYCLONE, FAST = b"\x01\x10" + bytes(14), b"\x01\x0f" + bytes(14)


def endpoint(topic, kind, publishes, node="/base", **changes):
    made = Endpoint(topic, kind, node, publishes, Qos(), type_hash(kind), b"e" * 16, CYCLONE)
    return made._replace(**changes)


GOOD = (endpoint("/cmd_vel", TWIST, False), endpoint("/odom", ODOMETRY, True))
OTHER = Participant(CYCLONE, "/", ("/base",), False)


def findings(*endpoints, participants=(OTHER,), traffic=None, distribution="jazzy"):
    graph = Graph(7, participants, endpoints)
    return diagnose(Examination(graph, distribution, traffic or {}, 3.0, ("localhost",)))


def only(found, level):
    (each,) = [each for each in found if each.level == level]
    return each.fact


def test_a_good_graph_has_no_fault():
    assert {each.level for each in findings(*GOOD)} == {"note"}


def test_an_empty_domain_is_an_error_with_its_ports():
    (found,) = findings(participants=())
    assert found.level == "error"
    assert "domain 7" in found.fact
    assert "localhost" in found.fact
    assert "9150 to 9399" in found.remedy


def test_different_types_on_a_topic_are_an_error():
    stamped = endpoint("/cmd_vel", "geometry_msgs/msg/TwistStamped", True, "/teleop")
    fact = only(findings(*GOOD, stamped), "error")
    assert fact == f"/cmd_vel has the types {TWIST} (/base) and {TWIST}Stamped (/teleop)"


RESULT = "nav2_msgs/action/FollowPath_GetResult_Response"


def test_the_definition_of_another_distribution_is_an_error_that_names_it():
    old = endpoint("/a", RESULT, True, "/nav", prefix="rr", type_hash=type_hash(RESULT, "iron"))
    (error,) = [each for each in findings(*GOOD, old) if each.level == "error"]
    assert error.fact == f"/nav has the definition of {RESULT} of iron on /a, not that of jazzy"
    assert error.remedy.endswith("--distribution iron")
    same = old._replace(type_hash=type_hash(RESULT, "kilted"))
    assert {each.level for each in findings(*GOOD, same)} == {"note"}


def test_a_definition_that_is_not_known_is_a_warning_with_both_hashes():
    odd = endpoint("/odom", ODOMETRY, True, type_hash="RIHS01_00")
    fact = only(findings(GOOD[0], odd), "warning")
    assert "nav_msgs/msg/Odometry on /odom that is not known: RIHS01_00; that of jazzy" in fact
    assert fact.endswith(type_hash(ODOMETRY))


def test_incompatible_qos_is_an_error_with_both_nodes():
    scan = "sensor_msgs/msg/LaserScan"
    pair = (
        endpoint("/scan", scan, True, "/lidar", qos=SENSOR_QOS),
        endpoint("/scan", scan, False, "/slam"),
    )
    fact = only(findings(*GOOD, *pair), "error")
    assert fact.startswith("/scan: nothing from /lidar arrives at /slam: ")


def test_two_publishers_of_commands_are_a_warning():
    pair = [endpoint("/cmd_vel", TWIST, True, name) for name in ("/teleop", "/nav2")]
    assert "/nav2, /teleop" in only(findings(*GOOD, *pair), "warning")


def test_no_robot_is_a_warning_for_commands_and_poses():
    facts = [each.fact for each in findings(endpoint("/x", TWIST, True)) if each.level == "warning"]
    assert facts == [
        "nothing subscribes to /cmd_vel",
        "neither /odom nor /tf is published",
    ]


@pytest.mark.parametrize(
    ("traffic", "level", "text"),
    [
        (TopicTraffic(3, [-0.4, -0.5, -0.6], [0.0]), "error", "0.5 s ahead of"),
        (TopicTraffic(3, [0.5] * 3, [0.0]), "error", "0.5 s behind"),
        (TopicTraffic(3, [0.0] * 3, [2.0] * 3), "warning", "stamps are 2 s old"),
        (TopicTraffic(), "warning", "no message within 3 s"),
    ],
)
def test_clocks_and_stamps(traffic, level, text):
    assert text in only(findings(*GOOD, traffic={"/odom": traffic}), level)


def test_a_paused_simulation_is_an_error():
    assert "0 Hz" in only(findings(*GOOD, traffic={"/clock": TopicTraffic()}), "error")


def test_mixed_distributions_and_other_middlewares_are_named():
    old = endpoint("/x", TWIST, True, type_hash="", participant=FAST)
    people = (OTHER, Participant(FAST, "/", (), False))
    facts = " ".join(each.fact for each in findings(*GOOD, old, participants=people))
    assert "Humble" in facts
    assert "1 processes with topics of ROS announce no nodes" in facts
    assert "topics reach Fast DDS; services and actions do not" in facts


def test_it_hears_a_peer_with_an_old_stamp():
    """The peer answers commands with stamps of 1970."""
    domain = new_domain()
    with (
        running_peer(domain),
        Node("driver", domain=domain, peers=["localhost"], distribution="jazzy") as driver,
        Node("doctor", domain=domain, peers=["localhost"], distribution="jazzy") as node,
    ):
        commands = driver.publisher("/cmd_vel", TWIST)
        odometry = driver.subscription("/odom", ODOMETRY)
        assert node.wait_for(lambda: commands.matched and node.graph().publishers("/odom"), 10.0)
        stop = threading.Event()

        def command():
            while not stop.wait(0.01):
                commands.publish(commands.message())

        thread = threading.Thread(target=command)
        thread.start()
        try:
            seen = examine(node, 0.5)
        finally:
            stop.set()
            thread.join()
        assert odometry.take()
    assert seen.graph.topics() == {"/cmd_vel": {TWIST}, "/odom": {ODOMETRY}}
    assert seen.traffic["/odom"].count >= 5
    assert abs(seen.traffic["/odom"].skews[0]) < 0.1
    facts = [each.fact for each in diagnose(seen) if each.level != "note"]
    assert len(facts) == 1
    assert facts[0].startswith("/odom: stamps are 1.")
