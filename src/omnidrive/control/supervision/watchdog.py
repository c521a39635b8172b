"""The watchdog: says when a robot must be stopped."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot, inf, isfinite
from typing import Annotated, NamedTuple

from omnidrive.geometry import Pose
from omnidrive.parameter import Bounds
from omnidrive.robot import Robot

_ROUNDING = 1e-9  # s


class WatchdogLimits(NamedTuple):
    """Beyond which a robot must stop."""

    error: Annotated[float, Bounds(0.01, 1e6, "m")] = 1.5
    """Distance to the reference, on top of that at the start."""
    position_sigma: Annotated[float, Bounds(1e-3, 1e6, "m")] = 0.5
    """Standard deviation of the position."""
    age: Annotated[float, Bounds(0.01, 1e6, "s")] = 1.5
    """Time since a pose was measured."""
    patience: Annotated[float, Bounds(0.0, 60.0, "s")] = 0.3
    """For which a limit has to be exceeded: one bad measurement is not a lost robot."""

    @classmethod
    def of(cls, robot: Robot) -> WatchdogLimits:
        """Of a robot: no less than a metre, and the larger the robot the more."""
        return cls(error=max(1.0, 2.0 * robot.body_radius))


@dataclass(slots=True)
class Watchdog:
    """Compares where a robot is believed to be with where it shall be, sample by sample.

    Attributes:
        limits: Beyond which it must stop.
    """

    limits: WatchdogLimits
    _at_start: float = field(default=inf, init=False)
    _since: dict[str, float] = field(default_factory=dict, init=False)

    def reset(self) -> None:
        """Forget the past: the next look is the first."""
        self._at_start = inf
        self._since.clear()

    def look(
        self, t: float, pose: Pose, target: Pose, position_sigma: float, age: float
    ) -> str | None:
        """Why the robot must stop now; None if it need not.

        Args:
            t: In s.
            pose: Where it is believed to be.
            target: Where it shall be.
            position_sigma: In m; NaN if unknown.
            age: Of the last measurement of the pose, in s.
        """
        if not all(map(isfinite, pose)):
            return "the measured pose is not finite"
        error = hypot(pose.x - target.x, pose.y - target.y)
        if self._at_start == inf:
            self._at_start = error
        allowed = self.limits.error + self._at_start
        limits = self.limits
        beyond = {
            "error": error > allowed,
            "position_sigma": position_sigma > limits.position_sigma,
            "age": age > limits.age + _ROUNDING,
        }
        why = {
            "error": f"it is {error:.2f} m from the reference, more than {allowed:.2f} m",
            "position_sigma": f"its pose is lost: uncertain by {position_sigma:.2f} m, more than "
            f"{limits.position_sigma:g} m",
            "age": f"its pose is lost: measured {age:.2f} s ago, more than {limits.age:g} s",
        }
        for name, is_so in beyond.items():
            if not is_so:
                self._since.pop(name, None)
            elif t - self._since.setdefault(name, t) >= limits.patience - _ROUNDING:
                return why[name]
        return None
