"""What a robot perceives while its sensors fail."""

from __future__ import annotations

from dataclasses import dataclass, field

from omnidrive.simulation.conditions import SensorConditions
from omnidrive.simulation.plant import Measurement
from omnidrive.simulation.sensing import DisturbableSensor, Estimate, Sensor


@dataclass(slots=True)
class Perception:
    """A sensor and the wheels' encoders, under conditions.

    A sensor without parts of its own that can fail is a measurement of the pose; while it is
    silent, the last estimate grows old.

    Attributes:
        sensor: As it is when nothing is wrong with it.
    """

    sensor: Sensor
    _last: tuple[float, Estimate] | None = field(default=None, init=False)
    _seen: list[float] = field(default_factory=list, init=False)
    _turned: tuple[float, ...] = field(default=(), init=False)

    def sense(self, t: float, state: Measurement, conditions: SensorConditions) -> Estimate:
        """What is believed at ``t`` (s) when ``state`` is the truth."""
        if isinstance(self.sensor, DisturbableSensor):
            self.sensor.impose(conditions)
        elif conditions.fixes_silent and self._last is not None:
            since, estimate = self._last
            return estimate._replace(age=estimate.age + t - since)
        estimate = self.sensor.sense(t, state)
        self._last = t, estimate
        return estimate

    def encoders(self, state: Measurement, conditions: SensorConditions) -> tuple[float, ...]:
        """How far each wheel seems to have turned, in rad: a dead encoder counts nothing."""
        if len(self._seen) != len(state.wheel_angles):
            self._seen = [0.0] * len(state.wheel_angles)
            self._turned = tuple(self._seen)
        for i, (now, before) in enumerate(zip(state.wheel_angles, self._turned, strict=True)):
            if i not in conditions.dead_encoders:
                self._seen[i] += now - before
        self._turned = state.wheel_angles
        return tuple(self._seen)
