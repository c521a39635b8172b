"""Compiled kernels: kept on disk, and renewed when any source changes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import omnidrive

PROGRAM = """
import numpy as np
from omnidrive.fuzzy import FuzzySet, Membership
from omnidrive.fuzzy.sets import membership_bounds
print(membership_bounds([FuzzySet("low", Membership("trimf", (0.0, 1.0, 2.0)))], np.array([0.4])))
"""


def test_an_edited_callee_is_compiled_anew(tmp_path):
    """The kernel that calls it stands in another file, which does not change."""
    shutil.copytree(
        Path(omnidrive.__file__).parent,
        tmp_path / "omnidrive",
        ignore=shutil.ignore_patterns("__pycache__"),
    )

    def run():
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout

    before = run()
    assert run() == before
    callee = tmp_path / "omnidrive" / "fuzzy" / "membership.py"
    text = callee.read_text()
    edited = text.replace("return (x - p) / (q - p)", "return 0.5 * (x - p) / (q - p)")
    assert edited != text
    callee.write_text(edited)
    assert run() != before
