"""Minimum time through waypoints: known optima, limits, regions, and constraints to blame."""

import sys
from math import pi

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, MissingExtra, NoPathFound
from omnidrive.reference import (
    ConvexPolygon,
    Disc,
    MotionLimits,
    MotionSection,
    MotionWaypoint,
    minimum_time_through,
)
from omnidrive.reference.waypoint_motion.constraints import constraints_of, margins
from omnidrive.reference.waypoint_motion.initial_path import initial_path
from omnidrive.reference.waypoint_motion.regions import distance, separation
from omnidrive.robot import Chassis
from tests.reference.sample_paths import CROSS

CHASSIS = Chassis.omni(
    angles=CROSS, ring_radius=0.15, wheel_radius=0.05, max_wheel_speed=1000.0
)  # no limit in these cases
LIMITS = MotionLimits(wheel_acceleration=1e4, speed=1.5, acceleration=1.0)
ACROSS = (MotionWaypoint(0.0, 0.0, 0.0), MotionWaypoint(4.0, 0.0, 0.0))
SQUARE = ConvexPolygon(((1.5, -1.0), (2.5, -1.0), (2.5, 0.3), (1.5, 0.3)))


def fine(motion, per_node=20):
    """Return poses and twists of a motion at many times."""
    duration = motion.reference.duration
    count = per_node * len(motion.reference.times)
    return motion.reference.window(0.0, count + 1, duration / count)


def through(waypoints, *sections, **options):
    return minimum_time_through(waypoints, CHASSIS, LIMITS, sections, **options)


def check_limits(motion):
    """Check limits between samples, and that accelerations agree with differences of twists."""
    assert max(motion.reference.limit_usage.values()) <= 1.0 + 1e-3
    samples = fine(motion)
    assert np.linalg.norm(samples[:, 3:5], axis=1).max() <= 1.5 * (1.0 + 1e-3)
    step = motion.reference.duration / (len(samples) - 1)
    changes = np.linalg.norm(np.diff(samples[:, 3:5], axis=0), axis=1) / step
    assert np.quantile(changes, 0.999) <= 1.02


def test_speed_limit_of_a_section():
    way = [MotionWaypoint(x, 0.0, 0.0 if x in {0.0, 4.0} else None) for x in (0.0, 1.0, 3.0, 4.0)]
    motion = through(way, MotionSection(1, 2, max_speed=0.5))
    # from rest to 1 m: up to the peak p, down to 0.5: p^2 - 0.125 = 1
    ends = 2.0 * np.sqrt(1.125) - 0.5
    assert motion.reference.duration == pytest.approx(2.0 * ends + 4.0, rel=0.005)
    check_limits(motion)
    times = motion.waypoint_times
    samples, at = fine(motion), np.linspace(0.0, motion.reference.duration, len(fine(motion)))
    inside = (at >= times[1]) & (at <= times[2])
    assert np.linalg.norm(samples[inside, 3:5], axis=1).max() <= 0.5 * (1.0 + 1e-3)


def test_yaw_rate_of_zero_and_guess():
    way = [MotionWaypoint(0.0, 0.0, 0.3), MotionWaypoint(1.5, 0.2), MotionWaypoint(2.0, 1.5, 1.0)]
    held = MotionSection(0, 1, max_yaw_rate=0.0)
    guess = [
        np.linspace((0, 0, 0.3), (1.5, 0.2, 0.3), 9),
        np.linspace((1.5, 0.2, 0.3), (2, 1.5, 1), 9),
    ]
    motion = through(way, held, guess=guess)
    samples = fine(motion)
    at = np.linspace(0.0, motion.reference.duration, len(samples))
    np.testing.assert_allclose(samples[at <= motion.waypoint_times[1], 2], 0.3, atol=1e-9)
    check_limits(motion)
    straight = float(np.hypot(1.5, 0.2) + np.hypot(0.5, 1.3)) / 1.5 + 1.5
    assert straight < motion.reference.duration < 1.2 * straight
    with pytest.raises(InvalidInput, match="yaw rate of 0, and the headings of waypoints 0 and 2"):
        through(way, MotionSection(0, 2, max_yaw_rate=0.0))
    with pytest.raises(InvalidInput, match="the guess has 1 legs, and the waypoints have 2"):
        through(way, guess=guess[:1])
    with pytest.raises(InvalidInput, match="leg 1 of the guess"):
        through(way, guess=[guess[0], guess[1][:, :2]])


@pytest.mark.long
def test_stop_is_the_sum_of_two_motions():
    middle = MotionWaypoint(2.0, 0.0, stop=True)
    motion = through([ACROSS[0], middle, ACROSS[1]])
    assert motion.reference.duration == pytest.approx(4.0 * np.sqrt(2.0), rel=0.005)
    at_stop = motion.reference.at(float(motion.waypoint_times[1]))
    assert np.abs(at_stop.twist).max() < 1e-6
    np.testing.assert_allclose(at_stop.pose[:2], (2.0, 0.0), atol=1e-9)
    check_limits(motion)


def test_passes_waypoints_exactly_and_keeps_limits():
    way = [MotionWaypoint(0.0, 0.0), MotionWaypoint(1.5, 0.2, 1.0), MotionWaypoint(2.0, 1.5)]
    motion = through(way, MotionSection(1, 1, max_speed=0.4))
    poses = [motion.reference.at(float(t)) for t in motion.waypoint_times]
    np.testing.assert_allclose([p.pose[:2] for p in poses], [(w.x, w.y) for w in way], atol=1e-9)
    assert np.cos(poses[1].pose[2] - 1.0) == pytest.approx(1.0)
    assert np.hypot(*poses[1].twist[:2]) <= 0.4 * (1.0 + 1e-3)
    check_limits(motion)


@pytest.mark.long
@pytest.mark.parametrize("region", [Disc(2.0, 0.1, 0.5), SQUARE], ids=["disc", "polygon"])
def test_keeps_out(region):
    motion = through(ACROSS, MotionSection(0, 1, keep_out=(region,)), body_radius=0.2)
    assert min(motion.margins.values()) >= -1e-5
    assert distance(region, fine(motion)[:, :2]).min() >= 0.2 - 1e-5
    straight = 4.0 / 1.5 + 1.5
    assert straight < motion.reference.duration < 1.06 * straight


def test_keeps_in_and_points():
    room = ConvexPolygon(((-0.3, -0.3), (2.3, -0.3), (2.3, 2.3), (-0.3, 2.3)))
    way = [MotionWaypoint(0.0, 0.0), MotionWaypoint(2.0, 0.0), MotionWaypoint(2.0, 2.0)]
    motion = through(
        way,
        MotionSection(0, 2, keep_in=(room, Disc(1.0, 1.0, 2.0))),
        MotionSection(0, 1, point_at=(1.0, 1.0), point_offset=pi),
        body_radius=0.25,
    )
    samples = fine(motion)
    assert room.depth(samples[:, :2]).min() >= 0.25 - 1e-5
    at = np.linspace(0.0, motion.reference.duration, len(samples))
    first = samples[at <= motion.waypoint_times[1]]
    away = first[:, 2] - pi - np.arctan2(1.0 - first[:, 1], 1.0 - first[:, 0])
    assert np.abs((away + pi) % (2.0 * pi) - pi).max() <= 0.05 + 1e-5
    check_limits(motion)


@pytest.mark.long
def test_names_the_constraint_to_blame():
    wall = Disc(2.0, 0.0, 0.5)
    corridor = ConvexPolygon(((-1.0, -0.4), (5.0, -0.4), (5.0, 0.4), (-1.0, 0.4)))
    with pytest.raises(NoPathFound, match=r"because of the keep-(in|out) .* of section 0"):
        through(ACROSS, MotionSection(0, 1, keep_in=(corridor,), keep_out=(wall,)))


def test_initial_path_keeps_a_narrow_lane():
    way = [MotionWaypoint(0.0, 0.0), MotionWaypoint(1.0, 1.0), MotionWaypoint(2.0, 1.0)]
    section = MotionSection(1, 2, lane=1e-3)
    constraints = tuple(constraints_of(way, (section,)))
    start = initial_path(way, (section,), constraints, 0.0)
    assert min(margins(constraints, start.layout, start.paths, 0.0)) >= -1e-5
    assert start.paths[0].poses(0.0)[:2] == pytest.approx([0.0, 0.0])


def test_names_all_faults():
    way = [*ACROSS[:1], MotionWaypoint(2.0, 0.0), *ACROSS[1:]]
    sections = (
        MotionSection(0, 2, keep_out=(Disc(2.0, 0.1, 0.5),)),
        MotionSection(0, 1, point_at=(1.0, 1.0)),
        MotionSection(0, 2, point_at=(1.0, 2.0)),
        MotionSection(0, 1, keep_in=(Disc(0.0, 0.0, 1.0),)),
        MotionSection(0, 9, max_speed=-1.0),
    )
    with pytest.raises(InvalidInput) as caught:
        through(way, *sections)
    for text in (
        "waypoint 1 at (2, 0) lies 0.4 m inside the keep-out disc of radius 0.5 m at (2, 0.1) of "
        "section 0",
        "waypoint 1 at (2, 0) lies 1 m outside the keep-in disc of radius 1 m at (0, 0) of sec",
        "section 4: it is from waypoint 0 to 9",
        "section 4: max_speed must be positive",
        "sections 1 and 2 share waypoints 0 to 1 and point at different points",
        "the heading of waypoint 0 at (0, 0), 0 rad, is 0.785 rad from the direction of (1, 1)",
    ):
        assert text in str(caught.value)


@pytest.mark.parametrize(
    ("section", "text"),
    [
        (MotionSection(0, 5), "there are 2 waypoints"),
        (MotionSection(1, 0), "comes after its last"),
        (MotionSection(0, 1, max_speed=-1.0), "max_speed must be positive, got -1 m/s"),
        (MotionSection(0, 1, max_acceleration=float("nan")), "max_acceleration must be positive"),
        (MotionSection(0, 1, point_at=(1.0, 1.0), point_tolerance=0.0), "point_tolerance"),
        (MotionSection(0, 0, lane=0.1), "a lane needs two different waypoints"),
    ],
)
def test_refuses_sections(section, text):
    with pytest.raises(InvalidInput, match=text):
        through(ACROSS, section)


def test_refuses_waypoints():
    nan = MotionWaypoint(float("nan"), 0.0)
    with pytest.raises(InvalidInput, match="waypoint 0 is at"):
        through([nan, *ACROSS])
    with pytest.raises(InvalidInput, match="waypoints 0 and 1 are both at"):
        through([ACROSS[0], *ACROSS])
    with pytest.raises(InvalidInput, match="need 2 to 200 waypoints"):
        through(ACROSS[:1])
    with pytest.raises(InvalidInput, match="convex polygon"):
        ConvexPolygon(((0.0, 0.0), (2.0, 0.0), (0.5, 0.5), (0.0, 2.0)))
    with pytest.raises(InvalidInput, match="positive radius"):
        Disc(0.0, 0.0, 0.0)


def test_separation_is_the_distance_of_hulls():
    """Compare with the distance of many points of both hulls."""
    rng = np.random.default_rng(1)
    pieces = rng.uniform(-1.0, 1.0, (20, 4, 2)) + rng.uniform(-3.0, 3.0, (20, 1, 2))
    weights = rng.dirichlet(np.full(4, 0.3), 2000)
    inside = np.einsum("wk,pkd->pwd", weights, pieces)
    for region in (Disc(0.0, 0.0, 0.7), ConvexPolygon(((0, 0), (1.0, 0.2), (0.8, 1.0)))):
        bound, normals = separation(region, pieces)
        found = np.array([distance(region, points).min() for points in inside])
        assert (bound <= found + 1e-9).all()
        apart = found > 0.1
        assert (found - bound)[apart].max() < 0.1
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_needs_casadi(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(MissingExtra, match="pip install casadi"):
        through(ACROSS)


def test_time_limit_ends_the_optimisation():
    motion = through(ACROSS, time_limit=600.0)
    assert motion.reference.duration == pytest.approx(through(ACROSS).reference.duration)
    assert through(ACROSS, time_limit=1e-9).status in {"capped", "guess"}
    with pytest.raises(InvalidInput, match="time limit must be positive, got nan s"):
        through(ACROSS, time_limit=float("nan"))
