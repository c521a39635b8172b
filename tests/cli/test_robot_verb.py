"""The verb robot: show, import and identify."""

import json

import pytest
from typer.testing import CliRunner

from omnidrive.cli.robots.robot import robot
from omnidrive.errors import CannotWrite, InvalidInput, InvalidRobot
from omnidrive.robot import load_robot, named_robot, save_robot
from tests.robot.descriptions import mecanum_urdf

STANDSTILL = "t,command_vx,command_vy,command_yaw_rate,x,y,yaw\n" + "".join(
    f"{0.1 * k},0,0,0,0,0,0\n" for k in range(30)
)
"""Log of a robot that does not move."""


def run(*args):
    done = CliRunner().invoke(robot, [str(arg) for arg in args], catch_exceptions=False,
                              env={"COLUMNS": "160"})  # fmt: skip
    assert done.exit_code == 0, done.output
    return done.output


def test_show_prints_and_draws(tmp_path):
    text = run("show", "mecanum", "--png", tmp_path / "m.png")
    for part in ("Robot mecanum", "wheel matrix", "condition", "dead wheel"):
        assert part in text
    assert "warning" not in text
    assert (tmp_path / "m.png").read_bytes()[:4] == b"\x89PNG"
    assert "no longer omnidirectional" in run("show", "kiwi")


def test_import_writes_a_file_that_can_be_shown_and_names_what_is_unknown(tmp_path):
    (tmp_path / "base.urdf").write_text(mecanum_urdf())
    text = run("import", tmp_path / "base.urdf", "--out", tmp_path / "base.yaml")
    kinds = {line.split()[0] for line in text.splitlines()}
    assert {"read", "guessed", "missing", "written"} <= kinds
    content = (tmp_path / "base.yaml").read_text()
    assert content.startswith("# Imported from base.urdf.\n# guessed: ")
    assert "# missing: friction: 0.8 (typical)" in content
    assert load_robot(tmp_path / "base.yaml").name == "my_base"
    assert "Robot my_base" in run("show", tmp_path / "base.yaml")


@pytest.mark.parametrize(
    ("args", "keys"),
    [
        (["show", "kiwi"], {"name", "wheel_matrix", "speed", "acceleration_without_wheel"}),
        (["import", "base.urdf"], {"read", "guessed", "missing"}),
        (["identify", "drive.csv", "--robot", "kiwi"], {"wheel radius", "friction", "delay"}),
    ],
)
def test_json(tmp_path, monkeypatch, args, keys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base.urdf").write_text(mecanum_urdf())
    (tmp_path / "drive.csv").write_text(STANDSTILL)
    done = CliRunner().invoke(robot, [*args, "--json"], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert keys <= json.loads(done.stdout).keys()


def test_import_without_out_says_that_nothing_is_written(tmp_path):
    (tmp_path / "base.urdf").write_text(mecanum_urdf())
    assert run("import", tmp_path / "base.urdf").endswith("\nnot written; use --out FILE.yaml\n")


def test_a_robot_file_is_not_imported(tmp_path):
    save_robot(named_robot("kiwi"), tmp_path / "base.yaml")
    with pytest.raises(InvalidRobot, match=r"base.yaml is a robot file already; use --robot"):
        run("import", tmp_path / "base.yaml")


def test_identify_prints_estimates_or_reasons_and_writes_a_file(tmp_path):
    (tmp_path / "drive.csv").write_text(STANDSTILL)
    out = tmp_path / "found.yaml"
    text = run("identify", tmp_path / "drive.csv", "--robot", "kiwi", "--out", out)
    assert text.count("not identifiable: ") == 6
    assert "wheel radius         not identifiable: the log has no wheel speeds" in text
    assert load_robot(out) == named_robot("kiwi")
    assert "# wheel radius: not identifiable" in out.read_text()


@pytest.mark.parametrize(
    ("args", "error", "message"),
    [
        (["show", "mecanun"], InvalidInput, "there is no robot 'mecanun'"),
        (["show", "none.yaml"], InvalidRobot, "cannot read the robot file none.yaml"),
        (["show", "kiwi", "--png", "a.jpg"], InvalidInput, "must be .png or .svg"),
        (["identify", "none.csv", "--robot", "kiwi"], InvalidInput, "cannot read the log none.csv"),
        (["import", "none.urdf"], InvalidRobot, "cannot read the robot description none.urdf"),
        (["import", "BASE", "--out", "a.txt"], InvalidInput, "suffix of a robot file is .yaml"),
        (["import", "BASE", "--out", "BASE.yaml"], CannotWrite, "already exists; .* --force"),
    ],
)
def test_bad_input_is_refused(tmp_path, monkeypatch, args, error, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "BASE").write_text(mecanum_urdf())
    (tmp_path / "BASE.yaml").write_text("")
    with pytest.raises(error, match=message):
        CliRunner().invoke(robot, args, catch_exceptions=False)
