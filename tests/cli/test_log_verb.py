"""`omnidrive log`: what a log holds, as text, JSON, figure and table."""

import json

import numpy as np
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from omnidrive.deploy import DriveControls
from omnidrive.deploy.log import read_log
from omnidrive.evaluation.measures.metrics import heading_error
from tests.command import omnidrive
from tests.deploy.test_drive_log import held_and_armed, logged


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a log of a drive that was held once, and the result of the drive."""
    made = tmp_path_factory.mktemp("log")
    controls = DriveControls(arm=True)
    result, _ = logged(made / "log.mcap", held_and_armed(controls), controls)
    content = (made / "log.mcap").read_bytes()
    (made / "cut.mcap").write_bytes(content[: len(content) * 3 // 4])
    return made, result


def test_show_tells_states_errors_and_punctuality(folder):
    made, result = folder
    done = omnidrive("log", "show", "log.mcap", "--png", "a.png", cwd=made)
    assert done.returncode == 0, done.stderr
    for change in result.changes:
        assert f"{change.t:8.3f} s  {change.state.value:<8} {change.reason}\n" in done.stdout
    assert "robot               small\n" in done.stdout
    assert "66 at 20 Hz" in done.stdout
    assert "estimated tracking error over 2.55 s" in done.stdout
    assert "missed 0 deadlines" in done.stdout
    assert (made / "a.png").read_bytes().startswith(b"\x89PNG")


def test_run_folder_stands_for_its_log(folder):
    made, result = folder
    shown = omnidrive("log", "show", ".", cwd=made)
    assert shown.stdout == omnidrive("log", "show", "log.mcap", cwd=made).stdout
    compared = omnidrive("log", "compare", ".", "log.mcap", "--json", cwd=made)
    assert compared.returncode == 0, compared.stderr
    identified = omnidrive("robot", "identify", ".", "--robot", "small", "--json", cwd=made)
    assert json.loads(identified.stdout)["wheel radius"]["reason"].startswith("the log has ")
    assert result.log.paths[0].name == "log.mcap"


def test_folder_without_the_log_of_a_run_names_its_logs(folder, tmp_path):
    made, _ = folder
    done = omnidrive("log", "show", ".", cwd=tmp_path)
    assert done.returncode == 2
    assert "has no log.mcap\n" in done.stderr
    for name in ("drive-0001", "drive-0002-0000", "drive-0002-0001"):
        (tmp_path / f"{name}.mcap").write_bytes((made / "log.mcap").read_bytes())
    done = omnidrive("log", "replay", ".", cwd=tmp_path)
    assert done.returncode == 2
    names = "drive-0001.mcap, drive-0002-0000.mcap"
    assert f"has no log.mcap; name one of its logs: {names}\n" in done.stderr


@pytest.mark.parametrize("names", [["drive-0001"], ["drive-0001-0000", "drive-0001-0001"]])
def test_folder_of_one_drive_stands_for_its_log(folder, tmp_path, names):
    made, _ = folder
    for name in names:
        (tmp_path / f"{name}.mcap").write_bytes((made / "log.mcap").read_bytes())
    assert read_log(tmp_path).paths == (tmp_path / f"{names[0]}.mcap",)


def test_show_prints_json(folder):
    made, result = folder
    done = omnidrive("log", "show", "log.mcap", "--json", cwd=made)
    data = json.loads(done.stdout)
    assert [each["reason"] for each in data["states"]] == [c.reason for c in result.changes]
    assert data["complete"] is True
    assert data["samples"] == result.log.samples
    error = np.hypot(*(result.run.pose - result.run.target)[:, :2].T)
    assert data["me_m"] == pytest.approx(error.mean())
    turn = heading_error(result.run.pose, result.run.target)
    assert turn.min() < 0.0 < turn.max()
    assert data["mae_rad"] == pytest.approx(np.abs(turn).mean())


def test_table_has_the_columns_of_a_run_folder(folder):
    made, result = folder
    for suffix, read in ((".parquet", pq.read_table), (".csv", pyarrow.csv.read_csv)):
        name = f"drive{suffix}"
        done = omnidrive("log", "export", "log.mcap", "--out", name, cwd=made)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        table = read(made / name)
        assert table.column_names == [column.name for column in result.run.columns]
        for column in result.run.columns:
            values = table[column.name].to_numpy()
            if suffix == ".parquet":
                unit = table.schema.field(column.name).metadata[b"unit"].decode()
                assert unit == column.unit
                np.testing.assert_array_equal(values, column.values)
    again = omnidrive("log", "export", "log.mcap", "--out", "drive.csv", cwd=made)
    assert again.returncode == 2
    assert "add --force" in again.stderr


def test_logs_without_end_are_shown_up_to_there(folder):
    made, _ = folder
    done = omnidrive("log", "show", "cut.mcap", cwd=made)
    if done.returncode:  # the only chunk is cut
        pytest.fail(done.stderr)
    assert "missing: the process was killed, or the disk was full" in done.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["show", "missing.mcap"], "cannot read the log missing.mcap: No such file"),
        (["show", "log.mcap", "--png", "a.gif"], "a.gif"),
        (["export", "log.mcap", "--out", "a.xlsx"], "one of .csv, .parquet"),
        (["show", "a.txt"], "a.txt is not an MCAP file"),
    ],
)
def test_bad_input_is_one_line(folder, words, message):
    made, _ = folder
    (made / "a.txt").write_text("no log", encoding="utf-8")
    done = omnidrive("log", *words, cwd=made)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
