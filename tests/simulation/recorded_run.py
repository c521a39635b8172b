"""A run without simulation, whose log has every kind of column."""

import numpy as np

from omnidrive.control.supervision import Event
from omnidrive.simulation import Outcome, Run

ROWS = 7


def recorded_run(outcome=Outcome.FINISHED, *, sigma=True, wheels=4, details=2):
    """Return a run with random numbers in every column, NaN among them."""
    rng = np.random.default_rng(5)

    def block(*shape):
        values = rng.normal(size=(ROWS, *shape))
        values[-1] = np.nan
        return values

    unknown = np.full(ROWS, np.nan)
    return Run(
        t=0.1 * np.arange(ROWS), pose=block(3), measured=block(3),
        position_sigma=block() if sigma else unknown, yaw_sigma=block() if sigma else unknown,
        target=block(3), command=block(3), twist=block(3),
        wheel_speed=block(wheels), wheel_torque=block(wheels),
        saturated=rng.integers(0, 4, ROWS), wheel_speed_command=block(0),
        wheel_torque_command=block(0), work=block(), step_time=block(),
        status=rng.integers(0, 2, ROWS), collisions=np.arange(ROWS), outcome=outcome,
        details={f"kp_{k}": block() for k in range(details)},
        detail_units={f"kp_{k}": "1/s" for k in range(details)},
        events=(Event(0.1, "wheel 1 locked"), Event(0.30000000000000004, "locked | \u00fcber")),
        reason="" if outcome is Outcome.FINISHED else "no solution", traceback="",
    )  # fmt: skip
