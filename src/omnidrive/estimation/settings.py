"""What an estimator takes for granted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from omnidrive.parameter import Bounds


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """What is not in the sensors' data sheets."""

    creep: Annotated[float, Bounds(0.0, 1.0, "m/sqrt(m)")] = 1e-3
    """Standard deviation of a rim's way after 1 m while no slip is suspected; it grows with the
    square root of the way."""
    slip_error: Annotated[float, Bounds(0.0, 10.0, "1")] = 0.2
    """Standard deviation of every rim's slip, as a part of the slip that is expected, root mean
    square of all rims: what is wrong of how the robot is dragged along shows at all of them."""
    slip_doubt: Annotated[float, Bounds(0.0, 100.0, "1")] = 1.5
    """The same of a slip that is not, as a multiple of what redundant wheels and the gyro show of
    it: they do not show slip that looks like a motion."""
    slip_memory: Annotated[float, Bounds(0.001, 60.0, "s")] = 0.05
    """Time constant with which a suspicion of slip fades."""
    false_alarms: Annotated[float, Bounds(1e-9, 0.5, "1")] = 1e-3
    """Share of sound fixes that is not believed."""
    relocate_after: Annotated[int, Bounds(2, 1000, "fixes")] = 5
    """Fixes in a row that are not believed but agree with each other: then the robot must have been
    carried away, and they are believed after all."""
    memory: Annotated[float, Bounds(0.0, 60.0, "s")] = 2.0
    """For how long readings are kept for fixes that come late; older ones are not used."""
    floor: Annotated[float, Bounds(1e-6, 1.0, "m, rad")] = 1e-3
    """Standard deviation that fixes have at least, whatever they say of themselves."""
