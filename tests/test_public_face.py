"""Examples, exported names and lock files."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import omnidrive

ROOT = Path(__file__).resolve().parents[1]
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
