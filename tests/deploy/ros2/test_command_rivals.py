"""Other publishers on the topic of commands: they end a drive when they send, not by existing."""

import logging
import time
from contextlib import contextmanager

import pytest

from omnidrive.control import FeedforwardController
from omnidrive.deploy.clock import MonotonicClock
from omnidrive.deploy.robot_link import LinkLost
from omnidrive.deploy.ros2.drive_reports import ReportedPipeline
from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters
from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
from omnidrive.deploy.ros2.ros2_link import Ros2Link, Ros2LinkSettings
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Circle, ShapeReference
from omnidrive.ros2 import Node
from tests.deploy.ros2.robot_process import ROBOT, running_robot
from tests.ros2.peer_process import new_domain

TWIST = "geometry_msgs/msg/Twist"
NOTE = "/behavior_server can also command /cmd_vel: a drive ends when one of them does"


@contextmanager
def meeting(**settings):
    """A robot in the graph, the node of a link, and another node with a publisher of commands."""
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    with (
        Node("robot", **options) as robot,
        Node("drive", **options) as node,
        Node("behavior_server", **options) as other,
    ):
        robot.subscription("/cmd_vel", TWIST)
        publisher = other.publisher("/cmd_vel", TWIST)
        link = Ros2Link(node, ROBOT, Ros2LinkSettings(timeout=5.0, **settings))
        assert node.wait_for(
            lambda: any(each.node for each in node.graph().publishers("/cmd_vel")), 10.0
        )
        yield link, publisher


def test_an_idle_publisher_is_noted_once_and_ends_nothing(caplog):
    with meeting() as (link, _), caplog.at_level(logging.WARNING, "omnidrive"):
        for _ in range(2):
            link.open(MonotonicClock())
            for _ in range(10):
                link.send(BodyTwist(0.1, 0.0, 0.0))
                link.read()
    assert [each for each in caplog.messages if "can also command" in each] == [NOTE]


def test_a_command_of_another_node_is_an_error_with_its_name():
    with meeting() as (link, publisher):
        link.open(MonotonicClock())
        with pytest.raises(LinkLost, match=r"/behavior_server also commands /cmd_vel: .*--allow-"):
            link.node.wait_for(lambda: publisher.publish(publisher.message()) or link.read(), 5.0)


@pytest.mark.long  # a message that does not arrive within a time
def test_a_command_before_the_drive_is_none_of_it():
    with meeting() as (link, publisher):
        link.open(MonotonicClock())
        assert link.node.wait_for(lambda: publisher.matched == 2, 5.0)
        publisher.publish(publisher.message())
        time.sleep(0.3)
        link.open(MonotonicClock())
        assert link.read() is None


@pytest.mark.parametrize("name", ["/behavior_server", "behavior_server"])
def test_an_allowed_node_may_send(name):
    with meeting(allowed_publishers=(name,)) as (link, publisher):
        link.open(MonotonicClock())
        for _ in range(20):
            publisher.publish(publisher.message())
            link.send(BodyTwist(0.1, 0.0, 0.0))
            time.sleep(0.01)
            link.read()


def test_a_publisher_that_sends_at_the_opening_is_refused():
    with meeting() as (link, publisher):
        note = link._note_rivals

        def send_and_note(rivals):
            assert link.node.wait_for(lambda: publisher.matched == 2, 5.0)
            publisher.publish(publisher.message())
            note(rivals)

        link._note_rivals = send_and_note
        with pytest.raises(LinkLost, match="/behavior_server also commands"):
            link.open(MonotonicClock())


@pytest.mark.parametrize("topic", ["cmd_vel_nav", "/cmd_vel_nav"])
def test_another_topic_of_commands_may_be_relative(topic):
    """Nav2 remaps its controller server to cmd_vel_nav."""
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    with Node("smoother", **options) as smoother, Node("drive", **options) as node:
        taken = smoother.subscription("/cmd_vel_nav", TWIST)
        link = Ros2Link(node, ROBOT, Ros2LinkSettings(cmd_vel=topic, timeout=5.0))
        link.open(MonotonicClock())
        link.send(BodyTwist(0.1, 0.0, 0.0))
        assert smoother.wait_for(taken.latest, 5.0)


@pytest.mark.long
def test_a_command_during_a_drive_ends_it():
    domain = new_domain()
    options = {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}
    with (
        running_robot(domain, rate=25.0, command_type="Twist") as robot,
        Node("drive", **options) as node,
        Node("user", **options) as user,
    ):
        pipeline = ReportedPipeline(FeedforwardController(0.04))
        follower = PathFollower(Ros2Link(node, ROBOT), pipeline, 25.0, DriveRequests(node))
        publisher = user.publisher("/cmd_vel", TWIST)

        def intrude(_controls):
            if robot.commands > 40:
                publisher.publish(publisher.message())

        circle = ShapeReference(Circle(radius=0.3), 20.0)
        result = follower.drive(circle, watch=intrude)
    assert "/user also commands /cmd_vel" in result.ending
    assert result.run.t[-1] < 10.0


def test_an_allowed_node_has_a_name_of_ros():
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    with (
        Node("drive", **options) as node,
        pytest.raises(InvalidInput, match="'/a b' is not a name of ROS 2"),
    ):
        Ros2Link(node, ROBOT, Ros2LinkSettings(allowed_publishers=("a b",)))


def test_allowed_publishers_are_a_list_of_parameters(tmp_path):
    file = tmp_path / "drive.yaml"
    file.write_text("omnidrive_drive: {ros__parameters: {allowed_publishers: [/a, b]}}")
    settings = DriveSettings().with_values(read_parameters(file))
    assert settings.link.allowed_publishers == ("/a", "b")
    file.write_text("omnidrive_drive: {ros__parameters: {allowed_publishers: /a}}")
    with pytest.raises(InvalidInput, match="allowed_publishers must be a list of texts"):
        DriveSettings().with_values(read_parameters(file))
