"""Cells of the gauntlet: one run of one controller each, and its figures."""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields, replace
from functools import cache
from math import inf, nan
from typing import NamedTuple

import numpy as np
from gauntlet_cases import CASES, case_plant
from gauntlet_references import (
    ARRIVED,
    IMPOSSIBLE,
    SHAPES,
    STEPS,
    counted,
    exact_arrival,
    path_distance,
    reference_of,
)

from omnidrive.components import configure
from omnidrive.control.components import ControllerContext
from omnidrive.evaluation import step_response
from omnidrive.evaluation.measures.metrics import heading_error, position_error
from omnidrive.geometry import Pose
from omnidrive.robot import ROBOTS
from omnidrive.scenario import paper_scenario
from omnidrive.scenario.planned_scenario import plan_and_check
from omnidrive.scenario.run_settings import RunSettings, settings_of_runs
from omnidrive.scenario.run_simulation import simulate_run
from omnidrive.scenario.scenario import DEFAULT_CONTROLLERS
from omnidrive.simulation import FAULTS, Outcome, Run, Schedule, simulate

RECOMMENDED = "holonomic-nmpc"
CONTROLLERS = (
    *DEFAULT_CONTROLLERS["recommended"], "lqr", "linear-mpc", "sliding-mode", "adrc", "mppi",
)  # fmt: skip
"""The studies of the paper's path, parts ``noise`` and ``study``, have the default ones only."""
PLANTS = ("ball", "rollers")
DTS = (0.02, 0.05, 0.1)  # s
FAULT_KINDS = ("slope", "payload")
SEEDS = 20
PARTS = ("step", "step-cases", "tracking", "faults", "impossible", "noise", "study")
START = Pose(0.0, 0.0, 0.0)
SETTLED_BAND = 0.02  # of the step
STUDY_DT = 0.1  # s


class Cell(NamedTuple):
    """One run. Cells that differ in the controller only are compared with each other."""

    part: str
    robot: str
    dt: float
    plant: str
    case: str
    """Name of the case, kind of the fault, or preset of the paper's study."""
    reference: str
    """Name of the reference, or task of the paper's study."""
    seed: int
    controller: str

    @property
    def name(self) -> str:
        return " ".join(f"{value:g}" if isinstance(value, float) else str(value) for value in self)


class Figures(NamedTuple):
    """Figures of a run; NaN where one does not apply, infinite where the run failed."""

    me_mm: float = nan
    """Mean position error over the samples that count."""
    mae_mrad: float = nan
    """Mean absolute heading error over the samples that count."""
    max_mm: float = nan
    """Largest position error over the samples that count."""
    overshoot_percent: float = nan
    """Largest overshoot of the axes that step."""
    settling_s: float = nan
    """Time after which all axes that step stay within 2 % of their steps."""
    arrival: float = nan
    """Time of arrival at the end of the path over that of the exact retiming."""
    work_J: float = nan  # noqa: N815 - the unit
    """Work of the motors."""


FAILED = Figures(*[inf] * len(Figures._fields))


@dataclass(frozen=True)
class Grid:
    """Selection of cells."""

    parts: tuple[str, ...] = PARTS
    robots: tuple[str, ...] = tuple(ROBOTS)
    dts: tuple[float, ...] = DTS
    plants: tuple[str, ...] = PLANTS
    cases: tuple[str, ...] = tuple(CASES)
    references: tuple[str, ...] = (*SHAPES, *STEPS)
    controllers: tuple[str, ...] = CONTROLLERS

    def with_values(self, **values) -> Grid:
        """Return the grid with those values that are not None."""
        given = {f.name: values[f.name] for f in fields(self) if values.get(f.name) is not None}
        return replace(self, **given)

    def cells(self) -> list[Cell]:
        """Return the cells, each controller next to those that it is compared with."""
        every = []
        for part in self.parts:
            every += getattr(self, f"_{part.replace('-', '_')}")()
        return list(dict.fromkeys(every))

    def _product(self, part, plants, cases, references):
        return [
            Cell(part, robot, dt, plant, case, reference, 0, controller)
            for plant in self.plants if plant in plants
            for robot in self.robots
            for dt in self.dts
            for case in cases
            for reference in references
            for controller in self.controllers
        ]  # fmt: skip

    def _step(self):
        steps = [name for name in self.references if name in STEPS]
        return self._product("step", PLANTS, ("nominal",), steps)

    def _step_cases(self):
        steps = [name for name in self.references if name in STEPS]
        cases = [name for name in self.cases if name != "nominal"]
        return self._product("step-cases", ("ball",), cases, steps)

    def _tracking(self):
        shapes = [name for name in self.references if name in SHAPES]
        cases = dict.fromkeys(["nominal", *self.cases])
        return self._product("tracking", ("ball",), cases, shapes)

    def _faults(self):
        own = self._product("faults", PLANTS, FAULT_KINDS, ["eight"])
        return own + self._of_study("faults", self.plants, range(1, len(FAULT_KINDS) + 1))

    def _impossible(self):
        return self._product("impossible", PLANTS, ("nominal",), [IMPOSSIBLE])

    def _noise(self):
        return self._of_study("noise", self.plants)

    def _study(self):
        return self._of_study("study", [p for p in self.plants if p == "rollers"])

    def _of_study(self, part, plants, faults=()):
        """Return the runs of the paper's study: its robot, sample time and path."""
        if "paper" not in self.robots or STUDY_DT not in self.dts:
            return []
        cells = [
            cell
            for plant in plants
            for preset in (("paper", "recommended") if part == "study" else ("recommended",))
            for cell, settings in study_runs(part, plant, preset).items()
            if not faults or settings.fault in faults
        ]
        return [cell for cell in cells if cell.controller in self.controllers]


@cache
def study_scenario(part: str, plant: str, preset: str):
    scenario = paper_scenario(preset)
    tasks = scenario.tasks.model_dump()
    if part == "noise":
        tasks = {"noise": {"durations": tasks["noise"]["durations"], "repeats": SEEDS}}
    elif part == "faults":
        faults = [{"kind": kind, "at": 5.0} for kind in FAULT_KINDS]
        tasks = {"faults": {"duration": 20.0, "faults": faults}}
    name = "mujoco-rollers" if plant == "rollers" else "mujoco-balls"
    return scenario.with_values(tasks=tasks, plant=name)


@cache
def planned_study(part: str, plant: str, preset: str):
    return plan_and_check(study_scenario(part, plant, preset))


@cache
def study_runs(part: str, plant: str, preset: str) -> dict[Cell, RunSettings]:
    """Return the runs of the paper's study by their cells."""
    runs = {}
    for settings in settings_of_runs(study_scenario(part, plant, preset)):
        horizon = f" N={settings.horizon}" if settings.task == "horizon" else ""
        reference = f"{settings.task} {settings.duration:g} s{horizon}"
        case = (
            preset
            if part != "faults"
            else FAULT_KINDS[settings.fault - 1]
            if settings.fault
            else "none"
        )
        cell = Cell(
            part, "paper", STUDY_DT, plant, case, reference, settings.repeat, settings.controller
        )
        runs[cell] = settings
    return runs


def run_cell(cell: Cell) -> Figures:
    """Simulate one cell and return its figures; an exception is printed and fails this cell."""
    try:
        figures = figures_of(cell)
    except Exception as error:
        print(f"{cell.name}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
        return FAILED
    if figures is FAILED:
        print(f"{cell.name}: the run ended early", file=sys.stderr, flush=True)
    return figures


def figures_of(cell: Cell) -> Figures:
    preset = cell.case if cell.part == "study" else "recommended"
    if cell.part in ("noise", "study") or cell.reference not in SHAPES | STEPS | {IMPOSSIBLE: 0}:
        settings = study_runs(cell.part, cell.plant, preset)[cell]
        return study_figures(
            simulate_run(planned_study(cell.part, cell.plant, preset), settings), settings
        )
    return FIGURES[cell.part](cell, simulated(cell))


def simulated(cell: Cell) -> Run:
    robot, reference = ROBOTS[cell.robot], reference_of(cell.reference, cell.robot)
    context = ControllerContext(robot, cell.dt, np.random.default_rng(1))
    plant = case_plant(cell.robot, cell.case if cell.case in CASES else "nominal", cell.plant)
    fault = None
    if cell.part == "faults":
        fault = FAULTS[cell.case](at=0.25 * reference.duration)
        plant = case_plant(cell.robot, "nominal", cell.plant)
    return simulate(
        plant,
        configure("controllers", cell.controller).make(context),
        reference,
        start=START if cell.reference in STEPS else reference.at(0.0).pose,
        dt=cell.dt,
        schedule=Schedule((fault,), robot) if fault else None,
    )


def errors(run: Run, which: np.ndarray) -> Figures:
    """Return the errors over some samples of a run."""
    if run.outcome is not Outcome.FINISHED or not which.any():
        return FAILED
    distance = position_error(run.pose, run.target)[which]
    turn = np.abs(heading_error(run.pose, run.target))[which]
    return Figures(
        me_mm=1e3 * float(distance.mean()),
        mae_mrad=1e3 * float(turn.mean()),
        max_mm=1e3 * float(distance.max()),
        work_J=float(run.work[-1]),
    )


def tracking_figures(cell: Cell, run: Run) -> Figures:
    return errors(run, counted(cell.reference, run.t))


def fault_figures(cell: Cell, run: Run) -> Figures:
    return errors(run, run.t >= 0.25 * reference_of(cell.reference, cell.robot).duration)


def step_figures(cell: Cell, run: Run) -> Figures:
    return responses(run, START, STEPS[cell.reference])


def responses(run: Run, start: Pose, goal: Pose) -> Figures:
    """Return overshoot and settling time, the largest of the axes that step."""
    if run.outcome is not Outcome.FINISHED:
        return FAILED
    axes = [i for i in range(3) if goal[i] != start[i]]
    columns = {i: run.pose[:, i] for i in axes}
    overshoots = [step_response(run.t, columns[i], start[i], goal[i]).overshoot for i in axes]
    settling = [settling_time(run.t, columns[i], start[i], goal[i]) for i in axes]
    return Figures(
        overshoot_percent=max(overshoots), settling_s=max(settling), work_J=float(run.work[-1])
    )


def settling_time(t: np.ndarray, response: np.ndarray, start: float, goal: float) -> float:
    """Return when a linearly interpolated response enters the band for good, s; else infinity."""
    away = np.abs((response - goal) / (goal - start))
    outside = np.flatnonzero(away > SETTLED_BAND)
    if not len(outside):
        return 0.0
    last = int(outside[-1])
    if last == len(t) - 1:
        return inf
    low, high = (response[last : last + 2] - goal) / (goal - start)
    edge = np.copysign(SETTLED_BAND, low)
    return float(t[last] + (t[last + 1] - t[last]) * (low - edge) / (low - high))


def impossible_figures(cell: Cell, run: Run) -> Figures:
    """Return the distance to the path, and the time at which the robot arrives at its end."""
    if run.outcome is not Outcome.FINISHED:
        return FAILED
    found = path_distance(SHAPES["eight"], run.pose)
    end = reference_of(cell.reference, cell.robot).at(1e3).pose
    distance = np.hypot(*(run.pose - end)[:, :2].T)
    away = np.flatnonzero((distance > ARRIVED) | (found.share < 0.9))
    last = int(away[-1])
    time = inf
    if last + 1 < len(run.t):  # linear interpolation of the distance
        share = (distance[last] - ARRIVED) / (distance[last] - distance[last + 1])
        time = float(run.t[last] + share * (run.t[last + 1] - run.t[last]))
    return Figures(
        me_mm=1e3 * float(found.position.mean()),
        mae_mrad=1e3 * float(found.heading.mean()),
        max_mm=1e3 * float(found.position.max()),
        arrival=time / exact_arrival(cell.robot),
        work_J=float(run.work[-1]),
    )


def study_figures(run: Run, settings: RunSettings) -> Figures:
    if settings.task == "step":
        return responses(run, Pose(*run.pose[0].tolist()), Pose(*run.target[0].tolist()))
    return errors(run, run.t >= (5.0 if settings.task == "faults" else 0.0))


FIGURES = {
    "step": step_figures,
    "step-cases": step_figures,
    "tracking": tracking_figures,
    "faults": fault_figures,
    "impossible": impossible_figures,
}


def duration_of(cell: Cell) -> float:
    """Return the simulated time of a cell, s."""
    if cell.reference in SHAPES or cell.reference in STEPS or cell.reference == IMPOSSIBLE:
        return reference_of(cell.reference, cell.robot).duration
    return float(cell.reference.split()[1])


def cost_of(cell: Cell) -> float:
    """Return the approximate computing time of a cell, s."""
    duration = duration_of(cell)
    return duration / (150.0 if cell.plant == "ball" else 30.0) + 0.0003 * duration / cell.dt
