"""`omnidrive plan`: plan a path and its timing without simulation."""

from __future__ import annotations

import re
from dataclasses import fields
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, get_args

from omnidrive import scenario as scenarios
from omnidrive import study
from omnidrive.choices import MethodName, Unknown
from omnidrive.cli.options import PATH_PANEL, RESULTS_PANEL, JsonOption, choose_one, option
from omnidrive.cli.scenario_options import ScenarioOptions, with_options
from omnidrive.cli.terminal import conclude, note, print_json, show
from omnidrive.errors import InvalidInput, one_line
from omnidrive.study.output_paths import POSE_FORMATS

FigureOption = Annotated[
    Path | None,
    option("FILE.png", "Draw map, path and speeds; .svg is supported too.", RESULTS_PANEL),
]
TimeLimitOption = Annotated[
    float | None,
    option(
        "S",
        "Time for search and smoothing of the path, and again for the optimisation of --timing "
        "minimum-time, s; results then depend on the load of the computer [default: no limit].",
        PATH_PANEL,
    ),
]
_MAX_LISTED = 10  # queries listed in the text output
_SEARCH_OPTIONS = {"scenario", "map", "search", "unknown"}  # options that --scen uses


@with_options("plant", "preset", "seed", "estimator")
def plan(
    shared: ScenarioOptions,
    scen: Annotated[
        Path | None,
        option(
            "FILE.scen",
            "Instead, search every query of a MovingAI scenario file on the given map and list "
            "the path lengths that differ from those in the file.",
            PATH_PANEL,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        option(
            "FILE|FOLDER",
            "Write the motion to a waypoint file: .csv, .path (PathPlanner), .traj (Choreo) or "
            ".yaml (ROS nav_msgs/Path); any other name is a new folder for scenario.yaml, "
            "reference.csv, path.png and path.html.",
            RESULTS_PANEL,
        ),
    ] = None,
    png: FigureOption = None,
    html: Annotated[
        Path | None,
        option(
            "FILE.html",
            "Write a page with map, costs and zones, on which chart and robot follow the pointer.",
            RESULTS_PANEL,
        ),
    ] = None,
    time_limit: TimeLimitOption = None,
    json: JsonOption = False,
) -> None:
    """Search, smooth and time a path, and report its use of the robot's limits.

    If neither a duration nor a speed is given, the duration on a map file, or with
    `--timing limits` or `--timing minimum-time`, is the shortest that the robot's limits allow,
    rounded up to whole sample times (`compare` and `run` drive at 0.5 m/s, if they can); that of a
    waypoint file with times is its own; otherwise it is that of the scenario.

    For example:

    * `omnidrive plan`
    * `omnidrive plan depot.yaml --start 2,2 --goal 27,13 --robot small --out depot.traj`
    * `omnidrive plan depot.yaml --start 2,2 --goal 27,13 --robot small --html depot.html`
    * `omnidrive plan --reference circle,radius=1.5 --png circle.png`
    * `omnidrive plan maze.map --scen maze.map.scen --json`
    """
    from omnidrive.compiled import announce_compiling

    if scen is not None:
        _check_search_options(shared, out=out, png=png, html=html, time_limit=time_limit)
        _solve(shared, scen, json)
        return
    study.check_plan_targets(out, png, html)
    with announce_compiling():
        planned = _planned(shared, time_limit)
    _report(planned, (out, png, html), json, time_limit is not None)


def _planned(shared: ScenarioOptions, time_limit: float | None) -> scenarios.PlannedScenario:
    """Plan the path, and its timing unless the scenario has one."""
    is_timed_here = (
        shared.speed is not None
        or shared.map_file is not None
        or shared.defines_motion
        or shared.timing in {"limits", "minimum-time"}
        or (time_limit is not None and shared.max_speed is not None)
    )
    if is_timed_here and shared.duration is None:
        return scenarios.plan_at(shared.resolve(retimed=False), shared.speed, time_limit)
    return scenarios.plan_and_check(shared.resolve(), time_limit)


def _report(
    planned: scenarios.PlannedScenario,
    files: tuple[Path | None, Path | None, Path | None],
    json: bool,
    is_limited: bool,
) -> None:
    """Print the results and write the requested files: motion, figure and page."""
    reference = planned.reference(study.planned_duration(planned))
    facts = study.plan_facts(planned, reference, is_limited=is_limited)
    if json:
        print_json(dict(_key(*item) for item in facts.items()))
    else:
        for name, fact in facts.items():
            show(f"{name:<20}{fact}")
    out, png, html = files
    if out:
        study.save_plan(planned, reference, out)
        if out.suffix.lower() in POSE_FORMATS:
            note(f"{out} has no velocities; .csv and .traj keep the motion")
        conclude(f"written to {out}", beside_json=json)
    if png:
        study.save_figure(planned, reference, png)
        conclude(f"figure written to {png}", beside_json=json)
    if html:
        study.save_plan_page(planned, reference, html)
        conclude(f"page written to {html}", beside_json=json)


def _key(name: str, fact: study.Fact) -> tuple[str, float | str | None]:
    """Return key and value of a result for JSON; the key contains the unit.

    For example ``mean_speed_m_per_s``. A value that is not finite, such as the curvature of a sharp
    corner, becomes null.
    """
    unit = fact.unit.replace("1/", "per ").replace("/", " per ").replace("%", "percent")
    return re.sub(r"\W+", "_", f"{name} {unit}".strip()), (
        None if isinstance(fact.value, float) and not isfinite(fact.value) else fact.value
    )


def _check_search_options(shared: ScenarioOptions, **options: object) -> None:
    """Raise InvalidInput if an option is given that has no effect with ``--scen``."""
    options = {field.name: getattr(shared, field.name) for field in fields(shared)} | options
    unused = [
        "--" + name.replace("_", "-")
        for name, value in options.items()
        if value not in {None, False} and name not in _SEARCH_OPTIONS
    ]
    if unused:
        raise InvalidInput(f"--scen only searches: omit {', '.join(unused)}")


def _solve(shared: ScenarioOptions, scen: Path, json: bool) -> None:
    """Search the queries of a scenario file and print the results."""
    from omnidrive.maps import load_map, load_queries

    if shared.map_file is None:
        raise InvalidInput(
            "--scen needs the map file of its queries: omnidrive plan FILE.map --scen FILE.scen"
        )
    method = choose_one("search", shared.search or "astar", get_args(MethodName))
    unknown = choose_one(
        "treatment of unknown cells", shared.unknown or "occupied", get_args(Unknown)
    )
    grid = load_map(shared.map_file, unknown=unknown)
    solved = study.solve_queries(grid, load_queries(scen, grid), method=method)
    if json:
        print_json(solved)
        return
    for line in _lines(solved, one_line(str(scen))):
        show(line)


def _lines(solved: dict[str, Any], file: str) -> list[str]:
    """Format the results of :func:`~omnidrive.study.solve_queries` with cells as in the file."""
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
        f"{file}, line {each['line']}: {tuple(each['start_in_file'])} to "
        f"{tuple(each['goal_in_file'])}: {each['length_in_file']:.8f} cells in the file, "
        + (each["why"] if each["length"] is None else f"{each['length']:.8f} found")
        for each in differing[:_MAX_LISTED]
    ]
    more = len(differing) - _MAX_LISTED
    return [*lines, f"and {more} more: --json lists them"] if more > 0 else lines
