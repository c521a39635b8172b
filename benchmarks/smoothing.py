"""Curvature, collisions and times of smoothed paths: ours, SciPy's splines, gradient smoothing.

All methods smooth the same shortest grid paths between random free cells of the shared maps. A path
collides if one of its samples, 40 per cell, lies in an occupied cell. The curvature is the greatest
of each path in 1 / cell: the proved bound for ours, the attained value for the others. Times are
process times of warm calls. SciPy's ``splprep`` uses its default smoothness and a tenth of it.
Gradient smoothing is that of Nav2's simple smoother with its default weights and two refinements,
without and with its check that no point lies in an obstacle. Collisions are those of its polygon;
its curvature is that of a spline with its points as control points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
from figures import at_least, at_most, publish, row
from numba import njit
from scipy.interpolate import splev, splprep

from omnidrive.errors import NoPathFound
from omnidrive.maps import OccupancyGrid, load_nav2_map
from omnidrive.planning import SplinePath, search, smooth

SHARED = Path(__file__).resolve().parents[2] / "shared" / "maps"
NAV2 = {"depot": 0.25, "tb3_sandbox": 0.15, "smoothers_world": 0.25, "demo_map": 0.15}  # m
MOVINGAI = ("random-32-32-20", "maze-32-32-4", "room-64-64-8", "warehouse-10-20-10-2-1")
PATHS, SHORTEST = 400, 12  # per map; cells
PER_CELL = 40
DISTANCE = 0.2  # cells
ABOUT_200 = (150, 250)  # cells of the timed paths
WEIGHT_OF_DATA, WEIGHT_OF_SMOOTHNESS, CHANGE, SWEEPS, REFINEMENTS = 0.2, 0.3, 1e-10, 1000, 2

GridPath = tuple[OccupancyGrid, np.ndarray]


def grids() -> Iterator[OccupancyGrid]:
    for name, radius in NAV2.items():
        yield load_nav2_map(SHARED / "nav2" / f"{name}.yaml").inflated(radius)
    for name in MOVINGAI:
        lines = (SHARED / "movingai" / f"{name}.map").read_text().splitlines()[4:]
        yield OccupancyGrid(np.array([[c not in ".G" for c in line] for line in lines]), 1.0)


def grid_paths(grid: OccupancyGrid, rng: np.random.Generator) -> Iterator[GridPath]:
    """Yield shortest paths between random free cells, as cell centres."""
    free = np.argwhere(~grid.occupied)
    for _ in range(PATHS):
        start, goal = free[rng.integers(0, len(free), 2)].tolist()
        try:
            cells = search(grid, tuple(start), tuple(goal)).cells
        except NoPathFound:
            continue
        if len(cells) >= SHORTEST:
            yield grid, np.array([grid.centre(r, c) for r, c in cells.tolist()])


def collides(grid: OccupancyGrid, points: np.ndarray) -> bool:
    col, row_ = np.floor((points - grid.origin) / grid.resolution).astype(int).T + 1
    padded = np.pad(grid.occupied, 1, constant_values=grid.walled)
    rows, cols = padded.shape
    return bool(padded[row_.clip(0, rows - 1), col.clip(0, cols - 1)].any())


def dense(path: SplinePath, grid: OccupancyGrid) -> np.ndarray:
    return path.poses(np.linspace(0.0, 1.0, 2 + int(PER_CELL * path.length / grid.resolution)))[
        :, :2
    ]


def curvature(velocity: np.ndarray, acceleration: np.ndarray) -> float:
    cross = velocity[0] * acceleration[1] - velocity[1] * acceleration[0]
    return float(np.abs(cross / np.hypot(*velocity) ** 3).max())


def scipy_spline(share: float) -> Callable[[GridPath], tuple[np.ndarray, Callable[[], float]]]:
    """Return a smoother by SciPy's spline, which returns samples and curvature."""

    def smoothed(grid_path: GridPath) -> tuple[np.ndarray, Callable[[], float]]:
        grid, points = grid_path
        m = len(points)
        scaled = points.T / grid.resolution
        spline, _ = splprep(scaled, s=share * (m - (2.0 * m) ** 0.5))
        u = np.linspace(0.0, 1.0, PER_CELL * m)
        samples = np.stack(splev(u, spline), axis=1) * grid.resolution
        return samples, lambda: curvature(
            np.array(splev(u, spline, 1)), np.array(splev(u, spline, 2))
        )

    return smoothed


@njit(cache=True)
def sweep_points(points, occupied, corner, resolution, checked):
    """Run sweeps of gradient smoothing; if ``checked``, stop before a point enters an obstacle."""
    new, last = points.copy(), points.copy()
    for _ in range(SWEEPS):
        change = 0.0
        for i in range(1, len(points) - 1):
            for j in range(2):
                y = new[i, j]
                step = WEIGHT_OF_DATA * (points[i, j] - y)
                step += WEIGHT_OF_SMOOTHNESS * (new[i + 1, j] + new[i - 1, j] - 2.0 * y)
                new[i, j] += step
                change += abs(step)
            if checked:
                r = int(np.floor((new[i, 1] - corner[1]) / resolution))
                c = int(np.floor((new[i, 0] - corner[0]) / resolution))
                if occupied[r, c]:
                    return last, False
        last[:] = new
        if change < CHANGE:
            return new, True
    return last, False


def gradient(checked: bool) -> Callable[[GridPath], tuple[np.ndarray, Callable[[], float]]]:
    """Return a gradient smoother, which returns samples of the polygon and spline curvature."""

    def smoothed(grid_path: GridPath) -> tuple[np.ndarray, Callable[[], float]]:
        grid, points = grid_path
        corner = np.array(grid.origin, float)
        for _ in range(1 + REFINEMENTS):
            points, going = sweep_points(points, grid.occupied, corner, grid.resolution, checked)
            if not going:
                break
        at = np.linspace(0.0, len(points) - 1.0, PER_CELL * len(points))
        samples = np.stack([np.interp(at, np.arange(len(points)), x) for x in points.T], axis=1)
        path = SplinePath(np.column_stack([points, np.zeros(len(points))]))
        return samples, lambda: path.max_curvature[0] * grid.resolution

    return smoothed


PEERS = {
    "SciPy": scipy_spline(1.0),
    "SciPy, s a tenth": scipy_spline(0.1),
    "gradient": gradient(checked=False),
    "gradient, points checked": gradient(checked=True),
}


def peer_rows(chosen: list[GridPath]) -> Iterator[dict]:
    for name, peer in PEERS.items():
        collisions, curvatures = 0, []
        for grid_path in chosen:
            samples, path_curvature = peer(grid_path)
            collisions += collides(grid_path[0], samples)
            curvatures.append(path_curvature())
        yield row(f"{name}: paths that collide", collisions / len(chosen), "of paths")
        yield row(f"{name}: median of the greatest curvature", median(curvatures), "1/cell")


def distant_rows(chosen: list[GridPath]) -> Iterator[dict]:
    """Yield rows for certified paths with a required clearance."""
    curvatures, clearances = [], []
    for grid, points in chosen:
        smoothed = smooth(grid, points, clearance=DISTANCE * grid.resolution)
        curvatures.append(smoothed.path.max_curvature[1] * grid.resolution)
        clearances.append(smoothed.clearance / grid.resolution)
    name = f"certified, {DISTANCE:g} cells off"
    yield at_least(f"{name}: least proved clearance", min(clearances), "cells", DISTANCE - 1e-6)
    yield row(f"{name}: median of the greatest curvature", median(curvatures), "1/cell")


def our_rows(chosen: list[GridPath]) -> Iterator[dict]:
    curvatures: dict[str, list[float]] = {"spline": [], "certified": []}
    collisions, closest, seconds = dict.fromkeys(curvatures, 0), np.inf, []
    smooth(*chosen[0])
    for grid, points in chosen:
        for method, found in curvatures.items():
            began = process_time()
            smoothed = smooth(grid, points, method=method)
            took = process_time() - began
            collisions[method] += collides(grid, dense(smoothed.path, grid))
            found.append(smoothed.path.max_curvature[method == "certified"] * grid.resolution)
        closest = min(closest, smoothed.clearance / grid.resolution)
        if ABOUT_200[0] <= len(points) <= ABOUT_200[1]:
            seconds.append(took)
    plain, certified = (median(found) for found in curvatures.values())
    yield row("paths", len(chosen), "1")
    yield at_most("certified: paths that collide", collisions["certified"], "1", 0)
    yield at_least("certified: least proved clearance", closest, "cells", 0.0)
    yield at_least(
        "certified: median curvature below the plain spline's", plain / certified, "1", 2.0
    )
    yield at_most("certified: 150 to 250 cells, median", median(seconds) * 1e3, "ms", 10.0)
    yield row(
        "certified: 150 to 250 cells, 95th percentile", np.percentile(seconds, 95) * 1e3, "ms"
    )
    yield row("certified: paths timed", len(seconds), "1")
    yield row("certified: median of the greatest curvature", certified, "1/cell")
    yield row("plain spline: median of the greatest curvature", plain, "1/cell")
    yield row("plain spline: paths that collide", collisions["spline"] / len(chosen), "of paths")


def main() -> None:
    rng = np.random.default_rng(5)
    chosen = [path for grid in grids() for path in grid_paths(grid, rng)]
    publish(
        "smoothing",
        [
            *our_rows(chosen),
            *distant_rows(chosen),
            *peer_rows(chosen),
        ],
    )


if __name__ == "__main__":
    main()
