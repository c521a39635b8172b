"""MovingAI maps and scenario files: benchmark files, semantics and malformed files."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidMap
from omnidrive.maps import OccupancyGrid, load_movingai_map, load_queries
from tests.examples import examples
from tests.shared_data import shared

MAP = b"type octile\nheight 2\nwidth 3\nmap\n.@G\nSTO\n"
SCEN = b"version 1\n0\tm.map\t3\t2\t0\t0\t2\t0\t2.00000000\n"


def write(folder, content, name="m.map"):
    path = folder / name
    path.write_bytes(content)
    return path


def error_message(read, *args):
    with pytest.raises(InvalidMap) as caught:
        read(*args)
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 700
    return message


@pytest.mark.parametrize("content", [MAP, MAP.replace(b"\n", b"\r\n"), MAP[:-1], MAP + b"\n\n"])
def test_first_line_is_the_top_of_the_map(tmp_path, content):
    grid = load_movingai_map(write(tmp_path, content), resolution=0.5)
    assert grid.occupied.tolist() == [[False, True, True], [False, True, False]]
    assert (grid.resolution, grid.origin, grid.yaw) == (0.5, (0.0, 0.0), 0.0)


def test_free_terrain(tmp_path):
    content = b"type octile\nheight 1\nwidth 7\nmap\n.GS@OTW\n"
    occupied = load_movingai_map(write(tmp_path, content)).occupied
    assert occupied.tolist() == [[False] * 3 + [True] * 4]


@pytest.mark.parametrize(
    ("name", "shape", "free", "queries", "total"),
    [
        ("random-32-32-20", (32, 32), 819, 100, 2011.83470301),
        ("maze-32-32-4", (32, 32), 790, 200, 7999.57517696),
        ("room-64-64-8", (64, 64), 3232, 310, 19192.26254417),
        ("warehouse-10-20-10-2-1", (63, 161), 5699, 450, 40407.30713341),
    ],
)
def test_benchmark_files(name, shape, free, queries, total):
    grid = load_movingai_map(shared(f"maps/movingai/{name}.map"))
    assert grid.occupied.shape == shape
    assert np.count_nonzero(~grid.occupied) == free
    read = load_queries(shared(f"maps/movingai/{name}.map.scen"), grid)
    assert len(read) == queries
    assert sum(query.length for query in read) == pytest.approx(total, abs=1e-6)
    assert not any(grid.occupied[q.start] or grid.occupied[q.goal] for q in read)
    for query in read:
        away = np.abs(np.subtract(query.start, query.goal))
        assert query.length >= max(away) + (2**0.5 - 1) * min(away) - 1e-6


def test_queries_are_parsed(tmp_path):
    grid = load_movingai_map(write(tmp_path, MAP))
    lines = [b"version 1.0", b"3 m.map 3 2 2 0 0 1 1.5e0", b"", b"3\tmy map\t3\t2\t0\t1\t0\t0\t1\r"]
    queries = load_queries(write(tmp_path, b"\n".join(lines), "m.scen"), grid)
    assert queries == [((1, 2), (0, 0), 1.5, 0.05, 2), ((0, 0), (1, 0), 1.0, 0.5, 4)]


@pytest.mark.parametrize(
    ("text", "rounding"),
    [
        (b"2.00000000", 5e-9), (b"2.00", 5e-3), (b"2.", 0.5), (b"2", 0.5), (b"0.2e1", 0.5),
        (b"2e-1", 0.05), (b"2e-" + b"9" * 300, 5e-301), (b"0e" + b"9" * 300, 5e299),
    ],
)  # fmt: skip
def test_rounding_of_a_length_is_half_of_its_last_decimal(tmp_path, text, rounding):
    grid = load_movingai_map(write(tmp_path, MAP))
    (query,) = load_queries(write(tmp_path, SCEN.replace(b"2.00000000", text), "m.scen"), grid)
    assert query.rounding == pytest.approx(rounding)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not a MovingAI map: its first lines must be 'type octile'"),
        (b"type octile\nheight 2\n", "is not a MovingAI map"),
        (MAP.replace(b"octile", b"tile"), "is not a MovingAI map"),
        (MAP.replace(b"\nmap", b"\nmop"), "is not a MovingAI map"),
        (MAP.replace(b"height 2", b"height -2"), "height must be a whole number, got '-2'"),
        (MAP.replace(b"height 2", b"height 2 2"), "height must be a whole number, got '2 2'"),
        (MAP.replace(b"width 3", b"depth 3"), "width must be a whole number, got ''"),
        (MAP.replace(b"height 2", b"height 20000").replace(b"3", b"20000"), "more than 50,000,000"),
        (MAP.replace(b"height 2", b"height 0"), "has no cells: 0 rows of 3"),
        (MAP.replace(b"height 2", b"height 3"), "3 rows of 3 cells, but contains 2 rows of 3"),
        (MAP.replace(b"width 3", b"width 7"), "2 rows of 7 cells, but contains 2 rows of 3"),
        (MAP.replace(b"S", b""), "line 6 has 2 cells, line 5 has 3"),
        (MAP[:-2], "line 6 has 2 cells, line 5 has 3"),
        (MAP.replace(b"T", b"\x1b"), r"line 6, column 2: '\\x1b' is not a cell; use '.' 'G'"),
        (MAP.replace(b".@G\nSTO\n", b""), "has no cells"),
        (b"type octile\n" + b"x " * 500_000, "is not a MovingAI map"),
    ],
)
def test_malformed_map_is_reported(tmp_path, content, message):
    assert message.replace("\\\\", "\\") in error_message(
        load_movingai_map, write(tmp_path, content)
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "its first line must be 'version 1', got ''"),
        (SCEN.replace(b"version 1", b"version 2"), "must be 'version 1', got 'version 2'"),
        (
            SCEN.replace(b"\t3\t2", b"\t2\t3"),
            "line 2 is for a map of 3 rows of 2 cells, but this map",
        ),
        (SCEN.replace(b"\t2.0", b""), "line 2 has 8 fields, need 9"),
        (SCEN.replace(b"\t2\t0\t2.", b"\t3\t0\t2."), "line 2: the cell (3, 0) lies outside"),
        (SCEN.replace(b"\t0\t0", b"\t-1\t0"), "line 2: '-1' is not a whole number"),
        (SCEN.replace(b"\t0\t0", b"\t" + b"9" * 5000 + b"\t0"), "is not a whole number"),
        (SCEN.replace(b"2.0", b"nan"), "line 2: 'nan0000000' is not the length of a path"),
        (SCEN.replace(b"2.00000000", b"inf"), "'inf' is not the length of a path"),
        (SCEN.replace(b"2.0", b"-2.0"), "is not the length of a path"),
        (SCEN.replace(b"2.00000000", b"1_000"), "'1_000' is not the length of a path"),
    ],
)
def test_malformed_scenario_is_reported(tmp_path, content, message):
    grid = OccupancyGrid(np.zeros((2, 3), bool), 1.0)
    assert message in error_message(load_queries, write(tmp_path, content, "m.scen"), grid)


@examples(200)
@given(
    content=st.sampled_from([MAP, SCEN]), at=st.integers(0, 60), cut=st.integers(0, 9),
    new=st.binary() | st.sampled_from([b"99999999", b"\n", b"\t", b"\r\n", b" 20000"]),
)  # fmt: skip
def test_mutated_files_raise_only_invalid_map(tmp_path_factory, content, at, cut, new):
    path = write(tmp_path_factory.mktemp("map"), content[:at] + new + content[at + cut :])
    with suppress(InvalidMap):
        load_movingai_map(path)
    with suppress(InvalidMap):
        load_queries(path, OccupancyGrid(np.zeros((2, 3), bool), 1.0))
