"""The link to a robot in the graph, and drives over it."""

import json
import threading
import time
from dataclasses import replace
from math import hypot, inf, nan, pi

import numpy as np
import pytest

from omnidrive.control import FeedforwardController, Pipeline
from omnidrive.deploy.clock import MonotonicClock
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.log import LogFolder, read_log
from omnidrive.deploy.log_replay import replay_log
from omnidrive.deploy.robot_link import LinkLost, RobotLink
from omnidrive.deploy.ros2.drive_files import PARAMETERS_FILE, drive_of_log, parameters_file
from omnidrive.deploy.ros2.drive_reports import DriveReports, ReportedPipeline
from omnidrive.deploy.ros2.drive_settings import DriveSettings, read_parameters
from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
from omnidrive.deploy.ros2.path_reference import is_same_ahead, path_poses, path_reference
from omnidrive.deploy.ros2.plan_follower import PlanFollower
from omnidrive.deploy.ros2.ros2_link import Ros2Link, Ros2LinkSettings
from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import BodyTwist, Pose, wrap
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Circle, Hold, ShapeReference
from omnidrive.ros2 import LATCHED_QOS, Node, message_type
from omnidrive.ros2.planar_messages import map_message, set_pose
from omnidrive.ros2.ros_time import stamp
from omnidrive.ros2.transform_tree import Transform, TransformTree
from tests.command import omnidrive
from tests.deploy.ros2.robot_process import ROBOT, Odometer, running_robot
from tests.ros2.peer_process import new_domain

RATE = 25.0
QUICK = Ros2LinkSettings(timeout=0.1)


def options(domain):
    return {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}


def pipeline(reports=None):
    return ReportedPipeline(FeedforwardController(1.0 / RATE), reports=reports)


@pytest.fixture
def world():
    """A robot that moves, a node that drives, and another node of the user."""
    domain = new_domain()
    with (
        running_robot(domain, rate=RATE, command_type="Twist") as robot,
        Node("drive", **options(domain)) as node,
        Node("user", **options(domain)) as user,
    ):
        link = Ros2Link(node, ROBOT)
        follower = PathFollower(link, pipeline(), RATE, DriveRequests(node))
        yield robot, follower, user


def circle(duration):
    return ShapeReference(Circle(radius=0.3), duration)


def test_it_is_a_link_with_the_type_of_the_robot(world):
    robot, follower, user = world
    link = follower.link
    assert isinstance(link, RobotLink)
    link.open(MonotonicClock())
    assert link._commands.type == "geometry_msgs/msg/Twist"
    link.send(BodyTwist(0.1, 0.0, 0.2))
    assert user.wait_for(lambda: robot.commands == 1, 30.0)
    assert user.wait_for(lambda: robot.state.twist.vx > 0.05, 30.0)
    found = []
    assert user.wait_for(lambda: found.append(link.read()) or found[-1] is not None, 30.0)
    fix = found[-1].fixes[0]
    assert abs(fix.stamp - time.monotonic()) < 0.3
    assert hypot(fix.pose.x - robot.state.pose.x, fix.pose.y - robot.state.pose.y) < 0.1
    link.stop()
    assert user.wait_for(lambda: robot.commands == 2, 2.0)
    for value in (BodyTwist(nan, 0.0, 0.0), BodyTwist(0.0, inf, 0.0)):
        with pytest.raises(InvalidInput, match="finite"):
            link.send(value)
    link.close()


@pytest.mark.long
def test_a_drive_follows_its_reference_and_reports_it(world):
    robot, follower, user = world
    diagnostics = user.subscription("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    plans = user.subscription("/local_plan", "nav_msgs/msg/Path")
    node = follower.link.node
    follower.reports = DriveReports(node, follower.link.ros_clock, "map")
    follower.pipeline = pipeline(follower.reports)
    result = follower.drive(ShapeReference(Circle(radius=0.1), 1.5))
    assert result.finished, result.changes
    errors = np.hypot(*(result.run.pose - result.run.target)[:, :2].T)
    assert errors.mean() < 0.1
    assert hypot(*robot.state.pose[:2]) < 0.1
    assert user.wait_for(lambda: robot._command.vx == 0.0, 3.0)
    messages = [each.message for each in diagnostics.take()]
    tracking, state = messages[0].status
    assert tracking.name == "drive: tracking"
    assert tracking.values[0].key == "position error (m)"
    assert (state.level, state.name, state.message) == (0, "drive: drive", "driving")
    (end,) = messages[-1].status
    assert (end.level, end.message) == (0, result.ending)
    plan = plans.take()[0].message
    assert (plan.header.frame_id, len(plan.poses)) == ("map", 21)


@pytest.mark.long
@pytest.mark.parametrize("logged", [False, True])
def test_a_stop_request_of_another_node_ends_the_drive(world, tmp_path, logged):
    """With a log, which can be replayed."""
    robot, follower, user = world
    stop = user.publisher("/e_stop", "std_msgs/msg/Bool")
    user.wait_for(lambda: stop.matched, 5.0)

    def ask(_controls):
        if robot.commands > 20:
            stop.publish(stop.message(data=True))

    if logged:
        settings = DriveSettings(robot="small", controller="feedforward", rate=follower.rate)
        follower.logs = LogFolder(tmp_path, {PARAMETERS_FILE: parameters_file(settings)})
    result = follower.drive(circle(200.0), watch=ask)
    assert not result.finished
    assert result.ending == "stop requested on /e_stop"
    assert follower.requests.stopped
    assert user.wait_for(lambda: max(map(abs, robot.state.twist)) < 0.02, 30.0)
    if not logged:
        return
    found = read_log(tmp_path / "drive-0001.mcap")
    assert found.changes == result.changes
    assert sum(each.sent is not None for each in found.samples()) > 20
    _replay(tmp_path, found)


def _replay(folder, found):
    """Replay the log of a drive, as ``omnidrive log replay`` does."""
    same = replay_log(found, *drive_of_log(found.files, found.robot))
    assert len(same.t) > 10
    assert same.replayed == pytest.approx(same.logged, abs=1e-9)
    other = replay_log(found, *drive_of_log(found.files, found.robot, controller="pid"))
    assert np.abs(other.replayed - other.logged).max() > 1e-6
    done = omnidrive("log", "replay", "drive-0001.mcap", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["samples"] == len(same.t)
    own = replace(DriveSettings(rate=1.0 / found.dt), controller="mine.py:Controller")
    files = dict(found.files) | {PARAMETERS_FILE: parameters_file(own)}
    with pytest.raises(InvalidInput, match="allow-code"):
        drive_of_log(files, found.robot)


@pytest.mark.long
def test_a_robot_that_falls_silent_is_held_until_it_is_armed_again(world, caplog):
    """Odometry stops for a second; the drive says why, and goes on when another node arms it."""
    robot, follower, user = world
    arm = user.publisher("/drive/arm", "std_msgs/msg/Bool")
    publish, silent = robot._publish, []

    def mute():
        if robot.commands > 40 and len(silent) < 40:
            silent.append(time.monotonic())
        else:
            publish()

    robot._publish = mute

    def ask(_controls):
        if len(silent) == 40 and robot._publish is mute:
            arm.publish(arm.message(data=True))

    result = follower.drive(circle(4.0), watch=ask)
    states = [each.state for each in result.changes]
    assert DriveState.HOLDING in states
    held = next(each for each in result.changes if each.state is DriveState.HOLDING)
    assert "more than 0.5 s" in held.reason
    assert states.count(DriveState.RUNNING) >= 2
    assert result.finished
    noted = [
        each
        for each in caplog.records
        if getattr(each, "is_event", False) and each.levelname == "WARNING"
    ]
    assert [each.getMessage()[:5] for each in noted] == ["holdi", "held:"]


@pytest.mark.long
def test_a_jump_of_the_localisation_holds_the_robot():
    """A pose on /amcl_pose that is 2 m beside the last one: nothing moves until it is armed."""
    domain = new_domain()
    with (
        running_robot(domain, rate=RATE, localised=False) as robot,
        Node("drive", **options(domain)) as node,
        Node("amcl", **options(domain)) as user,
    ):
        follower = PathFollower(Ros2Link(node, ROBOT), pipeline(), RATE, DriveRequests(node))
        localisation = Odometer(user).localisation
        assert user.wait_for(lambda: localisation.matched, 5.0)
        jumped, at_rest = [], []

        def publish(x):
            message = localisation.message()
            message.header.stamp, message.header.frame_id = stamp(time.time(), "jazzy"), "map"
            message.pose.pose.position.x = x
            message.pose.pose.orientation.w = 1.0
            localisation.publish(message)

        def watch(controls):
            if robot.commands > 15 and not jumped:
                jumped.append(time.monotonic())
                publish(robot.state.pose.x + 2.0)
            elif jumped and time.monotonic() - jumped[0] > 1.5:
                at_rest.append(max(map(abs, robot.state.twist)))
                controls.stop("end of the test")

        assert user.wait_for(lambda: publish(0.0) or follower.link.poses.read(), 5.0)
        result = follower.drive(Hold(Pose(0.5, 0.0, 0.0), 30.0), watch=watch)
    held = next(each for each in result.changes if each.state is DriveState.HOLDING)
    assert held.reason.startswith("the pose jumps by ")
    assert result.ending == "end of the test"
    assert at_rest[0] < 0.02


def test_no_robot_is_an_error_that_names_the_domain():
    with Node("drive", **options(new_domain())) as node:
        link = Ros2Link(node, ROBOT, QUICK)
        with pytest.raises(LinkLost, match="nothing subscribes to /cmd_vel in domain"):
            link.open(MonotonicClock())
        timed = Ros2LinkSettings(timeout=0.1, use_sim_time=True, command_type="Twist")
        with pytest.raises(LinkLost, match="no time on /clock"):
            Ros2Link(node, ROBOT, timed).open(MonotonicClock())
        follower = PathFollower(Ros2Link(node, ROBOT, QUICK), pipeline(), RATE, DriveRequests(node))
        with pytest.raises(LinkLost, match="no pose of base_link in map within"):
            follower.current_pose()


def test_wheel_joints_must_fit_the_robot():
    with Node("drive", **options(new_domain())) as node:
        settings = Ros2LinkSettings(wheel_joints=("left", "right"))
        with pytest.raises(InvalidInput, match="2 wheel joints, but the robot has 4 wheels"):
            Ros2Link(node, ROBOT, settings)


def path_message(poses, frame="map"):
    message = message_type("nav_msgs/msg/Path")()
    message.header.frame_id = frame
    for pose in poses:
        each = message_type("geometry_msgs/msg/PoseStamped")()
        set_pose(each.pose, Pose(*pose))
        message.poses.append(each)
    return message


@pytest.mark.long
def test_plans_goals_and_replanned_paths_are_driven(world):
    """A path; its rest, sent again, is ignored; another one is continued; then a goal on a map."""
    robot, follower, user = world
    plans = user.publisher("/plan", "nav_msgs/msg/Path")
    goals = user.publisher("/goal_pose", "geometry_msgs/msg/PoseStamped")
    maps = user.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED_QOS)
    limit = threading.Timer(40.0, lambda: setattr(follower.requests, "stopped", True))
    limit.start()
    follower.speed = 0.4
    room = OccupancyGrid(np.zeros((80, 80), bool), 0.1, (-4.0, -4.0))
    plan_follower = PlanFollower(follower)
    assert user.wait_for(lambda: plans.matched and goals.matched and maps.matched, 5.0)
    maps.publish(map_message(room, maps.message()))
    first = [(0.02 * i, 0.0, 0.0) for i in range(101)]
    second = [(0.5 + 0.02 * i, 0.008 * i, 0.0) for i in range(51)]
    plans.publish(path_message(first))
    sent = []

    def replan():
        x = robot.state.pose.x
        if x > 0.2 and not sent:
            sent.append(plans.publish(path_message(first[5:])))
        if x > 0.5 and len(sent) == 1:
            sent.append(plans.publish(path_message(second)))

    results = []
    watch = plan_follower._watch

    def watch_and_replan(controls):
        replan()
        watch(controls)

    plan_follower._watch = watch_and_replan
    for result in plan_follower.run(3):
        results.append(result)
        if len(results) == 1:
            goal = goals.message()
            goal.header.frame_id = "map"
            set_pose(goal.pose, Pose(-0.3, -0.2, 0.5))
            goals.publish(goal)
    limit.cancel()
    assert [each.ending for each in results] == [
        "the reference ends",
        "the reference ends",
    ]
    assert len(sent) == 2
    assert results[0].run.pose[-1, 1] == pytest.approx(0.4, abs=0.1)
    assert user.wait_for(
        lambda: (
            np.allclose(robot.state.pose[:2], (-0.3, -0.2), atol=0.15)
            and abs(wrap(robot.state.pose.yaw - 0.5)) < 0.15
        ),
        5.0,
    ), robot.state.pose


@pytest.mark.long
def test_a_path_for_a_held_robot_is_driven_when_it_is_armed(world):
    """A jump of the pose holds the robot; the paths that come then do not move it."""
    robot, follower, user = world
    plans = user.publisher("/plan", "nav_msgs/msg/Path")
    arm = user.publisher("/drive/arm", "std_msgs/msg/Bool")
    diagnostics = user.subscription("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    follower.speed, follower.reports = (
        0.4,
        DriveReports(follower.link.node, follower.link.ros_clock, "map"),
    )
    plan_follower = PlanFollower(follower)
    assert user.wait_for(lambda: plans.matched and arm.matched, 5.0)
    at = robot.state.pose
    plans.publish(path_message([(at.x + 0.02 * i, at.y, 0.0) for i in range(101)]))
    aside = path_message([(at.x + 0.02 * i, at.y - 0.02 * i, 0.0) for i in range(41)])
    publish, watch, began, moved = robot._publish, plan_follower._watch, [], []

    def watch_and_lose(controls):
        watch(controls)
        now = time.monotonic()
        if not began and robot.state.pose.x > at.x + 0.2:
            began.append(now)
            robot._publish = lambda: None
        elif began and now - began[0] > 4.0:
            arm.publish(arm.message(data=True))
        elif began and now - began[0] > 1.5:
            robot._publish = publish
            plans.publish(aside)
            moved.append(max(map(abs, robot.state.twist)))

    plan_follower._watch = watch_and_lose
    limit = threading.Timer(40.0, lambda: setattr(follower.requests, "stopped", True))
    limit.start()
    results = list(plan_follower.run(2))
    limit.cancel()
    assert max(moved) < 0.02
    assert results[-1].finished, [each.ending for each in results]
    assert user.wait_for(lambda: robot.state.pose.y < at.y - 0.65, 3.0)
    told = [status.message for each in diagnostics.take() for status in each.message.status]
    assert any(each.startswith("the robot is held: no readings for") for each in told)


def test_paths_without_headings_turn_evenly_to_the_goal():
    poses = np.array([(0.1 * i, 0.0, 0.0) for i in range(11)])
    poses[-1, 2] = pi / 2
    reference = path_reference(poses, Pose(0.0, 0.0, 0.0), ROBOT, speed=0.2)
    half = reference.at(0.5 * reference.duration).pose
    assert half.yaw == pytest.approx(pi / 4, abs=0.15)
    assert reference.at(reference.duration).pose.yaw == pytest.approx(pi / 2)
    speeds = [hypot(*reference.at(t).twist[:2]) for t in np.linspace(0, reference.duration, 50)]
    assert max(speeds) <= 0.2001
    assert path_reference(poses, Pose(-1.0, 0.0, 0.0), ROBOT).at(0.0).pose.x == -1.0


def test_paths_are_checked():
    tree = TransformTree()
    with pytest.raises(InvalidReference, match="frame odom, which is not known in map"):
        path_poses(path_message([(0, 0, 0)], "odom"), "map", tree)
    tree.set("odom", Transform("map", Pose(1.0, 0.0, 0.0), 0.0))
    poses = path_poses(path_message([(1.0, 2.0, 0.5)], "odom"), "map", tree)
    assert np.allclose(poses, [(2.0, 2.0, 0.5)])
    with pytest.raises(InvalidReference, match="has 0 poses"):
        path_poses(path_message([]), "map", tree)
    with pytest.raises(InvalidReference, match="not finite"):
        path_poses(path_message([(nan, 0.0, 0.0)]), "map", tree)


def test_the_rest_of_a_path_is_the_same_path():
    old = np.array([(0.1 * i, 0.0, 0.0) for i in range(21)])
    here = Pose(0.55, 0.02, 0.0)
    assert is_same_ahead(old[5:], old, here)
    assert is_same_ahead(old + np.array([0.0, 0.04, 0.0]), old, here)
    assert not is_same_ahead(old + np.array([0.0, 0.06, 0.0]), old, here)
    assert not is_same_ahead(old[:-3], old, here)
    turned = old.copy()
    turned[-1, 2] = 0.2
    assert not is_same_ahead(turned, old, here)
    bent = old.copy()
    bent[12, 1] = 0.3
    assert not is_same_ahead(bent, old, here)
    bent[:, 1] = 0.0
    bent[1, 1] = 0.3  # behind the robot
    assert is_same_ahead(bent, old, here)


PARAMETERS = """
/**:
  ros__parameters:
    use_sim_time: true
omnidrive_drive:
  ros__parameters:
    robot: mecanum
    rate: 100
    controller: {type: holonomic-nmpc, horizon: 12}
"""


def test_parameters_are_those_of_a_ros_file(tmp_path):
    file = tmp_path / "drive.yaml"
    file.write_text(PARAMETERS)
    settings = DriveSettings().with_values(read_parameters(file))
    assert settings.use_sim_time
    assert settings.rate == 100.0
    assert settings.controller == "holonomic-nmpc,horizon=12"
    assert settings.link.use_sim_time
    settings = settings.with_values({"controller": "feedforward"})
    made = settings.make_pipeline(settings.make_robot())
    assert isinstance(made, Pipeline)
    assert settings.with_values({"rate": 20.0, "max_speed": None}).rate == 20.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("omnidrive_drive: {ros__parameters: {rat: 5.0}}", "did you mean 'rate'"),
        ("omnidrive_drive: {ros__parameters: {rate: fast}}", "rate must be a float, got 'fast'"),
        ("omnidrive_drive: {ros__parameters: {rate: 5000}}", "rate is 5000 Hz"),
        ("omnidrive_drive: {ros__parameters: {max_speed: -1.0}}", "max_speed is -1 m/s"),
        ("omnidrive_drive: {ros__parameters: {command_type: Wrench}}", "one of Twist"),
        ("omnidrive_drive: {rate: 5.0}", "no mapping ros__parameters"),
        ("controller_server: {ros__parameters: {a: 1}}", "its nodes are 'controller_server'"),
        ("omnidrive_drive: {ros__parameters: {controller: {horizon: 3}}}", "has no type"),
        ("- 1", "no mapping"),
    ],
)
def test_wrong_parameters_are_refused(tmp_path, text, message):
    file = tmp_path / "drive.yaml"
    file.write_text(text)
    with pytest.raises(InvalidInput, match=message):
        DriveSettings().with_values(read_parameters(file))
