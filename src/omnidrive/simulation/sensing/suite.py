"""All sensors of a robot."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.robot import Chassis
from omnidrive.simulation.conditions import SensorConditions
from omnidrive.simulation.plant import Measurement
from omnidrive.simulation.sensing.encoders import Encoders, EncoderSettings
from omnidrive.simulation.sensing.gyro import Gyro, GyroSettings
from omnidrive.simulation.sensing.pose_fix import PoseFixes, PoseFixSettings
from omnidrive.simulation.sensing.readings import Readings


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """What sensors a robot has, and how good they are."""

    encoders: EncoderSettings = field(default_factory=EncoderSettings)
    gyro: GyroSettings | None = field(default_factory=GyroSettings)
    """None: it has none."""
    fixes: PoseFixSettings | None = field(default_factory=PoseFixSettings)
    """None: nothing measures the pose."""


@dataclass(slots=True)
class Sensors:
    """Makes readings from the truth.

    Attributes:
        settings: Of all sensors.
        chassis: The true one.
        rng: What the noise of the fixes is drawn from; generators for the rest are spawned from
            it, so that no sensor's numbers depend on the others' settings.
    """

    settings: SensorSettings
    chassis: Chassis
    rng: np.random.Generator
    _encoders: Encoders = field(init=False, repr=False)
    _gyro: Gyro | None = field(init=False, repr=False)
    _fixes: PoseFixes | None = field(init=False, repr=False)
    _conditions: SensorConditions = field(default=SensorConditions(), init=False, repr=False)
    _before: tuple[float, float] | None = field(default=None, init=False, repr=False)
    """Time and yaw of the last readings."""

    def __post_init__(self) -> None:
        settings = self.settings
        for_gyro, chance = self.rng.spawn(2)
        self._encoders = Encoders(settings.encoders, self.chassis)
        self._gyro = Gyro(settings.gyro, for_gyro) if settings.gyro else None
        self._fixes = PoseFixes(settings.fixes, self.rng, chance) if settings.fixes else None

    def reset(self, pose: Pose) -> None:
        """Begin at rest at ``pose``, all sensors sound; random numbers go on."""
        self._conditions, self._before = SensorConditions(), None
        self._encoders.reset(pose)
        if self._gyro:
            self._gyro.reset()
        if self._fixes:
            self._fixes.reset(pose)

    def impose(self, conditions: SensorConditions) -> None:
        """Let ``conditions`` hold from now on; ``reset`` takes them back.

        Raises:
            InvalidInput: They speak of wheels that the robot does not have.
        """
        wheels = len(self.chassis.jacobian)
        for wheel in conditions.dead_encoders:
            if not 0 <= wheel < wheels:
                raise InvalidInput(f"there is no wheel {wheel} whose encoder could be dead: the "
                                   f"robot has wheels 0 to {wheels - 1}")  # fmt: skip
        self._conditions = conditions

    def read(self, t: float, state: Measurement) -> Readings:
        """What the sensors tell at ``t`` (s), in steady succession, when ``state`` is the truth."""
        conditions = self._conditions
        angles = self._encoders.read(state, conditions.dead_encoders)
        yaw_rate = None
        if self._gyro and self._before and t > self._before[0]:
            since, yaw = self._before
            yaw_rate = self._gyro.read(state.pose.yaw - yaw, t - since)
            if conditions.gyro_silent:
                yaw_rate = None
        self._before = t, state.pose.yaw
        fixes = (
            self._fixes.read(t, state.pose, silent=conditions.fixes_silent) if self._fixes else ()
        )
        return Readings(t, angles, yaw_rate, fixes)
