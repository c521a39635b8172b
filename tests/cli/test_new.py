"""`omnidrive new` and `omnidrive list`: written files run as they are."""

import json
import subprocess
import sys

import pytest

from omnidrive.components import find_component
from omnidrive.scenario import paper_scenario
from omnidrive.study import run_study
from tests.command import omnidrive

RUN_TEST = """
import runpy, sys, pytest
runpy.run_path(sys.argv[1], run_name="__main__")  # as new prints
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", sys.argv[1]]))
"""


@pytest.mark.parametrize("kind", ["controller", pytest.param("plant", marks=pytest.mark.long)])
def test_written_file_runs_passes_its_test_and_is_well_formed(tmp_path, kind):
    name = f"Swift{kind.capitalize()}"
    done = omnidrive("new", kind, name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    file, test = tmp_path / f"swift_{kind}.py", tmp_path / f"test_swift_{kind}.py"
    assert f"My{kind.capitalize()}" not in file.read_text() + test.read_text()
    for command in (
        ("-m", "ruff", "check", "--isolated", "--select", "E,F,B,D1", "--ignore", "D103,D107", "."),
        ("-c", RUN_TEST, test.name),
    ):
        checked = subprocess.run(
            [sys.executable, *command],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert checked.returncode == 0, checked.stdout
    assert checked.stdout.startswith(f"{name} obeys all laws\n")
    assert "1 passed" in checked.stdout
    spec = f"{file}:{name}"
    values = {
        "controller": {"controllers": {"mine": spec}, "plant": "kinematic"},
        "plant": {"controllers": ["feedforward"], "plant": spec},
    }[kind]
    assert find_component(f"{kind}s", spec, allow_code=True).summary.startswith(
        f"{name};"
    )  # whatever it becomes
    tasks = {"track": {"durations": [17.0]}}
    run_study(paper_scenario().with_values(**values, tasks=tasks)).raise_if_failed()


def test_existing_file_is_not_replaced(tmp_path):
    (tmp_path / "law.py").write_text("precious")
    done = omnidrive("new", "controller", "Law", cwd=tmp_path)
    assert (done.returncode, (tmp_path / "law.py").read_text()) == (2, "precious")
    assert "law.py exists already" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("controller", "../x"), "cannot be used as a name"),
        (("controller", "For"), "'for' is a Python keyword or"),
        (("plant", "Random"), "use another name, such as MyRandom"),
        (("robto", "X"), "there is no kind 'robto'"),
        (("robot", "X", "--like", "mecanun"), "did you mean 'mecanum'"),
        (("plant", "X", "--like", "kiwi"), "--like: not for a plant, only for a robot"),
    ],
)
def test_bad_arguments_are_rejected(tmp_path, arguments, message):
    done = omnidrive("new", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())


def test_list_prints_parameters_as_json(tmp_path):
    done = omnidrive("list", "controllers", "--json", cwd=tmp_path)
    records = {record["name"]: record for record in json.loads(done.stdout)}
    parameters = {each["name"]: each for each in records["holonomic-nmpc"]["parameters"]}
    assert parameters["horizon"]["range"] == [1, 200]
    assert parameters["horizon"]["unit"] == "steps"
    assert "null: false with an estimator" in parameters["may_spin"]["description"]
    assert parameters["weights.position_weight"]["default"] == 90.0
    assert records["pid"]["origin"].startswith("omnidrive ")


def test_list_of_an_unknown_group_is_rejected(tmp_path):
    done = omnidrive("list", "controler", cwd=tmp_path)
    assert done.returncode == 2
    assert "did you mean 'controllers'" in " ".join(done.stderr.split())


def test_written_robot_is_used(tmp_path):
    assert omnidrive("new", "robot", "MyBase", cwd=tmp_path).returncode == 0
    shown = omnidrive("robot", "show", "my_base.yaml", cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    assert "my_base" in shown.stdout


def test_robot_file_says_which_robot_it_copies(tmp_path):
    for name, like, wheels in (("a", [], "small, which has 4 omni"),
                               ("b", ["--like", "mecanum"], "mecanum, which has 4 mecanum"),
                               ("c", ["--like", "kiwi"], "kiwi, which has 3 omni")):  # fmt: skip
        assert omnidrive("new", "robot", name, *like, cwd=tmp_path).returncode == 0
        head = (tmp_path / f"{name}.yaml").read_text().split("format:")[0]
        assert f"A copy of the robot {wheels} wheels" in head
        assert "omnidrive robot import" in head
        assert "docs/robots.md" in head
