"""A simulated robot in the graph: commands in; odometry, transforms, scans out."""

from dataclasses import replace
from math import atan2, cos, hypot, nan, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.deploy.ros2.simulated_robot import (
    Ros2Robot,
    Ros2RobotSettings,
    scan_ranges,
)
from omnidrive.errors import InvalidInput, InvalidMap
from omnidrive.geometry import Pose, compose, inverse
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import named_robot
from omnidrive.robot.imports import import_robot
from omnidrive.ros2 import LATCHED_QOS, SENSOR_QOS, Node, Qos, message_type
from omnidrive.ros2.planar_messages import grid_of, map_message, pose_of, set_pose, transform_of
from omnidrive.ros2.robot_description import robot_description
from omnidrive.ros2.ros_time import RosClock, seconds, stamp
from omnidrive.simulation import KinematicPlant
from tests.ros2.peer_process import new_domain

ROBOT = named_robot("mecanum")
START = Pose(1.0, 1.5, 0.5)
ROOM = np.zeros((40, 60), bool)
ROOM[:, [0, -1]] = ROOM[[0, -1], :] = True
GRID = OccupancyGrid(ROOM, 0.05, walled=False)
NUMBERS = st.floats(-100.0, 100.0)
POSES = st.builds(Pose, NUMBERS, NUMBERS, st.floats(-3.1, 3.1))


class Bench:
    """A robot on simulated time, and a node that commands it."""

    def __init__(self, robot, client):
        self.robot, self.client = robot, client
        settings = robot.settings
        self.commands = client.publisher("/cmd_vel", f"geometry_msgs/msg/{settings.command_type}")
        self.odometry = client.subscription("/odom", "nav_msgs/msg/Odometry")
        self.transforms = client.subscription("/tf", "tf2_msgs/msg/TFMessage")
        self.joints = client.subscription("/joint_states", "sensor_msgs/msg/JointState")
        self.scans = client.subscription("/scan", "sensor_msgs/msg/LaserScan", SENSOR_QOS)
        self.latched = {
            name: client.subscription(name, kind, LATCHED_QOS)
            for name, kind in {
                "/map": "nav_msgs/msg/OccupancyGrid",
                "/robot_description": "std_msgs/msg/String",
                "/tf_static": "tf2_msgs/msg/TFMessage",
            }.items()
        }
        assert client.wait_for(
            lambda: self.commands.matched and self.odometry.matched and self.scans.matched, 10.0
        )

    def command(self, vx, vy, yaw_rate, t=0.0):
        message = self.commands.message()
        twist = getattr(message, "twist", message)
        twist.linear.x, twist.linear.y, twist.angular.z = vx, vy, yaw_rate
        if hasattr(message, "header"):
            message.header.stamp = stamp(t, "jazzy")
        before = self.robot.commands + self.robot.refused
        self.commands.publish(message)
        self.client.wait_for(lambda: self.robot._subscription._reader.read(1), 5.0)
        self.robot.step()
        assert self.robot.commands + self.robot.refused == before + 1


@pytest.fixture(params=["Twist", "TwistStamped"])
def bench(request):
    settings = Ros2RobotSettings(command_type=request.param, clock=True, rate=20.0)
    domain = new_domain()
    options = {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}
    with Node("robot", **options) as node, Node("client", **options) as client:
        plant = KinematicPlant(ROBOT)
        yield Bench(Ros2Robot(node, plant, ROBOT, START, settings=settings, grid=GRID), client)


def newest(subscription):
    return subscription.take()[-1].message


def test_it_moves_as_commanded_and_reports_it(bench):
    robot = bench.robot
    for _ in range(10):
        bench.command(0.2, -0.1, 0.3)
    assert bench.client.wait_for(lambda: bench.odometry._reader.read(1), 5.0)
    state = robot.state
    assert state.pose.yaw > START.yaw + 0.05
    odometry = newest(bench.odometry)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert seconds(odometry.header.stamp) == pytest.approx(0.5)
    moved = compose(START, pose_of(odometry.pose.pose))
    assert np.allclose(moved[:2], state.pose[:2], atol=2e-3)
    twist = odometry.twist.twist
    assert twist.linear.x == pytest.approx(state.twist.vx, abs=5e-3)
    frames = {each.child_frame_id: each for each in newest(bench.transforms).transforms}
    parent = transform_of(frames["odom"].transform)
    total = compose(parent, transform_of(frames["base_link"].transform))
    assert (frames["odom"].header.frame_id, frames["base_link"].header.frame_id) == ("map", "odom")
    assert np.allclose(total, state.pose, atol=1e-9)
    joints = newest(bench.joints)
    assert joints.name == [f"wheel_{i}_joint" for i in range(4)]
    expected = ROBOT.chassis.wheel_speeds(state.twist)
    np.testing.assert_allclose(joints.velocity, expected, atol=0.1)


def test_it_stops_without_commands_and_refuses_others(bench, caplog):
    robot, stamped = bench.robot, bench.robot.settings.command_type == "TwistStamped"
    bench.command(0.2, 0.0, 0.0)
    for _ in range(9):
        robot.step()
    assert robot.state.twist.vx > 0.1
    for _ in range(30):
        robot.step()
    assert abs(robot.state.twist.vx) < 1e-3
    bench.command(nan, 0.0, 0.0)
    assert (robot.commands, robot.refused) == (1, 1)
    if stamped:
        bench.command(0.2, 0.0, 0.0, t=robot.now - 0.6)
        assert (robot.commands, robot.refused) == (1, 2)
        assert "a command is refused: its stamp is 0.6 s old" in caplog.messages
    bench.command(1e6, 0.0, 0.0, t=robot.now)
    assert ROBOT.chassis.wheel_speeds(robot._command).max() <= ROBOT.max_wheel_speed * 1.001


def test_a_stamp_of_another_time_is_reported_once_with_both_times(bench, caplog):
    robot = bench.robot
    if robot.settings.command_type == "Twist":
        pytest.skip("a Twist has no stamp")
    now, refused = robot.now, robot.refused
    for _ in range(2):
        bench.command(0.2, 0.0, 0.0, t=1.7e9)
    assert robot.refused == refused + 2
    (said,) = [each for each in caplog.messages if "is refused" in each and "1700000000" in each]
    assert f"the time is {now:.0f} s" in said
    assert "use_sim_time" in said


def test_scans_reach_subscriptions_of_each_reliability(bench):
    reliable = bench.client.subscription("/scan", "sensor_msgs/msg/LaserScan")
    assert bench.client.wait_for(lambda: reliable.matched and bench.scans.matched, 5.0)
    (offered,) = [each.qos for each in bench.client.graph().publishers("/scan")]
    assert Qos().fault(offered) is None
    assert SENSOR_QOS.fault(offered) is None


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_the_published_map_has_the_walls_that_the_scanner_sees(yaw):
    """Rays on the published map, without walls around it, are those that the scanner measures."""
    open_grid = OccupancyGrid(np.zeros((20, 30), bool), 0.2, (1.0, -2.0), yaw=yaw)
    shown = grid_of(map_message(open_grid.bordered(), message_type("nav_msgs/msg/OccupancyGrid")()))
    x, y = open_grid.centre(9, 12)
    bearings = np.linspace(-3.1, 3.1, 60)
    seen = scan_ranges(open_grid, Pose(x, y, 0.3), bearings, 20.0)
    assert np.isfinite(seen).all()
    ranges = scan_ranges(replace(shown, walled=False), Pose(x, y, 0.3), bearings, 20.0)
    np.testing.assert_allclose(ranges, seen, atol=1e-3)
    assert GRID.bordered() is GRID
    walled = replace(GRID, walled=True)
    assert walled.bordered() is walled


def test_it_publishes_map_description_scanner_and_clock(bench):
    clock = RosClock(bench.client, simulated=True)
    assert clock.now() is None
    assert bench.client.wait_for(lambda: clock._subscription.matched, 5.0)
    for _ in range(4):
        bench.robot.step()
    assert bench.client.wait_for(lambda: clock.now() == pytest.approx(0.2), 5.0)
    grid = grid_of(newest(bench.latched["/map"]))
    np.testing.assert_array_equal(grid.occupied, ROOM)
    assert grid.resolution == pytest.approx(0.05)
    assert newest(bench.latched["/robot_description"]).data == robot_description(ROBOT)
    (laser,) = newest(bench.latched["/tf_static"]).transforms
    assert (laser.header.frame_id, laser.child_frame_id) == ("base_link", "laser")
    (scan,) = [each.message for each in bench.scans.take()][:1]
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    ends = START[0] + scan.ranges * np.cos(START.yaw + bearings)
    assert ends.min() == pytest.approx(0.05, abs=0.1)


def test_ranges_are_distances_to_walls():
    bearings = np.array([0.0, np.pi / 2, np.pi, -np.pi / 2])
    ranges = scan_ranges(GRID, Pose(1.0, 1.0, 0.0), bearings, 10.0)
    np.testing.assert_allclose(ranges, [1.95, 0.95, 0.95, 0.95], atol=0.026)
    assert np.isinf(scan_ranges(GRID, Pose(1.0, 1.0, 0.0), bearings, 0.5)).all()


@pytest.mark.parametrize("name", ["paper", "kiwi", "mecanum"])
def test_the_description_is_the_robot(name, tmp_path):
    robot = named_robot(name)
    file = tmp_path / "robot.urdf"
    file.write_text(robot_description(robot))
    found = import_robot(file).robot
    for ours, theirs in zip(robot.mounts, found.mounts, strict=True):
        assert np.allclose(ours[:2], theirs[:2])
        assert cos(ours.axle_angle - theirs.axle_angle) == pytest.approx(1.0)
    np.testing.assert_allclose(found.chassis.jacobian, robot.chassis.jacobian, atol=1e-6)
    assert found.mass == pytest.approx(robot.mass)


@given(pose=POSES, other=POSES)
def test_poses_survive_messages(pose, other):
    message = message_type("geometry_msgs/msg/Pose")()
    set_pose(message, pose)
    back = pose_of(message)
    assert np.allclose(back[:2], pose[:2])
    assert abs(atan2(sin(back.yaw - pose.yaw), cos(back.yaw - pose.yaw))) < 1e-9
    unit = compose(inverse(pose), pose)
    assert hypot(unit.x, unit.y) < 1e-9
    total = compose(pose, other)
    assert np.allclose(compose(inverse(pose), total), other, atol=1e-9)


def test_maps_that_do_not_fit_are_refused():
    message = map_message(GRID, message_type("nav_msgs/msg/OccupancyGrid")())
    message.info.width += 1
    with pytest.raises(InvalidMap, match="has 2400 of them"):
        grid_of(message)
    message.info.width = 0
    with pytest.raises(InvalidMap):
        grid_of(message)
    message.info.width, message.info.resolution = 60, nan
    with pytest.raises(InvalidMap, match="resolution"):
        grid_of(message)


def test_settings_out_of_range_are_refused():
    with pytest.raises(InvalidInput, match="rate is 0 Hz"):
        Ros2RobotSettings(rate=0.0)
