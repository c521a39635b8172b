"""Waypoint files: round trips, and the fields of each format."""

import json
import re

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import CannotWrite, InvalidReference
from omnidrive.geometry import Pose
from omnidrive.planning import Path, SplinePath
from omnidrive.reference import (
    Hold,
    SampledReference,
    UniformReference,
    load_waypoints,
    save_waypoints,
)
from tests.examples import examples
from tests.shared_data import shared_table

CONTROL = np.array([[0, 0, 0], [1, 0, 0.5], [2, 1, 1], [2, 2, 2], [1, 3, 4], [0, 3, 4.0]])
REFERENCE = UniformReference(SplinePath(CONTROL), 6.0)
PATH = Path(SplinePath(CONTROL).poses(np.linspace(0, 1, 30)))


def turned(yaw):
    """Return the direction of an angle, without whole turns."""
    return np.column_stack([np.cos(yaw), np.sin(yaw)])


def same(a, b):
    return (
        (a.times == b.times).all() and (a.poses == b.poses).all() and (a.twists == b.twists).all()
    )


# ---- all formats ----


@pytest.mark.parametrize("ending", [".csv", ".path", ".yaml"])
def test_repeated_poses_of_a_path_are_left_out(tmp_path, ending):
    poses = np.array([[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [2.0, 1.0, 0.5]])
    save_waypoints(tmp_path / f"once{ending}", Path(poses))
    save_waypoints(tmp_path / f"again{ending}", Path(poses[[0, 0, 1, 1, 1, 2, 2]]))
    once, again = (load_waypoints(tmp_path / f"{name}{ending}") for name in ("once", "again"))
    np.testing.assert_array_equal(again.poses, once.poses)


def test_repeated_rows_of_a_file_are_left_out(tmp_path):
    (tmp_path / "a.csv").write_text("x,y,yaw\n0,0,0\n0,0,0\n1,0,0\n1,0,0\n")
    assert load_waypoints(tmp_path / "a.csv").poses.tolist() == [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def fast_turn():
    """Turn at 3 rad/s for 6 s while moving 2 m forward."""
    return SampledReference(
        np.array([0.0, 6.0]),
        np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 18.0]]),
        np.array([[1 / 3, 0.0, 3.0]] * 2),
        unwrapped=True,
    )


@pytest.mark.parametrize("ending", [".csv", ".traj", ".yaml", ".path"])
@pytest.mark.parametrize("dt", [2.0, None])
def test_step_that_loses_a_turn_is_rejected_with_a_suggestion(tmp_path, ending, dt):
    """A reader assumes at most half a turn from one waypoint to the next."""
    file = tmp_path / f"spin{ending}"
    with pytest.raises(InvalidReference, match="more than half a turn between samples") as error:
        save_waypoints(file, fast_turn(), dt=dt)
    assert not file.exists()
    step = float(re.search(r"choose dt = (\S+) s", str(error.value))[1])
    save_waypoints(file, fast_turn(), dt=step)
    again = load_waypoints(file)
    assert abs(again.poses[-1, 2] - again.poses[0, 2]) == pytest.approx(18.0, abs=0.05)


def test_path_that_loses_a_turn_is_rejected(tmp_path):
    path = Path(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [2.0, 0.0, 5.0]]))
    with pytest.raises(InvalidReference, match=r"turns by 4.000 rad from pose 1 to pose 2"):
        save_waypoints(tmp_path / "a.csv", path)


def test_motion_that_turns_too_fast_is_rejected(tmp_path):
    wild = SampledReference(
        np.array([0.0, 1.0]),
        np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e7]]),
        np.array([[0.0, 0.0, 1e7]] * 2),
        unwrapped=True,
    )
    with pytest.raises(InvalidReference, match="100,000 samples cannot represent"):
        save_waypoints(tmp_path / "a.csv", wild)


@pytest.mark.parametrize("turn", [4.0, -6.0, 12.0])
def test_pathplanner_preserves_the_total_turn(tmp_path, turn):
    """The headings follow PathPlanner's interpolation, so that the end headings would suffice."""
    share = np.linspace(0.0, 1.0, 200)
    yaw = turn * 0.5 * (1.0 - np.cos(np.pi * share))
    save_waypoints(tmp_path / "a.path", Path(np.column_stack([3 * share, 0 * share, yaw])))
    again = load_waypoints(tmp_path / "a.path").poses
    assert again[-1, 2] - again[0, 2] == pytest.approx(turn, abs=1e-6)


@pytest.mark.parametrize("ending", [".csv", ".traj"])
def test_reference_round_trip_is_exact(tmp_path, ending):
    file = tmp_path / f"drive{ending}"
    save_waypoints(file, REFERENCE, dt=0.05)
    again = load_waypoints(file)
    assert isinstance(again, SampledReference)
    assert same(again, SampledReference.of(REFERENCE, 0.05))
    text = file.read_text()
    save_waypoints(file, again)  # without dt, its own samples are written
    assert file.read_text() == text


@pytest.mark.parametrize("ending", [".csv", ".yaml"])
def test_path_round_trip(tmp_path, ending):
    file = tmp_path / f"path{ending}"
    save_waypoints(file, PATH)
    again = load_waypoints(file)
    assert isinstance(again, Path)
    assert again.poses == pytest.approx(PATH.poses, abs=1e-12)


def test_nav_path_round_trip_keeps_poses_and_times_only(tmp_path):
    file = tmp_path / "drive.yaml"
    save_waypoints(file, REFERENCE, dt=0.05)
    again, sampled = load_waypoints(file), SampledReference.of(REFERENCE, 0.05)
    assert again.times == pytest.approx(sampled.times, abs=1e-9)
    assert again.poses == pytest.approx(sampled.poses, abs=1e-12)
    # interpolated from rest to rest: the velocities agree away from the ends
    assert again.twists[20:-20] == pytest.approx(sampled.twists[20:-20], abs=1e-3)


@examples(25)
@given(
    ending=st.sampled_from([".csv", ".traj", ".yaml"]),
    steps=st.lists(st.floats(1e-3, 10), min_size=1, max_size=8),
    data=st.data(),
)
def test_any_reference_round_trip(tmp_path_factory, ending, steps, data):
    count = len(steps) + 1
    number = st.floats(-1e6, 1e6)
    rows = st.lists(st.tuples(number, number, number), min_size=count, max_size=count)
    times = np.concatenate([[0.0], np.cumsum(steps)])
    reference = SampledReference(times, np.array(data.draw(rows)), np.array(data.draw(rows)))
    file = tmp_path_factory.mktemp("path") / f"any{ending}"
    save_waypoints(file, reference)
    again = load_waypoints(file)
    if ending == ".yaml":
        assert again.times == pytest.approx(reference.times, abs=1e-9)
        assert (again.poses[:, :2] == reference.poses[:, :2]).all()
        assert turned(again.poses[:, 2]) == pytest.approx(turned(reference.poses[:, 2]), abs=1e-9)
    else:
        assert same(again, reference)


def test_default_step_is_20_ms(tmp_path):
    save_waypoints(tmp_path / "a.csv", REFERENCE)
    assert load_waypoints(tmp_path / "a.csv").times[1] == pytest.approx(0.02)


def test_upper_case_extension_and_string_file_name(tmp_path):
    save_waypoints(str(tmp_path / "A.CSV"), PATH)
    assert (load_waypoints(str(tmp_path / "A.CSV")).poses == PATH.poses).all()


@pytest.mark.parametrize("name", ["a.json", "a", "a.csv.gz", "path"])
def test_unknown_extension_is_rejected(tmp_path, name):
    with pytest.raises(InvalidReference, match=r"is not a waypoint format; use \.csv, \.path"):
        load_waypoints(tmp_path / name)
    with pytest.raises(InvalidReference, match="is not a waypoint format"):
        save_waypoints(tmp_path / name, PATH)


@pytest.mark.parametrize(
    ("name", "what", "options", "message"),
    [
        ("a.traj", PATH, {}, "a Choreo trajectory needs times, which a path does not have"),
        ("a.csv", PATH, {"dt": 0.1}, "a path has no times: omit dt"),
        (
            "a.csv",
            Path(np.zeros((1, 3))),
            {},
            "the path: a path needs at least 2 waypoints, and the file has 1",
        ),
        (
            "a.yaml",
            Path(np.zeros((2, 3))),
            {},
            "the path: all waypoints are the same",
        ),
        (
            "a.csv",
            Path(np.array([[0, 0, 0], [np.nan, 1, 0]])),
            {},
            "has a number that is not finite",
        ),
        ("a.csv", Path(np.zeros((100_001, 3))), {}, "100,001 waypoints are more than 100,000"),
        ("a.csv", REFERENCE, {"dt": 0.0}, "must be positive and finite, got 0 s"),
        ("a.traj", REFERENCE, {"dt": 1e-4}, "needs samples at least 0.0005 s apart"),
        ("a.csv", REFERENCE, {"dt": 1e-9}, "more than 100,000; choose a step of"),
        ("a.yaml", REFERENCE, {"dt": 1.4e-4}, r"more than 10,000,000; .* choose a longer dt"),
        ("a.path", Hold(Pose(1, 2, 3), 1.0), {}, "the waypoints are all at the same position"),
    ],
)
def test_waypoints_that_a_format_cannot_represent_are_rejected(
    tmp_path, name, what, options, message
):
    with pytest.raises(InvalidReference, match=message):
        save_waypoints(tmp_path / name, what, **options)
    assert not (tmp_path / name).exists()


def test_write_error_is_reported(tmp_path):
    with pytest.raises(CannotWrite, match=r"cannot write to .*: No such file"):
        save_waypoints(tmp_path / "no" / "a.csv", PATH)


# ---- CSV ----


@pytest.mark.parametrize(
    "text",
    [
        "t,x,y,yaw\n0,1,2,0.5\n1,2,3,1\n",
        "\ufefft,x,y,yaw\r\n0,1,2,0.5\r\n\r\n1,2,3,1\r\n",
        "# t,x,y,yaw\n0 , 1 , 2 , 0.5\n# a remark\n1,2,3,1",
        '"yaw","y","x","time"\n0.5,2,1,0\n1,3,2,1',
        "t_s,x_m,y_m,yaw_rad\n0,1,2,0.5\n1,2,3,1",
        f"t [ms],x (cm),Y_MM,theta [deg]\n0,100,2000,{np.rad2deg(0.5)}\n1e3,200,3000,{180 / np.pi}",
        f"# units: s, m, m, deg\nt,x,y,heading\n0,1,2,{np.rad2deg(0.5)}\n1,2,3,{180 / np.pi}",
        "# driven in hall 3, by night\nt,x,y,yaw\n5,1,2,0.5\n6,2,3,1",
    ],
)
def test_table_variants(tmp_path, text):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    reference = load_waypoints(tmp_path / "a.csv")
    assert reference.times == pytest.approx([0.0, 1.0])
    assert reference.poses == pytest.approx(np.array([[1, 2, 0.5], [2, 3, 1.0]]))


ROW = [[1.0, 2.0, 0.5], [2.0, 3.0, 1.0]]


@pytest.mark.parametrize(
    ("text", "notes"),
    [
        (",x,y,yaw\n0,1,2,0.5\n1,2,3,1\n", []),
        ("Unnamed: 0,x,y,yaw\n0,1,2,0.5\n1,2,3,1\n", []),
        ('x,y,yaw,speed,name\n1,2,0.5,1,"a, b"\n2,3,1,1,\n', ["not used: speed, name"]),
        ("x;y;yaw\r\n1;2;0,5\r\n2;3;1\r\n", []),
        ("x;y;yaw;note\n1;2;0,5;\n2;3;1;1.2.2026, by night\n", ["not used: note"]),
        ('\ufeff"x"\t"y"\t"yaw"\n1\t2\t0,5\n2\t3\t1\n', []),
        ("  x   y yaw\n 1  2   0.5\n 2  3  1\n", []),
        ("# by night\n# x; y; yaw\n1; 2; 0.5\n2; 3; 1\n", []),
        (
            "# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n"
            "0.0; 1.0; 2.0; 0.5; 0.0; 1.0; 0.0\n1.0; 2.0; 3.0; 1.0; 0.0; 1.0; 0.0\n",
            ["not used: s_m, kappa_radpm, vx_mps, ax_mps2"],
        ),
        (
            f"x,y,qx,qy,qz,qw\n1,2,0,0,{np.sin(0.25)},{np.cos(0.25)}\n"
            f"2,3,0,0,{np.sin(0.5)},{np.cos(0.5)}\n",
            [],
        ),
        (f"x,y,yaw_deg\n1,2,{np.rad2deg(0.5)}\n2,3,{180 / np.pi}\n", []),
        ("1,2,0.5\n2,3,1\n", ["no titles and are read as x, y, yaw"]),
    ],
)
def test_tables_of_other_programs(tmp_path, caplog, text, notes):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8", newline="")
    path = load_waypoints(tmp_path / "a.csv")
    assert isinstance(path, Path)
    assert path.poses == pytest.approx(np.array(ROW))
    assert len(caplog.messages) == len(notes)
    assert all(note in said for note, said in zip(notes, caplog.messages, strict=True))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (",0,1\n0,2.0,0.0\n1,1.9,0.3\n", "line 1: 0, 1 are the numbers of columns"),
        ("0,2.0,0.0\n1,1.9,0.3\n2,1.7,0.5\n", "first column, 0, 1, 2, ..., has"),
    ],
)
def test_numbers_of_pandas_are_no_waypoints(tmp_path, text, fault):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InvalidReference, match=f"{fault}.*titles"):
        load_waypoints(tmp_path / "a.csv")


LINE, COLUMN = "first line may be the numbers of col", "first column may be the numbers of rows"


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        ("0,1\n0.5,1.5\n1.5,2.5\n", LINE),
        ("0,1,2\n2.0,0.0,0.5\n1.9,0.3,0.5\n", LINE),
        ("0;1\n2,0;0,0\n1,9;0,3\n", LINE),
        ("0,0.0\n1,0.5\n2,0.8\n3,1.0\n", COLUMN),
        ("0,1.0,0.5,0.0\n1,1.5,0.5,0.0\n2,2.0,0.5,0.0\n", COLUMN),  # t in whole seconds
        ("0,1\n1,1\n2,3\n", ""),
        ("0,1.0\n1,2.0\n", ""),
        ("0,1,0\n1,1,0.5\n2,3,1\n", ""),
    ],
)
def test_waypoints_that_may_be_numbers_of_pandas_are_read_with_a_note(
    tmp_path, caplog, text, remark
):
    (tmp_path / "a.csv").write_text(text)
    found = load_waypoints(tmp_path / "a.csv")
    assert len(found.poses) == len(text.split())
    note = caplog.messages[0]
    assert "have no titles and are read as" in note
    assert remark in note
    assert ("may be" in note) == bool(remark)


@pytest.mark.parametrize("axis", ["y", "x"])
@pytest.mark.parametrize("rotation", [0.0, 1.9, -2.5])
def test_heading_of_race_lines(tmp_path, caplog, axis, rotation):
    """TUM's psi = atan2(dy, dx) - pi/2, within (-pi, pi]; other programs count from the x axis."""
    angle = np.linspace(0.0, 1.5 * np.pi, 61) + rotation  # of a circle, counterclockwise
    tangent = angle + 0.5 * np.pi
    psi = tangent - (0.5 * np.pi if axis == "y" else 0.0)
    psi = np.arctan2(np.sin(psi), np.cos(psi))
    x, y = 9.0 * np.cos(angle), 9.0 * np.sin(angle)
    rows = zip(9.0 * angle, x, y, psi, strict=True)
    text = "# 5f3a\n# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n"
    text += "".join(f"{s:.7f}; {x:.7f}; {y:.7f}; {p:.7f}; 0.11; 5; 0\n" for s, x, y, p in rows)
    (tmp_path / "traj_race_cl.csv").write_text(text)
    yaw = load_waypoints(tmp_path / "traj_race_cl.csv").poses[:, 2]
    assert np.cos(yaw - tangent) == pytest.approx(np.ones(61))
    assert np.abs(np.diff(yaw)).max() < 0.1
    assert any("counts from the y axis" in each for each in caplog.messages) == (axis == "y")


def test_decimal_sign_is_that_of_the_first_number_with_one(tmp_path):
    """Spreadsheets write whole numbers without it."""
    (tmp_path / "a.csv").write_text("x;y;yaw\n0;0;0\n1;2;0\n2,5;2;1\n")
    poses = load_waypoints(tmp_path / "a.csv").poses
    assert poses == pytest.approx(np.array([[0, 0, 0], [1, 2, 0], [2.5, 2, 1]]))


@pytest.mark.parametrize(
    "text",
    [
        "timestamp,x,y,theta\n5,1,2,0.5\n6,2,3,1\n",
        "#stamp [ns], x, y, yaw\n1403636579763555584, 1, 2, 0.5\n1403636580763555584, 2, 3, 1\n",
        "stamp,x,y,yaw\n1403636579763555584,1,2,0.5\n1403636580763555584,2,3,1\n",
        "t;x;y;yaw\n0,5;1;2;0,5\n1,5;2;3;1\n",
        "0,1,2,0.5\n1,2,3,1\n",
        "# timestamp tx ty tz qx qy qz qw\n"
        f"1305031102.25 1 2 9 0 0 {np.sin(0.25)} {np.cos(0.25)}\n"
        f"1305031103.25 2 3 9 0 0 {np.sin(0.5)} {np.cos(0.5)}\n",
        f"1305031102.25 1 2 9 0 0 {np.sin(0.25)} {np.cos(0.25)}\n"
        f"1305031103.25 2 3 9 0 0 {np.sin(0.5)} {np.cos(0.5)}\n",
        "t,x,y,yaw,vx\n0,1,2,0.5,9\n1,2,3,1,9\n",
    ],
)
def test_timed_tables_of_other_programs(tmp_path, text):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    reference = load_waypoints(tmp_path / "a.csv")
    assert reference.times == pytest.approx([0.0, 1.0], abs=1e-6)
    assert reference.poses == pytest.approx(np.array(ROW))


@pytest.mark.parametrize("titles", ["x,y\n", "# x_m, y_m\n", ""])
def test_heading_of_a_table_without_one(tmp_path, caplog, titles):
    (tmp_path / "a.csv").write_text(f"{titles}0,0\n0,1\n-1,1\n")
    tangent = load_waypoints(tmp_path / "a.csv").poses
    assert tangent[:, 2] == pytest.approx([np.pi / 2, np.pi / 2, np.pi])
    assert "the heading is the direction of travel" in caplog.messages[-1]
    fixed = load_waypoints(tmp_path / "a.csv", heading="fixed").poses
    assert fixed.tolist() == [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]


def test_table_with_velocities(tmp_path):
    (tmp_path / "a.csv").write_text(
        "t,x,y,yaw,vx [m/s],vy [m/s],omega [deg/s]\n0,0,0,0,1,2,90\n1,1,2,1,3,4,180\n"
    )
    twists = load_waypoints(tmp_path / "a.csv").twists
    assert twists == pytest.approx(np.array([[1, 2, np.pi / 2], [3, 4, np.pi]]))


def test_table_without_times_is_a_path_with_unwrapped_yaw(tmp_path):
    (tmp_path / "a.csv").write_text("x,y,yaw\n0,0,3\n1,0,-3\n1,0,-2\n")
    path = load_waypoints(tmp_path / "a.csv")
    assert isinstance(path, Path)
    assert path.poses[:, 2] == pytest.approx([3.0, 2 * np.pi - 3, 2 * np.pi - 2])


def test_paper_reference_as_table(tmp_path):
    """A table of the reference data's samples reproduces its motion between the samples."""
    theirs = shared_table("reference/ref_paper_T20.csv")
    rows = [",".join(map(repr, row)) for row in theirs[:, :4].tolist()]
    (tmp_path / "ref.csv").write_text("\n".join(["t,x,y,theta", *rows]))
    reference = load_waypoints(tmp_path / "ref.csv")
    window = reference.window(0.0, len(theirs), 0.1)
    assert window[:, :2] == pytest.approx(theirs[:, 1:3], abs=1e-12)
    middle = slice(20, -20)  # the paper's motion is not at rest at its ends
    speed = np.hypot(window[middle, 3], window[middle, 4])
    assert speed == pytest.approx(theirs[middle, 4], abs=0.02)


# ---- Choreo ----

# after the schema: the heading wraps, and the last two samples are less than 1 us apart
SAMPLES = [
    {"t": 0.0, "x": 1.0, "y": 1.0, "heading": 3.0, "vx": 0.0, "vy": 0.0, "omega": 0.0},
    {"t": 0.5, "x": 1.5, "y": 1.0, "heading": -3.1, "vx": 2.0, "vy": 0.1, "omega": 0.4},
    {"t": 1.0, "x": 2.0, "y": 1.0, "heading": -3.0, "vx": 0.01, "vy": 0.0, "omega": 0.0},
    {"t": 1.0000003, "x": 2.00001, "y": 1.0, "heading": -3.0, "vx": 0.0, "vy": 0.0, "omega": 0.0},
]


def choreo(**changes):
    trajectory = {"sampleType": "Swerve", "waypoints": [0.0, 1.0], "splits": [0]}
    trajectory["samples"] = [{**s, "ax": 0.0, "fx": [0.0] * 4, "fy": [0.0] * 4} for s in SAMPLES]
    trajectory.update(changes)
    return {"name": "a", "version": 1, "snapshot": None, "params": {}, "trajectory": trajectory,
            "events": []}  # fmt: skip


def read(folder, name, content):
    text = content if isinstance(content, str) else json.dumps(content)
    (folder / name).write_text(text)
    return load_waypoints(folder / name)


def test_choreo_trajectory(tmp_path):
    reference = read(tmp_path, "a.traj", choreo())
    assert reference.times == pytest.approx([0.0, 0.5, 1.0000003])
    turn = 2 * np.pi
    assert reference.poses == pytest.approx(
        np.array([[1, 1, 3], [1.5, 1, turn - 3.1], [2.00001, 1, turn - 3]])
    )
    assert reference.twists == pytest.approx(np.array([[0, 0, 0], [2, 0.1, 0.4], [0, 0, 0]]))
    assert np.abs(reference.window(0.0, 1001, 0.001)[:, 3]).max() < 2.1


def test_choreo_trajectory_of_2024(tmp_path):
    names = {"t": "timestamp", "vx": "velocityX", "vy": "velocityY", "omega": "angularVelocity"}
    samples = [{names.get(k, k): v for k, v in s.items()} for s in SAMPLES]
    old = read(tmp_path, "old.traj", {"samples": samples, "eventMarkers": []})
    assert same(old, read(tmp_path, "new.traj", choreo()))


@pytest.mark.parametrize("kind", [{"sampleType": "Differential"}, {"sampleType": None}])
def test_choreo_trajectory_of_differential_drive_has_poses_only(tmp_path, kind):
    samples = [
        {"t": t, "x": t, "y": 0.0, "heading": 0.0, "vl": 1.0, "vr": 1.0} for t in (0.0, 1.0, 2.0)
    ]
    reference = read(tmp_path, "a.traj", choreo(samples=samples, **kind))
    assert reference.poses[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert reference.twists[:, 0] == pytest.approx([0.0, 1.5, 0.0])


def test_written_choreo_trajectory_has_required_fields(tmp_path):
    """The fields that the loaders of ChoreoLib and PathPlannerLib require."""
    save_waypoints(tmp_path / "drive.traj", REFERENCE, dt=0.5)
    data = json.loads((tmp_path / "drive.traj").read_text())
    assert (data["name"], data["version"], data["events"]) == ("drive", 3, [])
    trajectory = data["trajectory"]
    assert trajectory["sampleType"] == "Swerve"
    assert trajectory["splits"] == [0]
    assert trajectory["waypoints"] == [0.0, 6.0]
    for sample in trajectory["samples"]:
        assert set(sample) == {*SAMPLES[0], "ax", "ay", "alpha", "fx", "fy"}
        assert len(sample["fx"]) == len(sample["fy"]) == 4
    first = trajectory["samples"][0]
    assert [w["x"]["val"] for w in data["params"]["waypoints"]] == [first["x"], CONTROL[-1, 0]]
    assert [w["x"] for w in data["snapshot"]["waypoints"]] == [first["x"], CONTROL[-1, 0]]
    assert data["snapshot"]["constraints"] == []  # not at rest at its ends


def test_accelerations_in_choreo_trajectory(tmp_path):
    times = np.linspace(0.0, 2.0, 201)
    poses = np.column_stack([0.25 * times**2, -(times**2), 0.5 * times**2])
    twists = np.column_stack([0.5 * times, -2.0 * times, times])
    save_waypoints(tmp_path / "a.traj", SampledReference(times, poses, twists))
    samples = json.loads((tmp_path / "a.traj").read_text())["trajectory"]["samples"]
    assert [samples[-1][key] for key in ("ax", "ay", "alpha")] == [0.0, 0.0, 0.0]
    for sample in samples[:-1]:
        found = [sample[key] for key in ("ax", "ay", "alpha")]
        assert found == pytest.approx([0.5, -2.0, 1.0])


def test_motion_at_rest_at_its_ends_has_stop_points(tmp_path):
    reference = SampledReference.through(
        np.arange(3.0), np.array([[0, 0, 0], [1, 1, 1], [2, 0, 0.0]])
    )
    reference = SampledReference(reference.times, reference.poses, np.round(reference.twists, 9))
    save_waypoints(tmp_path / "a.traj", reference)
    data = json.loads((tmp_path / "a.traj").read_text())
    assert [c["from"] for c in data["params"]["constraints"]] == ["first", "last"]


# ---- nav_msgs/Path ----

ECHO = """\
header:
  stamp:
    sec: 1717
    nanosec: 500000000
  frame_id: map
poses:
- header:
    stamp:
      sec: {s0}
      nanosec: {n0}
    frame_id: map
  pose:
    position:
      x: 1.0
      y: -2.5
      z: 0.3
    orientation:
      x: 0.0
      y: 0.0
      z: 0.7071067811865476
      w: 0.7071067811865476
- header:
    stamp:
      sec: {s1}
      nanosec: {n1}
    frame_id: map
  pose:
    position:
      x: 2.0
      y: 1.0e-05
      z: 0.0
    orientation:
      x: 0.0
      y: 0.0
      z: -1.0
      w: 0.0
---
"""


def test_nav_path_printed_by_echo(tmp_path):
    path = read(tmp_path, "plan.yaml", ECHO.format(s0=0, n0=0, s1=0, n1=0))
    assert isinstance(path, Path)
    assert path.poses == pytest.approx(np.array([[1, -2.5, np.pi / 2], [2, 1e-5, np.pi]]))


def test_increasing_stamps_are_times(tmp_path):
    text = ECHO.format(s0=1_717_171_717, n0=900_000_000, s1=1_717_171_718, n1=150_000_001)
    reference = read(tmp_path, "plan.yaml", text)
    assert isinstance(reference, SampledReference)
    assert reference.duration == pytest.approx(0.250000001, abs=1e-12)
    assert reference.poses[:, 2] == pytest.approx([np.pi / 2, np.pi])


def test_nav_path_typed_for_pub(tmp_path):
    path = read(
        tmp_path, "plan.yaml",
        "{header: {frame_id: map}, poses: [{pose: {position: {x: 1, y: 2}, orientation: {w: 1.0}}},"
        " {pose: {position: {x: 3.0}}}]}",
    )  # fmt: skip
    assert path.poses.tolist() == [[1.0, 2.0, 0.0], [3.0, 0.0, 0.0]]


def test_nav_path_of_ros_1(tmp_path):
    text = (
        ECHO.format(s0=1, n0=0, s1=2, n1=0).replace("nanosec:", "nsecs:").replace("sec:", "secs:")
    )
    text = text.replace("  frame_id", "  seq: 7\n  frame_id", 1).replace("---", "")
    assert read(tmp_path, "plan.yaml", text).duration == 1.0


def test_written_nav_path_matches_ros_schema(tmp_path):
    """PyYAML, which ros2 topic pub uses, reads all numbers as numbers, even tiny ones."""
    reference = SampledReference(
        np.array([0.0, 1.25]), np.array([[1e-7, 1e9, 0], [2, 1, np.pi]]), np.zeros((2, 3))
    )
    save_waypoints(tmp_path / "plan.yml", reference, frame_id="odom: x\n#'\"")
    message, end = yaml.safe_load_all((tmp_path / "plan.yml").read_text())
    assert end is None
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "odom: x\n#'\""}
    first, last = message["poses"]
    assert first["pose"]["position"] == {"x": 1e-7, "y": 1e9, "z": 0.0}
    assert last["header"]["stamp"] == {"sec": 1, "nanosec": 250_000_000}
    assert last["pose"]["orientation"] == pytest.approx({"x": 0, "y": 0, "z": 1, "w": 0})
    for part in first["pose"].values():
        assert all(isinstance(value, float) for value in part.values())
