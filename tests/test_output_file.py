"""Output files: complete or absent, and one-line errors."""

from contextlib import suppress

import pytest

from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.files.output_file import output_file


def test_file_is_replaced_only_if_the_block_succeeds(tmp_path):
    path = tmp_path / "a"
    path.write_text("old")
    with suppress(InvalidInput), output_file(path) as part:
        part.write_text("ne")
        raise InvalidInput("line 7")
    assert path.read_text() == "old"
    with output_file(path) as part:
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["no/a", "folder", "a\0b", ".", "x" * 300, "a\ud800"])
def test_path_that_cannot_be_written(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(CannotWrite, match=r"cannot write to .*; choose another path") as caught:  # noqa: SIM117
        with output_file(type(tmp_path)(name)) as part:
            part.write_text("new")
    assert str(caught.value).isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]
