"""Independent reference data beside the repository; tests that need it skip where it is absent."""

from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


def shared(name):
    """Path of one file of the reference data."""
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"the reference data {name} is not beside the repository")
    return path


def shared_table(name):
    """One CSV file as an array, without its heading."""
    return np.loadtxt(shared(name), delimiter=",", skiprows=1)
