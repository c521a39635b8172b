"""A robot that only scans localise: by messages of an independent peer, and driven end to end."""

import time
from math import hypot, nan, pi

import numpy as np
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.ros2 import Ros2Robot, Ros2RobotSettings
from omnidrive.deploy.ros2.drive_reports import ReportedPipeline
from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters
from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
from omnidrive.deploy.ros2.pose_source import PoseSource
from omnidrive.deploy.ros2.ros2_link import Ros2Link, Ros2LinkSettings
from omnidrive.deploy.ros2.scan_localisation import ScanLocalisation, StampedPose, odometry_at
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.maps import OccupancyGrid, paper_map
from omnidrive.reference import Hold
from omnidrive.ros2 import Node, message_type
from omnidrive.ros2.planar_messages import is_level
from omnidrive.ros2.transform_tree import Frames
from omnidrive.simulation import KinematicPlant
from tests.deploy.ros2.robot_process import ROBOT, Odometer, running_robot
from tests.ros2.peer_process import new_domain, running_peer

RATE = 25.0
NEAR = Pose(1.6, 1.9, 0.2)


def options(domain):
    return {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}


@pytest.mark.parametrize("initial", [NEAR, pytest.param(None, marks=pytest.mark.long)])
def test_scans_of_an_independent_peer_localise_the_robot(initial):
    domain = new_domain()
    with running_peer(domain) as peer, Node("driver", **options(domain)) as node:
        scans = ScanLocalisation(node, Frames(), initial=initial)
        source = PoseSource(node, ROBOT, Frames(), time.time, scans=scans)
        assert node.wait_for(lambda: source._subscriptions[2][0].matched, 10.0)
        peer.room()
        found = []
        node.wait_for(
            lambda: found.append(source.read()) or found[-1] is not None,
            4.0 if initial is None else 30.0,
        )
    if initial is None:
        assert set(found) == {None}
        assert "no initial pose: publish it on /initialpose" in source.fault
        return
    fix = found[-1]
    assert np.allclose(fix.pose, (1.5, 2.0, 0.3), atol=0.01)
    assert 0.01 < fix.position_sigma < 0.05
    assert 0.0 < fix.yaw_sigma < 0.05
    assert abs(fix.stamp - time.time()) < 5.0


ROOM = np.zeros((80, 100), bool)
ROOM[:, [0, -1]] = ROOM[[0, -1], :] = True
ROOM[20:30, 60:65] = True
GRID = OccupancyGrid(ROOM, 0.05, (-2.0, -2.0), walled=False)
START = Pose(-0.5, 0.3, 0.4)


def driven_by_scans(duration, watch=lambda *_: None):
    """The result of a drive, and the true pose at its end."""
    domain = new_domain()
    settings = Ros2LinkSettings(initial_pose=Pose(-0.4, 0.2, 0.3))
    with (
        running_robot(domain, rate=RATE, localised=False, start=START, grid=GRID) as robot,
        Node("drive", **options(domain)) as node,
    ):
        link = Ros2Link(node, ROBOT, settings)
        follower = PathFollower(
            link,
            ReportedPipeline(FeedforwardController(1.0 / RATE)),
            RATE,
            DriveRequests(node),
        )
        begin = follower.current_pose()
        assert np.allclose(begin, START, atol=0.05)
        goal = Hold(Pose(begin.x + 0.4, begin.y + 0.2, begin.yaw), duration)
        result = follower.drive(goal, watch=lambda controls: watch(robot, controls))
        return result, robot.state.pose


@pytest.mark.long
def test_a_drive_is_localised_by_scans_alone():
    result, pose = driven_by_scans(3.0)
    assert result.finished, result.changes
    last = result.run.pose[-1]
    assert hypot(pose.x - last[0], pose.y - last[1]) < 0.08
    assert pose.x > START.x + 0.3


@pytest.mark.parametrize("start", [(1.5, 1.5), (5.0, 7.0), (7.6, 1.0)])
def test_a_simulated_robot_is_localised_by_its_own_scans_on_the_map_of_the_paper(start):
    """The rays end at walls around the map, which are cells of the published one."""
    domain = new_domain()
    pose = Pose(*start, 0.3)
    with Node("robot", **options(domain)) as served, Node("drive", **options(domain)) as node:
        settings = Ros2RobotSettings(localised=False)
        robot = Ros2Robot(
            served, KinematicPlant(ROBOT), ROBOT, pose, settings=settings, grid=paper_map()
        )
        near = Pose(pose.x + 0.1, pose.y - 0.1, 0.2)
        scans = ScanLocalisation(node, Frames(), initial=near)
        source = PoseSource(node, ROBOT, Frames(), time.time, scans=scans)
        assert served.wait_for(lambda: robot._publishers["scan"].matched, 10.0)
        found = []

        def localised():
            robot.step()
            found.append(source.read())
            return found[-1]

        assert node.wait_for(localised, 20.0), (source.refused, scans.fault)
    fix = found[-1].pose
    assert hypot(fix.x - pose.x, fix.y - pose.y) < 0.15
    assert abs(fix.yaw - pose.yaw) < 0.05


@pytest.mark.long
def test_a_scanner_that_falls_silent_holds_the_robot():
    """Odometry goes on; after 2 s without a scan and 0.5 s without a pose the robot is held."""
    silent = []

    def watch(robot, controls):
        if robot.commands > 40 and not silent:
            robot._grid = None
            silent.append(time.monotonic())
        elif silent and time.monotonic() - silent[0] > 6.0:
            controls.stop("end of the test")

    result, _ = driven_by_scans(30.0, watch)
    held = next(each for each in result.changes if each.state is DriveState.HOLDING)
    assert "odom in map is 2" in held.reason


def test_another_localisation_takes_precedence_and_leaves_no_pose_behind():
    domain = new_domain()
    with Node("robot", **options(domain)) as robot, Node("driver", **options(domain)) as node:
        scans = ScanLocalisation(node, Frames(), initial=NEAR)
        source = PoseSource(node, ROBOT, Frames(), time.time, scans=scans)
        odometer = Odometer(robot)
        assert node.wait_for(lambda: odometer.transforms.matched, 5.0)
        odometer.tf("map", "odom", 1.0)
        odometer.tf("odom", "base_link")
        assert node.wait_for(source.read, 2.0)
        assert scans.initial is None


def test_in_the_frame_of_odometry_nothing_localises():
    """A transform of the map that is old does not matter there."""
    domain = new_domain()
    frames = Frames(world="odom")
    with Node("robot", **options(domain)) as robot, Node("driver", **options(domain)) as node:
        scans = ScanLocalisation(node, frames, initial=NEAR)
        source = PoseSource(node, ROBOT, frames, time.time, scans=scans)
        odometer = Odometer(robot)
        assert node.wait_for(lambda: odometer.transforms.matched and odometer.odometry.matched, 5.0)
        odometer.tf("map", "odom", age=10.0)
        odometer.odom(0.5)
        assert node.wait_for(source.read, 2.0)
    assert source.refused == {}


def test_odometry_is_interpolated():
    odometry = [StampedPose(1.0 + t, Pose(t, 0.0, 2.0 * t)) for t in (0.0, 0.1, 0.2)]
    assert odometry_at(odometry, 1.05).yaw == pytest.approx(0.1)
    assert odometry_at(odometry, 1.1) == pytest.approx((0.1, 0.0, 0.2))
    assert odometry_at(odometry, 1.3) == pytest.approx((0.2, 0.0, 0.4))
    assert odometry_at(odometry, 0.9) == pytest.approx((0.0, 0.0, 0.0))
    assert odometry_at(odometry, 2.0) is None
    assert odometry_at([], 1.0) is None


def test_scanners_that_are_not_level_are_known():
    turn = message_type("geometry_msgs/msg/Quaternion")
    assert is_level(turn(x=0.0, y=0.0, z=1.0, w=0.0))
    assert is_level(turn(x=0.05, y=0.0, z=0.0, w=1.0))
    assert not is_level(turn(x=1.0, y=0.0, z=0.0, w=0.0))  # upside down
    assert not is_level(turn(x=nan, y=0.0, z=0.0, w=1.0))


def test_initial_poses_of_files_and_options(tmp_path):
    file = tmp_path / "drive.yaml"
    file.write_text("omnidrive_drive: {ros__parameters: {initial_pose: [1, 2.5, 0.1]}}")
    settings = DriveSettings().with_values(read_parameters(file))
    assert settings.link.initial_pose == Pose(1.0, 2.5, 0.1)
    assert settings.with_values({"initial_pose": "3,4"}).link.initial_pose == Pose(3.0, 4.0, 0.0)
    for wrong in ("3", "a,b", "1,2,3,4", "1,nan", f"0,0,{5.0 * pi}"):
        with pytest.raises(InvalidInput, match="initial_pose is"):
            settings.with_values({"initial_pose": wrong})
