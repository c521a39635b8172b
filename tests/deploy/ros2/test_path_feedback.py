"""Feedback of the action follow_path in each distribution."""

from math import pi

import numpy as np
import pytest

from omnidrive.deploy.ros2.path_feedback import fill_feedback, tracking
from omnidrive.geometry import Pose
from omnidrive.ros2 import encode, message_type
from tests.ros2.peer_types import STORES

PATH = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0, 0.0)])


@pytest.mark.parametrize("distribution", STORES)
def test_feedback_has_the_fields_of_the_distribution(distribution):
    message = message_type("nav2_msgs/action/FollowPath_FeedbackMessage", distribution)()
    head = message_type("std_msgs/msg/Header", distribution)(frame_id="map")
    fill_feedback(message.feedback, PATH, Pose(1.0, 0.5, 0.0), 0.3, head)
    later = distribution in {"lyrical", "rolling"}
    found = message.feedback.tracking_feedback if later else message.feedback
    assert (found.distance_to_goal, found.speed) == (1.5, 0.3)
    if later:
        assert (found.current_path_index, found.remaining_path_length) == (1, 2.0)
        assert found.heading_tracking_error == pytest.approx(pi / 2)
        assert found.robot_pose.header.frame_id == "map"
    encode(message)


def test_the_offset_is_positive_on_the_left_of_the_path():
    assert tracking(PATH, Pose(0.5, 0.2, 0.0)).offset == pytest.approx(0.2)
    assert tracking(PATH, Pose(0.5, -0.2, 0.0)).offset == pytest.approx(-0.2)
    assert tracking(PATH, Pose(1.3, 1.0, 0.0)).offset == pytest.approx(-0.3)
    assert tracking(PATH[:1], Pose(3.0, 4.0, 0.0)) == (0, 5.0, 0.0, 0.0)
    assert tracking(PATH[[0, 0, 1]], Pose(0.0, 0.0, 0.0)).remaining == 1.0
