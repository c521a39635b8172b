"""The action follow_path and the lifecycle: requests and replies in the form of rmw_cyclonedds."""

import struct
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import int64, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from omnidrive.control import FeedforwardController
from omnidrive.control.controller import STOP
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.robot_link import LinkLost
from omnidrive.deploy.ros2.drive_reports import ReportedPipeline
from omnidrive.deploy.ros2.follow_path import (
    ABORTED,
    ACCEPTED,
    CANCELED,
    EXECUTING,
    SUCCEEDED,
    FollowPathServer,
    Goal,
    _error_code,
)
from omnidrive.deploy.ros2.path_follower import DriveRequests, NoPose, PathFollower
from omnidrive.deploy.ros2.path_reference import UnknownFrame
from omnidrive.deploy.ros2.ros2_link import Ros2Link
from omnidrive.errors import InvalidMessage, InvalidReference
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.ros2 import Node, message_type
from omnidrive.ros2.planar_messages import set_pose
from omnidrive.ros2.service import ACTIVE, UNCONFIGURED, Lifecycle
from tests.deploy.ros2.robot_process import ROBOT, running_robot
from tests.ros2.peer_process import new_domain
from tests.ros2.peer_types import from_peer, to_peer, typestore

ACTION = "nav2_msgs/action/FollowPath"
STORE = typestore("jazzy")


class Client:
    """Client of a service, whose messages rosbags encodes."""

    def __init__(self, node, service, kind):
        self.kind, self.node, self.number = kind, node, 0
        mark = "clientid=10.1.2;"
        self.requests = node.request_publisher(f"rq{service}Request", f"{kind}_Request", mark)
        self.replies = node.request_subscription(f"rr{service}Reply", f"{kind}_Response", mark)

    def call(self, wait=10.0, **values):
        self.ask(**values)
        return self.answer(wait)

    def ask(self, **values):
        assert self.node.wait_for(lambda: self.requests.matched and self.replies.matched, 10.0)
        self.number += 1
        message = message_type(f"{self.kind}_Request")(**values)
        body = bytes(STORE.serialize_cdr(to_peer(message, STORE), f"{self.kind}_Request"))
        self.requests.send(body[:4] + struct.pack("<Qq", 2**63 + 5, self.number) + body[4:])

    def answer(self, wait=10.0):
        found = []
        assert self.node.wait_for(lambda: found.extend(self.replies.take_raw()) or found, wait)
        (raw,) = found
        assert struct.unpack_from("<Qq", raw.data, 4) == (2**63 + 5, self.number)
        name = f"{self.kind}_Response"
        body = raw.data[:4] + raw.data[20:]
        return from_peer(STORE.deserialize_cdr(body, name), name, "jazzy")


class Nav:
    """What Nav2 does with a controller server."""

    def __init__(self, node):
        self.node = node
        lifecycle = "lifecycle_msgs/srv/ChangeState"
        self.change = Client(node, "/controller_server/change_state", lifecycle)
        self.send = Client(node, "/follow_path/_action/send_goal", f"{ACTION}_SendGoal")
        self.result = Client(node, "/follow_path/_action/get_result", f"{ACTION}_GetResult")
        self.cancel = Client(node, "/follow_path/_action/cancel_goal", "action_msgs/srv/CancelGoal")
        self.feedback = node.subscription(
            "/follow_path/_action/feedback", f"{ACTION}_FeedbackMessage"
        )

    def activate(self):
        for label in ("configure", "activate"):
            make = message_type("lifecycle_msgs/msg/Transition")
            assert self.change.call(transition=make(0, label)).success

    def goal(self, number, points, frame="map"):
        path = message_type("nav_msgs/msg/Path")()
        path.header.frame_id = frame
        for x, y in points:
            each = message_type("geometry_msgs/msg/PoseStamped")()
            set_pose(each.pose, Pose(x, y, 0.0))
            path.poses.append(each)
        goal = message_type(f"{ACTION}_Goal")(path, "FollowPath")
        return self.send.call(goal_id=uuid(number), goal=goal).accepted


def uuid(number):
    return message_type("unique_identifier_msgs/msg/UUID")(np.full(16, number, np.uint8))


@contextmanager
def serving():
    """A robot, a server that drives it, and Nav2's part."""
    domain = new_domain()
    options = {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}
    with (
        running_robot(domain, rate=25.0) as robot,
        Node("controller_server", **options) as node,
        Node("bt_navigator", **options) as user,
    ):
        requests = DriveRequests(node)
        pipeline = ReportedPipeline(FeedforwardController(0.04))
        follower = PathFollower(Ros2Link(node, ROBOT), pipeline, 25.0, requests, speed=0.4)
        server = FollowPathServer(follower)
        results = []
        thread = threading.Thread(target=lambda: results.extend(server.run()))
        thread.start()
        try:
            yield robot, server, Nav(user)
        finally:
            requests.stopped = True
            if server._controls is not None:
                server._controls.stop("end of the test")
            thread.join(10.0)
            assert not thread.is_alive()


LINE = [(0.05 * i, 0.0) for i in range(13)]


@pytest.mark.long
def test_a_behaviour_tree_drives_cancels_and_replaces_goals():
    with serving() as (robot, _, nav):
        assert not nav.goal(1, LINE)  # the node is not active
        nav.activate()
        assert nav.goal(2, LINE)
        response = nav.result.call(goal_id=uuid(2), wait=20.0)
        assert (response.status, response.result.error_code) == (SUCCEEDED, 0)
        assert response.result.error_msg == ""
        assert abs(robot.state.pose.x - 0.6) < 0.15
        distances = [each.message.feedback.distance_to_goal for each in nav.feedback.take()]
        assert distances[-1] < distances[0]
        assert nav.goal(3, [(0.6 - 0.05 * i, 0.0) for i in range(60)])
        nav.result.ask(goal_id=uuid(3))
        time.sleep(0.5)
        info = message_type("action_msgs/msg/GoalInfo")(goal_id=uuid(3))
        assert len(nav.cancel.call(goal_info=info).goals_canceling) == 1
        assert nav.result.answer().status == CANCELED
        assert nav.cancel.call(goal_info=info).return_code == 1
        assert nav.goal(4, [(0.05 * i, 0.5) for i in range(60)])
        time.sleep(0.3)
        assert nav.goal(5, LINE, "nowhere")
        assert nav.result.call(goal_id=uuid(4)).status == ABORTED
        response = nav.result.call(goal_id=uuid(5))
        assert (response.status, response.result.error_code) == (ABORTED, 102)
        assert response.result.error_msg.startswith("the path is in the frame nowhere, which is")
        assert nav.goal(6, [])
        response = nav.result.call(goal_id=uuid(6))
        assert (response.status, response.result.error_code) == (ABORTED, 103)
        assert response.result.error_msg == "the path has 0 poses, need 1 to 100000"
        assert nav.result.call(goal_id=uuid(99)).status == 0


@pytest.mark.long
def test_a_robot_arrives_although_a_behaviour_tree_plans_again_every_second():
    """As Nav2's default tree: each goal is the rest of the path from the robot's pose on."""
    with serving() as (robot, _, nav):
        nav.activate()
        goal, number, speeds = (2.4, 0.3), 10, []
        end = time.monotonic() + 25.0
        while time.monotonic() < end and abs(robot.state.pose.x - goal[0]) > 0.05:
            x, y, _ = robot.state.pose
            count = max(round(np.hypot(goal[0] - x, goal[1] - y) / 0.05), 1)
            share = np.arange(count + 1) / count
            # a planner's path is a little beside the last one
            beside = 0.08 * np.sin(np.pi * share) * (-1) ** number
            path = np.column_stack([x + (goal[0] - x) * share, y + (goal[1] - y) * share + beside])
            number += 1
            assert nav.goal(number, path.tolist())
            later = time.monotonic() + 1.0
            while time.monotonic() < later:
                time.sleep(0.02)
                if 0.5 < robot.state.pose.x < 1.9:
                    speeds.append(np.hypot(robot.state.twist.vx, robot.state.twist.vy))
        response = nav.result.call(goal_id=uuid(number), wait=20.0)
        assert (response.status, response.result.error_code) == (SUCCEEDED, 0)
        assert number > 13
        assert min(speeds) > 0.1  # it does not stop for a new path
        assert nav.result.call(goal_id=uuid(12)).status == ABORTED  # replaced, as in Nav2


@pytest.mark.long
def test_a_goal_of_a_thousand_poses_is_accepted_before_its_path_is_decoded():
    with serving() as (_, server, nav):
        nav.activate()
        decoded = []
        decode = server._decode
        server._decode = lambda goal: decoded.append(server._goals[goal.identity]) or decode(goal)
        with server._lock:  # the request waits
            handled = server._accept
            order = []
            server._send._handle = lambda *a: order.append(len(decoded)) or handled(*a)
        assert nav.goal(7, [(0.002 * i, 0.0) for i in range(1000)])
        assert order == [0]
        assert nav.result.call(goal_id=uuid(7), wait=30.0).status == SUCCEEDED


class WatchedServer(FollowPathServer):
    """A server without a node, whose drive has decided whether it follows a new goal."""

    def __init__(self, continues, present, following):
        self._follower = SimpleNamespace(
            continuation=SimpleNamespace(poll=lambda _controls: continues),
            link=SimpleNamespace(sent=STOP),
            held_sentence=lambda reason: f"the robot is held: {reason}",
        )
        self._lock, self._goals, self._done = threading.RLock(), {}, 0
        self._present, self._following = present, following

    def _publish_status(self):
        pass

    def _feed_back(self, goal):
        pass


@pytest.mark.parametrize(
    ("continues", "status", "former", "stopped"),
    [
        (True, ACCEPTED, ABORTED, None),
        (True, CANCELED, ABORTED, "the goal was canceled"),
        (False, ACCEPTED, EXECUTING, "a new goal"),
        (False, CANCELED, EXECUTING, None),
    ],
)
def test_a_goal_may_be_canceled_while_its_motion_is_computed(continues, status, former, stopped):
    """A drive that follows it all the same stops; one that does not goes on to the former goal."""
    present = Goal(b"1" * 16, b"", 0.0, np.zeros((1, 3)), EXECUTING)
    following = Goal(b"2" * 16, b"", 0.0, np.ones((1, 3)), status)
    server, controls = WatchedServer(continues, present, following), DriveControls(arm=True)
    server._watch(controls)
    server._watch(controls)
    assert controls.stop_reason == stopped
    assert present.status == former
    assert following.status == (EXECUTING if (continues, stopped) == (True, None) else status)
    assert server._present is (following if continues else present)


@pytest.mark.parametrize(
    ("sent", "stopped"), [(BodyTwist(0.1, 0.0, 0.0), None), (STOP, "the robot is held: a jump")]
)
def test_goals_are_aborted_when_the_robot_is_held(sent, stopped):
    """The drive ends after the ramp; a goal that a behaviour tree sends again arms nothing."""
    present = Goal(b"1" * 16, b"", 0.0, np.zeros((1, 3)), EXECUTING)
    waiting = Goal(b"2" * 16, b"", 0.0, np.ones((1, 3)), ACCEPTED)
    server, controls = WatchedServer(None, present, None), DriveControls()
    server._goals = {each.identity: each for each in (present, waiting)}
    server._follower.link.sent, controls.held = sent, "a jump"
    server._watch(controls)
    for goal in (present, waiting):
        assert (goal.status, goal.error_code) == (ABORTED, 102)
        assert goal.message == "the robot is held: a jump"
    assert controls.stop_reason == stopped
    assert not controls.arm_requested
    controls.held = None  # armed during the ramp: the motion of an aborted goal does not go on
    server._watch(controls)
    assert controls.stop_reason == (stopped or "the goal was canceled")


@pytest.mark.long
def test_a_held_robot_rests_until_it_is_armed_although_goals_come_every_second():
    """Poses are missing for a second, while a behaviour tree plans again and again."""
    with serving() as (robot, server, nav):
        arm = nav.node.publisher("/controller_server/arm", "std_msgs/msg/Bool")
        path = [(0.05 * i, 0.0) for i in range(61)]
        nav.activate()
        assert nav.node.wait_for(lambda: arm.matched, 10.0)
        assert nav.goal(1, path)
        assert nav.node.wait_for(lambda: robot.state.pose.x > 0.2, 10.0)
        publish, robot._publish = robot._publish, lambda: None
        response = nav.result.call(goal_id=uuid(1), wait=5.0)
        robot._publish = publish
        assert (response.status, response.result.error_code) == (ABORTED, 102)
        reason = response.result.error_msg
        assert reason.startswith("the robot is held: no readings for 0.5")
        assert reason.endswith("it moves again after true on /controller_server/arm")
        time.sleep(1.0)
        rest = robot.state.pose
        for number in (2, 3):  # poses are back
            assert nav.goal(number, path)
            response = nav.result.call(goal_id=uuid(number), wait=5.0)
            assert (response.status, response.result.error_msg) == (ABORTED, reason)
            time.sleep(0.5)
        assert robot.state.pose == pytest.approx(rest, abs=1e-3)
        arm.publish(arm.message(data=True))
        assert nav.node.wait_for(lambda: not server._follower.held, 5.0)
        time.sleep(0.5)
        assert robot.state.pose == pytest.approx(rest, abs=1e-3)  # the goal is over
        assert nav.goal(4, path)
        assert nav.result.call(goal_id=uuid(4), wait=20.0).status == SUCCEEDED


def test_errors_have_the_codes_of_nav2():
    errors = {
        UnknownFrame("the path is in the frame nowhere"): 102,
        NoPose("no pose of base_link in map"): 102,
        InvalidReference("the path has 0 poses"): 103,
        InvalidMessage("not a path"): 103,
        LinkLost("/teleop also commands /cmd_vel"): 100,
    }
    assert [_error_code(each) for each in errors] == list(errors.values())


@pytest.fixture
def lifecycle():
    """A lifecycle that answers, and a client of raw DDS types."""
    domain = new_domain()
    options = {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}
    with Node("server", **options) as node:
        yield Lifecycle(node), domain


def test_the_lifecycle_answers_a_client_of_raw_types(lifecycle):
    served, domain = lifecycle
    head = {"request_writer": uint64, "request_number": int64}
    state = make_idl_struct("State_", "lifecycle_msgs.msg.dds_.State_", {"id": uint8, "label": str})
    request = make_idl_struct(
        "GetState_Request_",
        "lifecycle_msgs.srv.dds_.GetState_Request_",
        head | {"structure_needs_at_least_one_member": uint8},
    )
    response = make_idl_struct(
        "GetState_Response_",
        "lifecycle_msgs.srv.dds_.GetState_Response_",
        head | {"current_state": state},
    )
    participant = DomainParticipant(domain)
    qos = Qos(
        Policy.Reliability.Reliable(10**9),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(b"clientid=1.2;"),
    )
    writer = DataWriter(participant, Topic(participant, "rq/server/get_stateRequest", request), qos)
    reader = DataReader(participant, Topic(participant, "rr/server/get_stateReply", response), qos)
    end = time.monotonic() + 10.0
    while not (writer.get_matched_subscriptions() and reader.get_matched_publications()):
        assert time.monotonic() < end
        time.sleep(0.01)
    for number in (1, 2):
        writer.write(request(77, number, 0))
        found = []
        while not found and time.monotonic() < end:
            served.poll()
            found = reader.take(10)
            time.sleep(0.005)
        (reply,) = found
        assert (reply.request_writer, reply.request_number) == (77, number)
        expected = UNCONFIGURED if number == 1 else ACTIVE
        assert reply.current_state.id == expected
        assert reply.current_state.label == {1: "unconfigured", 3: "active"}[expected]
        served.state = ACTIVE


def test_the_lifecycle_lists_states_and_transitions(lifecycle):
    served, _ = lifecycle
    make = message_type("lifecycle_msgs/srv/ChangeState_Request")
    transition = message_type("lifecycle_msgs/msg/Transition")

    def labels():
        found = served._transitions(None, b"").available_transitions
        return [(each.transition.label, each.goal_state.label) for each in found]

    assert len(served._states(None, b"").available_states) == 4
    assert labels() == [("configure", "inactive"), ("shutdown", "finalized")]
    assert not served._change(make(transition(3, "")), b"").success
    assert served._change(make(transition(1, "")), b"").success
    assert labels() == [
        ("cleanup", "unconfigured"),
        ("activate", "active"),
        ("shutdown", "finalized"),
    ]
    assert served._change(make(transition(6, "")), b"").success
    assert labels() == []
