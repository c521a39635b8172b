"""What surrounds the pipeline in a simulation: the plant, the sensors and the faults."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

from omnidrive.control import CommandValue
from omnidrive.control.supervision import Event
from omnidrive.errors import InvalidInput, kind_of, short_repr
from omnidrive.estimation import SensorReadings
from omnidrive.estimation.readings import readings_fault
from omnidrive.geometry import Pose
from omnidrive.parameter import are_finite
from omnidrive.reference import Reference
from omnidrive.simulation import guard
from omnidrive.simulation.disturbances import Schedule
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.guard import Guard, RunEnded
from omnidrive.simulation.plant import (
    DisturbablePlant,
    Plant,
    PlantCapabilities,
    PlantState,
    plant_state_fault,
)
from omnidrive.simulation.run import Outcome
from omnidrive.simulation.sensors import Sensors

_SLOWEST = 20.0  # wall-clock time per simulated time of the slowest plant


@dataclass(slots=True)
class Environment:
    """Plant, sensors and the faults that act on them.

    Exceptions and malformed results of plant and sensors end the run (:class:`RunEnded`). Until the
    first step is done, an :class:`OmnidriveError` of the plant is raised: it concerns every run.

    Attributes:
        plant: The simulated robot.
        sensors: Its simulated sensors.
        reference: The motion to track; the default place of a slippery patch.
        schedule: Faults and their times; None: none.
        events: Start and end of the faults so far.
    """

    plant: Plant
    sensors: Sensors
    reference: Reference
    schedule: Schedule | None
    events: list[Event] = field(default_factory=list)
    _applied: Disturbances = field(default_factory=Disturbances, init=False)
    """Disturbances that act on the plant."""
    _capabilities: PlantCapabilities = field(default=PlantCapabilities(), init=False)
    """Capabilities of the plant, from :meth:`check` on."""
    _started: bool = field(default=False, init=False)
    """Whether the plant has made a step."""

    def check(self) -> None:
        """Check the parts before the run.

        Raises:
            InvalidInput: The plant or the sensors lack a method, or a fault cannot occur in this
                run.
        """
        with Guard(Outcome.PLANT_FAILED, starting=True):
            _check_part("plant", self.plant, ("capabilities", "reset", "step", "close"))
            capabilities = self.plant.capabilities
        _check_part("sensors", self.sensors, ("reset", "apply", "read"))
        if not isinstance(capabilities, PlantCapabilities):
            raise InvalidInput(
                f"capabilities of a plant are PlantCapabilities(...), got {kind_of(capabilities)}"
            )
        self._capabilities = capabilities
        if self.schedule is None:
            return
        self.schedule.check(self.reference.duration)
        if self.schedule.plant_faults and not capabilities.disturbable:
            raise InvalidInput(
                f"this plant is not disturbable, so no {', '.join(self.schedule.plant_faults)}; "
                "use a plant with the capability disturbable"
            )

    def reset(self, pose: Pose) -> PlantState:
        """Start plant and sensors at rest at ``pose``."""
        with self._plant_guard("reset"):
            state = self.plant.reset(pose)
        with Guard(Outcome.SENSORS_FAILED, call="reset", limit=guard.PART_TIMEOUT):
            self.sensors.reset(pose)
        return self._checked(state)

    def step(self, t: float, command: CommandValue, dt: float) -> PlantState:
        """Simulate the plant with ``command`` from ``t`` for ``dt`` (s)."""
        with self._plant_guard("step", t, dt):
            state = self.plant.step(command, dt)
        self._started = True
        return self._checked(state)

    def read(self, t: float, state: PlantState) -> SensorReadings:
        """Return the sensor readings at ``t`` (s)."""
        with Guard(Outcome.SENSORS_FAILED, call="read", t=t, limit=guard.PART_TIMEOUT):
            if self.schedule is not None:
                self.sensors.apply(self.schedule.sensor_faults(t))
            readings = self.sensors.read(t, state)
        fault = readings_fault(readings)
        if fault is not None:
            raise RunEnded(Outcome.SENSORS_FAILED, fault)
        return readings

    @property
    def duration(self) -> float:
        """Duration of the reference, s."""
        with Guard(Outcome.REFERENCE_FAILED):
            duration = self.reference.duration
        if not (are_finite((duration,)) and duration >= 0.0):
            raise RunEnded(
                Outcome.REFERENCE_FAILED, f"its duration is {short_repr(duration)}, not a number"
            )
        return duration

    def overrun(self, t: float) -> bool:
        """Return whether the command of the sample at ``t`` (s) is late."""
        return self.schedule is not None and self.schedule.overrun(t)

    def apply(self, before: float, t: float) -> None:
        """Apply the disturbances at ``t`` (s); ``before``: time of the previous sample (s)."""
        if self.schedule is None:
            return
        for fault in self.schedule.faults:
            if fault.is_active(t) != fault.is_active(before):
                change = "begins" if fault.is_active(t) else "ends"
                self.events.append(Event(t, f"{fault.kind} {change}"))
        with Guard(Outcome.REFERENCE_FAILED):
            disturbances = self.schedule.disturbances(before, t, self.reference)
        at_once = any(disturbances.impulse) or any(disturbances.offset)
        changed = at_once or disturbances != self._applied
        if changed and self._capabilities.disturbable:
            with self._plant_guard("apply", t):
                cast(DisturbablePlant, self.plant).apply(disturbances)
            self._applied = disturbances

    def _plant_guard(self, call: str, t: float | None = None, dt: float = 0.0) -> Guard:
        """Return the guard of a call of the plant at ``t`` that simulates ``dt`` (s).

        An exclusive plant, a running simulator, has time limits of its own.
        """
        limit = None if self._capabilities.exclusive else guard.PART_TIMEOUT + _SLOWEST * dt
        return Guard(Outcome.PLANT_FAILED, starting=not self._started, call=call, t=t, limit=limit)

    def _checked(self, state: Any) -> PlantState:
        """Return the state of the plant; a malformed one ends the run."""
        fault = plant_state_fault(state)
        if fault is not None:
            raise RunEnded(Outcome.PLANT_FAILED, fault)
        return cast(PlantState, state)


def _check_part(name: str, part: object, members: tuple[str, ...]) -> None:
    """Raise InvalidInput for a class, or an object without one of the members."""
    if isinstance(part, type):
        raise InvalidInput(
            f"as {name} the class {part.__name__} is given: pass an object, such as "
            f"{part.__name__}(...)"
        )
    missing = [member for member in members if not hasattr(part, member)]
    if missing:
        raise InvalidInput(
            f"{name}: need an object with {', '.join(members)}; {type(part).__name__} has no "
            f"{' and no '.join(missing)}"
        )
