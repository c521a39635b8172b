"""The sensors of a robot: wheel encoders, gyro, pose fixes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from omnidrive.errors import InvalidInput
from omnidrive.estimation import SensorReadings, SensorSettings
from omnidrive.geometry import Pose
from omnidrive.robot import Chassis
from omnidrive.simulation.disturbances.disturbances import SensorFaults
from omnidrive.simulation.plant import PlantState
from omnidrive.simulation.sensors.encoders import Encoders
from omnidrive.simulation.sensors.gyro import Gyro
from omnidrive.simulation.sensors.pose_fix import PoseFixes


@dataclass(slots=True)
class SensorSuite:
    """Simulated wheel encoders, gyro and pose fixes with noise.

    Attributes:
        settings: Settings of all sensors.
        chassis: True geometry of the robot.
        rng: Generator of the fixes' noise; the generators of the other sensors are spawned from
            it, so that no sensor's random numbers depend on another's settings.
    """

    settings: SensorSettings
    chassis: Chassis
    rng: np.random.Generator
    _encoders: Encoders = field(init=False, repr=False)
    _gyro: Gyro | None = field(init=False, repr=False)
    _fixes: PoseFixes | None = field(init=False, repr=False)
    _faults: SensorFaults = field(default=SensorFaults(), init=False, repr=False)
    _previous: tuple[float, float] | None = field(default=None, init=False, repr=False)
    """Time (s) and true yaw (rad) of the previous readings."""

    def __post_init__(self) -> None:
        settings = self.settings
        gyro_rng, event_rng = self.rng.spawn(2)
        self._encoders = Encoders(settings.encoders, self.chassis)
        self._gyro = Gyro(settings.gyro, gyro_rng) if settings.gyro else None
        self._fixes = PoseFixes(settings.fixes, self.rng, event_rng) if settings.fixes else None

    def reset(self, pose: Pose) -> None:
        """Start at rest at ``pose`` without faults; the random generators continue."""
        self._faults, self._previous = SensorFaults(), None
        self._encoders.reset(pose)
        if self._gyro:
            self._gyro.reset()
        if self._fixes:
            self._fixes.reset(pose)

    def apply(self, faults: SensorFaults) -> None:
        """Set the faults that hold from now on; ``reset`` removes them.

        Raises:
            InvalidInput: A fault names a wheel that the robot does not have.
        """
        wheels = len(self.chassis.jacobian)
        for wheel in faults.dead_encoders:
            if not 0 <= wheel < wheels:
                raise InvalidInput(
                    f"dead encoder: there is no wheel {wheel}; the robot has wheels 0 to "
                    f"{wheels - 1}"
                )
        self._faults = faults

    def read(self, t: float, state: PlantState) -> SensorReadings:
        """Return the readings at ``t`` (s) for the true ``state``; ``t`` must not decrease."""
        faults = self._faults
        angles = self._encoders.read(state, faults.dead_encoders)
        yaw_rate = None
        time, yaw = self._previous or (t, state.pose.yaw)
        if self._gyro and t > time:
            yaw_rate = self._gyro.read(state.pose.yaw - yaw, t - time)
            if faults.gyro_silent:
                yaw_rate = None
        self._previous = t, state.pose.yaw
        fixes = self._fixes.read(t, state.pose, silent=faults.fixes_silent) if self._fixes else ()
        return SensorReadings(t, angles, state.wheel_torques, yaw_rate, fixes)
