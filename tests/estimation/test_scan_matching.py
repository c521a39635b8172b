"""Scans matched with the walls of a map: accuracy, corridors, strangers, and what is refused."""

from math import hypot, inf, nan, pi

import numpy as np
import pytest

from omnidrive.estimation.scan_matching import find_scan, match_scan, scan_points
from omnidrive.geometry import BodyTwist, Pose, move, wrap
from omnidrive.maps import OccupancyGrid

WIDTH, HEIGHT = 4.0, 6.0


def room(walls="lrbt"):
    """A map with walls 0.05 m thick about a free room with a corner at the origin."""
    cells = np.zeros((122, 82), bool)
    for name, where in {"l": np.s_[:, 0], "r": np.s_[:, -1], "b": np.s_[0], "t": np.s_[-1]}.items():
        cells[where] = name in walls
    return OccupancyGrid(cells, 0.05, (-0.05, -0.05), walled=False)


def ranges_at(pose, bearings):
    """Exact distances from a pose in the room to its walls."""
    c, s = np.cos(pose.yaw + bearings), np.sin(pose.yaw + bearings)
    with np.errstate(divide="ignore"):
        x = np.where(c > 0.0, WIDTH - pose.x, -pose.x) / c
        y = np.where(s > 0.0, HEIGHT - pose.y, -pose.y) / s
    return np.minimum(x, y)


BEARINGS = np.arange(-pi, pi, pi / 180.0)
LIMITS = (0.05, 10.0)
MOUNT = Pose(0.0, 0.0, 0.0)


def points_at(pose, mount=MOUNT, spoilt=()):
    scanner = move(pose, BodyTwist(mount.x, mount.y, 0.0), 1.0)._replace(yaw=pose.yaw + mount.yaw)
    ranges = ranges_at(scanner, BEARINGS)
    for which, value in spoilt:
        ranges[which] = value
    return scan_points(ranges, BEARINGS[0], pi / 180.0, LIMITS, mount)


def error(pose, true):
    return hypot(pose.x - true.x, pose.y - true.y), abs(wrap(pose.yaw - true.yaw))


@pytest.mark.parametrize("mount", [MOUNT, Pose(0.2, -0.1, pi)])
def test_a_scan_gives_the_pose(mount):
    rng = np.random.default_rng(5)
    for _ in range(5):
        true = Pose(*rng.uniform((1.0, 1.0, -pi), (3.0, 5.0, pi)).tolist())
        prior = Pose(*(np.array(true) + rng.uniform(-0.1, 0.1, 3)).tolist())
        found = match_scan(room(), points_at(true, mount), prior)
        position, yaw = error(found.pose, true)
        assert position < 0.01
        assert yaw < 0.005
        assert found.share == 1.0
        assert found.is_usable
        assert position < 3.0 * found.position_sigma


def test_an_initial_pose_may_be_rough():
    true = Pose(1.3, 2.1, 0.4)
    found = find_scan(room(), points_at(true), Pose(1.7, 1.8, 0.1))
    assert error(found.pose, true)[0] < 0.02


def test_along_a_corridor_the_prior_decides():
    true, prior = Pose(2.0, 3.0, 0.0), Pose(2.05, 3.2, 0.02)
    points = points_at(true)
    points = points[np.abs(points[:, 1]) < 2.5]  # the ends of the corridor are not seen
    found = match_scan(room("lr"), points, prior)
    assert found.pose.y == pytest.approx(3.2, abs=0.01)
    assert found.pose.x == pytest.approx(2.0, abs=0.01)
    assert found.position_sigma > 0.04


def test_a_third_of_strangers_disturbs_little():
    true = Pose(1.5, 2.0, 0.3)
    points = points_at(true, spoilt=[(slice(40, 160), 0.7), (slice(200, 220), nan), (230, inf)])
    found = match_scan(room(), points, Pose(1.55, 1.95, 0.33))
    assert error(found.pose, true)[0] < 0.03
    assert 0.5 < found.share < 0.8


def test_another_place_is_not_usable():
    ranges = np.full(360, 0.8)
    points = scan_points(ranges, -pi, pi / 180.0, LIMITS, MOUNT)
    assert not match_scan(room(), points, Pose(2.0, 3.0, 0.0)).is_usable


def test_too_few_points_or_no_walls_give_none():
    assert match_scan(room(), np.ones((19, 2)), MOUNT) is None
    assert find_scan(room(), np.zeros((0, 2)), MOUNT) is None
    assert match_scan(room(""), points_at(Pose(1.0, 1.0, 0.0)), MOUNT) is None


def test_motion_during_a_scan_is_removed():
    begin, twist, period = Pose(1.5, 2.0, 0.3), BodyTwist(0.6, -0.4, 1.0), 0.1 / 360
    ranges = np.array(
        [
            float(ranges_at(move(begin, twist, k * period), np.array([b]))[0])
            for k, b in enumerate(BEARINGS)
        ]
    )
    still = scan_points(ranges, -pi, pi / 180.0, LIMITS, MOUNT)
    moving = scan_points(ranges, -pi, pi / 180.0, LIMITS, MOUNT, motion=(period, twist))
    poses = [match_scan(room(), points, begin).pose for points in (still, moving)]
    assert error(poses[1], begin)[0] < 0.01 < error(poses[0], begin)[0]
