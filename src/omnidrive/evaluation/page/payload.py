"""JSON data of a study for the scripts of the report."""

from __future__ import annotations

import json
from math import ceil
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from omnidrive.arrays import Array
from omnidrive.evaluation.map_cells import cell_kinds, max_pool
from omnidrive.evaluation.page.columns import column
from omnidrive.evaluation.page.plan_payload import layers_data, plan_data
from omnidrive.evaluation.palette import ControllerStyle, controller_styles, horizon_styles
from omnidrive.evaluation.plan_view import PlanView
from omnidrive.evaluation.study_logs import (
    RecordedRun,
    StudyLogs,
)
from omnidrive.evaluation.tuning import INPUTS, tuning_signals, unit_text
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path
from omnidrive.robot import Robot
from omnidrive.simulation import Outcome, Run

_POSE_DECIMALS = 8  # 10 nm, 10 nrad: errors are differences of poses
_TASKS = {"track": "Track", "noise": "Noise", "horizon": "Horizons"}
_SPLINE_POINTS = 600
_LARGEST = 1500
"""Cells along a side of the map; larger maps are reduced."""


def payload(logs: StudyLogs) -> str:
    """Return the JSON data, safe inside a script element: every ``<`` is escaped.

    Lengths in m, angles in rad, times in s. Wheels in B; poses, paths and the map in W. True and
    target poses are rounded to 1e-8, other columns to 1e-5; a value in a column that is not finite
    becomes null.
    """
    place = _place(logs.robot, logs.obstacles, logs.free_space, logs.grid_path)
    spline = logs.spline.poses(np.linspace(0.0, 1.0, _SPLINE_POINTS))
    return _text({"dt": logs.dt} | place | _path(spline, logs.plan) | {"groups": _groups(logs)})


def plan_payload(view: PlanView) -> str:
    """Return the JSON data of a planned motion alone, in the form of :func:`payload`."""
    place = _place(view.robot, view.obstacles, view.free_space, view.grid_path)
    step = float(view.times[-1] - view.times[0]) / max(len(view.times) - 1, 1)
    return _text({"dt": step} | place | _path(view.motion, view) | {"groups": []})


def _text(data: dict[str, Any]) -> str:
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _path(poses: Float[Array, "points columns"], plan: PlanView | None) -> dict[str, Any]:
    """Return the path as a polyline, and the planned motion along it, if there is one."""
    return {
        "spline": [column(poses[:, i]) for i in (0, 1)],
        "plan": plan and plan_data(plan),
        "layers": plan and layers_data(plan.costs),
    }


def _place(
    robot: Robot, obstacles: OccupancyGrid, free_space: OccupancyGrid, grid_path: Path | None
) -> dict[str, Any]:
    """Return robot, map and the cells of the grid path."""
    return {
        "robot": {
            "bodyRadius": robot.body_radius,
            "outline": robot.outline,
            "wheelRadius": robot.wheel.radius,
            "wheels": [
                {"x": m.x, "y": m.y, "axle": m.axle_angle, "roller": m.roller_angle}
                for m in robot.mounts
            ],
        },
        "map": _map(obstacles, free_space),
        "cells": [column(grid_path.poses[:, i]) if grid_path else [] for i in (0, 1)],
    }


def _map(grid: OccupancyGrid, free: OccupancyGrid) -> dict[str, Any]:
    """Return the cells, run-length encoded, bottom row first: 0 free, 1 inflated, 2 occupied.

    A large map is reduced: each of its cells then has the highest kind of a block of cells.
    """
    k = ceil(max(grid.occupied.shape) / _LARGEST)
    kinds = max_pool(cell_kinds(grid, free), k)
    rows, cols = kinds.shape
    return {
        "rows": rows,
        "cols": cols,
        "resolution": grid.resolution * k,
        "origin": [*grid.origin, grid.yaw],
        "extent": list(grid.extent),
        "size": [side * grid.resolution for side in grid.occupied.shape[::-1]],
        "kinds": _run_lengths(kinds.ravel()),
    }


def _run_lengths(kinds: UInt8[Array, " cells"]) -> list[int]:
    """Encode as kind, length, kind, length, ..."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(kinds)) + 1])
    lengths = np.diff(np.append(starts, len(kinds)))
    flat: list[int] = np.column_stack([kinds[starts], lengths]).ravel().tolist()
    return flat


def _groups(logs: StudyLogs) -> list[dict[str, Any]]:
    """Return the groups of runs: by task and duration, then the step responses and faults."""
    styles = controller_styles(logs)
    keys = dict.fromkeys((r.task, r.duration) for r in logs.select(*_TASKS))
    groups = []
    for task, duration in sorted(keys, key=lambda key: (list(_TASKS).index(key[0]), key[1])):
        runs = logs.select(task, duration=duration)
        if task == "horizon":
            runs = tuple(sorted(runs, key=lambda r: (r.horizon, r.controller)))
            encoded = [
                _run(r.log, f"{r.controller}, N = {r.horizon}", f"N = {r.horizon}", style)
                for r, style in zip(runs, horizon_styles(len(runs)), strict=True)
            ]
        else:
            encoded = [_controller(r, styles) for r in runs]
        name = f"{_TASKS[task]} {duration:g} s"
        if task == "noise" and logs.repeats > 1:
            name += f", first of {logs.repeats} seeds"
        groups.append(_group(f"{task}-{duration:g}", name, [r.log for r in runs], encoded))
    steps = logs.select("step")
    if steps:
        encoded = [_controller(r, styles) for r in steps]
        groups.append(_group("step", "Step response", [r.log for r in steps], encoded))
    for variant in dict.fromkeys(r.record.variant for r in logs.select("faults")):
        of_fault = [r for r in logs.select("faults") if r.record.variant == variant]
        fault = logs.faults.get(variant)
        name = f"{fault.kind} at {fault.at:g} s" if fault else "no fault"
        encoded = [_controller(r, styles) for r in of_fault]
        number = int(variant[:2])
        groups.append(_group(f"fault-{number}", name, [r.log for r in of_fault], encoded))
    return groups


def _group(
    identifier: str, label: str, runs: list[Run], encoded: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return one group of runs; times and target are those of the longest run."""
    longest = max(runs, key=lambda run: len(run.t))
    return {
        "id": identifier,
        "label": label,
        "onMap": identifier != "step",
        "t": column(longest.t),
        "target": [column(longest.target[:, i], _POSE_DECIMALS) for i in range(3)],
        "tuning": _quantities(runs),
        "runs": encoded,
    }


def _quantities(runs: list[Run]) -> list[dict[str, str]]:
    """Return the gains and fuzzy inputs in the logs of the runs, once each."""
    every = [each for run in runs for each in tuning_signals(run)]
    return [
        {
            "quantity": quantity,
            "title": INPUTS.get(quantity, quantity),
            "channel": channel,
            "unit": unit_text(unit),
        }
        for quantity, channel, unit in dict.fromkeys(each[:3] for each in every)
    ]


def _controller(result: RecordedRun, styles: dict[str, ControllerStyle]) -> dict[str, Any]:
    name = result.controller
    return _run(result.log, name, name, styles[name])


def _run(run: Run, label: str, short: str, style: ControllerStyle) -> dict[str, Any]:
    is_shown = not np.array_equal(run.measured, run.pose)  # noisy or estimated
    twist = run.twist
    if len(run.t) > 1 and not np.isfinite(twist).any():  # a robot that measures none
        twist = np.gradient(run.pose, run.t, axis=0)
    speed = np.hypot(twist[:, 0], twist[:, 1])
    return {
        "label": label,
        "short": short,
        "ink": list(style.colour),
        "dash": list(style.dash),
        "pose": [column(run.pose[:, i], _POSE_DECIMALS) for i in range(3)],
        "measured": [column(run.measured[:, i]) for i in (0, 1)] if is_shown else None,
        "speed": column(speed),
        "yawRate": column(twist[:, 2]),
        "tuning": {f"{each.quantity} {each.channel}": column(each.values)
                   for each in tuning_signals(run)},
        "ended": None if run.outcome is Outcome.FINISHED else run.ending,
    }  # fmt: skip
