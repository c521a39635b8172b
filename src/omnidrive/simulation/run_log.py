"""The log of a closed loop while it runs."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import nan
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Pipeline, PipelineStep, WheelSpeeds, WheelTorques
from omnidrive.control.controller import STOP, failed_command
from omnidrive.control.supervision import Event
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.simulation.guard import RunEnded
from omnidrive.simulation.plant import PlantState
from omnidrive.simulation.run import Outcome, Run

RUN_LOGGER = "omnidrive.simulation.run"
"""Name of the logger of the notices of runs."""

_logger = logging.getLogger(RUN_LOGGER)
_UNKNOWN = (nan, nan, nan)


@lru_cache(maxsize=256)
def warn_once(text: str) -> None:
    """Log a warning, unless it has been logged lately in this process."""
    _logger.warning(text)


class _Row(NamedTuple):
    """One sample of the log; the fields are those of :class:`Run`."""

    t: float
    pose: tuple[float, ...]
    measured: tuple[float, ...]
    position_sigma: float
    yaw_sigma: float
    target: tuple[float, ...]
    command: tuple[float, ...]
    twist: tuple[float, ...]
    wheel_speed: tuple[float, ...]
    wheel_torque: tuple[float, ...]
    saturated: int
    wheel_speed_command: tuple[float, ...]
    wheel_torque_command: tuple[float, ...]
    work: float
    step_time: float
    status: int
    collisions: int
    details: tuple[float, ...]


@dataclass(slots=True)
class RunLog:
    """Log of a run in progress: one row per sample.

    Attributes:
        pipeline: The pipeline of the run.
        rows: The samples so far.
        notices: Notices of the controller at the start, of the estimator and of the driver.
        end: Why the run ends.
    """

    pipeline: Pipeline
    rows: list[_Row] = field(default_factory=list)
    notices: list[Event] = field(default_factory=list)
    end: RunEnded = field(default_factory=lambda: RunEnded(Outcome.FINISHED))

    def note(self, notice: str) -> None:
        """Log a notice of the controller at the start as a warning, and as an event at 0 s."""
        if notice:
            warn_once(notice)
            self.notices.append(Event(0.0, notice))

    def add(self, t: float, state: PlantState, step: PipelineStep) -> None:
        """Append one sample."""
        estimate, command = step.state, step.command
        value = command.value
        if estimate.notice:
            self.notices.append(Event(t, estimate.notice))
        self.rows.append(
            _Row(
                t,
                state.pose,
                estimate.pose,
                estimate.position_sigma,
                estimate.yaw_sigma,
                step.target,
                value if isinstance(value, BodyTwist) else _UNKNOWN,
                state.twist,
                state.wheel_speeds,
                state.wheel_torques,
                state.saturated,
                value if isinstance(value, WheelSpeeds) else (),
                value if isinstance(value, WheelTorques) else (),
                state.work,
                step.step_time,
                command.status,
                state.collisions,
                command.details,
            )
        )

    def add_failed_start(self, start: Pose) -> None:
        """Append the only row of a run that fails before its first sample, at rest at ``start``."""
        state = PlantState(start, STOP, nan)
        step = PipelineStep(State(0.0, Pose(*_UNKNOWN)), Pose(*_UNKNOWN), failed_command(""))
        self.add(0.0, state, step)

    def run(self, events: Sequence[Event]) -> Run:
        """Return the log of the run."""
        columns = dict(zip(_Row._fields, zip(*self.rows, strict=True), strict=True))
        supervisor, units = self.pipeline.supervisor, self.pipeline.detail_units
        outcome, reason = self.end.outcome, supervisor.stopped or self.end.reason
        if reason and outcome is Outcome.FINISHED:
            outcome = Outcome.STOPPED
        return Run(
            **{name: np.array(columns[name], dtype=float) for name in _REAL},
            **{name: np.array(columns[name], dtype=np.int64) for name in _WHOLE},
            **{name: _columns(columns[name]) for name in _PER_WHEEL},
            outcome=outcome,
            details=_detail_columns(columns["details"], units),
            detail_units=dict(units),
            events=tuple(sorted([*events, *self.notices, *supervisor.events], key=attrgetter("t"))),
            reason=reason,
            traceback=self.end.traceback,
        )


_REAL = (
    "t", "pose", "measured", "position_sigma", "yaw_sigma", "target", "command", "twist", "work",
    "step_time",
)  # fmt: skip
_WHOLE = ("saturated", "status", "collisions")
_PER_WHEEL = ("wheel_speed", "wheel_torque", "wheel_speed_command", "wheel_torque_command")


def _columns(rows: Sequence[tuple[float, ...]]) -> Float[Array, "rows wheels"]:
    """Return the rows as an array, without columns if all are empty; NaN in shorter rows."""
    wheels = max(map(len, rows))
    if min(map(len, rows)) < wheels:
        rows = [row if len(row) == wheels else (nan,) * wheels for row in rows]
    return np.array(rows, dtype=float)


def _detail_columns(
    details: Sequence[tuple[float, ...]], units: Mapping[str, str]
) -> dict[str, Float[Array, " rows"]]:
    """Return the details by name; NaN in rows without details."""
    if not units:
        return {}
    none = (nan,) * len(units)
    columns = np.array([row or none for row in details], dtype=float)
    return {name: columns[:, i] for i, name in enumerate(units)}
