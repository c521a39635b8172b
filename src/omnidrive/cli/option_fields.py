"""Options that define a scenario: names, types and help texts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, get_args

import typer

from omnidrive.choices import (
    Heading,
    MethodName,
    PresetName,
    SmoothingName,
    TimingName,
    Unknown,
)
from omnidrive.cli.completion import component, one_of, paper_or_file
from omnidrive.cli.options import PATH_PANEL, RUN_PANEL, choice, flag, option
from omnidrive.components import component_names


@dataclass(frozen=True, slots=True)
class OptionFields:
    """Values of the shared options, one field per option; None: option not given."""

    scenario: Annotated[
        str,
        typer.Argument(
            help="`paper`, a scenario file (.yaml), the folder of a scenario, or a map file: Nav2 "
            "(.yaml), MovingAI (.map), NumPy (.npy) or text (.txt), or a waypoint file: .csv, "
            ".path (PathPlanner), .traj (Choreo) or .yaml (ROS nav_msgs/Path).",
            autocompletion=paper_or_file,
        ),
    ] = "paper"
    map: Annotated[
        Path | None, option("FILE|NAME", "Map file, or name of an installed map.", PATH_PANEL)
    ] = None
    reference: Annotated[
        str | None,
        option(
            "NAME[,KEY=VALUE...]|FILE",
            "Motion instead of a planned path: circle, eight, square, raised-cosine, slalom, "
            "random-smooth, a waypoint file, or your own as FILE.py:NAME; without a map on an open "
            "floor.",
            PATH_PANEL,
            complete=component("references"),
        ),
    ] = None
    start: Annotated[str | None, option("X,Y[,HEADING]", "Start, m, m, rad.", PATH_PANEL)] = None
    goal: Annotated[str | None, option("X,Y[,HEADING]", "Goal, m, m, rad.", PATH_PANEL)] = None
    duration: Annotated[
        float | None,
        option(
            "S",
            "Duration of the path, s; the task `track` has a second one, 1.5 times as long, which "
            "is that of the task `noise`.",
            PATH_PANEL,
        ),
    ] = None
    speed: Annotated[
        float | None,
        option(
            "M/S",
            "Mean speed, m/s, instead of a duration. Without both, on a map: 0.5, or the highest "
            "possible if that is lower; `plan` takes the shortest duration.",
            PATH_PANEL,
        ),
    ] = None
    max_speed: Annotated[
        float | None,
        option(
            "M/S",
            "Largest speed along the motion, m/s; durations grow as far as it requires.",
            PATH_PANEL,
        ),
    ] = None
    max_curvature: Annotated[
        float | None, option("1/M", "Largest curvature of the path, 1/m.", PATH_PANEL)
    ] = None
    max_curvature_rate: Annotated[
        float | None,
        option("1/M^2", "Largest change of the curvature with the distance, 1/m^2.", PATH_PANEL),
    ] = None
    max_jerk: Annotated[
        float | None,
        option(
            "M/S^3",
            "Largest jerk with timing `limits` or `minimum-time`, m/s^3: smooth starts and stops.",
            PATH_PANEL,
        ),
    ] = None
    margin: Annotated[
        float | None, option("M", "Clearance between robot and obstacles, m.", PATH_PANEL)
    ] = None
    unknown: Annotated[
        str | None, choice(get_args(Unknown), "Treatment of unknown cells.", PATH_PANEL)
    ] = None
    resolution: Annotated[
        float | None,
        option("M", "Cell size, m, if the map file does not define it [default: 1].", PATH_PANEL),
    ] = None
    keepout: Annotated[
        Path | None,
        option(
            "FILE.yaml",
            "Keep-out mask, a Nav2 map of the size of the map: 100 percent is not entered, less "
            "costs up to 2 metres per metre.",
            PATH_PANEL,
        ),
    ] = None
    speed_mask: Annotated[
        Path | None,
        option(
            "FILE.yaml",
            "Speed mask, likewise, with Nav2's `type` (1: percent, 2: m/s), `base` and "
            "`multiplier` in the file; with the timing `limits`.",
            PATH_PANEL,
        ),
    ] = None
    cost_weight: Annotated[
        float | None,
        option(
            "X",
            "Cost of a metre next to an obstacle, in metres; on a map 2, so that the path keeps to "
            "the middle where there is room. 0: the shortest path.",
            PATH_PANEL,
        ),
    ] = None
    cost_radius: Annotated[
        float | None,
        option("M", "Distance up to which obstacles cause costs, m [default: 3].", PATH_PANEL),
    ] = None
    cost_scaling: Annotated[
        float | None,
        option("1/M", "Decay of the cost with the distance, 1/m [default: 1].", PATH_PANEL),
    ] = None
    robot: Annotated[
        str | None,
        option(
            "NAME|FILE",
            f"Robot: {', '.join(component_names('robots'))}, or a robot file (.yaml).",
            RUN_PANEL,
            complete=component("robots"),
        ),
    ] = None
    plant: Annotated[
        str | None,
        option(
            "NAME[,KEY=VALUE...]",
            "Simulated plant: mujoco-rollers; mujoco-balls; planar, a rigid body with wheel "
            "friction; kinematic; coppeliasim, a running CoppeliaSim; or your own as FILE.py:NAME.",
            RUN_PANEL,
            complete=component("plants"),
        ),
    ] = None
    preset: Annotated[
        str | None,
        choice(
            get_args(PresetName),
            "Parameters of PID, fuzzy PIDs and unicycle NMPC: from the text of the paper, from its "
            "published code (including the error in its wheel matrix), or recommended values.",
            RUN_PANEL,
        ),
    ] = None
    search: Annotated[
        str | None,
        choice(
            get_args(MethodName),
            "Grid search: shortest path (astar; jump-point, faster on open or narrow maps), "
            "any-angle path (lazy-theta), or greedy best-first as in the paper.",
            PATH_PANEL,
        ),
    ] = None
    cut_corners: Annotated[
        bool | None,
        flag(
            "Whether diagonal moves may cut the corners of obstacles, as in the paper.",
            PATH_PANEL,
            "--cut-corners/--no-cut-corners",
        ),
    ] = None
    smooth: Annotated[
        str | None,
        choice(
            get_args(SmoothingName),
            "Smoothing with certified clearance, or without checks as in the paper.",
            PATH_PANEL,
        ),
    ] = None
    timing: Annotated[
        str | None,
        choice(
            get_args(TimingName),
            "Timing: uniform as in the paper; from rest to rest within the wheel limits; or a "
            "minimum-time trajectory, which also changes path and heading.",
            PATH_PANEL,
        ),
    ] = None
    heading: Annotated[
        str | None,
        option(
            "|".join("face:X,Y" if each == "face" else each for each in get_args(Heading)),
            "Heading of the robot, with the timing `limits`: of the path, along it, constant, "
            "toward a point, turned to that of the goal near the start or near the goal, the "
            "fastest angle to the direction of motion, or optimised for time; tangent or fixed "
            "also for a waypoint table without headings.",
            PATH_PANEL,
            complete=one_of([each for each in get_args(Heading) if each != "face"]),
        ),
    ] = None
    estimator: Annotated[
        bool | None,
        flag(
            "Whether the controllers receive the pose estimated from wheel encoders, a gyro and a "
            "measured pose, or, as in the paper, the measured pose.",
            RUN_PANEL,
            "--estimator/--no-estimator",
        ),
    ] = None
    seed: Annotated[int | None, option("N", "Seed of the noise.", RUN_PANEL)] = None
    allow_code: Annotated[
        bool,
        flag(
            "Import code that the scenario file or a controller file names, such as "
            "mine.py:MyController; only for files that you trust.",
            RUN_PANEL,
            "--allow-code",
        ),
    ] = False
