"""Reference data in a folder next to the repository; tests are skipped if it is missing."""

from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


def shared(name):
    """Return the path of a file of the reference data, or skip the test."""
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"the reference data {name} does not exist")
    return path


def shared_table(name):
    """Return a CSV file as an array, without its header."""
    return np.loadtxt(shared(name), delimiter=",", skiprows=1)
