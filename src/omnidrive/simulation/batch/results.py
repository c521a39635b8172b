"""Results of a batch of closed loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control.supervision import Event
from omnidrive.simulation.batch import loop
from omnidrive.simulation.batch.loop import LOG, LOG_COLUMNS
from omnidrive.simulation.run import Outcome, Run

_OUTCOMES = {
    loop.FINISHED: Outcome.FINISHED,
    loop.CONTROLLER_FAILED: Outcome.CONTROLLER_FAILED,
    loop.REFERENCE_FAILED: Outcome.REFERENCE_FAILED,
    loop.PLANT_FAILED: Outcome.PLANT_FAILED,
}


@dataclass(frozen=True, eq=False, slots=True)
class BatchResults:
    """Figures of consecutive runs of a batch; the means are over all samples of a run.

    Attributes:
        first: Number of the first run in the batch.
        me: Mean distance between true and reference position, m.
        mae: Mean absolute heading error, wrapped, rad.
        max_error: Largest distance between true and reference position, m.
        work: Mechanical work of the motors, J; NaN without forces.
        statuses: Number of samples with the status ``OK``, ``FALLBACK`` and ``FAILED``.
        outcomes: Why each run ended.
        logs: Log of each run, as :func:`~omnidrive.simulation.simulate` returns it, but without
            computing times and reasons; empty if they are not kept.
    """

    first: int
    me: Float[Array, " runs"]
    mae: Float[Array, " runs"]
    max_error: Float[Array, " runs"]
    work: Float[Array, " runs"]
    statuses: Int[Array, "runs 3"]
    outcomes: tuple[Outcome, ...]
    logs: tuple[Run, ...] = ()

    @classmethod
    def of(cls, first: int, figures: np.ndarray[Any, Any], logs: Sequence[Run]) -> BatchResults:
        """Return the results for the figures that the compiled loop filled in."""
        rows = figures["rows"]
        return cls(
            first,
            figures["sum_distance"] / rows,
            figures["sum_turn"] / rows,
            figures["max_distance"].copy(),
            figures["work"].copy(),
            figures["statuses"].copy(),
            tuple(_OUTCOMES[end] for end in figures["end"].tolist()),
            tuple(logs),
        )


def run_of(  # noqa: PLR0917
    log: Float[Array, "samples columns"],
    figures: Any,
    times: Float[Array, " samples"],
    wheels: int,
    units: Mapping[str, str],
    events: Sequence[tuple[int, Event]],
    *,
    forces: bool,
) -> Run:
    """Return the log of a run.

    Args:
        log: Rows that the compiled loop filled in.
        figures: Figures that it filled in, a record of :data:`.loop.FIGURES`.
        times: Time of each sample, s.
        wheels: Number of wheels.
        units: Name and unit of each detail of the controller.
        events: Events, and the sample in which each happens; -1: before the first.
        forces: Whether the plant has forces, and so reports torques.
    """
    rows = int(figures["rows"])
    table = log[:rows].copy()
    column = table[:, :LOG_COLUMNS].view(LOG)[:, 0]
    none = np.empty((rows, 0))
    moved = rows if figures["end"] == loop.PLANT_FAILED else rows - 1  # samples with a step
    details = table[:, LOG_COLUMNS + 3 * wheels :]
    return Run(
        t=times[:rows].copy(),
        pose=column["pose"],
        measured=column["estimate"],
        position_sigma=column["sigma"],
        yaw_sigma=column["sigma"],
        target=column["target"],
        command=column["command"],
        twist=column["twist"],
        wheel_speed=table[:, LOG_COLUMNS : LOG_COLUMNS + wheels],
        wheel_torque=_torques(table[:, LOG_COLUMNS + wheels : LOG_COLUMNS + 2 * wheels], forces),
        saturated=column["saturated"].astype(np.int64),
        wheel_speed_command=none,
        wheel_torque_command=none,
        work=column["work"],
        step_time=np.full(rows, np.nan),
        status=column["status"].astype(np.int64),
        collisions=np.zeros(rows, np.int64),
        outcome=_OUTCOMES[int(figures["end"])],
        details={name: details[:, i] for i, name in enumerate(units)},
        detail_units=dict(units),
        events=tuple(event for k, event in events if k < moved),
    )


def _torques(table: Float[Array, "rows wheels"], forces: bool) -> Float[Array, "rows _"]:
    return table if forces else table[:, :0]
