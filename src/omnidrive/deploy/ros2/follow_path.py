"""The action ``follow_path`` of Nav2: omnidrive as the controller server of a behaviour tree."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import hypot
from typing import Any

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import DriveResult
from omnidrive.deploy.ros2.path_feedback import fill_feedback
from omnidrive.deploy.ros2.path_follower import NoPose, PathFollower
from omnidrive.deploy.ros2.path_reference import UnknownFrame, is_same_ahead, path_poses
from omnidrive.errors import InvalidMessage, InvalidReference, OmnidriveError, one_line
from omnidrive.ros2.message import Message, message_type
from omnidrive.ros2.qos import LATCHED_QOS
from omnidrive.ros2.ros_time import stamp
from omnidrive.ros2.service import ACTIVE, FINALIZED, Lifecycle, Service

_log = logging.getLogger("omnidrive")
_POLL, _FEEDBACK_PERIOD = 0.005, 0.1  # s
_MAX_GOALS = 100
UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)
"""Status of a goal, as in ``action_msgs/msg/GoalStatus``."""
_FAILED, _TF_ERROR, _INVALID_PATH = 100, 102, 103
"""Error codes of ``nav2_msgs/action/FollowPath``, alike from Iron on; Humble has none."""
_CANCEL_REJECTED = 1
_TYPE = "nav2_msgs/action/FollowPath"
_IDENTITY_TYPE = "unique_identifier_msgs/msg/UUID"
_NEW_GOAL, _REPLACED = "a new goal", "replaced by a new goal"
_NO_GOAL = "the goal was canceled"


@dataclass(eq=False)
class Goal:
    """One goal of the action."""

    identity: bytes
    """Its UUID."""
    data: bytes
    """Bytes of the request."""
    accepted: float
    """Time in ROS, s."""
    poses: Float[Array, "poses 3"] | None = None
    """Path in W; None: it is not usable, or not decoded yet."""
    status: int = ACCEPTED
    error_code: int = 0
    message: str = ""
    waiting: list[bytes] = field(default_factory=list)
    """Identities of the requests for its result."""

    @property
    def is_over(self) -> bool:
        """Whether it has a result."""
        return self.status in {SUCCEEDED, CANCELED, ABORTED}


class FollowPathServer:
    """Server of the action ``follow_path``, and of the lifecycle of the node.

    One goal is driven at a time; a new one replaces the present one, which is aborted, as by
    Nav2's controller server. The drive continues along the new path without a stop, with the pose
    and twist of the present motion, if the limits of the robot permit it; otherwise the robot stops
    first.
    If the robot is held, the goal is aborted with the reason, the drive ends at rest, and other
    goals are aborted likewise until a user arms the robot: a hold is not ended by a planner that
    sends its goal again.
    Goals are accepted in the state ``active`` of the lifecycle only, before their path is decoded.

    Args:
        follower: Drives along references.
        action: Name of the action.

    Attributes:
        lifecycle: Lifecycle of the node.
    """

    def __init__(self, follower: PathFollower, action: str = "follow_path") -> None:
        self._follower, self._node = follower, follower.link.node
        self.lifecycle = Lifecycle(self._node)
        self._goals: dict[bytes, Goal] = {}
        self._present: Goal | None = None
        self._controls: DriveControls | None = None
        self._lock = threading.RLock()
        self._fed = 0.0
        self._following: Goal | None = None
        self._done = 0
        base = f"{action}/_action"
        self._send = Service(
            self._node, f"{base}/send_goal", f"{_TYPE}_SendGoal", self._accept, _IDENTITY_TYPE
        )
        self._cancel = Service(
            self._node, f"{base}/cancel_goal", "action_msgs/srv/CancelGoal", self._cancel_goals
        )
        self._result = Service(
            self._node, f"{base}/get_result", f"{_TYPE}_GetResult", self._get_result
        )
        self._feedback = self._node.publisher(f"{base}/feedback", f"{_TYPE}_FeedbackMessage")
        self._status = self._node.publisher(
            f"{base}/status", "action_msgs/msg/GoalStatusArray", LATCHED_QOS
        )

    def run(self, drives: int | None = None) -> Iterator[DriveResult]:
        """Yield the result of each drive, until a stop is requested or the node is shut down.

        Args:
            drives: Number of drives after which it ends; None: no limit.
        """
        self._done = 0
        ended = threading.Event()
        thread = threading.Thread(target=self._serve, args=(ended,), daemon=True)
        thread.start()
        try:
            while self._goes_on and (drives is None or self._done < drives):
                goal = self._next_goal()
                if goal is None or self._follower.held:
                    self._follower.idle()
                    if self._follower.held:
                        self._abort_all(self._follower.held)
                    time.sleep(_POLL)
                    continue
                result = self._drive(goal)
                if result is not None:
                    self._done += 1
                    yield result
                    if result.ending.startswith("signal"):
                        return
            time.sleep(0.1)  # for the last requests
        finally:
            ended.set()
            thread.join()

    @property
    def _goes_on(self) -> bool:
        return not self._follower.requests.stopped and self.lifecycle.state != FINALIZED

    def _serve(self, ended: threading.Event) -> None:
        """Answer requests, in a thread."""
        while not ended.wait(_POLL):
            with self._lock:
                for each in (self.lifecycle, self._send, self._cancel, self._result):
                    try:
                        each.poll()
                    except OmnidriveError as error:
                        _log.warning("a request cannot be answered: %s", error)
                if self.lifecycle.state != ACTIVE and self._controls is not None:
                    self._controls.stop("the node is not active any more")

    def _next_goal(self) -> Goal | None:
        with self._lock:
            waiting = [each for each in self._goals.values() if each.status == ACCEPTED]
            return waiting[-1] if waiting else None

    def _abort_all(self, held: str) -> None:
        """Abort all goals because the robot is held for a reason."""
        with self._lock:
            for each in list(self._goals.values()):
                self._end(each, self._follower.held_sentence(held), _TF_ERROR)

    def _drive(self, goal: Goal) -> DriveResult | None:
        """Drive along the path of a goal and give it its result."""
        controls = DriveControls(arm=True)
        with self._lock:
            if goal.is_over:  # canceled meanwhile
                return None
            self._present, self._controls = goal, controls
            self._change(goal, EXECUTING)
        result, code, message = self._driven(goal, controls)
        with self._lock:
            goal = self._present or goal  # the last one that the drive followed
            self._present = self._controls = self._following = None
            self._end(goal, message, code)
        return result

    def _end(self, goal: Goal, message: str, code: int) -> None:
        """Give a goal its result, unless it has one."""
        if goal.is_over:
            return
        goal.message, goal.error_code = one_line(message), code
        canceled = goal.status == CANCELING and code
        self._change(goal, CANCELED if canceled else ABORTED if code else SUCCEEDED)

    def _driven(self, goal: Goal, controls: DriveControls) -> tuple[DriveResult | None, int, str]:
        """Drive along a path; return the result, the error code of Nav2 and the reason."""
        self._decode(goal)
        if goal.poses is None:
            self._follower.refuse(f"a goal is not driven: {goal.message}")
            return None, goal.error_code, goal.message
        try:
            reference = self._follower.reference_along(goal.poses)
            result = self._follower.drive(reference, watch=self._watch, controls=controls)
        except OmnidriveError as error:
            self._follower.refuse(f"a goal is not driven: {error}")
            return None, _error_code(error), str(error)
        return (result, 0, "") if result.finished else (result, _FAILED, result.ending)

    def _decode(self, goal: Goal) -> None:
        """Decode the path of a goal, or note why it is not usable."""
        if goal.poses is not None or goal.message:
            return
        source = self._follower.link.poses
        try:
            path = self._send.request(goal.data).goal.path
            goal.poses = path_poses(path, source.frames.world, source.tree)
        except (InvalidReference, InvalidMessage) as error:
            goal.message, goal.error_code = str(error), _error_code(error)
        goal.data = b""

    def _watch(self, controls: DriveControls) -> None:
        """Look after the goals during a drive."""
        if (held := controls.held) is None:
            self._follow_goals(controls)
            return
        self._following = None
        self._abort_all(held)
        if not any(self._follower.link.sent):  # the ramp has ended
            controls.stop(self._follower.held_sentence(held))

    def _follow_goals(self, controls: DriveControls) -> None:
        """Feed back, and continue along the path of a new goal, or stop the drive for it."""
        with self._lock:
            present = self._present
        if present is not None and not present.is_over:
            self._feed_back(present)
        continuation = self._follower.continuation
        if self._following is not None:
            continues = continuation.poll(controls)
            if continues is None:
                return
            following, self._following = self._following, None
            if continues:
                self._replace(following)
            elif not following.is_over:
                controls.stop(_NEW_GOAL)
            return
        goal = self._next_goal()
        if goal is None:
            if present is not None and present.is_over:  # it ended before the drive followed it
                controls.stop(_NO_GOAL)
            return
        self._decode(goal)
        if goal.poses is None:
            controls.stop(_NEW_GOAL)
        elif present is not None and present.poses is not None and self._is_same(goal, present):
            self._replace(goal)
        else:
            begun = continuation.begin(goal.poses, controls)
            self._following = goal if begun else None
            if begun is False:
                controls.stop(_NEW_GOAL)

    def _is_same(self, goal: Goal, present: Goal) -> bool:
        """Return whether a goal leads the robot where the present one does."""
        source = self._follower.link.poses
        position = source.tree.pose(source.frames.base, source.frames.world)
        if position is None or goal.poses is None or present.poses is None:
            return False
        return is_same_ahead(goal.poses, present.poses, position)

    def _replace(self, goal: Goal) -> None:
        """Make a goal that of the present drive; the former one is aborted.

        The goal may be over already: canceled or replaced while its motion was computed.
        """
        with self._lock:
            former, self._present = self._present, goal
            if former is not None:
                self._end(former, _REPLACED, _FAILED)
            if not goal.is_over:
                self._change(goal, EXECUTING)
            self._done += 1

    def _accept(self, request: Any, _identity: bytes) -> Message:
        """Accept a goal, if the node is active."""
        now = self._follower.link.ros_clock.now() or 0.0
        key = request.uuid.tobytes()
        accepted = self.lifecycle.state == ACTIVE and key not in self._goals
        if accepted:
            for each in self._goals.values():
                if each.status == ACCEPTED:
                    self._end(each, _REPLACED, _FAILED)
            over = [k for k, each in self._goals.items() if each.is_over]
            for old in over[: max(len(self._goals) - _MAX_GOALS, 0)]:
                del self._goals[old]
            self._goals[key] = Goal(key, self._send.data, now)
            self._publish_status()
        time_stamp = stamp(now, self._node.distribution)
        return self._send.response(accepted=accepted, stamp=time_stamp)

    def _cancel_goals(self, request: Any, _identity: bytes) -> Message:
        """Cancel the goal that is named, or all goals."""
        key = request.goal_info.goal_id.uuid.tobytes()
        found = [
            each
            for each in self._goals.values()
            if not each.is_over and (not any(key) or each.identity == key)
        ]
        for each in found:
            if each is self._present and self._controls is not None:
                self._change(each, CANCELING)
                self._controls.stop("canceled")
            else:
                self._change(each, CANCELED)
        return self._cancel.response(
            return_code=0 if found else _CANCEL_REJECTED,
            goals_canceling=[self._info(each) for each in found],
        )

    def _get_result(self, request: Any, identity: bytes) -> Message | None:
        """Return the result of a goal that is over; that of another one follows."""
        goal = self._goals.get(request.goal_id.uuid.tobytes())
        if goal is None:
            return self._result.response(status=UNKNOWN)
        if goal.is_over:
            return self._response(goal)
        goal.waiting.append(identity)
        del goal.waiting[:-_MAX_GOALS]
        return None

    def _response(self, goal: Goal) -> Message:
        response = self._result.response(status=goal.status)
        fields = {each.name for each in response.result.interface.fields}
        if "error_code" in fields:  # from Iron on
            response.result.error_code = goal.error_code
        if "error_msg" in fields:  # from Jazzy on
            response.result.error_msg = goal.message
        return response

    def _change(self, goal: Goal, status: int) -> None:
        """Change the status of a goal, announce it, and answer those who wait for its result."""
        goal.status = status
        self._publish_status()
        if goal.is_over:
            goal.data = b""
            for identity in goal.waiting:
                self._result.reply(self._response(goal), identity)
            goal.waiting.clear()

    def _publish_status(self) -> None:
        make = message_type("action_msgs/msg/GoalStatus", self._node.distribution)
        listed = [make(self._info(each), each.status) for each in self._goals.values()]
        self._status.publish(self._status.message(status_list=listed))

    def _info(self, goal: Goal) -> Message:
        distribution = self._node.distribution
        uuid = message_type("unique_identifier_msgs/msg/UUID", distribution)
        make = message_type("action_msgs/msg/GoalInfo", distribution)
        return make(uuid(list(goal.identity)), stamp(goal.accepted, distribution))

    def _feed_back(self, goal: Goal) -> None:
        """Publish distance to the goal and speed, ten times a second."""
        now = time.monotonic()
        poses = self._follower.link.poses
        pose = poses.tree.pose(poses.frames.base, poses.frames.world)
        if now - self._fed < _FEEDBACK_PERIOD or pose is None or goal.poses is None:
            return
        self._fed = now
        message = self._feedback.message()
        message.goal_id.uuid = list(goal.identity)
        head = message_type("std_msgs/msg/Header", self._node.distribution)(
            stamp(self._follower.link.ros_clock.now() or 0.0, self._node.distribution),
            poses.frames.world,
        )
        speed = hypot(*self._follower.link.sent[:2])
        fill_feedback(message.feedback, goal.poses, pose, speed, head)
        self._feedback.publish(message)


def _error_code(error: OmnidriveError) -> int:
    """Return the code with which Nav2's controller server reports an error."""
    if isinstance(error, UnknownFrame | NoPose):
        return _TF_ERROR
    return _INVALID_PATH if isinstance(error, InvalidReference | InvalidMessage) else _FAILED
