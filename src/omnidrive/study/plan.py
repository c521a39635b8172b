"""A scenario's path by itself: facts about it, and files for other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from omnidrive.evaluation.figures import route_figure, save
from omnidrive.reference import shortest_duration
from omnidrive.study.folder import RunFolder, writing
from omnidrive.study.prepared import Prepared, prepare
from omnidrive.study.scenario import Scenario

_COLUMNS = "t_s,x_m,y_m,yaw_rad,vx_m_per_s,vy_m_per_s,yaw_rate_rad_per_s"


def plan_facts(scenario: Scenario) -> dict[str, str]:
    """What there is to say of the path, with units."""
    prepared = prepare(scenario)
    shortest = shortest_duration(prepared.spline, prepared.robot.chassis)
    samples = prepared.spline.poses(np.linspace(0.0, 1.0, 2001))[:, :2]
    return {
        "cells on the path": f"{len(prepared.path.poses)}",
        "length of the cells": f"{prepared.path.length:.3f} m",
        "length, smoothed": f"{prepared.spline.length:.3f} m",
        "least clearance": f"{prepared.clearance(samples):.3f} m",
        "shortest duration": f"{shortest:g} s",
        "duration": f"{_duration(prepared):g} s",
    }


def save_plan(scenario: Scenario, folder: Path) -> None:
    """Write scenario.yaml, reference.csv (in W, one row per sample time) and path.png.

    Raises:
        CannotWrite: The folder cannot be made, or holds something already.
    """
    prepared = prepare(scenario)
    RunFolder(folder).save_demand(prepared)
    duration, dt = _duration(prepared), scenario.sample_time
    rows = round(duration / dt) + 1
    times = dt * np.arange(rows)
    window = prepared.reference(duration).window(0.0, rows, dt)
    with writing(folder):
        np.savetxt(
            folder / "reference.csv", np.column_stack([times, window]), fmt="%.9g",
            delimiter=",", header=_COLUMNS, comments="",
        )  # fmt: skip
        figure = route_figure(prepared.obstacles, prepared.keepout, prepared.path, prepared.spline)
        save(figure, folder / "path.png")


def _duration(prepared: Prepared) -> float:
    """The scenario's shortest duration, or the robot's if the scenario follows no path; in s."""
    following = prepared.scenario.tasks.following
    return following[0] if following else shortest_duration(prepared.spline, prepared.robot.chassis)
