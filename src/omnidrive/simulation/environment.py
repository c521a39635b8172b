"""What surrounds the pipeline in a simulation: the plant, the sensors and the faults."""

from __future__ import annotations

import traceback
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, cast

from omnidrive.control import CommandValue, pipeline
from omnidrive.control.supervision import Event
from omnidrive.control.time_limit import SharedTimer, TimedOut, TimeLimit
from omnidrive.errors import (
    PART_ERRORS,
    InvalidInput,
    OmnidriveError,
    PlantLost,
    kind_of,
    one_line,
    short_repr,
)
from omnidrive.estimation import SensorReadings
from omnidrive.estimation.readings import readings_fault
from omnidrive.geometry import Pose
from omnidrive.parameter import are_finite
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

PART_TIMEOUT = 120.0
"""Wall-clock time, s, after which a call of a plant or of sensors counts as stalled. The first call
may compile kernels."""
_SLOWEST = 20.0  # wall-clock time per simulated time of the slowest plant
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


def run_timer() -> SharedTimer:
    """Return the timer for the time limits of all calls of a run."""
    return SharedTimer(min(pipeline.STEP_TIMEOUT, PART_TIMEOUT) / 10.0)


class Guard:
    """Context manager that ends the run for an exception of a user's part in its block.

    Args:
        outcome: Outcome of the run after an exception other than :class:`PlantLost`.
        starting: Whether an :class:`OmnidriveError` is raised as it is: before the first step it
            concerns every run.
        call: Name of the call, for the message about a part that stalls.
        t: Time of the call, s, for that message; None: before the first sample.
        limit: Longest wall-clock time of the block, s, see :class:`TimeLimit`; None: no limit.

    Raises:
        RunEnded: In place of the exception.
    """

    __slots__ = ("_call", "_limit", "_outcome", "_seconds", "_starting", "_t")

    def __init__(
        self,
        outcome: Outcome,
        *,
        starting: bool = False,
        call: str = "",
        t: float | None = None,
        limit: float | None = None,
    ) -> None:
        self._outcome, self._starting, self._call, self._t = outcome, starting, call, t
        self._seconds, self._limit = limit, TimeLimit(limit) if limit is not None else None

    def __enter__(self) -> None:
        if self._limit is not None:
            self._limit.__enter__()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._limit is not None:
            self._limit.__exit__()
        if error is None:
            return
        if isinstance(error, PlantLost):
            raise RunEnded(Outcome.PLANT_LOST, one_line(str(error), _MAX_REASON)) from None
        if isinstance(error, OmnidriveError) and not self._starting:
            raise RunEnded(self._outcome, one_line(str(error), _MAX_REASON)) from None
        if isinstance(error, TimedOut):
            at = "" if self._t is None else f" at {self._t:g} s"
            reason = f"its {self._call}{at} took longer than {self._seconds:g} s"
            raise RunEnded(self._outcome, reason) from None
        if isinstance(error, PART_ERRORS) and not isinstance(error, RunEnded | OmnidriveError):
            shown = "".join(traceback.format_exception(error, limit=-_FRAMES)).rstrip()
            raise RunEnded(self._outcome, _reason(error), shown) from None


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
        with Guard(Outcome.SENSORS_FAILED, call="reset", limit=PART_TIMEOUT):
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
        with Guard(Outcome.SENSORS_FAILED, call="read", t=t, limit=PART_TIMEOUT):
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
        limit = None if self._capabilities.exclusive else PART_TIMEOUT + _SLOWEST * dt
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
