"""Errors of a drive, as numbers and as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from omnidrive.simulation import Run


def drive_errors(run: Run) -> dict[str, float]:
    """Return the mean and the largest position error, m, and the mean heading error, rad."""
    from omnidrive.evaluation.measures.metrics import heading_error, position_error

    distance = position_error(run.pose, run.target)
    return {
        "me_m": float(distance.mean()),
        "mae_rad": float(abs(heading_error(run.pose, run.target)).mean()),
        "max_error_m": float(distance.max()),
    }


def tracking_error(run: Run) -> str:
    """Return the errors of a drive as one line."""
    errors = drive_errors(run)
    return (
        f"estimated tracking error over {run.t[-1]:g} s: ME {1e3 * errors['me_m']:.2f} mm, "
        f"MAE {1e3 * errors['mae_rad']:.2f} mrad, largest {1e3 * errors['max_error_m']:.2f} mm"
    )
