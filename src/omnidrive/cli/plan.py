"""`omnidrive plan`: from a map to a timed reference, without driving."""

from __future__ import annotations

import json as json_format
import re
from dataclasses import fields
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from omnidrive.cli.demand import Demand, with_demand
from omnidrive.cli.options import PATH_PANEL, RESULTS_PANEL, choose_one, flag, option
from omnidrive.compiled import kernels_are_kept
from omnidrive.errors import InvalidInput
from omnidrive.maps import Unknown, load_map, load_queries
from omnidrive.planning import MethodName
from omnidrive.study import (
    Fact,
    Prepared,
    check_plan_targets,
    plan_at,
    plan_facts,
    planned_duration,
    prepare,
    save_figure,
    save_plan,
    solve_queries,
)

_SHOWN = 10  # queries whose lengths differ
_OF_SEARCHES = {"scenario", "map", "search", "unknown"}


@with_demand("plant", "preset", "seed", "estimator")
def plan(
    demand: Demand,
    scen: Annotated[
        Path | None,
        option(
            "FILE.scen",
            "Search every query of a MovingAI scenario file on its map instead, and report the "
            "lengths that differ from the file's.",
            PATH_PANEL,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        option(
            "FILE|FOLDER",
            "Waypoint file for the reference: .csv, .path (PathPlanner), .traj (Choreo), .yaml "
            "(ROS nav_msgs/Path); or else a new folder for scenario.yaml, reference.csv and "
            "path.png.",
            RESULTS_PANEL,
        ),
    ] = None,
    png: Annotated[
        Path | None, option("FILE.png", "Draw map, path and speeds; .svg too.", RESULTS_PANEL)
    ] = None,
    json: Annotated[bool, flag("Print JSON, for machines.", RESULTS_PANEL, "--json")] = False,
) -> None:
    """Search a path, smooth it, time it; say what it asks of the robot.

    On a map, or with a timing from rest to rest, the robot goes as fast as its wheels allow, in a
    whole number of samples, unless a duration or a speed is given.

    For example:

    * `omnidrive plan`
    * `omnidrive plan depot.yaml --start 2,2 --goal 27,13 --robot small --png depot.png`
    * `omnidrive plan depot.yaml --start 2,2 --goal 27,13 --robot small --out depot.traj`
    * `omnidrive plan maze.map --scen maze.map.scen --json`
    """
    if scen is not None:
        _refuse_needless(demand, out=out, png=png)
        _solve(demand, scen, json)
        return
    check_plan_targets(out, png)
    if not kernels_are_kept():
        typer.echo("compiling, the first time only: up to a minute", err=True)
    at_best = demand.map_file is not None or demand.timing in {"limits", "minimum-time"}
    if at_best and demand.duration is None:
        prepared = plan_at(demand.resolve(retimed=False), demand.speed)
    else:
        prepared = prepare(demand.resolve())
    _report(prepared, out, png, json)


def _report(prepared: Prepared, out: Path | None, png: Path | None, json: bool) -> None:
    """Print the facts, and write what was asked for."""
    reference = prepared.reference(planned_duration(prepared))
    facts = plan_facts(prepared, reference)
    if json:
        typer.echo(json_format.dumps(dict(_key(*item) for item in facts.items()), indent=2))
    else:
        for name, fact in facts.items():
            typer.echo(f"{name:<20}{fact}")
    if out:
        save_plan(prepared, reference, out)
        typer.echo(f"written to {out}", err=json)
    if png:
        save_figure(prepared, reference, png)
        typer.echo(f"drawn in {png}", err=json)


def _key(name: str, fact: Fact) -> tuple[str, float | str | None]:
    """A fact for machines: the unit is part of the name, as in ``mean_speed_m_per_s``.

    What is not finite, such as the curvature of a sharp corner, is null, as JSON has it.
    """
    unit = fact.unit.replace("1/", "per ").replace("/", " per ").replace("%", "percent")
    return re.sub(r"\W+", "_", f"{name} {unit}".strip()), (
        None if isinstance(fact.value, float) and not isfinite(fact.value) else fact.value
    )


def _refuse_needless(demand: Demand, **options: object) -> None:
    """Refuse options that have nothing to do with searches alone."""
    options = {field.name: getattr(demand, field.name) for field in fields(demand)} | options
    needless = [
        "--" + name.replace("_", "-")
        for name, value in options.items()
        if value is not None and name not in _OF_SEARCHES
    ]
    if needless:
        raise InvalidInput(f"--scen only searches: leave out {', '.join(needless)}")


def _solve(demand: Demand, scen: Path, json: bool) -> None:
    """Search a scenario file's queries and print how that went."""
    if demand.map_file is None:
        raise InvalidInput("--scen needs the map's file: omnidrive plan FILE.map --scen FILE.scen")
    method = choose_one("search", demand.search or "astar", get_args(MethodName))
    unknown = choose_one("kind", demand.unknown or "occupied", get_args(Unknown))
    grid = load_map(demand.map_file, unknown=unknown)
    solved = solve_queries(grid, load_queries(scen, grid), method=method)
    if json:
        typer.echo(json_format.dumps(solved, indent=2))
        return
    for line in _lines(solved):
        typer.echo(line)


def _lines(solved: dict[str, Any]) -> list[str]:
    """How the searches went, for people."""
    differing = solved["differing"]
    lines = [
        f"{'search':<20}{solved['search']}",
        f"{'queries':<20}{solved['queries']}",
        f"{'solved':<20}{solved['solved']}",
        f"{'lengths that differ':<20}{len(differing)}",
        f"{'expansions':<20}{solved['expansions']}",
        f"{'time':<20}{1e3 * solved['seconds']:.3f} ms",
    ]
    lines += [
        f"query {each['query']}: {each['length_in_file']:.8f} cells in the file, "
        + (each["why"] if each["length"] is None else f"{each['length']:.8f} found")
        for each in differing[:_SHOWN]
    ]
    more = len(differing) - _SHOWN
    return [*lines, f"and {more} more: --json lists them"] if more > 0 else lines
