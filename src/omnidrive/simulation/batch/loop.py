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
from omnidrive.robot.slip import Vector
from omnidrive.simulation.batch.plants import PlantKernels

SILENT, LATE, NO_SETPOINTS = 1, 2, 4
"""Bits of :attr:`SampleArrays.flags`: no pose fix is taken; the new command comes too late; the
reference gave no setpoints to the controller."""

FINISHED, CONTROLLER_FAILED, REFERENCE_FAILED, PLANT_FAILED = 1, 2, 3, 4
"""Ends of a run; 0: it has not ended."""

FIGURES = np.dtype([
    ("sum_distance", "f8"),
    ("sum_turn", "f8"),
    ("max_distance", "f8"),
    ("work", "f8"),
    ("statuses", "i8", 3),
    ("rows", "i8"),
    ("end", "i8"),
], align=True)  # fmt: skip
"""Figures of a run: sum and largest of the distances between true and reference position (m), sum
of the absolute heading errors (rad), work (J), samples with each status, samples, and its end."""

LOG = np.dtype([
    ("pose", "f8", 3),
    ("estimate", "f8", 3),
    ("sigma", "f8"),
    ("target", "f8", 3),
    ("command", "f8", 3),
    ("twist", "f8", 3),
    ("work", "f8"),
    ("status", "f8"),
    ("saturated", "f8"),
])  # fmt: skip
"""First columns of a row of the log; the wheels' speeds, torques, angles and then the details of
the controller are at its end."""

LOG_COLUMNS = LOG.itemsize // 8

CARRIED = np.dtype([
    ("sent", "f8", 3),
    ("previous", "f8", 3),
    ("previous_status", "i8"),
    ("estimate", "f8", 3),
    ("has_fix", "i8"),
    ("fix_time", "f8"),
    ("drawn", "i8"),
], align=True)  # fmt: skip
"""What a run keeps from one sample to the next: the command that was sent, the one computed before
it with its status, the estimated pose, whether there was a pose fix, the time of the latest (s),
and how many samples of the noise are drawn."""

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
    carried: Any
    """One record of :data:`CARRIED` per run."""
    motion: Any
    """True motion of one run at a time, a record of :data:`~.plants.MOTION`."""
    floats: Float[Array, " floats"]
    """Memory of the law, of one run at a time, as floats of the same bytes."""
    memory: Any
    """The same with the structure that the law needs."""
    details: Float[Array, "runs 2 details"]
    """Details of the command computed in this sample, and in the one before."""
    figures: Any
    """One record of :data:`FIGURES` per run."""
    logs: Float[Array, "runs samples columns"]
    """Rows of the logs; without columns: none."""


@inlined
def update_estimate(t: float, silent: bool, motion: Any, uniforms: Array, carried: Any) -> None:
    """Take a pose fix and update the estimate, as ``PaperNoise`` and ``LatestFix`` do."""
    if silent:
        return
    x, y, yaw = motion.pose[0], motion.pose[1], motion.pose[2]
    if len(uniforms) > 0:
        size, drawn = sin(t / 5.0) / 6.0, carried.drawn
        x += uniforms[drawn, 0] * size
        y += uniforms[drawn, 1] * size
        yaw += uniforms[drawn, 2] * size
        carried.drawn += 1
    if not (abs(x) <= LARGEST and abs(y) <= LARGEST and abs(yaw) <= LARGEST):
        return
    estimate = carried.estimate
    turns = round((estimate[2] - yaw) / (2.0 * pi))
    estimate[0], estimate[1], estimate[2] = x, y, yaw + 2.0 * pi * turns
    carried.has_fix, carried.fix_time = 1, t


@inlined
def sample_state(samples: SampleArrays, k: int, noisy: bool, carried: Any) -> SampleState:
    """Return the estimate of ``LatestFix`` in sample k: the noise of a fix is unknown."""
    t, variances = samples.times[k], (0.0, 0.0, 0.0)
    if noisy and carried.has_fix > 0:
        variances = UNKNOWN_VARIANCES
    age, pose = t - carried.fix_time, as_vector(carried.estimate)
    return SampleState(t, pose, UNKNOWN_TWIST, variances, age, samples.delays[k], samples.last[k])


@inlined
def as_vector(array: Array) -> Vector:
    """Return the three components of an array."""
    return array[0], array[1], array[2]


@inlined
def is_finite(motion: Any) -> bool:
    """Return whether pose and twist are finite."""
    finite = True
    for i in range(3):
        finite &= isfinite(motion.pose[i]) and isfinite(motion.twist[i])
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
def send(command: Array, status: int, late: bool, carried: Any, details: Array) -> int:
    """Set the command to send and keep the computed one; return the status of the sent one.

    The details of the sent command are then in row 0 of ``details``, those of the computed command
    in row 1.
    """
    if status == _FAILED:
        command[:], details[0] = 0.0, nan
    sent_status = carried.previous_status if late else status
    for i in range(3):
        carried.sent[i] = carried.previous[i] if late else command[i]
        carried.previous[i] = command[i]
    carried.previous_status = status
    for i in range(details.shape[1]):
        computed = details[0, i]
        details[0, i] = details[1, i] if late else computed
        details[1, i] = computed
    return sent_status


@inlined
def add_to_figures(motion: Any, target: Vector, status: int, figures: Any) -> None:
    """Add one sample to the figures of a run."""
    pose = motion.pose
    distance = hypot(pose[0] - target[0], pose[1] - target[1])
    figures.sum_distance += distance
    figures.sum_turn += abs(wrap(pose[2] - target[2]))
    figures.max_distance = max(figures.max_distance, distance)
    figures.work = motion.work
    figures.statuses[status] += 1
    figures.rows += 1


@inlined
def write_row(  # noqa: PLR0917
    motion: Any, target: Vector, status: int, noisy: bool, carried: Any, row: Array
) -> None:
    """Write the columns of the log that every plant and law has."""
    log = row[:LOG_COLUMNS].view(LOG)[0]
    for i in range(3):
        log.pose[i], log.estimate[i] = motion.pose[i], carried.estimate[i]
        log.target[i], log.command[i], log.twist[i] = target[i], carried.sent[i], motion.twist[i]
    log.sigma = nan if noisy and carried.has_fix > 0 else 0.0
    log.work, log.status, log.saturated = motion.work, status, motion.saturated


@inlined
def write_details(details: Array, row: Array) -> None:
    """Write the details of the sent command to the last columns of a row of the log."""
    first = len(row) - details.shape[1]
    for i in range(details.shape[1]):
        row[first + i] = details[0, i]


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
        motion, command = runs.motion[0], np.empty(3)
        for r in range(len(runs.starts)):
            carried, details = runs.carried[r], runs.details[r]
            figures, uniforms = runs.figures[r], runs.uniforms[r]
            if begin == 0:
                runs.floats[:] = 0.0
                start_plant(initial, state, runs.starts[r], motion)
            for k in range(begin, end):
                if figures.end > 0:
                    break
                if k > 0:
                    step_plant(model, state, carried.sent, samples.steps[k - 1], motion)
                    if not is_finite(motion):
                        figures.end = PLANT_FAILED
                        break
                target = as_vector(samples.targets[k])
                if not isfinite(target[0] + target[1] + target[2]):
                    target, figures.end = as_vector(carried.estimate), REFERENCE_FAILED
                    status = send(command, _FAILED, False, carried, details)
                else:
                    silent = samples.flags[k] & SILENT > 0
                    update_estimate(samples.times[k], silent, motion, uniforms, carried)
                    noisy = len(uniforms) > 0
                    status = control(data, samples, k, runs, noisy, carried, command, details)
                    if k == len(samples.times) - 1:
                        figures.end = FINISHED
                    elif status == _FAILED:
                        figures.end = CONTROLLER_FAILED
                add_to_figures(motion, target, status, figures)
                if runs.logs.shape[2] > 0:
                    row = runs.logs[r, k]
                    write_row(motion, target, status, len(uniforms) > 0, carried, row)
                    write_details(details, row)
                    speeds = row[LOG_COLUMNS : LOG_COLUMNS + wheels]
                    torques = row[LOG_COLUMNS + wheels : LOG_COLUMNS + 2 * wheels]
                    angles = row[LOG_COLUMNS + 2 * wheels : LOG_COLUMNS + 3 * wheels]
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
