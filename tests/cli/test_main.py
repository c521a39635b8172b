"""Verbs of the command: lazy imports and consistent help texts."""

import subprocess
import sys

import pytest

from omnidrive.cli.main import VERBS, load_verb

HEAVY = ("numba", "numpy", "scipy", "mujoco", "matplotlib", "pydantic")


@pytest.mark.parametrize("verb", VERBS)
def test_verb_list_matches_verb_help(verb):
    assert load_verb(verb).help.splitlines()[0] == VERBS[verb]


def test_help_imports_no_heavy_packages():
    code = (
        "import sys; sys.argv = ['omnidrive', '--help']\n"
        "from omnidrive.cli import main\n"
        "try: main()\n"
        f"finally: print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(verb in done.stdout for verb in VERBS)
