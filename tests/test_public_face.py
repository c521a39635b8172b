"""Examples, exported names and lock files."""

import json
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


LONG = {"compare", "film", "learn"}
RUN_ALL = """
import contextlib, io, json, pathlib, runpy, sys, traceback
printed = {}
for path in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()) as text:
        try:
            runpy.run_path(path, run_name="__main__")
        except Exception:
            traceback.print_exc(file=sys.stdout)
    printed[pathlib.Path(path).stem] = text.getvalue()
print(json.dumps(printed))
"""


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


@pytest.mark.long
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs_in_a_process_of_its_own(example, tmp_path):
    assert run(example, cwd=tmp_path).strip()


def test_short_examples_run(tmp_path):
    """In one process: to import the package takes longer than most of them."""
    short = [path for path in EXAMPLES if path.stem not in LONG]
    printed = json.loads(run("-c", RUN_ALL, *short, cwd=tmp_path))
    assert len(printed) == len(short) >= 4
    for name, text in printed.items():
        assert text.strip(), name
        assert "Traceback" not in text, text
    # to a heading of 6.0 rad, the shorter way
    assert "turned by -0.28 rad" in printed["own_controller"]
    error = re.search(r"mean ([\d.]+) mm", printed["wheel_torque_control"])
    assert float(error[1]) < 2.0


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
