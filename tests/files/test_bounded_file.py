"""Bounded reading of files."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from omnidrive.files.bounded_file import open_file, read_bounded, read_head
from tests.memory import allocates_at_most


class InvalidPlan(ValueError):
    pass


def read(path, most=4):
    return read_bounded(path, most, "plan", InvalidPlan, excess="is too large")


def test_file_is_read_up_to_the_limit(tmp_path):
    file = tmp_path / "a"
    file.write_bytes(b"1234")
    assert read(file) == b"1234"
    assert read_head(file, 2, "plan", InvalidPlan) == b"12"
    with pytest.raises(InvalidPlan, match=r"^[^ ]*/a is too large$"):
        read(file, 3)


@pytest.mark.parametrize(
    ("name", "fact"),
    [
        ("none", "No such file or directory"),
        ("", "it is not a file but a folder"),
        ("pipe", "it is not a file but a pipe; save its content to a file first"),
        ("socket", "it is not a file but a socket"),
        ("null", "it is not a file but a device"),
        ("a\0b", "embedded null byte"),
        ("a\nb", "No such file or directory"),
        ("a/b", "Not a directory"),
    ],
)
def test_unreadable_file_gives_a_one_line_error(tmp_path, monkeypatch, name, fact):
    (tmp_path / "a").touch()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "null").symlink_to("/dev/null")
    monkeypatch.chdir(tmp_path)  # the path of a socket is short
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
    with pytest.raises(InvalidPlan) as caught:
        read(tmp_path / name)
    assert str(caught.value).startswith(f"cannot read the plan {tmp_path}")
    assert str(caught.value).endswith(f": {fact}")
    assert "\n" not in str(caught.value)


def test_file_replaced_by_a_pipe_before_it_is_opened(tmp_path, monkeypatch):
    """To open a pipe without a writer would wait for ever."""
    (tmp_path / "a").touch()
    os.mkfifo(tmp_path / "pipe")
    status = (tmp_path / "a").stat()
    monkeypatch.setattr(Path, "stat", lambda _: status)
    with pytest.raises(InvalidPlan, match="it is not a file but a pipe"):
        read(tmp_path / "pipe")


def test_standard_input_is_read_if_it_is_a_file(tmp_path):
    code = (
        "from pathlib import Path; from omnidrive.files.bounded_file import read_head;"
        "print(read_head(Path('/dev/stdin'), 4, 'plan', ValueError))"
    )
    (tmp_path / "a").write_text("1234")
    with (tmp_path / "a").open() as file:
        done = subprocess.run(
            [sys.executable, "-c", code], stdin=file, capture_output=True, check=False
        )
    assert done.stdout == b"b'1234'\n"
    done = subprocess.run(
        [sys.executable, "-c", code], input=b"1234", capture_output=True, check=False
    )
    assert b"cannot read the plan /dev/stdin: it is not a file but a pipe" in done.stderr


def test_memory_of_a_read_is_that_of_the_file(tmp_path):
    (tmp_path / "a").write_bytes(bytes(300_000))
    with allocates_at_most(1e6), open_file(tmp_path / "a", "plan", InvalidPlan) as file:
        assert len(file.read(100_000)) == 100_000
        assert len(file.read(0xEFFF_FFFF)) == 200_000
        assert file.read(0xEFFF_FFFF) == b""


def test_read_errors_are_converted_and_others_propagate(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(InvalidPlan, match=r"cannot read the plan .*/a: torn"):  # noqa: SIM117
        with open_file(tmp_path / "a", "plan", InvalidPlan):
            raise OSError("torn")
    with pytest.raises(ZeroDivisionError):  # noqa: SIM117
        with open_file(tmp_path / "a", "plan", InvalidPlan):
            raise ZeroDivisionError
