"""Check of a state estimator against the laws, the properties that all estimators must have."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isfinite
from typing import Any

import numpy as np

from omnidrive.errors import kind_of
from omnidrive.estimation import (
    EncoderSettings,
    GyroSettings,
    PoseFixSettings,
    SensorReadings,
    SensorSettings,
    StateEstimator,
)
from omnidrive.estimation.components import EstimatorContext
from omnidrive.estimation.state import state_fault
from omnidrive.geometry import BodyTwist, Pose, wrap
from omnidrive.robot import Robot
from omnidrive.simulation import KinematicPlant, SensorSuite
from omnidrive.testing.laws import Laws

_SETTINGS = SensorSettings(EncoderSettings(), GyroSettings(), PoseFixSettings())
_START = Pose(1.0, -2.0, 0.5)
_TWIST = BodyTwist(0.3, -0.1, 0.4)
_STEPS = 60


def check_estimator(
    factory: Callable[..., Any],
    *,
    robot: Robot | None = None,
    parameters: Any = None,
    accuracy: float = 0.25,
) -> None:
    """Check an estimator against the laws of :class:`~omnidrive.estimation.StateEstimator`.

    - It has ``reset`` and ``update``, and its estimates are of the type ``State``.
    - After ``reset`` it estimates the given pose.
    - Two runs with the same readings are the same, bit for bit; ``reset`` clears all memory.
    - Its estimate follows a robot on an arc with wheel encoders, a gyro and pose fixes, and its
      covariance is symmetric and not negative.
    - Readings without any sensor are no error.

    Args:
        factory: The class or function that makes the estimator.
        robot: The robot. None: the built-in robot `small`.
        parameters: Parameters for the factory. None: the defaults.
        accuracy: Greatest error on the arc, m and rad.

    Raises:
        AssertionError: A law is broken; the message has one line for each.
    """
    laws = _EstimatorLaws(factory, robot, parameters, accuracy)
    laws.check(start=laws.start, accuracy=laws.accurate, absent_readings=laws.absent)


class _EstimatorLaws(Laws):
    """The laws for one factory."""

    kind, row = "estimator", "estimate"

    def __init__(
        self, factory: Callable[..., Any], robot: Robot | None, parameters: Any, accuracy: float
    ) -> None:
        super().__init__(factory, robot, parameters)
        self.accuracy = accuracy

    def context(self) -> EstimatorContext:
        """Return the context for the factory."""
        return EstimatorContext(self.robot, _SETTINGS, forces=False)

    def protocol(self) -> str | None:
        """Return why the object is no estimator or its first estimate malformed; None: neither."""
        made = self.make()
        if not isinstance(made, StateEstimator):
            return f"it is {kind_of(made)}, need reset(pose) and update(readings)"
        return state_fault(self.estimates(made)[0][1])

    def record(self, part: StateEstimator) -> list[tuple[object, ...]]:
        """Return the estimates with their covariance as a list: an array is shown rounded."""
        return [
            (*state[:3], None if state.covariance is None else state.covariance.tolist(), state[4:])
            for _, state in self.estimates(part)
        ]

    def estimates(self, estimator: StateEstimator) -> list[tuple[Pose, Any]]:
        """Return true poses and estimates on an arc, with the same noise for every estimator.

        The type of the estimates is not checked yet.
        """
        plant = KinematicPlant(self.robot)
        sensors = SensorSuite(_SETTINGS, self.robot.chassis, np.random.default_rng(7))
        state = plant.reset(_START)
        sensors.reset(_START)
        estimator.reset(_START)
        rows = []
        for k in range(_STEPS):
            rows.append((state.pose, estimator.update(sensors.read(k * self.dt, state))))
            state = plant.step(_TWIST, self.dt)
        return rows

    def start(self) -> str | None:
        """Return the first estimate after a reset if it is not the start pose; None: it is."""
        _, first = self.estimates(self.make())[0]
        error = np.abs(np.subtract(first.pose, _START))
        if error.max() > self.accuracy:
            return f"after reset at {tuple(_START)} its estimate is {tuple(first.pose)}"
        return None

    def accurate(self) -> str | None:
        """Return when an estimate on the arc is wrong or its covariance invalid; None: never."""
        for k, (true, estimate) in enumerate(self.estimates(self.make())):
            t = k * self.dt
            if not all(map(isfinite, estimate.pose)):
                return f"its pose at {t:g} s is not finite"
            x, y, yaw = np.subtract(estimate.pose, true).tolist()
            distance, turn = hypot(x, y), abs(wrap(yaw))
            if max(distance, turn) > self.accuracy:
                return (
                    f"at {t:g} s it errs by {distance:.2g} m and {turn:.2g} rad, need at most "
                    f"{self.accuracy:g} m and rad"
                )
            covariance = estimate.covariance
            if covariance is not None and (
                not np.allclose(covariance, covariance.T, atol=1e-12)
                or np.linalg.eigvalsh(covariance).min() < -1e-12
            ):
                return f"its covariance at {t:g} s is not symmetric and positive semidefinite"
        return None

    def absent(self) -> str | None:
        """Return whether its pose is not finite after readings without any sensor."""
        estimator = self.make()
        estimator.reset(_START)
        for k in range(3):
            estimate = estimator.update(SensorReadings(k * self.dt))
            if not all(map(isfinite, estimate.pose)):
                return "without any reading its pose is not finite"
        return None
