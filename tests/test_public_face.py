"""README, examples, exported names and lock files."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import omnidrive
from omnidrive.control.pid import gain_tuning_system
from omnidrive.control.pid.rules import paper_rules
from omnidrive.fuzzy import save
from tests.shared_data import shared

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def run(*args, cwd):
    done = subprocess.run(
        [sys.executable, *map(str, args)],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=400,
        env={**os.environ, "COLUMNS": "150"},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(example, tmp_path):
    assert run(example, cwd=tmp_path).strip()


def test_own_controller_turns_the_shorter_way(tmp_path):
    """To a heading of 6.0 rad, by -0.28 rad."""
    assert "turned by -0.28 rad" in run(ROOT / "examples" / "own_controller.py", cwd=tmp_path)


def test_example_of_wheel_torques_follows_its_reference(tmp_path):
    printed = run(ROOT / "examples" / "wheel_torque_control.py", cwd=tmp_path)
    assert float(re.search(r"mean ([\d.]+) mm", printed)[1]) < 2.0


def test_every_verb_has_an_example():
    assert {"compare", "plan", "run"} <= {path.stem for path in EXAMPLES}


def test_readme_python_code_runs(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert blocks
    for block in blocks:
        assert "Metrics(" in run("-c", block, cwd=tmp_path)


SHELL = "".join(re.findall(r"```sh\n(.*?)```", README, re.DOTALL))
COMMANDS = re.findall(r"^omnidrive (.*?)(?: +#.*)?$", SHELL, re.MULTILINE)


@pytest.mark.parametrize("command", COMMANDS)
def test_readme_commands_run(command, tmp_path):
    """Run a command on a fast plant, with the map and the folder that it names."""
    words = command.split()
    if "depot.yaml" in words:
        words[words.index("depot.yaml")] = str(shared("maps/nav2/depot.yaml"))
    if "runs/NAME/scenario.yaml" in words:
        run("-m", "omnidrive", "plan", "--out", "runs/NAME", cwd=tmp_path)
    if "tuner.fis" in words:
        save(gain_tuning_system(paper_rules()), tmp_path / "tuner.fis")
    plant = "planar" if "--fault" in words else "kinematic"  # simulates no forces
    quick = [] if words[0] in {"plan", "fuzzy", "warmup"} else ["--plant", plant]
    assert run("-m", "omnidrive", *words, *quick, cwd=tmp_path)


def test_readme_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", README, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_public_names_are_listed_and_documented():
    assert set(dir(omnidrive)) == set(omnidrive.__all__)
    for name in omnidrive.__all__:
        getattr(omnidrive, name)  # loads it
    public = {
        name
        for name, value in vars(omnidrive).items()
        if not name.startswith("_") and not isinstance(value, ModuleType)
    }
    assert public == set(omnidrive.__all__)
    assert all((getattr(omnidrive, name).__doc__ or "").strip() for name in omnidrive.__all__)


@pytest.mark.parametrize(
    "name", ["requirements.lock", "requirements-dev.lock", "requirements-docs.lock"]
)
def test_lock_files_have_hashes_and_no_urls(name):
    text = (ROOT / name).read_text()
    assert "://" not in text
    assert "--index-url" not in text
    for requirement in re.split(r"\n(?=\S)", text):
        if not requirement.startswith("#"):
            assert re.match(r"[a-z0-9.\-_\[\]]+==\S+", requirement)
            assert "--hash=sha256:" in requirement
