"""PathPlanner files: curves, headings as in PathPlannerLib, and curve fitting."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidReference
from omnidrive.geometry import wrap
from omnidrive.planning import Path, SplinePath
from omnidrive.reference import (
    SampledReference,
    UniformReference,
    load_waypoints,
    save_waypoints,
    waypoint_reference,
)
from omnidrive.reference.waypoints.bezier_chain import chain_points, fit_chain, step_counts
from omnidrive.robot import named_robot
from tests.examples import examples

CONTROL = np.array([[0, 0, 0], [1, 0, 0.5], [2, 1, 1], [2, 2, 2], [1, 3, 4], [0, 3, 4.0]])


def point(x, y):
    return {"x": x, "y": y}


def waypoint(anchor, before=None, after=None):
    return {
        "anchor": point(*anchor),
        "prevControl": before and point(*before),
        "nextControl": after and point(*after),
        "isLocked": False,
        "linkedName": None,
    }


def pathplanner(waypoints, **changes):
    """Return a file by PathPlanner's schema of 2025."""
    return {
        "version": "2025.0",
        "waypoints": waypoints,
        "rotationTargets": [],
        "constraintZones": [],
        "pointTowardsZones": [],
        "eventMarkers": [],
        "globalConstraints": {"maxVelocity": 3.0},
        "goalEndState": {"velocity": 0, "rotation": 90.0},
        "reversed": False,
        "folder": None,
        "idealStartingState": {"velocity": 0, "rotation": 0.0},
        "useDefaultConstraints": False,
        **changes,
    }


STRAIGHT = [  # 6 m, with constant derivative
    waypoint((0, 0), after=(1, 0)),
    waypoint((3, 0), (2, 0), (4, 0)),
    waypoint((6, 0), (5, 0)),
]
CURVED = [
    waypoint((1.4, 1.9), after=(3.8, 1.3)),
    waypoint((7.7, 0.8), (5.9, 0.8), (9.0, 0.8)),
    waypoint((6.0, 4.1), (9.0, 4.3)),
]


def read(folder, content):
    (folder / "a.path").write_text(json.dumps(content))
    return load_waypoints(folder / "a.path")


def heading_at(path, x):
    return np.interp(x, path.poses[:, 0], path.poses[:, 2])


def casteljau(p, t):
    while len(p) > 1:
        p = (1 - t) * p[:-1] + t * p[1:]
    return p[0]


def distance(points, polyline):
    """Return the distance of each point to a polyline, in m."""
    start, step = polyline[:-1], np.diff(polyline, axis=0)
    away = points[:, None] - start
    along = np.clip((away * step).sum(2) / np.maximum((step**2).sum(1), 1e-300), 0, 1)
    return np.linalg.norm(away - along[..., None] * step, axis=2).min(axis=1)


def test_samples_follow_bezier_curve_within_a_millimetre(tmp_path):
    path = read(tmp_path, pathplanner(CURVED))
    first = np.array([[1.4, 1.9], [3.8, 1.3], [5.9, 0.8], [7.7, 0.8]])
    second = np.array([[7.7, 0.8], [9.0, 0.8], [9.0, 4.3], [6.0, 4.1]])
    exact = [casteljau(p, t) for p in (first, second) for t in np.linspace(0, 1, 500)]
    assert distance(np.array(exact), path.poses[:, :2]).max() < 1e-3
    assert distance(path.poses[:, :2], np.array(exact)).max() < 1e-3
    assert path.poses[[0, -1], :2].tolist() == [[1.4, 1.9], [6.0, 4.1]]
    assert np.linalg.norm(np.diff(path.poses[:, :2], axis=0), axis=1).max() <= 0.05


def test_headings_are_interpolated_from_start_to_end(tmp_path):
    path = read(tmp_path, pathplanner(STRAIGHT))
    assert heading_at(path, 3.0) == pytest.approx(np.pi / 4, abs=1e-3)
    assert heading_at(path, 1.5) == pytest.approx(np.pi / 4 * (1 - np.sqrt(0.5)), abs=1e-3)
    assert path.poses[[0, -1], 2] == pytest.approx([0.0, np.pi / 2])


def test_rotation_targets_hold_at_their_positions(tmp_path):
    targets = [
        {"waypointRelativePos": 1.5, "rotationDegrees": -170.0},
        {"waypointRelativePos": 0.5, "rotationDegrees": 170.0},
        {"waypointRelativePos": 0.0, "rotationDegrees": 33.0},  # the starting state has 0
    ]
    path = read(tmp_path, pathplanner(STRAIGHT, rotationTargets=targets))
    assert heading_at(path, 1.5) == pytest.approx(np.deg2rad(170.0))
    assert heading_at(path, 4.5) == pytest.approx(np.deg2rad(190.0))  # less than half a turn
    assert heading_at(path, 3.0) == pytest.approx(np.deg2rad(180.0), abs=1e-3)
    assert path.poses[0, 2] == 0.0
    assert path.poses[-1, 2] == pytest.approx(np.deg2rad(90.0))


def test_point_towards_zones(tmp_path):
    zone = {
        "name": "tower",
        "fieldPosition": point(3.0, 2.0),
        "rotationOffset": 180.0,
        "minWaypointRelativePos": 0.5,
        "maxWaypointRelativePos": 1.25,
    }
    path = read(tmp_path, pathplanner(STRAIGHT, pointTowardsZones=[zone]))
    for x in (1.6, 3.0, 3.7):
        expected = np.arctan2(2.0, 3.0 - x) + np.pi
        assert wrap(heading_at(path, x) - expected) == pytest.approx(0.0, abs=2e-3)
    assert path.poses[0, 2] == 0.0


def test_a_motion_keeps_the_limits_of_the_file_and_of_its_zones(tmp_path):
    """The zone is slower than the path; it takes up to one piece of the spline more."""
    zone = {
        "name": "slow", "minWaypointRelativePos": 0.5, "maxWaypointRelativePos": 1.0,
        "constraints": {"maxVelocity": 0.3, "maxAcceleration": 1.0},
    }  # fmt: skip
    file = tmp_path / "a.path"
    limits = {"maxVelocity": 1.0, "maxAcceleration": 0.8}
    file.write_text(
        json.dumps(pathplanner(STRAIGHT, constraintZones=[zone], globalConstraints=limits))
    )
    motion = waypoint_reference(file, named_robot("paper"))
    window = motion.window(0.0, 6001, motion.duration / 6000)
    speed, inside = window[:, 3], (window[:, 0] >= 1.5) & (window[:, 0] <= 3.0)
    assert speed[inside].max() <= 0.3 * (1.0 + 1e-3)
    assert 0.9 <= speed[~inside].max() <= 1.0 + 1e-3
    near = (window[:, 0] > 1.2) & (window[:, 0] < 3.3)
    assert speed[~near].max() > 0.9
    assert np.abs(np.diff(speed)).max() / (motion.duration / 6000) <= 1.0 + 1e-2


def test_a_motion_rests_at_the_stops_of_a_file_of_2023(tmp_path):
    def place(x, **flags):
        return {
            "anchorPoint": point(x, 0.0), "prevControl": point(x - 1.0, 0.0),
            "nextControl": point(x + 1.0, 0.0), "holonomicAngle": 0.0, **flags,
        }  # fmt: skip

    way = [place(0.0), place(3.0, isStopPoint=True), place(6.0)]
    file = tmp_path / "a.path"
    file.write_text(json.dumps({"waypoints": way, "maxVelocity": 1.0, "maxAcceleration": 1.0}))
    motion = waypoint_reference(file, named_robot("paper"))
    window = motion.window(0.0, 6001, motion.duration / 6000)
    rest = np.argmin(np.where(np.abs(window[:, 0] - 3.0) < 0.5, window[:, 3], 9.0))
    assert window[rest, 3] <= 1e-2
    assert window[rest, 0] == pytest.approx(3.0, abs=0.05)


def test_file_of_2024(tmp_path):
    content = pathplanner(STRAIGHT, version=1.0)
    for key in ("idealStartingState", "pointTowardsZones"):
        del content[key]
    there = read(tmp_path, {**content, "previewStartingState": {"rotation": 45.0, "velocity": 0}})
    assert there.poses[0, 2] == pytest.approx(np.pi / 4)
    none = read(tmp_path, {**content, "previewStartingState": None})
    assert none.poses[:, 2] == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (pathplanner(STRAIGHT[:1]), "waypoints has 1 entries, need at least 2"),
        (pathplanner([]), "waypoints has 0 entries, need at least 2"),
        (
            pathplanner([STRAIGHT[0], waypoint((3, 0))]),
            r"waypoints\[1\] has no key 'prevControl'",
        ),
        (
            pathplanner([waypoint((3, 0)), STRAIGHT[2]]),
            r"waypoints\[0\] has no key 'nextControl'",
        ),
        (
            pathplanner([waypoint((1, 1), after=(1, 1)), waypoint((1, 1), (1, 1))]),
            r"waypoints\[1\] has the position of waypoints\[0\]; remove",
        ),
        (
            pathplanner([waypoint((1e9, 1), after=(1, 1)), waypoint((1, 1), (1, 1))]),
            "waypoints need 866,026 samples, more than 100,000; are they",
        ),
        (pathplanner(STRAIGHT, goalEndState=None), "the file has no key 'goalEndState'"),
        (
            pathplanner(STRAIGHT, goalEndState={"velocity": 0, "rotation": "north"}),
            "goalEndState.rotation is 'north', need a number",
        ),
        (
            pathplanner(STRAIGHT, rotationTargets=[{"waypointRelativePos": 0.5}]),
            r"rotationTargets\[0\] has no key 'rotationDegrees'",
        ),
        (pathplanner(STRAIGHT, rotationTargets=7), "rotationTargets is 7, need a list"),
        (
            pathplanner(STRAIGHT, pointTowardsZones=[{}] * 1001),
            "pointTowardsZones has more than 1,000 entries",
        ),
        (
            {"waypoints": [{"position": point(0, 0)}] * 2},
            r"a.path: waypoints\[0\] has no key 'anchor'",
        ),
    ],
)
def test_malformed_path_message(tmp_path, content, message):
    with pytest.raises(InvalidReference, match=message):
        read(tmp_path, content)


# ---- writing ----


def assert_near(path, again):
    assert distance(path.poses[:, :2], again.poses[:, :2]).max() < 6e-3
    assert distance(again.poses[:, :2], path.poses[:, :2]).max() < 6e-3
    assert again.poses[[0, -1], :2] == pytest.approx(path.poses[[0, -1], :2], abs=1e-9)
    assert wrap(again.poses[[0, -1], 2] - path.poses[[0, -1], 2]) == pytest.approx(0.0, abs=1e-9)


def heading_misses(path, again):
    """Return the difference of heading, in rad, of each pose to the nearest point of a path."""
    start, step = again.poses[:-1], np.diff(again.poses, axis=0)
    away = path.poses[:, None] - start
    along = np.clip((away * step)[..., :2].sum(2) / (step[:, :2] ** 2).sum(1), 0, 1)
    miss = away - along[..., None] * step
    nearest = np.argmin(np.linalg.norm(miss[..., :2], axis=2), axis=1)
    return np.abs(wrap(miss[np.arange(len(nearest)), nearest, 2]))


def test_smooth_path_needs_few_curves(tmp_path):
    path = Path(SplinePath(CONTROL).poses(np.linspace(0, 1, 200)))
    save_waypoints(tmp_path / "a.path", path)
    again = load_waypoints(tmp_path / "a.path")
    assert_near(path, again)
    assert len(json.loads((tmp_path / "a.path").read_text())["waypoints"]) <= 8
    assert heading_misses(path, again).max() < 0.02


def test_continuous_turning_needs_many_rotation_targets(tmp_path):
    s = np.linspace(0, 4, 400)
    path = Path(np.column_stack([s, np.zeros(400), 10 * s + np.sin(5 * s)]))
    save_waypoints(tmp_path / "a.path", path)
    assert heading_misses(path, load_waypoints(tmp_path / "a.path")).max() < 0.02


def test_corners_are_kept(tmp_path):
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [2.5, 1.5, 0], [2.5, 1.4, 0.0]])
    save_waypoints(tmp_path / "a.path", Path(corners))
    again = load_waypoints(tmp_path / "a.path")
    assert_near(Path(corners), again)
    anchors = [
        (w["anchor"]["x"], w["anchor"]["y"])
        for w in json.loads((tmp_path / "a.path").read_text())["waypoints"]
    ]
    assert {tuple(c) for c in corners[:, :2].tolist()} <= set(anchors)


@examples(40)
@given(
    points=st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=2, max_size=12),
    scale=st.sampled_from([0.01, 1.0]),
)
def test_any_path_round_trip_within_tolerance(tmp_path_factory, points, scale):
    poses = np.array(points) * [scale, scale, 1.0]
    moving = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) > 1e-6
    poses = poses[np.concatenate([[True], moving])]
    if len(poses) < 2 or (np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1) < 1e-6).any():
        return
    poses[:, 2] = np.unwrap(poses[:, 2])
    file = tmp_path_factory.mktemp("path") / "a.path"
    save_waypoints(file, Path(poses))
    assert_near(Path(poses), load_waypoints(file))


def test_reference_keeps_shape_and_end_speeds(tmp_path):
    reference = UniformReference(SplinePath(CONTROL), 6.0)
    save_waypoints(tmp_path / "a.path", reference)
    content = json.loads((tmp_path / "a.path").read_text())
    start = reference.at(0.0)
    assert content["idealStartingState"]["velocity"] == pytest.approx(np.hypot(*start.twist[:2]))
    assert content["idealStartingState"]["rotation"] == 0.0
    assert content["goalEndState"]["rotation"] == pytest.approx(np.rad2deg(wrap(4.0)))
    window = reference.window(0.0, 301, 0.02)
    assert_near(Path(window[:, :3]), load_waypoints(tmp_path / "a.path"))


def test_written_path_has_required_fields(tmp_path):
    """The fields that the loader of PathPlannerLib requires."""
    save_waypoints(tmp_path / "a.path", Path(np.array([[0, 0, 0], [1, 0, 1.0]])))
    content = json.loads((tmp_path / "a.path").read_text())
    assert set(pathplanner([])) == set(content)
    assert content["version"].split(".")[0] == "2025"
    limits = ("maxVelocity", "maxAcceleration", "maxAngularVelocity", "maxAngularAcceleration")
    assert {*limits, "nominalVoltage", "unlimited"} == set(content["globalConstraints"])
    assert content["waypoints"][0]["prevControl"] is content["waypoints"][-1]["nextControl"] is None
    assert all(set(w) == set(waypoint((0, 0))) for w in content["waypoints"])
    positions = [t["waypointRelativePos"] for t in content["rotationTargets"]]
    assert positions == sorted(positions)


def test_rest_is_omitted_and_turn_on_the_spot_rejected(tmp_path):
    times = np.arange(5.0)
    poses = np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0.0]])
    save_waypoints(tmp_path / "a.path", SampledReference.through(times, poses))
    assert load_waypoints(tmp_path / "a.path").poses[-1].tolist() == [1, 0, 0]
    poses[3:, 2] = 1.0
    with pytest.raises(InvalidReference, match="turns on the spot at x 1 m, y 0 m"):
        save_waypoints(tmp_path / "b.path", SampledReference.through(times, poses))


def test_hundred_kilometres_are_sampled_sparsely(tmp_path):
    save_waypoints(tmp_path / "a.path", Path(np.array([[0, 0, 0], [1e5, 0, 1.0]])))
    again = load_waypoints(tmp_path / "a.path")
    assert len(again.poses) < 25_000
    assert again.poses[-1] == pytest.approx([1e5, 0, 1.0])


# ---- curves ----


@given(
    controls=st.lists(st.tuples(*[st.floats(-5, 5)] * 2), min_size=4, max_size=4),
    u=st.floats(0, 1),
)
def test_chain_points_match_de_casteljau(controls, u):
    controls = np.array(controls)
    assert chain_points(controls[None], np.array([u]))[0] == pytest.approx(casteljau(controls, u))


@given(controls=st.lists(st.tuples(*[st.floats(-2, 2)] * 2), min_size=4, max_size=4))
def test_step_counts_meet_spacing_and_tolerance(controls):
    controls = np.array([controls])
    (count,) = step_counts(controls, 1e-2, 0.2)
    polyline = chain_points(controls, np.linspace(0, 1, count + 1))
    assert np.linalg.norm(np.diff(polyline, axis=0), axis=1).max() <= 0.2 + 1e-9
    fine = chain_points(controls, np.linspace(0, 1, 301))
    assert distance(fine, polyline).max() <= 1e-2 + 1e-9


def test_fit_recovers_one_curve():
    controls = np.array([[[0, 0], [1, 0], [2, 1], [2, 2.0]]])
    points = chain_points(controls, np.linspace(0, 1, 100))
    chain = fit_chain(points, 1e-3)
    assert len(chain.controls) == 1
    assert chain.controls == pytest.approx(controls, abs=0.02)


def test_fit_of_noise():
    """Random points, of which one curve fits only a few."""
    rng = np.random.default_rng(5)
    chain = fit_chain(np.cumsum(rng.normal(size=(3_000, 2)), axis=0), 1e-3)
    assert chain.parameters[-1] == len(chain.controls)
    assert (np.diff(chain.parameters) >= 0).all()
