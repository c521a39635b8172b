"""Gain, phase and delay margins of every controller, confirmed by simulation.

`od.loop_margins` measures them on the plant `planar`, moving on a straight line and standing. Each
delay margin is confirmed by runs in which the command of that axis is executed later, from 4 s on,
by 0.8 and by 1.2 of the margin, with fractions of a sample. At the same time the robot is displaced
by 1 mm or 1 mrad: the difference from a run without this offset must decay with the first delay and
must not with the second. A controller that identifies the delay compensates the second one, which
is not required to be unstable. Of every controller and sample time, the least margin of all is
confirmed once more with all three components late, as on a real link.

`--page docs/margins.md` also rewrites the table of that page and its picture.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from math import isfinite, pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from figures import publish, row
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.components import configure
from omnidrive.control import Controller
from omnidrive.control.components import ControllerContext
from omnidrive.control.controller import STOP
from omnidrive.errors import InvalidInput, RunFailed
from omnidrive.evaluation import LoopMargins, loop_margins
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold, Reference
from omnidrive.reference.reference import WindowReference
from omnidrive.robot import named_robot
from omnidrive.simulation import PlanarPlant, PlantCapabilities, PlantState, simulate
from omnidrive.simulation.disturbances.disturbances import Disturbances, PoseOffset

CONTROLLERS: dict[str, tuple[str, dict[str, Any]]] = {
    "holonomic-nmpc": ("holonomic-nmpc", {}),
    "holonomic-nmpc, adapt: false": ("holonomic-nmpc", {"adapt": False}),
    **{
        name: (name, {})
        for name in (
            "unicycle-nmpc", "linear-mpc", "lqr", "feedforward", "adrc", "sliding-mode", "mppi",
            "pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3",
        )
    },
}  # fmt: skip
"""By label. The samples of `mppi` are those of one seed; its command is smooth in the pose."""
ROBOTS, TIMES = ("small", "kiwi"), (0.02, 0.05, 0.1)  # s
AXES = ("x", "y", "yaw")
MEASURED = ("x", "yaw")
MOTIONS = ("moving", "standing")
SPEED, RAMP = 0.4, 1.0  # m/s, s
AT, RESPONSE, AHEAD = 4.0, 16.0, 2.0  # s; the last is longer than every horizon
BEFORE, BEYOND = 0.8, 1.2  # of the delay margin
OFFSET = 1e-3  # m, rad
PERIODS = 12  # of the crossover frequency, in a run that confirms
DECAYED = 0.1  # at most, the last quarter of such a run over the first
PERSISTS = 0.5  # at least, the last quarter over the second
IDENTIFYING = ("holonomic-nmpc",)
NONLINEAR = 0.02


class Line(WindowReference):
    """A straight line along x at :data:`SPEED`, after a ramp from rest."""

    def __init__(self, duration: float) -> None:
        self.duration = duration

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        times = np.clip(t + dt * np.arange(n), 0.0, self.duration)
        rows = np.zeros((n, 6))
        rows[:, 0] = SPEED * np.where(times < RAMP, 0.5 * times**2 / RAMP, times - 0.5 * RAMP)
        rows[:, 3] = SPEED * np.minimum(times / RAMP, 1.0) * (times < self.duration)
        return rows


class LatePlant:
    """A plant that executes some components of its commands later, from 4 s on.

    Args:
        plant: The plant.
        delay: The delay, s; not necessarily whole samples.
        axes: The components.
        offset: Offset of the pose at 4 s; m, m, rad.
    """

    def __init__(
        self, plant: PlanarPlant, delay: float, axes: Iterable[str], offset: PoseOffset
    ) -> None:
        self.plant, self.delay, self.offset = plant, delay, offset
        self.late = [axis in axes for axis in AXES]
        self.queue: list[BodyTwist] = []

    @property
    def capabilities(self) -> PlantCapabilities:
        return self.plant.capabilities

    def reset(self, pose: Pose) -> PlantState:
        self.queue.clear()
        return self.plant.reset(pose)

    def step(self, command: BodyTwist, dt: float) -> PlantState:
        self.queue.append(command)
        begin = round(AT / dt)
        if len(self.queue) <= begin:
            return self.plant.step(command, dt)
        if len(self.queue) == begin + 1:
            self.plant.apply(Disturbances(offset=self.offset))
        whole, part = divmod(self.delay / dt, 1.0)
        if part > 1e-9:
            self.plant.step(self._mixed(int(whole) + 1), part * dt)
        return self.plant.step(self._mixed(int(whole)), (1.0 - part) * dt)

    def _mixed(self, samples: int) -> BodyTwist:
        """Return the command whose late components are older by ``samples``."""
        old = self.queue[-1 - samples] if samples < len(self.queue) else STOP
        pairs = zip(self.queue[-1], old, self.late, strict=True)
        return BodyTwist(*(b if late else a for a, b, late in pairs))

    def close(self) -> None:
        """Do nothing: the plant is used again."""


class Cell(NamedTuple):
    controller: str
    robot: str
    dt: float
    axis: str
    motion: str

    @property
    def name(self) -> str:
        return f"{self.controller}, {self.robot}, {self.dt:g} s, {self.axis}, {self.motion}"


class Result(NamedTuple):
    """Margins of a cell, and whether simulations confirm its delay margin."""

    margins: LoopMargins | None
    confirmed: bool
    reason: str = ""
    """Why there are no margins."""


@cache
def plant_of(robot: str) -> PlanarPlant:
    return PlanarPlant(named_robot(robot))


def controller_of(cell: Cell) -> Controller:
    name, options = CONTROLLERS[cell.controller]
    context = ControllerContext(named_robot(cell.robot), cell.dt, np.random.default_rng(1))
    return configure("controllers", name, options).make(context)


def reference_of(cell: Cell, duration: float) -> Reference:
    return Line(duration) if cell.motion == "moving" else Hold(Pose(0.0, 0.0, 0.0), duration)


def measured(cell: Cell) -> Result:
    """Return the margins of one axis, confirmed with this axis late."""
    reference = reference_of(cell, AT + RESPONSE + AHEAD)
    try:
        margins = loop_margins(
            plant_of(cell.robot), controller_of(cell), reference, dt=cell.dt, axis=cell.axis,
            at=AT, response=RESPONSE,
        )  # fmt: skip
    except (InvalidInput, RunFailed) as error:
        return Result(None, confirmed=False, reason=str(error))
    if margins.nonlinearity > NONLINEAR:
        return Result(margins, confirmed=False, reason="not linear at small amplitudes")
    return Result(margins, confirmed(cell, margins, [cell.axis]))


def confirmed(cell: Cell, margins: LoopMargins, late: Sequence[str]) -> bool:
    """Whether errors decay with less than the delay margin, and do not with more."""
    if not isfinite(margins.delay_margin):
        return False
    duration = PERIODS * 2.0 * pi / margins.delay_frequency
    run = partial(envelope, cell, duration=duration, late=late)
    first, _, _, last = run(BEFORE * margins.delay_margin)
    if cell.controller in IDENTIFYING or last >= DECAYED * first:
        return last < DECAYED * first
    first, second, _, last = run(BEYOND * margins.delay_margin)
    return last >= max(DECAYED * first, PERSISTS * second)


def envelope(cell: Cell, delay: float, duration: float, late: Sequence[str]) -> list[float]:
    """Return the largest effect of a small offset in each quarter of a run, m or rad."""
    moved, still = (poses_of(cell, delay, duration, late, offset) for offset in (OFFSET, 0.0))
    return [float(np.abs(quarter).max()) for quarter in np.array_split(moved - still, 4)]


def poses_of(
    cell: Cell, delay: float, duration: float, late: Sequence[str], offset: float
) -> Float[Array, " samples"]:
    """Return one coordinate of the robot, from the offset on."""
    plant = LatePlant(plant_of(cell.robot), delay, late, PoseOffset(**{cell.axis: offset}))
    reference = reference_of(cell, AT + duration)
    start = Pose(0.0, 0.0, 0.0)
    run = simulate(plant, controller_of(cell), reference, start=start, dt=cell.dt)
    return run.raise_if_failed().pose[round(AT / cell.dt) + 1 :, AXES.index(cell.axis)]


def jointly_confirmed(cell: Cell, margins: LoopMargins) -> bool:
    return confirmed(cell, margins, AXES)


def cells() -> Iterator[Cell]:
    for controller in CONTROLLERS:
        for dt in TIMES:
            for robot in ROBOTS:
                for axis in MEASURED:
                    for motion in MOTIONS:
                        yield Cell(controller, robot, dt, axis, motion)


Results = dict[Cell, Result]


def least(results: Results, controller: str, dt: float) -> Cell | None:
    """Return the cell with the least delay margin of a controller; None: one has no margins."""
    own = {c: r for c, r in results.items() if (c.controller, c.dt) == (controller, dt)}
    if any(r.reason or r.margins is None or not r.margins.stable for r in own.values()):
        return None
    return min(own, key=lambda c: own[c].margins.delay_margin)


def target_of(cell: Cell) -> str:
    identifying = cell.controller in IDENTIFYING
    return "errors decay at 0.8 of it" + ("" if identifying else ", not at 1.2")


def rows_of(results: Results, joint: dict[Cell, bool]) -> list[dict[str, object]]:
    """Return one row per cell with all figures, and one per confirmation with all axes late."""
    rows = []
    for cell, (margins, holds, reason) in results.items():
        value = 1e3 * margins.delay_margin if margins else float("nan")
        figures = {k: float(f"{v:.4g}") for k, v in margins._asdict().items()} if margins else {}
        rows.append(
            row(cell.name, value, "ms", reason or target_of(cell), holds)
            | cell._asdict() | figures | {"reason": reason}
        )  # fmt: skip
    for cell, holds in joint.items():
        value = 1e3 * results[cell].margins.delay_margin
        rows.append(row(f"{cell.name}, all axes late", value, "ms", target_of(cell), holds))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", type=Path, help="page whose table and picture are rewritten")
    parser.add_argument("--controller", action="append", choices=list(CONTROLLERS), default=None)
    parser.add_argument("--dt", action="append", type=float, choices=TIMES, default=None)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    options = parser.parse_args()
    if options.page and (options.controller or options.dt):
        parser.error("--page needs all controllers and sample times")
    wanted = [
        each
        for each in cells()
        if each.controller in (options.controller or CONTROLLERS)
        and each.dt in (options.dt or TIMES)
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        results = dict(zip(wanted, pool.map(measured, wanted, chunksize=4), strict=True))
        groups = dict.fromkeys((each.controller, each.dt) for each in wanted)
        nearest = [c for c in (least(results, *group) for group in groups) if c]
        margins = [results[cell].margins for cell in nearest]
        joint = dict(zip(nearest, pool.map(jointly_confirmed, nearest, margins), strict=True))
    rows = rows_of(results, joint)
    publish("margins", rows)
    if options.page:
        from margins_page import write_page

        write_page(options.page, results, joint)


if __name__ == "__main__":
    main()
