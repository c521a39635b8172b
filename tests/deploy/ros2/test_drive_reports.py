"""The state of a drive in /diagnostics: why a path is not driven."""

import logging
from math import nan

import pytest

from omnidrive.control import FeedforwardController
from omnidrive.deploy.robot_link import LinkLost
from omnidrive.deploy.ros2.drive_reports import ERROR, WARN, DriveReports, ReportedPipeline
from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
from omnidrive.deploy.ros2.plan_follower import PlanFollower
from omnidrive.deploy.ros2.ros2_link import Ros2Link, Ros2LinkSettings
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.ros2 import Node, message_type
from omnidrive.ros2.planar_messages import set_pose
from tests.deploy.ros2.robot_process import ROBOT
from tests.ros2.peer_process import new_domain


@pytest.fixture(scope="module")
def meeting():
    """A node that follows paths, and a planner that reads /diagnostics."""
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    with Node("drive", **options) as node, Node("planner", **options) as planner:
        link = Ros2Link(node, ROBOT, Ros2LinkSettings(timeout=0.1))
        reports = DriveReports(node, link.ros_clock, "map")
        pipeline = ReportedPipeline(FeedforwardController(0.04))
        requests = DriveRequests(node)
        follower = PathFollower(link, pipeline, 25.0, requests, reports=reports)
        plans = planner.publisher("/plan", "nav_msgs/msg/Path")
        diagnostics = planner.subscription("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        taker = PlanFollower(follower)
        assert planner.wait_for(lambda: plans.matched and diagnostics.matched, 10.0)
        assert node.wait_for(lambda: reports._diagnostics.matched and taker._plans.matched, 10.0)
        yield taker, plans, diagnostics


def path(frame, *poses):
    message = message_type("nav_msgs/msg/Path")()
    message.header.frame_id = frame
    for pose in poses:
        each = message_type("geometry_msgs/msg/PoseStamped")()
        set_pose(each.pose, Pose(*pose))
        message.poses.append(each)
    return message


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (path("nowhere", (1.0, 0.0, 0.0)), "/plan: the path is in the frame nowhere, which is not"),
        (path("map"), "/plan: the path has 0 poses"),
        (path("map", (nan, 0.0, 0.0)), "/plan: a pose of the path is not finite"),
    ],
)
def test_a_path_that_is_not_usable_is_reported_with_its_reason(meeting, caplog, message, reason):
    taker, plans, diagnostics = meeting
    found = []

    def reported():
        taker._take()
        statuses = [each.message.status[0] for each in diagnostics.take()]
        found.extend(each for each in statuses if each.message.startswith(reason))
        return found

    with caplog.at_level(logging.WARNING, "omnidrive"):
        plans.publish(message)
        assert taker.follower.link.node.wait_for(reported, 10.0)
        taker.follower.refuse(found[0].message, WARN)
    assert (found[0].level, found[0].name) == (WARN, "drive: drive")
    assert len([each for each in caplog.messages if each.startswith(reason)]) == 1  # said once


def test_a_robot_that_is_not_found_is_reported(meeting):
    taker, _, diagnostics = meeting
    follower, node = taker.follower, taker.follower.link.node
    diagnostics.take()
    with pytest.raises(LinkLost, match="nothing subscribes to /cmd_vel"):
        follower.drive(Hold(Pose(0.0, 0.0, 0.0), 1.0))
    found = []
    assert node.wait_for(lambda: found.extend(diagnostics.take()) or found, 5.0)
    (status,) = found[0].message.status
    assert status.level == ERROR
    assert status.message.startswith("nothing subscribes to /cmd_vel in domain")


def test_the_state_is_published_again_while_nothing_is_driven(meeting, monkeypatch):
    taker, _, diagnostics = meeting
    reports, node = taker.follower.reports, taker.follower.link.node
    taker.follower.refuse("not driven: there is no path")
    assert node.wait_for(diagnostics.take, 5.0)
    taker.follower.idle()
    reports._published -= 2.0
    taker.follower.idle()
    again = []
    assert node.wait_for(lambda: again.extend(diagnostics.take()) or again, 5.0)
    (status,) = again[-1].message.status
    assert (status.level, status.message) == (ERROR, "not driven: there is no path")
