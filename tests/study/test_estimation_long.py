"""Errors with the estimator in the task `noise` on a physical plant, 20 seeds."""

import numpy as np
import pytest

from omnidrive.estimation import PoseFixSettings
from omnidrive.evaluation import measure
from omnidrive.scenario import (
    RunSettings,
    SensorsSection,
    paper_scenario,
    plan_and_check,
    simulate_run,
)
from omnidrive.simulation import Outcome

pytestmark = pytest.mark.long

SEEDS = 20
FIXES = {
    "the paper's noise": (PoseFixSettings(), 0.006, 0.006),
    "delay, dropouts, outliers": (
        PoseFixSettings(latency=0.1, dropout=0.2, outliers=0.01, outlier_size=1.0), 0.020, 0.006
    ),
}  # fmt: skip
"""Settings of the fixes, and the largest allowed means of ME (m) and MAE (rad)."""


@pytest.mark.parametrize("name", FIXES)
def test_true_errors_with_the_estimator_over_twenty_seeds(name):
    """The option -s of pytest prints the table of decision 0009."""
    fixes, me, mae = FIXES[name]
    scenario = paper_scenario().model_copy(update={"sensors": SensorsSection(fixes=fixes)})
    planned = plan_and_check(scenario)
    rows = []
    for repeat in range(SEEDS):
        run = simulate_run(planned, RunSettings("noise", "holonomic-nmpc", 30.0, 15, repeat))
        assert run.outcome is Outcome.FINISHED
        estimation_error = np.hypot(*(run.pose - run.measured)[:, :2].T)
        m = measure(run, planned.robot.drive)
        rows.append((m.me, m.mae, m.max_error, estimation_error.mean(), estimation_error[-1]))
    found = np.array(rows)
    mean, worst = found.mean(axis=0), found.max(axis=0)
    print(f"\n{name}, {SEEDS} seeds: mean and worst run")
    for i, row in enumerate(("ME (m)", "MAE (rad)", "largest error (m)", "estimation error (m)")):
        print(f"{row:20} {mean[i]:.4f} {worst[i]:.4f}")
    assert mean[0] <= me
    assert mean[1] <= mae
    assert worst[2] < 0.2  # no lost run: the start from rest alone causes 0.11 m
