"""What surrounds the pipeline in a simulation: the plant, the sensors and the faults."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, cast

from omnidrive.control import CommandValue
from omnidrive.control.supervision import Event
from omnidrive.errors import InvalidInput, OmnidriveError, PlantLost, kind_of
from omnidrive.estimation import SensorReadings
from omnidrive.estimation.readings import readings_fault
from omnidrive.files.bounded_file import one_line, short_repr
from omnidrive.geometry import Pose
from omnidrive.record_check import are_finite
from omnidrive.reference import Reference
from omnidrive.simulation.disturbances import Schedule
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.plant import (
    DisturbablePlant,
    Plant,
    PlantCapabilities,
    PlantState,
    plant_state_fault,
)
from omnidrive.simulation.run import Outcome
from omnidrive.simulation.sensors import Sensors

_FRAMES = 4  # calls shown of a traceback
_MAX_REASON = 500  # characters


class RunEnded(Exception):
    """The run ends before its reference.

    Attributes:
        outcome: Why the run ends.
        reason: Reason in one line; may be empty.
        traceback: Traceback of the exception of a part; empty without one.
    """

    def __init__(self, outcome: Outcome, reason: str = "", traceback_: str = "") -> None:
        super().__init__(reason)
        self.outcome, self.reason, self.traceback = outcome, reason, traceback_


@contextmanager
def guard(outcome: Outcome, *, starting: bool = False) -> Iterator[None]:
    """Raise :class:`RunEnded` with this outcome for an exception of a user's part.

    Args:
        outcome: Outcome of the run after an exception other than :class:`PlantLost`.
        starting: Whether an :class:`OmnidriveError` is raised as it is: before the first step it
            concerns every run.
    """
    try:
        yield
    except PlantLost as error:
        raise RunEnded(Outcome.PLANT_LOST, one_line(str(error), _MAX_REASON)) from None
    except OmnidriveError as error:
        if starting:
            raise
        raise RunEnded(outcome, one_line(str(error), _MAX_REASON)) from None
    except (Exception, SystemExit) as error:
        shown = traceback.format_exc(limit=-_FRAMES).rstrip()
        raise RunEnded(outcome, _reason(error), shown) from None


def _reason(error: BaseException) -> str:
    """Return type and message of an exception in one line."""
    try:
        message = str(error)
    except Exception as second:
        message = f"its message raises {kind_of(second)}"
    first, *_ = message.splitlines() or [""]
    return one_line(f"{type(error).__name__}: {first}")


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
    _applied: Disturbances = field(default_factory=Disturbances)
    _started: bool = field(default=False, init=False)
    """Whether the plant has made a step."""

    def check(self) -> None:
        """Check the parts before the run.

        Raises:
            InvalidInput: The plant or the sensors lack a method, or a fault cannot occur in this
                run.
        """
        _check_part("plant", self.plant, ("capabilities", "reset", "step", "close"))
        _check_part("sensors", self.sensors, ("reset", "apply", "read"))
        if not isinstance(self.plant.capabilities, PlantCapabilities):
            raise InvalidInput(
                f"capabilities of a plant are PlantCapabilities(...), got "
                f"{kind_of(self.plant.capabilities)}"
            )
        if self.schedule is None:
            return
        self.schedule.check(self.reference.duration)
        if self.schedule.plant_faults and not self.plant.capabilities.disturbable:
            raise InvalidInput(
                f"this plant is not disturbable, so no {', '.join(self.schedule.plant_faults)}; "
                "use a plant with the capability disturbable"
            )

    def reset(self, pose: Pose) -> PlantState:
        """Start plant and sensors at rest at ``pose``."""
        with guard(Outcome.PLANT_FAILED, starting=True):
            state = self.plant.reset(pose)
        with guard(Outcome.SENSORS_FAILED):
            self.sensors.reset(pose)
        return self._checked(state)

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Simulate the plant with ``command`` for ``dt`` (s)."""
        with guard(Outcome.PLANT_FAILED, starting=not self._started):
            state = self.plant.step(command, dt)
        self._started = True
        return self._checked(state)

    def read(self, t: float, state: PlantState) -> SensorReadings:
        """Return the sensor readings at ``t`` (s)."""
        with guard(Outcome.SENSORS_FAILED):
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
        with guard(Outcome.REFERENCE_FAILED):
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
        with guard(Outcome.REFERENCE_FAILED):
            disturbances = self.schedule.disturbances(before, t, self.reference)
        at_once = any(disturbances.impulse) or any(disturbances.offset)
        changed = at_once or disturbances != self._applied
        if changed and self.plant.capabilities.disturbable:
            with guard(Outcome.PLANT_FAILED, starting=not self._started):
                cast(DisturbablePlant, self.plant).apply(disturbances)
            self._applied = disturbances

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
