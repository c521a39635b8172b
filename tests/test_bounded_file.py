"""Bounded reading of files, and one-line texts for messages."""

import os

import pytest

from omnidrive.files.bounded_file import one_line, open_file, read_bounded, read_head, short_repr


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
        ("", "it is not a file"),
        ("pipe", "it is not a file"),
        ("a\0b", "embedded null byte"),
        ("a\nb", "No such file or directory"),
        ("a/b", "Not a directory"),
    ],
)
def test_unreadable_file_gives_a_one_line_error(tmp_path, name, fact):
    (tmp_path / "a").touch()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InvalidPlan) as caught:
        read(tmp_path / name)
    assert str(caught.value).startswith(f"cannot read the plan {tmp_path}")
    assert str(caught.value).endswith(f": {fact}")
    assert "\n" not in str(caught.value)


def test_read_errors_are_converted_and_others_propagate(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(InvalidPlan, match=r"cannot read the plan .*/a: torn"):  # noqa: SIM117
        with open_file(tmp_path / "a", "plan", InvalidPlan):
            raise OSError("torn")
    with pytest.raises(ZeroDivisionError):  # noqa: SIM117
        with open_file(tmp_path / "a", "plan", InvalidPlan):
            raise ZeroDivisionError


def test_text_is_escaped_to_one_line():
    assert one_line("a\nb\x1b") == "a\\nb\\x1b"
    assert one_line("x" * 400, 10) == "xxxxxxx..."
    assert short_repr(["a\n"]) == "['a\\n']"
