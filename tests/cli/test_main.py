"""Verbs of the command: lazy imports and consistent help texts."""

import subprocess
import sys

import pytest

from omnidrive.cli.main import VERBS, load_verb

HEAVY = (
    "numba", "numpy", "scipy", "mujoco", "matplotlib", "pyarrow", "yaml", "jaxtyping",
    "omnidrive.scenario.scenario",
)  # fmt: skip
"""Modules that take long to import; typer itself imports pydantic."""
SUBVERBS = [
    [name, *([each] if each else [])]
    for name in VERBS
    for each in ("", *getattr(load_verb(name), "commands", ()))
]


@pytest.mark.parametrize("verb", VERBS)
def test_verb_list_matches_verb_help(verb):
    assert load_verb(verb).help.splitlines()[0] == VERBS[verb]


HELP = f"""
import sys
from omnidrive.cli import main
for verb in {[[], *SUBVERBS]}:
    sys.argv = ["omnidrive", *verb, "--help"]
    try:
        main()
    except SystemExit as ended:
        found = [name for name in {HEAVY} if name in sys.modules]
        print("HEAVY" if found else "light", ended.code, *verb, *found)
"""


def test_help_of_no_verb_imports_heavy_packages():
    done = subprocess.run(
        [sys.executable, "-c", HELP], capture_output=True, text=True, check=False, timeout=300
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith(("HEAVY", "light"))]
    assert lines == ["light 0", *(" ".join(["light", "0", *verb]) for verb in SUBVERBS)]
    assert all(verb in done.stdout for verb in VERBS)


def test_report_of_a_study_imports_no_physics_engine():
    code = (
        "import sys, omnidrive.cli.progress, omnidrive.study.stored_study; "
        "print('mujoco' in sys.modules)"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout == "False\n"


@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&1", "<&- >&- 2>&-"])
def test_closed_streams_do_not_change_the_status(closed):
    """The shell closes a standard stream of the command."""
    command = ["sh", "-c", f'exec "$0" -m omnidrive list controler {closed}', sys.executable]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "")
