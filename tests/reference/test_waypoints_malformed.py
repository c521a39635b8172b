"""Malformed waypoint files: rejected with a one-line message, within time and memory bounds."""

import json
import os
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidReference
from omnidrive.planning import Path, SplinePath
from omnidrive.reference import SampledReference, UniformReference, load_waypoints, save_waypoints
from tests.examples import examples

CONTROL = np.array([[0, 0, 0], [1, 0, 0.5], [2, 1, 1], [2, 2, 2.0]])
ENDINGS = (".csv", ".path", ".traj", ".yaml")


def write(folder, name, content):
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


def check_rejected(file, message):
    with pytest.raises(InvalidReference, match=message) as error:
        load_waypoints(file)
    text = str(error.value).replace(str(file.parent), "")
    assert text.isprintable()
    assert file.stem[:20] in text
    assert len(text) < 500


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; a table of waypoints starts with x_m,y_m,yaw_rad"),
        ("x,y,yaw\n", "a path needs at least 2 waypoints, and the file has 0"),
        ("x,y,yaw\n1,2,3\n", "a path needs at least 2 waypoints, and the file has 1"),
        ("t,yaw\n1,2\n", "line 1: there is no column x and no column y"),
        ("t,x,y,yaww\n", "line 1: unknown column 'yaww'; did you mean 'yaw'"),
        ("t,x,y,colour\n", "has 0"),
        ("t;x;yaw\n0;1;2;3\n", "line 1: there is no column y$"),
        ("a;b\n0;1\n", "line 1: there is no column x and no column y; there are a, b"),
        ("0,1,2,3,4\n1,1,2,3,4\n", "line 1: 5 columns without titles; start the table with"),
        ('x,y,yaw\n"1,2,3\n', "line 2: unexpected end of data"),
        ('"x,y,yaw\n', "a.csv: unexpected end of data"),
        ("x,y,qx,qy,qz,qw\n1,2,0,0,0,1\n1,3,0,0,0,2\n", "line 3: a quaternion of norm 2, need 1"),
        ("x,y,yaw_grad\n1,2,3\n", "the unit of 'yaw_grad' is unknown; there are rad, deg"),
        ("x,y,yaw,x\n", "line 1: two columns contain x"),
        ("x,y,yaw,theta\n", "line 1: two columns contain yaw"),
        ("x_ft,y,yaw\n", "line 1: the unit of 'x_ft' is unknown; there are m, cm, mm"),
        ("# units: m,m\nx,y,yaw\n", "2 units for 3 columns"),
        ("# units: m,m,m\nx,y,yaw\n", "unknown unit 'm' of yaw; there are rad, deg"),
        ("x,y,yaw\n1,2,3\n1,2\n", "line 3: 2 values, but the table has 3 columns"),
        ("x,y,yaw\n1,2,3,\n", "line 2: 4 values, but the table has 3 columns"),
        ("x,y,yaw\n1,2,3\n\n1,two,3\n", "line 4: 'two' is not a number"),
        ("x,y,yaw\n1,,3\n", "line 2: '' is not a number"),
        ("x,y,yaw\n1,nan,3\n", "line 2: 'nan' is not a number"),
        ("x,y,yaw\n1,-inf,3\n", "line 2: '-inf' is not a number"),
        ("x,y,yaw\n1_000,2,3\n", "line 2: '1_000' is not a number"),
        ("x,y,yaw\n1,\N{FULLWIDTH DIGIT TWO},3\n", "line 2: .* is not a number"),
        ("x,y,yaw\n1,1e300,3\n", r"line 2: 1e\+300 is not a finite number of at most 1e"),
        ("x,y,yaw\n1," + "9" * 100_000 + ",3\n", "line 2: '9999"),
        (
            "x,y,yaw\n1,2,3\n1,2,3\n",
            "all waypoints are the same, x 1 m, y 2 m; a path needs two different ones",
        ),
        ("t,x,y,yaw\n0,1,2,3\n# so\n0,1,2,3\n", "line 4: the time 0 s does not come after 0 s"),
        (
            "t,x,y,yaw\n2,1,2,3\n1.5,1,2,3\n",
            "line 3: the time 1.5 s does not come after 2 s; times",
        ),
        (b"x,y,yaw\n1,2,\xff\n", "line 2: not UTF-8 text"),
        ("\n" * 200_002, "a.csv has more than 200,000 lines; thin them out"),
        ("x,y,yaw\n" + "1,2,3.00000000000000\n" * 500_000, "too large for waypoints"),
        ("\0\0\0", r"line 1: there is no column x and no column y; there are \\x00"),
    ],
)
def test_malformed_table_message(tmp_path, text, message):
    check_rejected(write(tmp_path, "a.csv", text), message)


def sample(**changes):
    plain = {"t": 0.0, "x": 1, "y": 1, "heading": 0, "vx": 0, "vy": 0, "omega": 0}
    return {**plain, **changes}


def choreo(*samples, **changes):
    return json.dumps({"name": "a", "version": 1, "trajectory": {"samples": samples, **changes}})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: not JSON: Expecting value; is the file truncated"),
        (
            '{\n"trajectory": {\n"samples": [',
            "line 3: not JSON: Expecting value; is the file trunc",
        ),
        ("[]", "a.traj: the file is a list, need a mapping"),
        ("7", "the file is 7, need a mapping"),
        ("{}", "the file has no key 'samples'"),
        ('{"trajectory": 3}', "trajectory is 3, need a mapping"),
        ('{"trajectory": {"samples": {}}}', "trajectory.samples is a mapping, need a list"),
        (choreo(), "trajectory.samples is empty: the trajectory was never generated"),
        (choreo(sample()), "a path needs at least 2 waypoints, and the file has 1"),
        (choreo(sample(), sample(t=1e-4)), "a path needs at least 2 waypoints"),
        (choreo(sample(t=1), sample()), r"samples\[1\] has the time 0 s, before 1 s; sort them"),
        (choreo(sample(), sample(t="1")), r"samples\[1\].t is '1', need a number"),
        (choreo(sample(), sample(t=True)), r"samples\[1\].t is True, need a number"),
        (choreo(sample(), {"t": 1, "x": 1}), r"trajectory.samples\[1\] has no key 'y'"),
        (choreo(sample(), 5), r"trajectory.samples\[1\] is 5, need a mapping"),
        (choreo(sample(), sample(t=1, vx=None)), r"samples\[1\] has no key 'vx'"),
        (choreo(sample(), sample(t=1, x=1e99)), r"x is 1e\+99, need a finite number of at most"),
        (choreo(sample(), sample(t=1, x=10**4000)), r"x is 1000*\.\.\., need a finite number"),
        (choreo(sample(), sample(t=1, x=[[1]])), r"samples\[1\].x is a list, need a number"),
        (choreo(sample(x=float("nan"))), "cannot be read: NaN is not a number in JSON"),
        (choreo(sample(x=float("inf"))), "cannot be read: Infinity is not a number"),
        ('{"a": 1, "b": 2, "a": 3}', "cannot be read: the key 'a' occurs twice in one object"),
        ('{"a": ' + "9" * 5000 + "}", "cannot be read: Exceeds the limit"),
        ("[" * 100_000, "cannot be read: it is nested too deeply|not JSON"),
        ('{"a":' * 100_000, "cannot be read: it is nested too deeply|not JSON"),
        ("[" * 500 + "]" * 500, "the file is a list, need a mapping"),
        (b'{"a": "\xff"}', "line 1: not UTF-8 text"),
        (
            '{"a": "' + "x" * 10_000_000 + '"}',
            "too large for waypoints: more than 10,000,000 bytes",
        ),
        (choreo(*[7] * 100_001), "samples has 100,001 entries, more than 100,000"),
    ],
)
def test_malformed_trajectory_message(tmp_path, text, message):
    check_rejected(write(tmp_path, "a.traj", text), message)


def message(*poses):
    return json.dumps({"header": {"frame_id": "map"}, "poses": poses})  # JSON is YAML


def stamped(sec, **pose):
    return {
        "header": {"stamp": {"sec": sec, "nanosec": 0}},
        "pose": {"position": {"x": sec}, **pose},
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "contains 0 messages, need one; record it with ros2 topic echo --once"),
        ("---\n---\n", "contains 0 messages"),
        ("poses: []\n---\nposes: []\n---\n", "contains 2 messages, need one"),
        ("7", "the file is 7.0, need a mapping"),
        ("{}", "the file has no key 'poses'"),
        ("pose: []", "the file has the unknown key 'pose'; did you mean 'poses'"),
        ("poses: []", "a path needs at least 2 waypoints, and the file has 0"),
        ("poses: {}", "poses is a mapping, need a list"),
        ("image: a.pgm\nresolution: 0.05", "is a Nav2 map, not a path; load it with load_nav2_map"),
        (
            message(stamped(0), "..."),
            r"poses\[1\] is '...': ros2 topic echo truncated the list; add",
        ),
        (message(stamped(0), stamped(0)), "all waypoints are the same, x 0 m, y 0 m"),
        (
            message(stamped(1), stamped(2), stamped(1.0)),
            r"poses\[2\].header.stamp: the time 0 s does not come after 1 s",
        ),
        (message(stamped(0), 3), r"poses\[1\] is 3.0, need a mapping"),
        (message(stamped(0), {}), r"poses\[1\] has no key 'pose'"),
        (message(stamped(0), {"pose": {}}), r"poses\[1\].pose has no key 'position'"),
        (message({"position": {"x": 1}}), r"poses\[0\] has the unknown key 'position'"),
        (message(stamped(0.5)), r"sec is 0.5, need a whole number from 0 to 4,294,967,295"),
        (message(stamped(-1)), r"sec is -1.0, need a whole number"),
        (message(stamped("soon")), r"poses\[0\].header.stamp.sec is 'soon', need a whole number"),
        (message(stamped(1, orientation={"z": 1})), "is a quaternion of norm 1.41421, need 1"),
        (message(stamped(1, orientation={"w": 0})), "is a quaternion of norm 0, need 1"),
        (message(stamped(1, orientation={"x": 1, "w": 0})), "tilts the robot: x 1 and y 0 must be"),
        (message(stamped(1, orientation={"u": 1})), "unknown key 'u'; there are x, y, z, w"),
        ("poses: [{pose: {position: {x: .nan}}}]", r"position.x is '.nan', need a number"),
        ("poses: [{pose: {position: {x: nan}}}]", r"position.x is 'nan', need a number"),
        ("poses: [{pose: {position: {x: 1_0}}}]", r"position.x is '1_0', need a number"),
        ("poses: [{pose: {position: {x: 1e11}}}]", r"position.x is 100000000000.0, need a finite"),
        ("poses: &a []\nheader: *a", "is not a YAML waypoint file: line 2: aliases"),
        (
            "poses: !!python/object/apply:os.system ['true']",
            "is not a YAML waypoint file: line 1: tags",
        ),
        ("poses: !!float 3", "is not a YAML waypoint file: line 1: tags"),
        (
            "poses: []\nposes: []",
            "is not a YAML waypoint file: line 1: a mapping has the key 'poses' twice",
        ),
        (
            "? [a]\n: 1",
            "is not a YAML waypoint file: line 1: a mapping has a list or a mapping as a key",
        ),
        ("poses: [unclosed", "is not a YAML waypoint file: line 2: did not find expected"),
        ("[" * 100_000, "is not a YAML waypoint file: line 1: it is nested more than 30 deep"),
        ("- " * 50_000, "is not a YAML waypoint file: line 1: it is nested more than 30 deep"),
        ("a: \0", "is not a YAML waypoint file"),
        (b"a: \xff", "is not a YAML waypoint file"),
        ("a: " + "x" * 10_000_000, "too large for a YAML waypoint file"),
    ],
)
def test_malformed_nav_path_message(tmp_path, text, message):
    check_rejected(write(tmp_path, "a.yaml", text), message)


@pytest.mark.parametrize("ending", ENDINGS)
def test_missing_file_or_folder_is_rejected(tmp_path, ending):
    (tmp_path / f"folder{ending}").mkdir()
    (tmp_path / f"loop{ending}").symlink_to(f"loop{ending}")
    os.mkfifo(tmp_path / f"pipe{ending}")
    check_rejected(
        tmp_path / f"folder{ending}", "cannot read the waypoint file .*: it is not a file"
    )
    check_rejected(tmp_path / f"pipe{ending}", "cannot read the waypoint file .*: it is not a file")
    check_rejected(tmp_path / f"loop{ending}", "cannot read the waypoint file .*: Too many levels")
    check_rejected(tmp_path / f"none{ending}", "cannot read the waypoint file .*: No such file")
    check_rejected(
        tmp_path / ("b" * 5000 + ending), "cannot read the waypoint file .*: File name too long"
    )


EXAMPLES = {}


def valid_files(folder):
    """Write one valid file of each format."""
    if not EXAMPLES:
        path = Path(SplinePath(CONTROL).poses(np.linspace(0, 1, 7)))
        reference = UniformReference(SplinePath(CONTROL), 2.0)
        for ending in ENDINGS:
            save_waypoints(folder / f"a{ending}", reference, dt=0.4)
            EXAMPLES[ending] = (folder / f"a{ending}").read_bytes()
        save_waypoints(folder / "b.csv", path)
    return EXAMPLES


def check_read_or_rejected(file):
    try:
        found = load_waypoints(file)
    except InvalidReference as error:
        rejection = str(error)
    else:
        poses = found.poses
        assert len(poses) >= 2
        assert np.isfinite(poses).all()
        if isinstance(found, SampledReference):
            assert (np.diff(found.times) > 0).all()
            assert np.isfinite(found.window(-1.0, 50, (found.duration + 2) / 49)).all()
        return
    assert rejection.isprintable()
    assert len(rejection) < 800


@examples(150)
@given(
    ending=st.sampled_from(ENDINGS),
    cut=st.integers(0, 6000),
    insert=st.binary(max_size=8),
    at=st.integers(0, 6000),
    gone=st.integers(0, 30),
)
def test_damaged_file_is_read_or_rejected(tmp_path_factory, ending, cut, insert, at, gone):
    folder = tmp_path_factory.mktemp("damaged")
    content = valid_files(folder)[ending]
    at %= len(content)
    damaged = content[:at] + insert + content[at + gone :]
    check_read_or_rejected(write(folder, f"a{ending}", damaged))
    check_read_or_rejected(write(folder, f"b{ending}", content[: cut % len(content)]))


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


@examples(200)
@given(ending=st.sampled_from([".path", ".traj"]), value=values, number=st.integers(0, 10_000))
def test_replaced_value_is_read_or_rejected(tmp_path_factory, ending, value, number):
    folder = tmp_path_factory.mktemp("odd")
    data = json.loads(valid_files(folder)[ending])
    entries = []

    def visit(node):
        for key in node if isinstance(node, dict) else range(len(node)):
            entries.append((node, key))
            if isinstance(node[key], (dict, list)):
                visit(node[key])

    visit(data)
    node, key = entries[number % len(entries)]
    node[key] = value
    check_read_or_rejected(write(folder, f"a{ending}", json.dumps(data)))


@examples(150)
@given(
    number=st.integers(0, 10_000),
    value=st.text(max_size=12) | st.floats().map(str) | st.integers().map(str),
    ending=st.sampled_from([".csv", ".yaml"]),
)
def test_number_replaced_by_word_is_read_or_rejected(tmp_path_factory, number, value, ending):
    folder = tmp_path_factory.mktemp("odd")
    text = valid_files(folder)[ending].decode()
    found = list(re.finditer(r"-?\d+(\.\d+)?(e-?\d+)?", text))
    where = found[number % len(found)]
    damaged = text[: where.start()] + value + text[where.end() :]
    check_read_or_rejected(write(folder, f"a{ending}", damaged.encode("utf-8", "surrogatepass")))


@examples(100)
@given(ending=st.sampled_from(ENDINGS), content=st.binary(max_size=60) | st.text(max_size=60))
def test_arbitrary_content_is_read_or_rejected(tmp_path_factory, ending, content):
    folder = tmp_path_factory.mktemp("any")
    data = content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass")
    check_read_or_rejected(write(folder, f"a{ending}", data))
