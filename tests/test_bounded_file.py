"""Files within a bound, and text from them on one line."""

import os

import pytest

from omnidrive.files.bounded_file import one_line, open_file, read_bounded, read_head, short_repr


class Refused(ValueError):
    pass


def read(path, most=4):
    return read_bounded(path, most, "plan", Refused, excess="is too large")


def test_a_file_is_read_up_to_its_bound(tmp_path):
    file = tmp_path / "a"
    file.write_bytes(b"1234")
    assert read(file) == b"1234"
    assert read_head(file, 2, "plan", Refused) == b"12"
    with pytest.raises(Refused, match=r"^[^ ]*/a is too large$"):
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
def test_what_cannot_be_read_is_refused_in_one_line(tmp_path, name, fact):
    (tmp_path / "a").touch()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(Refused) as refused:
        read(tmp_path / name)
    assert str(refused.value).startswith(f"cannot read the plan {tmp_path}")
    assert str(refused.value).endswith(f": {fact}")
    assert "\n" not in str(refused.value)


def test_errors_of_reading_are_refused_and_others_are_left_alone(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(Refused, match=r"cannot read the plan .*/a: torn"):  # noqa: SIM117
        with open_file(tmp_path / "a", "plan", Refused):
            raise OSError("torn")
    with pytest.raises(ZeroDivisionError):  # noqa: SIM117
        with open_file(tmp_path / "a", "plan", Refused):
            raise ZeroDivisionError


def test_text_is_shown_on_one_line():
    assert one_line("a\nb\x1b") == "a\\nb\\x1b"
    assert one_line("x" * 400, 10) == "xxxxxxx..."
    assert short_repr(["a\n"]) == "['a\\n']"
