"""Storms of bad readings: the estimates stay finite and valid, and recover from good readings."""

import subprocess
import sys

import pytest

from omnidrive.estimation import LatestFix
from tests.estimation.storms import survive

SEEDS = (2, 3, 6, 18)


@pytest.mark.parametrize("seed", SEEDS)
def test_estimator_survives_a_storm(seed):
    survive(seed)


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_latest_fix_survives_a_storm(seed):
    survive(seed, LatestFix())


@pytest.mark.long
def test_estimators_survive_a_thousand_storms():
    """Without run-time type checks; the option -s of pytest prints the longest update."""
    command = [sys.executable, "-W", "error", "-m", "tests.estimation.storms", "1000"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=3600)
    assert done.returncode == 0, done.stderr
    print(f"\n{done.stdout}")
