"""The closed loop as a kernel: the same calls in the same order as :func:`omnidrive.simulate`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import hypot, isfinite, nan, pi, sin
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.command_check import MAX_COMMAND
from omnidrive.control.compiled_law import UNKNOWN_TWIST, UNKNOWN_VARIANCES, SampleState
from omnidrive.estimation.state import LARGEST
from omnidrive.geometry.kernels import wrap
from omnidrive.simulation.batch.plants import Motion, PlantKernels

SILENT, LATE, NO_SETPOINTS = 1, 2, 4
"""Bits of :attr:`SampleArrays.flags`: no pose fix is taken; the new command comes too late; the
reference gave no setpoints to the controller."""

FINISHED, CONTROLLER_FAILED, REFERENCE_FAILED, PLANT_FAILED = 1, 2, 3, 4
"""Ends of a run; 0: it has not ended."""

(
    SUM_DISTANCE, SUM_TURN, LARGEST_DISTANCE, WORK, STEPS_OK, STEPS_FALLBACK, STEPS_FAILED, ROWS,
    END,
) = range(9)  # fmt: skip
FIGURES = 9
"""Number of figures of a run, in this order."""

LOG_POSE, LOG_ESTIMATE, LOG_SIGMA, LOG_TARGET, LOG_COMMAND, LOG_TWIST, LOG_WORK = (
    0, 3, 6, 7, 10, 13, 16,
)  # fmt: skip
LOG_STATUS, LOG_SATURATED, LOG_WHEELS = 17, 18, 19
"""First columns of the parts of a row of the log; the wheels' speeds, torques, angles and then the
details of the controller are at its end."""

# places in the carried state of a run, from one sample to the next
_SENT, _PREVIOUS, _PREVIOUS_STATUS, _ESTIMATE, _FIXED, _FIX_TIME, _DRAWN = (
    0, 3, 6, 7, 10, 11, 12,
)  # fmt: skip
CARRIED = 13
"""Number of floats of the carried state."""

_OK, _FAILED = 0, 2


class SampleArrays(NamedTuple):
    """What runs on the same reference with the same faults have in common, for every sample."""

    times: Float[Array, " samples"]
    """Time, s."""
    steps: Float[Array, " samples"]
    """Time to the next sample, s."""
    targets: Float[Array, "samples 3"]
    """Pose of the reference; m, m, rad. Not finite where the reference fails."""
    setpoints: Float[Array, "rows 6"]
    """Setpoints for the law, columns as in ``Reference.window``."""
    length: int
    """Number of setpoints that the law needs in a sample."""
    first: Int[Array, " samples"]
    """Row of the first of them; the next ones follow."""
    last: Int[Array, " samples"]
    """As :attr:`~omnidrive.control.compiled_law.SampleState.last`."""
    delays: Float[Array, " samples"]
    """Delay of the motion that the controller tracks, s."""
    flags: Int[Array, " samples"]
    """Sum of :data:`SILENT`, :data:`LATE` and :data:`NO_SETPOINTS`."""


class RunArrays(NamedTuple):
    """State and results of runs."""

    starts: Float[Array, "runs 3"]
    """Pose at t = 0; m, m, rad."""
    uniforms: Float[Array, "runs draws 3"]
    """Random numbers of the paper's noise, in the order of drawing; without draws: no noise."""
    carried: Float[Array, "runs carried"]
    floats: Float[Array, " floats"]
    """Memory of the law, of one run at a time, as floats of the same bytes."""
    memory: Any
    """The same with the structure that the law needs."""
    details: Float[Array, "runs 2 details"]
    """Details of the command computed in this sample, and in the one before."""
    figures: Float[Array, "runs figures"]
    logs: Float[Array, "runs samples columns"]
    """Rows of the logs; without columns: none."""


@inlined
def update_estimate(
    t: float, silent: bool, motion: Motion, uniforms: Array, carried: Array
) -> None:
    """Take a pose fix and update the estimate, as ``PaperNoise`` and ``LatestFix`` do."""
    if silent:
        return
    x, y, yaw = motion[0], motion[1], motion[2]
    if len(uniforms) > 0:
        size, drawn = sin(t / 5.0) / 6.0, int(carried[_DRAWN])
        x += uniforms[drawn, 0] * size
        y += uniforms[drawn, 1] * size
        yaw += uniforms[drawn, 2] * size
        carried[_DRAWN] += 1.0
    if not (abs(x) <= LARGEST and abs(y) <= LARGEST and abs(yaw) <= LARGEST):
        return
    turns = round((carried[_ESTIMATE + 2] - yaw) / (2.0 * pi))
    carried[_ESTIMATE], carried[_ESTIMATE + 1] = x, y
    carried[_ESTIMATE + 2] = yaw + 2.0 * pi * turns
    carried[_FIXED], carried[_FIX_TIME] = 1.0, t


@inlined
def sample_state(samples: SampleArrays, k: int, noisy: bool, carried: Array) -> SampleState:
    """Return the estimate of ``LatestFix`` in sample k: the noise of a fix is unknown."""
    pose = (carried[_ESTIMATE], carried[_ESTIMATE + 1], carried[_ESTIMATE + 2])
    t, variances = samples.times[k], (0.0, 0.0, 0.0)
    if noisy and carried[_FIXED] > 0.0:
        variances = UNKNOWN_VARIANCES
    age = t - carried[_FIX_TIME]
    return SampleState(t, pose, UNKNOWN_TWIST, variances, age, samples.delays[k], samples.last[k])


@inlined
def is_finite(motion: Motion) -> bool:
    """Return whether pose and twist are finite."""
    finite = True
    for i in range(6):
        finite &= isfinite(motion[i])
    return finite


@inlined
def checked_status(status: int, command: Array, memory: Array) -> int:
    """Return the status of a command, as ``GuardedController`` and ``checked_command`` decide it.

    A failed law is reset.
    """
    if not isfinite(command[0] + command[1] + command[2]):
        memory[:] = 0.0
        return _FAILED
    for i in range(3):
        if not abs(command[i]) <= MAX_COMMAND:
            return _FAILED
    return status


@inlined
def send(command: Array, status: int, late: bool, carried: Array, details: Array) -> int:
    """Set the command to send and keep the computed one; return the status of the sent one.

    The details of the sent command are then in row 0 of ``details``, those of the computed command
    in row 1.
    """
    if status == _FAILED:
        command[:], details[0] = 0.0, nan
    sent_status = int(carried[_PREVIOUS_STATUS]) if late else status
    for i in range(3):
        carried[_SENT + i] = carried[_PREVIOUS + i] if late else command[i]
        carried[_PREVIOUS + i] = command[i]
    carried[_PREVIOUS_STATUS] = status
    for i in range(details.shape[1]):
        computed = details[0, i]
        details[0, i] = details[1, i] if late else computed
        details[1, i] = computed
    return sent_status


@inlined
def add_to_figures(motion: Motion, target: Array, status: int, figures: Array) -> None:
    """Add one sample to the figures of a run."""
    distance = hypot(motion[0] - target[0], motion[1] - target[1])
    figures[SUM_DISTANCE] += distance
    figures[SUM_TURN] += abs(wrap(motion[2] - target[2]))
    figures[LARGEST_DISTANCE] = max(figures[LARGEST_DISTANCE], distance)
    figures[WORK] = motion[6]
    figures[STEPS_OK + status] += 1.0
    figures[ROWS] += 1.0


@inlined
def write_row(  # noqa: PLR0917
    motion: Motion, target: Array, status: int, noisy: bool, carried: Array, row: Array
) -> None:
    """Write the columns of the log that every plant and law has."""
    for i in range(3):
        row[LOG_POSE + i], row[LOG_ESTIMATE + i] = motion[i], carried[_ESTIMATE + i]
        row[LOG_TARGET + i], row[LOG_COMMAND + i] = target[i], carried[_SENT + i]
        row[LOG_TWIST + i] = motion[3 + i]
    row[LOG_SIGMA] = nan if noisy and carried[_FIXED] > 0.0 else 0.0
    row[LOG_WORK], row[LOG_STATUS], row[LOG_SATURATED] = motion[6], status, motion[7]


@inlined
def write_details(details: Array, row: Array) -> None:
    """Write the details of the sent command to the last columns of a row of the log."""
    first = len(row) - details.shape[1]
    for i in range(details.shape[1]):
        row[first + i] = details[0, i]


@inlined
def reset_run(start: Array, carried: Array, memory: Array, details: Array, figures: Array) -> None:
    """Set everything that a run keeps to its value at the start."""
    carried[:], memory[:], figures[:], details[:] = 0.0, 0.0, 0.0, nan
    for i in range(3):
        carried[_ESTIMATE + i] = start[i]


@cache
def closed_loop(kernels: PlantKernels, law: Callable[..., int]) -> Callable[..., None]:
    """Return the kernel of the closed loop of a plant and a law.

    ``loop(model, initial, state, data, samples, runs, wheels, begin, end)`` computes the samples
    from ``begin`` up to, but not including, ``end`` of every run; a single run can go on where an
    earlier call ended. ``wheels`` is the number of wheels. In a sample the plant first executes the
    command of the sample before, so that disturbances between two calls act as in ``simulate``.
    """
    start_plant, step_plant, measure_wheels = kernels
    control = _control(law)

    @compiled
    def loop(model, initial, state, data, samples, runs, wheels, begin, end):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, PLR0917
        """Advance all runs of a block over the samples from ``begin`` to ``end``."""
        motion, command = np.empty(8), np.empty(3)
        for r in range(len(runs.starts)):
            carried, details = runs.carried[r], runs.details[r]
            figures, uniforms = runs.figures[r], runs.uniforms[r]
            if begin == 0:
                reset_run(runs.starts[r], carried, runs.floats, details, figures)
                start_plant(initial, state, runs.starts[r], motion)
            for k in range(begin, end):
                if figures[END] > 0.0:
                    break
                if k > 0:
                    step_plant(model, state, carried[:3], samples.steps[k - 1], motion)
                    if not is_finite(motion):
                        figures[END] = PLANT_FAILED
                        break
                target = samples.targets[k]
                if not isfinite(target[0] + target[1] + target[2]):
                    target, figures[END] = carried[_ESTIMATE : _ESTIMATE + 3], REFERENCE_FAILED
                    status = send(command, _FAILED, False, carried, details)
                else:
                    silent = samples.flags[k] & SILENT > 0
                    update_estimate(samples.times[k], silent, motion, uniforms, carried)
                    noisy = len(uniforms) > 0
                    status = control(data, samples, k, runs, noisy, carried, command, details)
                    if k == len(samples.times) - 1:
                        figures[END] = FINISHED
                    elif status == _FAILED:
                        figures[END] = CONTROLLER_FAILED
                add_to_figures(motion, target, status, figures)
                if runs.logs.shape[2] > 0:
                    row = runs.logs[r, k]
                    write_row(motion, target, status, len(uniforms) > 0, carried, row)
                    write_details(details, row)
                    speeds = row[LOG_WHEELS : LOG_WHEELS + wheels]
                    torques = row[LOG_WHEELS + wheels : LOG_WHEELS + 2 * wheels]
                    angles = row[LOG_WHEELS + 2 * wheels : LOG_WHEELS + 3 * wheels]
                    measure_wheels(state, speeds, torques, angles)

    return loop


def _control(law: Callable[..., int]) -> Callable[..., int]:
    """Return the kernel that computes and sends the command of a sample."""

    @inlined
    def control(data, samples, k, runs, noisy, carried, command, details):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202, PLR0917
        """Compute and send the command of sample k; return its status."""
        late = samples.flags[k] & LATE > 0
        if k == len(samples.times) - 1:
            command[:], details[:] = 0.0, nan
            return send(command, _OK, False, carried, details)
        if samples.flags[k] & NO_SETPOINTS > 0:
            return send(command, _FAILED, late, carried, details)
        now = sample_state(samples, k, noisy, carried)
        first = samples.first[k]
        setpoints = samples.setpoints[first : first + samples.length]
        status = law(data, runs.memory, now, setpoints, command, details[0])
        status = checked_status(status, command, runs.floats)
        return send(command, status, late, carried, details)

    return control
