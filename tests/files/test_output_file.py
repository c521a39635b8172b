"""Output files: complete or absent, and one-line errors."""

import errno
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.evaluation.figures import save as save_figure
from omnidrive.evaluation.tables.table import Table
from omnidrive.evaluation.tables.table_files import write_tables
from omnidrive.files.output_file import output_file
from omnidrive.maps import paper_map, save_nav2_map
from omnidrive.planning import Path as PosePath
from omnidrive.reference.waypoints import save_waypoints
from omnidrive.robot import named_robot, save_robot
from omnidrive.scenario import paper_scenario, save_scenario
from omnidrive.study import RunFolder
from tests.files.power_failure import TORN, contents_after_failure, recorded_disk
from tests.simulation.recorded_run import recorded_run


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
        with output_file(Path(name)) as part:
            part.write_text("new")
    assert str(caught.value).isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


PATH = PosePath(np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.2], [2.0, 0.5, 0.4]]))
TABLE = Table("t", ("a",), (("1",),))
WRITERS = {
    "map.yaml": lambda path: save_nav2_map(paper_map(), path),
    "robot.yaml": lambda path: save_robot(named_robot("small"), path),
    "scenario.yaml": lambda path: save_scenario(paper_scenario(), path),
    "path.csv": lambda path: save_waypoints(path, PATH),
    "path.yaml": lambda path: save_waypoints(path, PATH),
    "log.csv": recorded_run().save,
    "log.parquet": recorded_run().save,
    "figure.png": lambda path: save_figure(Figure(), path),
    "t.csv": lambda path: list(write_tables([TABLE], path.parent)),
}


@pytest.mark.parametrize("old", [None, b"old"])
@pytest.mark.parametrize("name", WRITERS)
def test_file_is_whole_or_as_before_after_a_power_failure(tmp_path, monkeypatch, name, old):
    if old is not None:
        (tmp_path / name).write_bytes(old)
    with recorded_disk(monkeypatch) as events:
        WRITERS[name](tmp_path / name)
    for path in tmp_path.iterdir():
        before = old if path.name == name else None
        during, after = contents_after_failure(events, path.name, before)
        assert after == {path.read_bytes()}
        assert during == {before, path.read_bytes()}


def test_what_a_power_failure_does_to_other_writers(tmp_path, monkeypatch):
    """The simulation finds what is wrong with a writer that forgets a step."""

    def write(*steps):
        """Write a file with some of the steps and return what may be there during and after."""
        path, part = tmp_path / "a", tmp_path / "part"
        with recorded_disk(monkeypatch) as events:
            part.write_bytes(b"new")
            for step in steps:
                if step == "rename":
                    os.replace(part, path)
                else:
                    descriptor = os.open({"file": part, "folder": tmp_path}[step], os.O_RDONLY)
                    os.fsync(descriptor)
                    os.close(descriptor)
        return contents_after_failure(events, "a", b"old")

    assert write("file", "rename", "folder") == ({b"old", b"new"}, {b"new"})
    assert write("rename", "folder") == ({b"old", TORN}, {TORN})
    assert write("file", "rename") == ({b"old", b"new"}, {b"old", b"new"})
    assert write("rename") == ({b"old", TORN}, {b"old", TORN})
    assert write("file") == ({b"old"}, {b"old"})


def fail_to_synchronise(monkeypatch, number):
    """Let os.fsync fail with the number of an error."""

    def fail(descriptor):
        """Raise the error."""
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fail)


def test_file_system_that_cannot_synchronise_folders(tmp_path, monkeypatch):
    fail_to_synchronise(monkeypatch, errno.EINVAL)
    with output_file(tmp_path / "a") as part:
        part.write_text("new")
    assert (tmp_path / "a").read_text() == "new"


def test_disk_that_fails_late_is_reported(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("old")
    fail_to_synchronise(monkeypatch, errno.ENOSPC)
    with pytest.raises(CannotWrite, match=r"cannot write to .*a: No space left"):  # noqa: SIM117
        with output_file(tmp_path / "a") as part:
            part.write_text("new")
    assert (tmp_path / "a").read_text() == "old"
    assert os.listdir(tmp_path) == ["a"]


def test_files_of_killed_processes_are_removed(tmp_path):
    code = (
        "import os, sys; from pathlib import Path\n"
        "from omnidrive.files.output_file import output_file\n"
        "with output_file(Path(sys.argv[1])) as part:\n"
        "    part.touch(); os.kill(os.getpid(), 9)"
    )
    series = tmp_path / "killed" / "series"
    series.mkdir(parents=True)
    subprocess.run([sys.executable, "-c", code, str(series / "a")], check=False)
    (abandoned,) = series.iterdir()
    others = [series / name for name in (".a.part", "a.part", ".a.00000000-1-2.part")]
    for path in others:
        path.touch()
    (tmp_path / "done").mkdir()
    (tmp_path / "done" / "report.html").touch()
    shutil.copy(abandoned, tmp_path / "done")
    with output_file(series / "b") as part:
        part.touch()
        RunFolder(tmp_path / "next", numbered=True)
        assert sorted(series.iterdir()) == sorted([part, *others])
    assert len(list((tmp_path / "done").iterdir())) == 2  # finished folders are not searched
