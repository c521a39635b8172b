"""Loading of maps by suffix and content: NumPy arrays, text and malformed files."""

import io
import os
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omnidrive.errors import InvalidMap
from omnidrive.maps import (
    OccupancyGrid,
    load_ascii_map,
    load_map,
    load_numpy_map,
    paper_map,
    save_nav2_map,
)
from tests.examples import examples
from tests.memory import allocates_at_most
from tests.shared_data import shared


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def header(text):
    text += " " * (117 - len(text)) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def write(folder, content, name):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_text_map_shows_the_top_row_first(tmp_path):
    path = write(tmp_path, "..#\r\n0 @\r\n?1.\r\n", "m.txt")
    grid = load_ascii_map(path, resolution=0.5)
    assert grid.occupied.tolist() == [[1, 1, 0], [0, 0, 1], [0, 0, 1]]
    assert grid.resolution == 0.5
    assert not load_ascii_map(path, unknown="free").occupied[0, 0]
    assert grid.is_occupied(1.4, 1.4)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "m.txt has no cells"),
        ("\n\n", "m.txt has no cells"),
        ("...\n..\n", "m.txt, line 2 has 2 cells, line 1 has 3"),
        ("...\n..x\n", "m.txt, line 2, column 3: 'x' is not a cell; use '.' ' ' '0' '#'"),
        ("\n...\n", "m.txt has no cells"),
        (b".\xff\n", "m.txt, line 1, column 2: 'ÿ' is not a cell"),
        (b"\n" * 10_000_000 + b".", "has no cells"),
    ],
)
def test_malformed_text_is_reported(tmp_path, content, message):
    with pytest.raises(InvalidMap, match=message.replace("?", r"\?")):
        load_ascii_map(write(tmp_path, content, "m.txt"))


@pytest.mark.parametrize(
    "values",
    [
        np.array([[False, True, True], [False, False, True]]),
        np.array([[0, 100, -1], [0, 0, 1]], np.int8),
        np.array([[0, 100, -1], [0, 0, 1]], ">i4"),
        np.array([[0.0, 0.3, np.nan], [-0.0, 0.0, np.inf]]),
        np.array([[0, 1, 1], [0, 0, 255]], np.uint8),
        np.array([[0.0, 0.3, -1.0], [0.0, 0.0, 1.0]], np.float16),
        np.asfortranarray([[0, 100, -1], [0, 0, 1]]),
    ],
)
def test_array_types(tmp_path, values):
    path = write(tmp_path, npy(values), "m.npy")
    grid = load_numpy_map(path, resolution=0.1)
    assert grid.occupied.tolist() == [[False, True, True], [False, False, True]]
    assert grid.occupied.flags.c_contiguous
    known = load_numpy_map(path, unknown="free").occupied
    assert known[0, 2] == (values.dtype.kind in "bu")
    assert known[0, 1]


@examples(20)
@given(occupied=arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_numpy_round_trip(tmp_path_factory, occupied):
    path = write(tmp_path_factory.mktemp("map"), npy(occupied), "m.npy")
    assert (load_map(path).occupied == occupied).all()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r"is not a NumPy array \(\.npy\)"),
        (b"\x93NUMPY\x07\x07", r"version \(7, 7\) of the NumPy format; only \(1, 0\) is supported"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff", r"has version \(2, 0\)"),
        (npy(np.zeros(3)), r"must contain a two-dimensional array, got shape \(3,\)"),
        (npy(np.zeros((2, 2, 2))), "must contain a two-dimensional array"),
        (npy(np.zeros((2, 2), complex)), "must contain booleans or numbers, got 'complex128'"),
        (npy(np.full((2, 2), None)), "must contain booleans or numbers, got 'object'"),
        (npy(np.full((2, 2), "wall")), "must contain booleans or numbers, got '<U4'"),
        (npy(np.zeros((2, 2), "i4,f8")), "must contain booleans or numbers"),
        (npy(np.zeros((0, 7))), "has no cells: 0 rows of 7"),
        (npy(np.zeros((9, 9)))[:-1],
         "has 647 bytes of data, but an array of 9 rows of 9 float64 needs 648"),
        (header("{'descr': '<f8', 'fortran_order': False, 'shape': (20000, 20000), }"),
         "has 20,000 rows of 20,000: more than 50,000,000 cells"),
        (header("{'descr': '<f8', 'fortran_order': False, 'shape': (7000, 7000), }"),
         "has 0 bytes of data, but an array of 7,000 rows"),
        (header("{'descr': '<f8', 'fortran_order': False, 'shape': (-3, -3), }"), "has no cells"),
        (header("{'descr': '<f8', 'fortran_order': False, 'shape': (True, 2), }"), "m.npy"),
        (header("{'descr': '<f8', 'fortran_order': __import__('os'), 'shape': (2, 2), }"),
         "is not a NumPy array"),
        (header("(" * 110), "is not a NumPy array"),
    ],
)  # fmt: skip
def test_malformed_array_is_reported(tmp_path, content, message):
    with pytest.raises(InvalidMap, match=message):
        load_numpy_map(write(tmp_path, content, "m.npy"))


def test_format_is_detected_by_suffix_or_content(tmp_path):
    plain = np.zeros((2, 3), bool)
    save_nav2_map(OccupancyGrid(plain, 0.1), tmp_path / "m.yaml")
    octile = b"type octile\nheight 2\nwidth 3\nmap\n...\n...\n"
    for name, content in {
        "a.map": octile, "a.octile": octile, "b.npy": npy(plain), "b": npy(plain),
        "c.txt": b"...\n...\n", "c.grid": b"...\n...\n",
        "m.conf": (tmp_path / "m.yaml").read_bytes(),
    }.items():  # fmt: skip
        grid = load_map(write(tmp_path, content, name))
        assert grid.occupied.tolist() == plain.tolist()
        assert grid.resolution == (0.1 if name == "m.conf" else 1.0)
    assert load_map(tmp_path / "a.octile", resolution=0.2).resolution == 0.2
    assert load_map(tmp_path / "m.yaml").resolution == 0.1


def test_treatment_of_unknown_cells(tmp_path):
    for name, content in {"m.txt": b"?\n", "m.npy": npy(np.array([[-1]]))}.items():
        path = write(tmp_path, content, name)
        assert load_map(path).occupied.all()
        assert not load_map(path, unknown="free").occupied.any()
    path = shared("maps/nav2/tb3_sandbox.yaml")
    assert load_map(path, unknown="free").occupied.sum() < load_map(path).occupied.sum()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("m.pgm", b"P5 1 1 255 x", r"is an image, .* load the YAML file .*\(m.yaml\)"),
        ("m.dat", b"\x89PNG\r\n", "is an image"),
        ("m.dat", b"\xff\xd8\xff", r"is not a map: need a Nav2 map \(.yaml\), a MovingAI map"),
        ("m.dat", b"", "is not a map"),
        ("m.yaml", b"image: x", "m.yaml does not set"),
    ],
)
def test_file_that_is_not_a_map_is_rejected(tmp_path, name, content, message):
    with pytest.raises(InvalidMap, match=message):
        load_map(write(tmp_path, content, name))


@pytest.mark.parametrize("name", ["m.txt", "m.npy", "m.map", "m", "m.yaml"])
def test_path_that_is_not_a_file_is_rejected(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(InvalidMap, match="it is not a file"):
        load_map(tmp_path / name)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / name).mkdir()
    with pytest.raises(InvalidMap, match="it is not a file"):
        load_map(tmp_path / "folder" / name)
    with pytest.raises(InvalidMap, match="No such file"):
        load_map(tmp_path / "absent" / name)
    with pytest.raises(InvalidMap, match="null byte"):
        load_map(tmp_path / ("\0" + name))


@pytest.mark.parametrize("resolution", [0.0, -1.0, 1e-9, 1e6, np.nan, np.inf])
@pytest.mark.parametrize("name", ["m.txt", "m.npy", "m.map"])
def test_resolution_out_of_range_is_rejected(tmp_path, name, resolution):
    with pytest.raises(InvalidMap, match=r"m per cell, need 0\.001 to 10 m per cell"):
        load_map(tmp_path / name, resolution=resolution)


def test_second_resolution_is_rejected(tmp_path):
    save_nav2_map(paper_map(), tmp_path / "m.yaml")
    with pytest.raises(InvalidMap, match="states its own resolution"):
        load_map(tmp_path / "m.yaml", resolution=0.1)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("m.npy", header("{'descr': '<f8', 'fortran_order': False, 'shape': (7000, 7000), }")),
        ("m.map", b"type octile\nheight 7000\nwidth 7000\nmap\n...\n"),
        ("m.map", b"type octile\nheight 20000\nwidth 20000\nmap\n...\n"),
    ],
)
def test_header_alone_allocates_no_map(tmp_path, name, content):
    """The stated size is checked before allocation; the read buffer dominates the memory."""
    path = write(tmp_path, content, name)
    with allocates_at_most(60e6), pytest.raises(InvalidMap):
        load_map(path)


SEEDS = [
    npy(np.eye(3)), npy(np.eye(3, dtype=bool)), b"..#\n#..\n",
    b"type octile\nheight 2\nwidth 3\nmap\n.@G\nSTO\n", b"image: m.pgm\nresolution: 0.1\n",
]  # fmt: skip


@examples(300)
@given(
    content=st.sampled_from(SEEDS), at=st.integers(0, 140), cut=st.integers(0, 9),
    new=st.binary() | st.sampled_from([b"9" * 12, b"\n", b"(", b"'", b"<O", b"\0"]),
    name=st.sampled_from(["m", "m.npy", "m.txt", "m.map", "m.yaml", "m.png"]),
)  # fmt: skip
def test_mutated_files_raise_only_invalid_map(tmp_path_factory, content, at, cut, new, name):
    path = write(tmp_path_factory.mktemp("map"), content[:at] + new + content[at + cut :], name)
    with suppress(InvalidMap):
        load_map(path)
