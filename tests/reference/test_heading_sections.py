"""Headings of sections of a path, and the turns between them."""

from math import nan, pi

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import wrap
from omnidrive.planning.polyline import cumulative_length
from omnidrive.reference import HeadingSection, MotionLimits, time_within_limits
from omnidrive.reference.headings.heading_sections import heading_in_sections
from omnidrive.reference.headings.least_strafing import least_strafing
from omnidrive.robot import named_robot
from tests.reference.sample_paths import straight
from tests.reference.test_least_strafing import smooth_path

U = np.linspace(0.0, 1.0, 4001)


def test_each_section_has_its_heading():
    path = smooth_path(3)
    target = (2.0, 9.0)
    found = heading_in_sections(
        path,
        [
            HeadingSection(0.0, 2.5, "tangent"),
            HeadingSection(2.5, 5.0, "fixed", yaw=1.0),
            HeadingSection(5.0, 7.9, "face", target=target),
        ],
        goal_yaw=-2.0,
    )
    poses, first = found.poses(U), found.first_derivatives(U)
    along = cumulative_length(poses[:, :2])
    inner = [(along > low) & (along < high) for low, high in ((0.0, 1.0), (3.9, 4.0), (6.3, 6.4))]
    toward = np.arctan2(target[1] - poses[:, 1], target[0] - poses[:, 0])
    expected = [np.arctan2(first[:, 1], first[:, 0]), np.full(len(U), 1.0), toward]
    for within, yaw in zip(inner, expected, strict=True):
        assert np.abs(wrap(poses[within, 2] - yaw[within])).max() < 0.12
    assert wrap(poses[-1, 2] + 2.0) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_array_equal(found.control_points[:, :2], path.control_points[:, :2])


def test_one_section_along_the_motion_is_the_least_strafing():
    path = smooth_path(1)
    one = heading_in_sections(path, [HeadingSection(0.0, path.length, "tangent")], 1.0, -1.0)
    np.testing.assert_allclose(
        one.control_points, least_strafing(path, 1.0, -1.0).control_points, atol=1e-6
    )


def test_headings_of_the_path_are_kept():
    path = smooth_path(2)
    kept = heading_in_sections(path, [HeadingSection(0.0, path.length, "path")])
    assert np.abs(kept.poses(U)[:, 2] - path.poses(U)[:, 2]).max() < 0.01


def test_the_heading_turns_evenly_in_a_gap():
    path = straight(8.0, points=160)
    sections = [
        HeadingSection(0.0, 2.0, "fixed", yaw=0.0), HeadingSection(6.0, 8.0, "fixed", yaw=3.0),
    ]  # fmt: skip
    poses = heading_in_sections(path, sections).poses(U)
    within = (poses[:, 0] > 2.5) & (poses[:, 0] < 5.5)
    slopes = np.gradient(poses[within, 2], poses[within, 0])
    assert np.ptp(slopes) < 0.01
    assert 0.5 < slopes[0] < 0.75


def test_limits_hold_in_a_timed_motion():
    robot = named_robot("mecanum")
    sections = [HeadingSection(0.0, 3.0, "tangent"), HeadingSection(3.5, 7.0, "fixed", yaw=pi)]
    limits = MotionLimits.of_robot(robot)
    motion = time_within_limits(
        smooth_path(0), robot.chassis, limits, heading=sections, start_yaw=0.5
    )
    assert max(motion.limit_usage.values()) <= 1.0 + 1e-3
    assert motion.at(0.0).pose.yaw == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1.0, 1.0, "tangent"), "0 <= start < end"),
        ((-1.0, 1.0, "tangent"), "0 <= start < end"),
        ((0.0, nan, "tangent"), "0 <= start < end"),
        ((0.0, 1.0, "fixed"), "needs a yaw"),
        ((0.0, 1.0, "tangent", 1.0), "needs a yaw"),
        ((0.0, 1.0, "face"), "needs a target"),
        ((0.0, 1.0, "face", None, (nan, 0.0)), "must be finite"),
        ((0.0, 1.0, "sideways"), "heading"),
    ],
)
def test_faulty_sections_are_refused(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        HeadingSection(*arguments)


def test_sections_that_do_not_fit_the_path_are_refused():
    path = straight(3.0, points=20)
    first, second = HeadingSection(0.0, 2.0, "tangent"), HeadingSection(1.9, 2.5, "tangent")
    for sections, message in (
        ([], "there is no section"),
        ([first, second], r"from 1\.9 m starts before"),
        ([HeadingSection(0.0, 3.1, "tangent")], r"ends at 3\.1 m, and the path is 3 m long"),
        ([HeadingSection(1.0, 1.0 + 1e-9, "tangent")], "is too short"),
    ):
        with pytest.raises(InvalidInput, match=message):
            heading_in_sections(path, sections)
    through = [HeadingSection(0.0, 3.0, "face", target=tuple(path.poses(0.5)[:2]))]
    with pytest.raises(InvalidReference, match="passes through the target"):
        heading_in_sections(straight(3.0, points=4003), through)
