"""Check of a state estimator against the laws, the properties that all estimators must have."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, isfinite
from typing import Any

import numpy as np

from omnidrive.components import Component
from omnidrive.estimation import (
    EncoderSettings,
    GyroSettings,
    PoseFixSettings,
    SensorReadings,
    SensorSettings,
    State,
    StateEstimator,
)
from omnidrive.estimation.components import EstimatorContext
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation import KinematicPlant, SensorSuite
from omnidrive.testing.laws import Law, check_laws

_SETTINGS = SensorSettings(EncoderSettings(), GyroSettings(), PoseFixSettings())
_START = Pose(1.0, -2.0, 0.5)
_TWIST = BodyTwist(0.3, -0.1, 0.4)
_DT, _STEPS = 0.1, 60


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
    component = Component("estimators", "the estimator", "", factory)
    laws = _Laws(component, robot or named_robot("small"), parameters, accuracy)
    applicable: dict[str, Law] = {
        "protocol": laws.protocol,
        "start": laws.start,
        "determinism": laws.determinism,
        "accuracy": laws.accurate,
        "absent readings": laws.absent,
    }
    check_laws("estimator", applicable)


class _Laws:
    """The laws for one factory."""

    def __init__(
        self, component: Component, robot: Robot, parameters: Any, accuracy: float
    ) -> None:
        self.component, self.robot = component, robot
        self.parameters, self.accuracy = parameters, accuracy

    def make(self) -> Any:
        """Return a new object from the factory; its type is not checked yet."""
        context = EstimatorContext(self.robot, _SETTINGS, forces=False)
        return self.component.make(context, self.parameters)

    def estimates(self, estimator: StateEstimator) -> list[tuple[Pose, State]]:
        """Return true poses and estimates on an arc, with the same noise for every estimator."""
        plant = KinematicPlant(self.robot)
        sensors = SensorSuite(_SETTINGS, self.robot.chassis, np.random.default_rng(7))
        state = plant.reset(_START)
        sensors.reset(_START)
        estimator.reset(_START)
        rows = []
        for k in range(_STEPS):
            rows.append((state.pose, estimator.update(sensors.read(k * _DT, state))))
            state = plant.step(_TWIST, _DT)
        return rows

    def protocol(self) -> str | None:
        made = self.make()
        if not isinstance(made, StateEstimator):
            return f"it is a {type(made).__name__}, need reset(pose) and update(readings)"
        estimate: object = self.estimates(made)[0][1]
        if not isinstance(estimate, State):
            return f"update returns a {type(estimate).__name__}, need State(stamp, pose)"
        return None

    def start(self) -> str | None:
        _, first = self.estimates(self.make())[0]
        error = np.abs(np.subtract(first.pose, _START))
        if error.max() > self.accuracy:
            return f"after reset at {tuple(_START)} its estimate is {tuple(first.pose)}"
        return None

    def determinism(self) -> str | None:
        estimator = self.make()
        once, again = (repr(self.estimates(estimator)) for _ in range(2))
        if once != again:
            return "a second run after reset differs: reset keeps some memory"
        if once != repr(self.estimates(self.make())):
            return "a new estimator differs: randomness or global state"
        return None

    def accurate(self) -> str | None:
        for k, (true, estimate) in enumerate(self.estimates(self.make())):
            if not all(map(isfinite, estimate.pose)):
                return f"its pose at {k * _DT:g} s is not finite"
            x, y, yaw = np.subtract(estimate.pose, true).tolist()
            yaw = (yaw + np.pi) % (2 * np.pi) - np.pi
            if hypot(x, y) > self.accuracy or abs(yaw) > self.accuracy:
                return (
                    f"at {k * _DT:g} s it errs by {hypot(x, y):.2g} m and {abs(yaw):.2g} rad, need "
                    f"at most {self.accuracy:g} m and rad"
                )
            covariance = estimate.covariance
            if covariance is not None and (
                not np.allclose(covariance, covariance.T, atol=1e-12)
                or np.linalg.eigvalsh(covariance).min() < -1e-12
            ):
                return f"its covariance at {k * _DT:g} s is not symmetric and positive semidefinite"
        return None

    def absent(self) -> str | None:
        estimator = self.make()
        estimator.reset(_START)
        for k in range(3):
            estimate = estimator.update(SensorReadings(k * _DT))
            if not all(map(isfinite, estimate.pose)):
                return "without any reading its pose is not finite"
        return None
