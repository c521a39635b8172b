"""What the controller sees instead of the true pose."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan, sin
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from omnidrive.geometry import Pose, wrap
from omnidrive.simulation.conditions import SensorConditions
from omnidrive.simulation.plant import Measurement
from omnidrive.simulation.sensing.readings import Fix
from omnidrive.simulation.sensing.suite import Sensors


class Estimate(NamedTuple):
    """Where the robot is believed to be, and how sure that is."""

    pose: Pose
    """In W; m, m, rad. The yaw is continuous, not wrapped."""
    position_sigma: float = nan
    """Standard deviation of the position along its least certain direction, in m; NaN: unknown."""
    yaw_sigma: float = nan
    """Standard deviation of the yaw, in rad; NaN: unknown."""
    age: float = 0.0
    """Time since the last measurement of the pose that was used, in s."""


@runtime_checkable
class Sensor(Protocol):
    """Turns what a plant does into what the controller sees of it."""

    def reset(self, pose: Pose) -> None:
        """Forget the past; the robot now stands at ``pose``, and that is known."""
        ...

    def sense(self, t: float, state: Measurement) -> Estimate:
        """What is believed at ``t`` (s), in steady succession, when ``state`` is the truth."""
        ...


@runtime_checkable
class DisturbableSensor(Sensor, Protocol):
    """A sensor whose parts can fail."""

    def impose(self, conditions: SensorConditions) -> None:
        """Let ``conditions`` hold from now on; ``reset`` takes them back.

        Raises:
            InvalidInput: They speak of wheels that the robot does not have.
        """
        ...


@dataclass(frozen=True, slots=True)
class PerfectSensor:
    """Measures the true pose."""

    def reset(self, pose: Pose) -> None:
        """Nothing is remembered."""

    def sense(self, t: float, state: Measurement) -> Estimate:
        """The true pose."""
        return Estimate(state.pose, 0.0, 0.0)


@dataclass(frozen=True, eq=False, slots=True)
class PaperNoise:
    """The paper's noise: ``rand() / 6 * sin(t / 5)`` added to x, y (m) and yaw (rad).

    ``rand`` is uniform in [0, 1], so the noise is biased: positive for the first 5 pi seconds.

    Attributes:
        rng: Source of ``rand``; three numbers are drawn per call, in the order x, y, yaw.
    """

    rng: np.random.Generator

    def reset(self, pose: Pose) -> None:
        """Nothing is remembered; random numbers go on."""

    def sense(self, t: float, state: Measurement) -> Estimate:
        """True pose plus noise."""
        pose, size = state.pose, sin(t / 5.0) / 6.0
        dx, dy, dyaw = (self.rng.random(3) * size).tolist()
        return Estimate(Pose(pose.x + dx, pose.y + dy, pose.yaw + dyaw))


@dataclass(slots=True)
class LatestFix:
    """The newest fix of the pose as it is, without odometry or estimator.

    Attributes:
        sensors: Where fixes come from.
    """

    sensors: Sensors
    _latest: Fix = field(default=Fix(0.0, Pose(0.0, 0.0, 0.0), 0.0, 0.0), init=False, repr=False)

    def reset(self, pose: Pose) -> None:
        """The pose is known, until a fix arrives."""
        self.sensors.reset(pose)
        self._latest = Fix(0.0, pose, 0.0, 0.0)

    def impose(self, conditions: SensorConditions) -> None:
        """Let ``conditions`` hold for the sensors; see :meth:`Sensors.impose`."""
        self.sensors.impose(conditions)

    def sense(self, t: float, state: Measurement) -> Estimate:
        """The fix that was taken last of those that have arrived; its yaw made continuous."""
        for fix in self.sensors.read(t, state).fixes:
            if fix.stamp >= self._latest.stamp:
                turn = wrap(fix.pose.yaw - self._latest.pose.yaw)
                pose = fix.pose._replace(yaw=self._latest.pose.yaw + turn)
                self._latest = fix._replace(pose=pose)
        stamp, pose, *sigmas = self._latest
        return Estimate(pose, sigmas[0], sigmas[1], t - stamp)
