"""Settings of the pose estimator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from omnidrive.parameter import Bounds


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """Parameters of the filter that are not in the sensors' data sheets."""

    creep: Annotated[float, Bounds(0.0, 1.0, "m/sqrt(m)")] = 1e-4
    """Standard deviation of a rim's displacement per square root of its length, without slip and
    without the motion of the contacts."""
    slip_error: Annotated[float, Bounds(0.0, 10.0, "1")] = 0.2
    """Standard deviation of every rim's slip, as a share of the root mean square of the predicted
    slip of all rims: an error of the predicted body motion changes the slip of all of them."""
    slip_doubt: Annotated[float, Bounds(0.0, 100.0, "1")] = 1.5
    """Standard deviation of slip beyond the prediction, as a multiple of the residual between
    redundant wheels and the gyro; above 1 because slip that equals a rigid motion leaves no
    residual."""
    slip_memory: Annotated[float, Bounds(0.001, 60.0, "s")] = 0.05
    """Time constant with which detected excess slip decays."""
    false_alarms: Annotated[float, Bounds(1e-9, 0.5, "1")] = 1e-3
    """Share of valid fixes that the innovation gate rejects."""
    relocate_after: Annotated[int, Bounds(2, 1000, "fixes")] = 5
    """Number of consecutive rejected fixes that are consistent with each other after which the
    robot is taken to have been moved, and the fixes are accepted."""
    restart_after: Annotated[int, Bounds(2, 1000, "fixes")] = 15
    """Number of consecutive rejected fixes, at positions that the robot can reach from one to the
    next, after which the pose is taken to be lost: the filter starts anew at the next fix."""
    time_jump: Annotated[float, Bounds(0.01, 5.0, "s")] = 2.0
    """Longest time between readings. After a longer one, or when the time goes back, the clock is
    taken to have jumped: the filter starts anew at the next fix."""
    memory: Annotated[float, Bounds(0.0, 60.0, "s")] = 2.0
    """Time for which readings are stored for late fixes, at most 200 readings and fixes; a fix with
    an older stamp is rejected."""
    floor: Annotated[float, Bounds(1e-6, 1.0, "m, rad")] = 1e-3
    """Least standard deviation of a fix; smaller stated ones are replaced by it."""
