"""The stored result of one run of a study."""

from __future__ import annotations

from dataclasses import dataclass, field

from omnidrive.simulation import Outcome

Factor = float | int | bool | str | None
"""Value of a factor in a table; a whole section or component is a text."""

TIMING = ("step_time_median", "step_time_p99")
"""Metrics that differ from run to run on one machine."""

_LOST = frozenset(each.name.lower() for each in (Outcome.KILLED, Outcome.TIMED_OUT))

MAX_DETAIL = 4000
"""Largest number of characters of :attr:`RunRecord.detail`."""


@dataclass(frozen=True, slots=True)
class RunRecord:
    """Result of one run of a study without its time series.

    Attributes:
        number: Index in the plan, from 0.
        key: SHA-256 of all that the run depends on, as :attr:`PlannedRun.key`.
        pairing: Index of all factors but the controller.
        controller: Label of the controller.
        task: Task of the study.
        repetition: Index of the repetition, from 0.
        repeat: Index of the run in a task that repeats its runs with other noise, from 0.
        factors: Value of each axis and each random factor, by its dotted path in the scenario.
        outcome: Name of the :class:`~omnidrive.simulation.Outcome` in lower case, or ``refused``.
        finished: Whether the run reached the end of its reference.
        metrics: Reproducible metrics by name: fields of :class:`~omnidrive.evaluation.Metrics`,
            min_clearance and collisions; of a step response overshoot, rise_time and settling_time
            of x, y and heading; with a fault recovered, time_to_recover and worst_error.
        timing: Computing times by name, us.
        detail: Reason and traceback of a run that ended early; otherwise empty.
        duration: Duration of the reference, s.
        variant: Horizon of the task ``horizon``, such as ``N = 15``, or fault of the task
            ``faults``, such as ``01-push``; otherwise empty.
    """

    number: int
    key: str
    pairing: int
    controller: str
    task: str
    repetition: int
    factors: dict[str, Factor]
    outcome: str
    finished: bool
    metrics: dict[str, float]
    timing: dict[str, float] = field(default_factory=dict)
    detail: str = ""
    duration: float = 0.0
    variant: str = ""
    repeat: int = 0

    @property
    def is_lost(self) -> bool:
        """Whether the log of the run is lost with its process."""
        return self.outcome in _LOST

    @property
    def name(self) -> str:
        """Name, unique in the study of one scenario; see :func:`name_of_run`."""
        return name_of_run(self.task, self.controller, self.duration, self.variant, self.repeat)


def name_of_run(task: str, controller: str, duration: float, variant: str, repeat: int) -> str:
    """Return the name of a run of one scenario, the stem of the file of its time series.

    The fields are those of :class:`RunRecord`; names are such as ``track-pid-20s``,
    ``noise-pid-30s-r2``, ``horizon-unicycle-nmpc-20s-N15``, ``step-pid`` and
    ``faults-pid-01-push``.
    """
    if task == "step":
        return f"step-{controller}"
    if task == "faults":
        return f"faults-{controller}-{variant}"
    horizon = f"-{variant.replace(' = ', '')}" if variant else ""
    seed = f"-r{repeat}" if repeat else ""
    return f"{task}-{controller}-{duration:g}s{horizon}{seed}"
