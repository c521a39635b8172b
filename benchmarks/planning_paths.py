"""Rows of the planning benchmark on paths: costs, headings, and polygons of robots."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from figures import at_least, at_most, row

from omnidrive.errors import OmnidriveError
from omnidrive.maps import Inflation, OccupancyGrid, load_map, rooms_map, warehouse_map
from omnidrive.planning import PathOptions, Plan, Planner, SplinePath, Waypoint, plan_footprint
from omnidrive.planning.footprint import PoseSearch
from omnidrive.reference import MotionLimits, time_within_limits
from omnidrive.robot import named_robot

INFLATION = 0.25  # m
PATHS, HEADING_PATHS = 12, 20
FARTHEST = 2.0  # m between start and goal, at least
SAMPLES = 801
BOX = np.array([[0.35, 0.25], [-0.35, 0.25], [-0.35, -0.25], [0.35, -0.25]])  # m
FOOTPRINT_SIDE, FOOTPRINT_MAPS, FOOTPRINT_QUERIES = 500, 4, 10


def maps(files: list[Path]) -> dict[str, OccupancyGrid]:
    """Return generated maps with cells of 0.05 m, and those of files."""
    rng = np.random.default_rng(5)
    return {
        "rooms": refined(rooms_map(30, 40, 7, rng)),
        "warehouse": refined(warehouse_map(30, 50, rng)),
        **{file.stem: load_map(file) for file in files},
    }


def refined(grid: OccupancyGrid) -> OccupancyGrid:
    """Return a map whose cells have a side of 0.8 m, in cells of 0.05 m."""
    return OccupancyGrid(np.kron(grid.occupied, np.ones((16, 16), bool)), 0.05)


def cost_rows(files: list[Path]) -> Iterator[dict[str, object]]:
    """Yield mean clearance, length and time of paths with the default costs over those without."""
    for name, grid in maps(files).items():
        plain = Planner(grid, inflation=INFLATION, options=PathOptions())
        costly = Planner(grid, inflation=INFLATION, around_obstacles=Inflation())
        found = []
        for start, goal in queries(plain.free_space, np.random.default_rng(7)):
            try:
                first = timed(plain, start, goal)
            except OmnidriveError:
                continue
            found.append((first, timed(costly, start, goal)))
        if not found:
            continue
        ratios = np.array([compared(grid, *each) for each in found])
        yield at_least(f"costs, {name}: mean clearance", ratios[:, 0].mean(), "1", 1.5)
        yield at_most(f"costs, {name}: length", ratios[:, 1].mean(), "1", 1.05)
        yield at_most(f"costs, {name}: time of planning", float(np.median(ratios[:, 2])), "1", 2.0)
        yield row(f"costs, {name}: time of the search", float(np.median(ratios[:, 3])), "1")
        yield row(f"costs, {name}: least clearance", ratios[:, 4].mean(), "1")
        yield row(f"costs, {name}: largest curvature", float(np.median(ratios[:, 5])), "1")


def queries(free: OccupancyGrid, rng: np.random.Generator) -> Iterator[tuple[Waypoint, Waypoint]]:
    """Yield pairs of free positions that are not near each other."""
    cells, count = np.argwhere(~free.occupied), 0
    while count < PATHS:
        ends = free.centres(cells[rng.integers(len(cells), size=2)])
        if np.hypot(*(ends[1] - ends[0])) > FARTHEST:
            count += 1
            yield Waypoint(*ends[0].tolist()), Waypoint(*ends[1].tolist())


def timed(planner: Planner, start: Waypoint, goal: Waypoint) -> tuple[Plan, float]:
    """Return a plan and the shortest time of three, s."""
    seconds = []
    for _ in range(3):
        began = perf_counter()
        plan = planner.plan(start, goal)
        seconds.append(perf_counter() - began)
    return plan, min(seconds)


def compared(
    grid: OccupancyGrid, plain: tuple[Plan, float], costly: tuple[Plan, float]
) -> tuple[float, ...]:
    """Return ratios: mean clearance, length, times, least clearance and curvature."""
    clearances = []
    for plan, _ in (plain, costly):
        points = plan.spline.poses(np.linspace(0.0, 1.0, SAMPLES))[:, :2]
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        away = grid.clearance(0.5 * (points[1:] + points[:-1]))
        clearances.append((float(np.average(away, weights=steps)), float(away.min())))
    (mean, least), (costly_mean, costly_least) = clearances
    before, after = plain[0], costly[0]
    return (
        costly_mean / mean,
        after.spline.length / before.spline.length,
        costly[1] / plain[1],
        after.search_result.seconds / before.search_result.seconds,
        costly_least / least,
        after.spline.max_curvature[0] / max(before.spline.max_curvature[0], 1e-3),
    )


def heading_rows() -> Iterator[dict[str, object]]:
    """Yield how much faster the heading `fastest` is than `tangent`."""
    for name in ("kiwi", "mecanum", "paper"):
        robot = named_robot(name)
        limits = MotionLimits.of_robot(robot)
        gains = []
        for seed in range(HEADING_PATHS):
            path = random_path(np.random.default_rng(seed))
            tangent, fastest = (
                time_within_limits(path, robot.chassis, limits, heading=heading).duration
                for heading in ("tangent", "fastest")
            )
            gains.append(100.0 * (tangent / fastest - 1.0))
        yield at_least(f"heading fastest, {name}: least gain over tangent", min(gains), "%", 0.0)
        yield row(f"heading fastest, {name}: median gain", float(np.median(gains)), "%")


def footprint_rows() -> Iterator[dict[str, object]]:
    """Yield the processor times of plans of a robot of 14 x 10 cells on maps of 500 x 500 cells."""
    seconds: dict[str, list[float]] = {"disc": [], "polygon": [], "none": []}
    for seed in range(FOOTPRINT_MAPS):
        rng = np.random.default_rng(seed)
        grid = blocks_map(rng)
        poses = PoseSearch(grid, BOX)
        for start, goal in zip(*(free_waypoints(poses, rng) for _ in range(2)), strict=True):
            plan_footprint(grid, start, start, footprint=BOX)  # the caches of the map
            began = process_time()
            try:
                shape = str(plan_footprint(grid, start, goal, footprint=BOX).shape)
            except OmnidriveError:
                shape = "none"
            seconds[shape].append(process_time() - began)
    every = np.concatenate(list(seconds.values()))
    title = f"footprint, {FOOTPRINT_SIDE} x {FOOTPRINT_SIDE} cells"
    yield at_most(f"{title}: median processor time", 1e3 * float(np.median(every)), "ms", 150.0)
    yield row(f"{title}: longest processor time", 1e3 * float(every.max()), "ms")
    for shape, times in seconds.items():
        yield row(f"{title}: plans with shape {shape}", len(times), "1")
        if times:
            median = 1e3 * float(np.median(times))
            yield row(f"{title}: median processor time, shape {shape}", median, "ms")


def blocks_map(rng: np.random.Generator) -> OccupancyGrid:
    """Return a map with random blocks of 5 to 40 cells a side, in cells of 0.05 m."""
    side = FOOTPRINT_SIDE
    occupied = np.zeros((side, side), bool)
    for row_, col, height, width in rng.integers((0, 0, 5, 5), (side, side, 41, 41), (170, 4)):
        occupied[row_ : row_ + height, col : col + width] = True
    return OccupancyGrid(occupied, 0.05)


def free_waypoints(poses: PoseSearch, rng: np.random.Generator) -> Iterator[Waypoint]:
    """Yield random poses at which the polygon is free."""
    count = 0
    while count < FOOTPRINT_QUERIES:
        r, c, k = rng.integers((FOOTPRINT_SIDE, FOOTPRINT_SIDE, 72)).tolist()
        if poses.is_free(r, c, k):
            count += 1
            yield Waypoint(*poses.grid.centre(r, c), np.deg2rad(5.0 * k))


def random_path(rng: np.random.Generator) -> SplinePath:
    """Return a path that turns by less than a right angle per control point."""
    turns = np.cumsum(rng.uniform(-0.6, 0.6, 30))
    points = np.cumsum(0.3 * np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)
    return SplinePath(np.column_stack([points, turns]))
