"""Waypoints and constraints of Choreo and PathPlanner files."""

import json
from math import inf, pi, radians

import pytest

from omnidrive.errors import InvalidReference
from omnidrive.reference import (
    ConvexPolygon,
    Disc,
    MotionSection,
    MotionWaypoint,
    load_motion_problem,
    load_waypoints,
)


def expression(value):
    return {"exp": f"{value} m", "val": value}


def choreo(*constraints):
    waypoints = [
        {"x": expression(x), "y": expression(0.5), "heading": expression(0.1), "intervals": 9,
         "split": False, "fixTranslation": True, "fixHeading": k != 1, "overrideIntervals": False}
        for k, x in enumerate((0.0, 1.0, 2.0))
    ]  # fmt: skip
    return {"name": "a", "version": 3, "params": {
        "waypoints": waypoints, "constraints": list(constraints), "targetDt": expression(0.05),
    }}  # fmt: skip


def constraint(kind, start, to=None, *, enabled=True, **props):
    values = {k: v if isinstance(v, bool) else expression(v) for k, v in props.items()}
    return {"from": start, "to": to, "data": {"type": kind, "props": values}, "enabled": enabled}


def load(folder, name, content):
    file = folder / name
    file.write_text(json.dumps(content))
    return load_motion_problem(file)


def test_choreo(tmp_path):
    problem = load(
        tmp_path,
        "a.traj",
        choreo(
            constraint("StopPoint", 1),
            constraint("MaxVelocity", "first", "last", max=2.0),
            constraint("MaxAcceleration", 2, 1, max=3.0),
            constraint("MaxAngularVelocity", 1, max=1.0),
            constraint("MaxVelocity", 1, enabled=False, max=0.0),
            constraint("KeepInCircle", 0, 1, x=1.0, y=2.0, r=3.0),
            constraint("KeepOutCircle", 0, "last", x=1.0, y=2.0, r=0.5),
            constraint("KeepInRectangle", 0, "last", x=-1.0, y=-1.0, w=4.0, h=3.0),
            constraint("KeepInLane", 0, 1, tolerance=0.1),
            constraint("PointAt", 1, "last", x=5.0, y=6.0, tolerance=0.0, flip=True),
        ),
    )
    assert problem.waypoints[1] == MotionWaypoint(1.0, 0.5, None, stop=True)
    assert problem.waypoints[2] == MotionWaypoint(2.0, 0.5, 0.1)
    rectangle = ConvexPolygon(((-1.0, -1.0), (3.0, -1.0), (3.0, 2.0), (-1.0, 2.0)))
    assert problem.sections == (
        MotionSection(0, 2, max_speed=2.0),
        MotionSection(1, 2, max_acceleration=3.0),
        MotionSection(1, 1, max_yaw_rate=1.0),
        MotionSection(0, 1, keep_in=(Disc(1.0, 2.0, 3.0),)),
        MotionSection(0, 2, keep_out=(Disc(1.0, 2.0, 0.5),)),
        MotionSection(0, 2, keep_in=(rectangle,)),
        MotionSection(0, 1, lane=0.1),
        MotionSection(1, 2, point_at=(5.0, 6.0), point_tolerance=0.01, point_offset=pi),
    )


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (constraint("KeepOutStar", 0), "'KeepOutStar', which is not a known constraint"),
        (constraint("MaxVelocity", 7, max=1.0), r"constraints\[0\].from is 7, and there are 3"),
        (constraint("MaxVelocity", "middle", max=1.0), r"constraints\[0\].from is 'middle'"),
        (constraint("KeepOutCircle", 0, x=0.0, y=0.0, r=-1.0), "positive radius"),
    ],
)
def test_refuses_constraints(tmp_path, wrong, text):
    with pytest.raises(InvalidReference, match=text):
        load(tmp_path, "a.traj", choreo(wrong))


def test_refuses_other_files(tmp_path):
    with pytest.raises(InvalidReference, match="has no constraints"):
        load(tmp_path, "a.csv", {})
    with pytest.raises(InvalidReference, match="never generated"):
        load(tmp_path, "a.traj", {"samples": []})


def test_choreo_limits_of_zero(tmp_path):
    problem = load(
        tmp_path,
        "a.traj",
        choreo(
            constraint("MaxVelocity", 1, max=0.0),
            constraint("MaxAngularVelocity", "first", 1, max=0.0),
            constraint("KeepInLane", 1, "last", tolerance=0.0),
        ),
    )
    assert problem.waypoints[1].stop
    assert problem.sections == (
        MotionSection(0, 1, max_yaw_rate=0.0),
        MotionSection(1, 2, lane=1e-3),
    )


def test_choreo_samples_are_the_guess(tmp_path):
    content = choreo()
    samples = [
        {"t": t, "x": t, "y": 0.5, "heading": 0.1, "vx": 1.0, "vy": 0.0, "omega": 0.0}
        for t in (0.0, 0.5, 1.0, 1.5, 2.0)
    ]
    content["trajectory"] = {"sampleType": "Swerve", "waypoints": [0.0, 1.0, 2.0]}
    content["trajectory"]["samples"] = samples
    first, last = load(tmp_path, "a.traj", content).guess
    assert first[:, 0].tolist() == [0.0, 0.5, 1.0]
    assert last[:, 0].tolist() == [1.0, 1.5, 2.0]
    content["trajectory"]["samples"] = [samples[:2], samples[2:]]  # splits, as in beta files
    assert len(load(tmp_path, "a.traj", content).guess) == 2
    content["params"]["waypoints"][1]["x"] = ["1.2 m", 1.2]  # moved after the generation
    moved = load(tmp_path, "a.traj", content)
    assert moved.waypoints[1].x == pytest.approx(1.2)
    assert moved.guess == ()


def test_choreo_flat_file(tmp_path):
    keys = ("timestamp", "x", "y", "heading", "velocityX", "velocityY", "angularVelocity")
    rows = [(0, 0, 0, 0, 0, 0, 0), (1, 1, 0, 0, 1, 0, 0), (2, 2, 0, 0.5, 0, 0, 0),
            (2.5, 2, 0, 0.5, 0, 0, 0), (3, 2, 1, 0.5, 0, 1, 0),
            (4, 2, 2, 0.5, 0, 0, 0)]  # fmt: skip
    samples = [dict(zip(keys, row, strict=True)) for row in rows]
    problem = load(tmp_path, "a.traj", {"samples": samples})
    assert problem.waypoints == (
        MotionWaypoint(0.0, 0.0, 0.0),
        MotionWaypoint(2.0, 0.0, 0.5, stop=True),
        MotionWaypoint(2.0, 2.0, 0.5),
    )
    assert [len(each) for each in problem.guess] == [3, 4]


def test_pathplanner_of_2023(tmp_path):
    def waypoint(x, before, after, **more):
        points = [None if value is None else {"x": value, "y": 0.0} for value in (x, before, after)]
        keys = ("anchorPoint", "prevControl", "nextControl")
        return {**dict(zip(keys, points, strict=True)), "isReversal": False, "velOverride": None,
                "isStopPoint": False, "holonomicAngle": 90.0, **more}  # fmt: skip

    content = {
        "waypoints": [
            waypoint(0.0, None, 1.0),
            waypoint(2.0, 1.5, 2.5, isStopPoint=True, holonomicAngle=None),
            waypoint(4.0, 3.5, 4.5, velOverride=1.5),
            waypoint(6.0, 5.0, None),
        ],
        "maxVelocity": 3.0,
        "markers": [],
    }
    problem = load(tmp_path, "a.path", content)
    assert [(w.x, w.stop) for w in problem.waypoints] == [
        (0.0, False), (2.0, True), (4.0, False), (6.0, False)
    ]  # fmt: skip
    assert [w.yaw for w in problem.waypoints] == [pi / 2, None, pi / 2, pi / 2]
    assert problem.sections == (
        MotionSection(0, 3, max_speed=3.0),
        MotionSection(2, 2, max_speed=1.5),
    )
    poses = load_waypoints(tmp_path / "a.path").poses
    assert poses[[0, -1]].tolist() == [[0.0, 0.0, pi / 2], [6.0, 0.0, pi / 2]]


def test_pathplanner(tmp_path):
    def point(x):
        return {"x": x, "y": 0.0}

    limits = {
        "maxVelocity": 1.0,
        "maxAcceleration": 2.0,
        "maxAngularVelocity": 90.0,
        "maxAngularAcceleration": 180.0,
        "unlimited": False,
    }
    problem = load(tmp_path, "a.path", {
        "version": "2025.0",
        "waypoints": [
            {"anchor": point(0.0), "prevControl": None, "nextControl": point(1.0)},
            {"anchor": point(3.0), "prevControl": point(2.0), "nextControl": None},
        ],
        "rotationTargets": [{"waypointRelativePos": 0.25, "rotationDegrees": 30.0}],
        "constraintZones": [{"minWaypointRelativePos": 0.5, "maxWaypointRelativePos": 1.0,
                             "constraints": {**limits, "maxVelocity": 0.5}}],
        "pointTowardsZones": [{"minWaypointRelativePos": 0.5, "maxWaypointRelativePos": 0.75,
                               "fieldPosition": point(9.0), "rotationOffset": 180.0}],
        "globalConstraints": limits,
        "goalEndState": {"velocity": 0.0, "rotation": 90.0},
        "idealStartingState": {"velocity": 0.0, "rotation": 0.0},
    })  # fmt: skip
    places = [(w.x, w.yaw, w.fixed) for w in problem.waypoints]
    assert places == [
        (0.0, 0.0, True),
        (0.75, pytest.approx(radians(30.0)), True),
        (1.5, None, True),
        (2.25, None, True),
        (3.0, pytest.approx(radians(90.0)), True),
    ]
    first, second, aim = problem.sections
    assert (first.first, first.last, first.max_speed) == (0, 2, 1.0)
    assert first.max_yaw_rate == pytest.approx(radians(90.0))
    assert first.max_yaw_acceleration == pytest.approx(pi)
    assert (second.first, second.last, second.max_speed) == (2, 4, 0.5)
    assert (aim.first, aim.last, aim.point_at) == (2, 3, (9.0, 0.0))
    assert aim.point_offset == pytest.approx(pi)
    assert aim.max_speed == inf
