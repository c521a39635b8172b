"""Laser scanner compared with exact ranges."""

from math import hypot, inf, pi

import mujoco
import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.simulation import Lidar, LidarSettings

HALF = (3.0, 2.0)
"""Inner half-lengths of a room centred at the origin, m."""
ROOM = """<mujoco><worldbody>
  <geom type="plane" size="9 9 1"/>
  <geom type="box" size="0.1 9 1" pos="3.1 0 1"/> <geom type="box" size="0.1 9 1" pos="-3.1 0 1"/>
  <geom type="box" size="9 0.1 1" pos="0 2.1 1"/> <geom type="box" size="9 0.1 1" pos="0 -2.1 1"/>
  <body name="base" pos="0 0 0.1"><freejoint/><geom type="cylinder" size="0.3 0.2"/></body>
</worldbody></mujoco>"""


def lidar(pose=(0.0, 0.0, 0.0), **settings):
    model = mujoco.MjModel.from_xml_string(ROOM)
    data = mujoco.MjData(model)
    data.qpos[:2] = pose[:2]
    data.qpos[3:7] = np.cos(pose[2] / 2), 0.0, 0.0, np.sin(pose[2] / 2)
    mujoco.mj_forward(model, data)
    return Lidar(LidarSettings(**settings), model, data, np.random.default_rng(0))


def range_to_the_walls(pose, bearing):
    x, y, yaw = pose
    cx, cy = np.cos(yaw + bearing), np.sin(yaw + bearing)
    to_x = (np.sign(cx) * HALF[0] - x) / cx if abs(cx) > 1e-12 else inf
    to_y = (np.sign(cy) * HALF[1] - y) / cy if abs(cy) > 1e-12 else inf
    return min(to_x, to_y)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (1.2, -0.7, 0.4), (-2.0, 1.1, 3.0)])
def test_ranges_equal_exact_distances(pose):
    scan = lidar(pose, sigma=0.0).scan(0.0)
    expected = [range_to_the_walls(pose, bearing) for bearing in scan.bearings]
    assert len(scan.ranges) == 360
    assert scan.ranges == pytest.approx(expected, abs=1e-9)


def test_ranges_beyond_the_maximum_are_infinite():
    scan = lidar(sigma=0.0, max_range=2.5).scan(0.0)
    expected = np.array([range_to_the_walls((0, 0, 0), bearing) for bearing in scan.bearings])
    assert (np.isinf(scan.ranges) == (expected > 2.5)).all()
    assert np.isinf(scan.ranges).any()
    assert not np.isinf(scan.ranges).all()


def test_ranges_have_the_configured_noise():
    scanner = lidar(sigma=0.05)
    ranges = np.array([scanner.scan(0.0).ranges for _ in range(50)])
    assert ranges.std(axis=0).mean() == pytest.approx(0.05, rel=0.05)
    assert hypot(*HALF) + 0.5 > ranges.max()


def test_bearings_cover_the_field_of_view():
    half_turn = lidar(rays=5, field_of_view=pi).scan(0.0)
    assert half_turn.bearings == pytest.approx([-pi / 2, -pi / 4, 0.0, pi / 4, pi / 2])
    full_turn = lidar(rays=4).scan(0.0)
    assert full_turn.bearings == pytest.approx([-pi, -pi / 2, 0.0, pi / 2])
    assert lidar(rays=1).scan(0.0).bearings == pytest.approx([0.0])


def test_scans_occur_at_the_configured_rate():
    scanner = lidar(rate=5.0)
    times = [0.02 * k for k in range(101)]
    scans = [scan for t in times if (scan := scanner.read(t))]
    assert [scan.t for scan in scans] == pytest.approx([0.2 * k for k in range(11)], abs=0.021)
    scanner.reset()
    assert scanner.read(0.0) is not None


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"rays": 0}, "rays is 0"), ({"field_of_view": 7.0}, "field_of_view is 7 rad")],
)
def test_settings_out_of_range_are_rejected(settings, message):
    with pytest.raises(InvalidInput, match=message):
        lidar(**settings)


def test_unknown_body_is_named():
    model = mujoco.MjModel.from_xml_string(ROOM)
    with pytest.raises(InvalidInput, match="no body 'bass'"):
        Lidar(LidarSettings(), model, mujoco.MjData(model), np.random.default_rng(0), "bass")
