"""Cells of the gauntlet: one run of one controller each, and its figures."""

from __future__ import annotations

import sys
from functools import cache
from math import inf, nan
from typing import NamedTuple

import numpy as np
from gauntlet_cases import ALL_CASES, case_plant
from gauntlet_oscillation import at_bounds, reversals, straight
from gauntlet_references import (
    ARRIVED,
    IMPOSSIBLE,
    LINK_SHAPES,
    SETTLED,
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
UNADAPTED = "holonomic-nmpc:adapt=false"
"""The recommended controller without adaptation, in the parts ``link`` and ``link-steps``."""
FAULT_KINDS = ("slope", "payload")
SEEDS = 20
START = Pose(0.0, 0.0, 0.0)
SETTLED_BAND = 0.02  # of the step
AT_GOAL = 4.0  # s, after which a step has ended
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
    reversals: float = nan
    """Share of the samples on straights or at rest in which the command turns back."""
    at_bounds: float = nan
    """Number of identified parameters at a bound in the end."""


OWN_REFERENCES = {*SHAPES, *STEPS, *LINK_SHAPES, IMPOSSIBLE}
"""The others are tasks of the paper's study."""
FAILED = Figures(*[inf] * len(Figures._fields))


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
    if cell.part in ("noise", "study") or cell.reference not in OWN_REFERENCES:
        settings = study_runs(cell.part, cell.plant, preset)[cell]
        return study_figures(
            simulate_run(planned_study(cell.part, cell.plant, preset), settings), settings
        )
    return FIGURES[cell.part](cell, simulated(cell))


def simulated(cell: Cell) -> Run:
    robot, reference = ROBOTS[cell.robot], reference_of(cell.reference, cell.robot)
    context = ControllerContext(robot, cell.dt, np.random.default_rng(1))
    plant = case_plant(cell.robot, cell.case if cell.case in ALL_CASES else "nominal", cell.plant)
    controller = (
        configure("controllers", RECOMMENDED, {"adapt": False})
        if cell.controller == UNADAPTED
        else configure("controllers", cell.controller)
    )
    fault = None
    if cell.part == "faults":
        fault = FAULTS[cell.case](at=0.25 * reference.duration)
        plant = case_plant(cell.robot, "nominal", cell.plant)
    return simulate(
        plant,
        controller.make(context),
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


def link_figures(cell: Cell, run: Run) -> Figures:
    figures = tracking_figures(cell, run)
    if figures is FAILED:
        return FAILED
    which = straight(reference_of(cell.reference, cell.robot), run.t) & (run.t >= SETTLED)
    return figures._replace(reversals=reversals(run, which), at_bounds=at_bounds(run))


def link_step_figures(cell: Cell, run: Run) -> Figures:
    figures = step_figures(cell, run)
    if figures is FAILED:
        return FAILED
    shares = reversals(run, run.t >= AT_GOAL)
    return figures._replace(reversals=shares, at_bounds=at_bounds(run))


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
    "link": link_figures,
    "link-steps": link_step_figures,
    "faults": fault_figures,
    "impossible": impossible_figures,
}


COSTS = {"planar": (0.0017, 0.0005), "ball": (0.0113, 0.00075), "rollers": (0.065, 0.001)}
"""Computing time per simulated time, and that per sample in s, about."""


def duration_of(cell: Cell) -> float:
    """Return the simulated time of a cell, s."""
    if cell.reference in OWN_REFERENCES:
        return reference_of(cell.reference, cell.robot).duration
    return float(cell.reference.split()[1])


def cost_of(cell: Cell) -> float:
    """Return the approximate computing time of a cell, s."""
    duration, (per_time, per_sample) = duration_of(cell), COSTS[cell.plant]
    return duration * (per_time + per_sample / cell.dt)
