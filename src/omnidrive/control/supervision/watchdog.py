"""Watchdog: limits of tracking error and pose uncertainty, beyond which a robot is stopped."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot, inf
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.parameter import Bounds
from omnidrive.robot import Robot

_ROUNDING = 1e-9  # s


class WatchdogLimits(NamedTuple):
    """Limits beyond which a robot is stopped."""

    error: Annotated[float, Bounds(0.01, 1e6, "m")] = 1.5
    """Distance to the reference, in addition to that at the start."""
    position_sigma: Annotated[float, Bounds(1e-3, 1e6, "m")] = 0.5
    """Standard deviation of the estimated position."""
    age: Annotated[float, Bounds(0.01, 1e6, "s")] = 1.5
    """Age of the last pose fix."""
    patience: Annotated[float, Bounds(0.0, 60.0, "s")] = 0.3
    """Time for which a limit must be exceeded before the robot is stopped."""

    @classmethod
    def of(cls, robot: Robot) -> WatchdogLimits:
        """Limits for ``robot``: an error of its body's diameter, but at least 1 m."""
        return cls(error=max(1.0, 2.0 * robot.body_radius))


@dataclass(slots=True)
class Watchdog:
    """Compares the estimated state with the reference and with limits, sample by sample.

    Attributes:
        limits: Limits beyond which the robot is stopped.
    """

    limits: WatchdogLimits
    _at_start: float = field(default=inf, init=False)
    _since: dict[str, float] = field(default_factory=dict, init=False)

    def reset(self) -> None:
        """Start a run; the next check defines the initial error."""
        self._at_start = inf
        self._since.clear()

    def may_stop(
        self,
        positions: Float[Array, "runs samples 2"],
        targets: Float[Array, "samples 2"],
    ) -> Bool[Array, " runs"]:
        """Return whether ``check`` may stop runs; otherwise it does not.

        The estimates have no age and no standard deviations above the limits.

        Args:
            positions: Estimated positions, m.
            targets: Positions of the reference, m.
        """
        error = np.hypot(*np.moveaxis(positions - targets, -1, 0))
        stops: Bool[Array, " runs"] = ~(error <= self.limits.error + error[:, :1]).all(axis=1)
        return stops

    def check(self, t: float, state: State, target: Pose) -> str | None:
        """Return the reason for which the robot must stop at ``t`` (s), or None.

        Args:
            t: Time, s.
            state: Estimate; an unknown covariance exceeds no limit, a pose that is not finite does.
            target: Reference pose.
        """
        pose, sigma, age = state.pose, state.position_sigma, state.fix_age
        error = hypot(pose.x - target.x, pose.y - target.y)
        if self._at_start == inf:
            self._at_start = error
        limits = self.limits
        allowed = limits.error + self._at_start
        exceeded = {
            "error": not error <= allowed,  # also if it is NaN
            "position_sigma": sigma > limits.position_sigma,
            "age": age > limits.age + _ROUNDING,
        }
        reasons = {
            "error": f"it is {error:.2f} m from the reference, more than {allowed:.2f} m",
            "position_sigma": f"its pose is lost: standard deviation {sigma:.2f} m, more than "
            f"{limits.position_sigma:g} m",
            "age": f"its pose is lost: last fix {age:.2f} s ago, more than {limits.age:g} s",
        }
        for name, is_exceeded in exceeded.items():
            if not is_exceeded:
                self._since.pop(name, None)
            elif t - self._since.setdefault(name, t) >= limits.patience - _ROUNDING:
                return reasons[name]
        return None
