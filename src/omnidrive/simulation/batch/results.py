"""Results of a batch of closed loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control.supervision import Event
from omnidrive.simulation.batch import loop
from omnidrive.simulation.batch.loop import LOG_WHEELS
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
    def of(
        cls, first: int, figures: Float[Array, "runs figures"], logs: Sequence[Run]
    ) -> BatchResults:
        """Return the results for the figures that the compiled loop filled in."""
        rows = figures[:, loop.ROWS]
        return cls(
            first,
            figures[:, loop.SUM_DISTANCE] / rows,
            figures[:, loop.SUM_TURN] / rows,
            figures[:, loop.LARGEST_DISTANCE].copy(),
            figures[:, loop.WORK].copy(),
            figures[:, loop.STEPS_OK : loop.STEPS_FAILED + 1].astype(np.int64),
            tuple(_OUTCOMES[int(end)] for end in figures[:, loop.END]),
            tuple(logs),
        )


def run_of(  # noqa: PLR0917
    log: Float[Array, "samples columns"],
    figures: Float[Array, " figures"],
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
        figures: Figures that it filled in.
        times: Time of each sample, s.
        wheels: Number of wheels.
        units: Name and unit of each detail of the controller.
        events: Events, and the sample in which each happens; -1: before the first.
        forces: Whether the plant has forces, and so reports torques.
    """
    rows = int(figures[loop.ROWS])
    table = log[:rows].copy()
    none = np.empty((rows, 0))
    moved = rows if figures[loop.END] == loop.PLANT_FAILED else rows - 1  # samples with a step
    details = table[:, LOG_WHEELS + 3 * wheels :]
    return Run(
        t=times[:rows].copy(),
        pose=table[:, loop.LOG_POSE : loop.LOG_POSE + 3],
        measured=table[:, loop.LOG_ESTIMATE : loop.LOG_ESTIMATE + 3],
        position_sigma=table[:, loop.LOG_SIGMA],
        yaw_sigma=table[:, loop.LOG_SIGMA],
        target=table[:, loop.LOG_TARGET : loop.LOG_TARGET + 3],
        command=table[:, loop.LOG_COMMAND : loop.LOG_COMMAND + 3],
        twist=table[:, loop.LOG_TWIST : loop.LOG_TWIST + 3],
        wheel_speed=table[:, LOG_WHEELS : LOG_WHEELS + wheels],
        wheel_torque=_torques(table[:, LOG_WHEELS + wheels : LOG_WHEELS + 2 * wheels], forces),
        saturated=table[:, loop.LOG_SATURATED].astype(np.int64),
        wheel_speed_command=none,
        wheel_torque_command=none,
        work=table[:, loop.LOG_WORK],
        step_time=np.full(rows, np.nan),
        status=table[:, loop.LOG_STATUS].astype(np.int64),
        collisions=np.zeros(rows, np.int64),
        outcome=_OUTCOMES[int(figures[loop.END])],
        details={name: details[:, i] for i, name in enumerate(units)},
        detail_units=dict(units),
        events=tuple(event for k, event in events if k < moved),
    )


def _torques(table: Float[Array, "rows wheels"], forces: bool) -> Float[Array, "rows _"]:
    return table if forces else table[:, :0]
