"""Rows of the planning benchmark on plans with a time limit on 2048 x 2048 cells."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter, thread_time

import numpy as np
from figures import at_most, row
from scipy import ndimage

from omnidrive.errors import NoPathFound, NoPathYet
from omnidrive.maps import Inflation, OccupancyGrid, maze_map, random_map, rooms_map
from omnidrive.planning import Planner, Waypoint

TIME_LIMIT, OVERRUN = 0.02, 5.0  # s, ms
LARGE, LIMITED_PATHS = 2048, 20  # cells per side


def time_limit_rows() -> Iterator[dict[str, object]]:
    """Yield overrun and share of paths of plans with a time limit on large maps."""
    rng = np.random.default_rng(11)
    grids = {
        "random": random_map(LARGE, LARGE, 0.1, rng),
        "maze": maze_map(LARGE, LARGE, 8, rng),
        "rooms": rooms_map(LARGE, LARGE, 31, rng),
    }
    divided = grids["random"].occupied.copy()
    divided[:, LARGE // 2] = True
    grids["no path"] = OccupancyGrid(divided, 1.0)
    for name, each in grids.items():
        grid = OccupancyGrid(each.occupied, 0.05)
        for title, around in ((name, None), (f"{name}, costs", Inflation())):
            planner = Planner(grid, inflation=0.0, around_obstacles=around)
            planner.prepare()
            ends = far_queries(grid, across=name == "no path")
            results = [limited(planner, *each) for each in ends]
            busy, wall = np.array([each[:2] for each in results]).max(axis=0)
            states = [each[2] for each in results]
            label = f"limit 20 ms, {title}"
            yield at_most(f"{label}: worst overrun, processor time", busy, "ms", OVERRUN)
            yield row(f"{label}: worst overrun", wall, "ms")
            optimal = [each in {"complete", "not smoothed"} for each in states]
            found = [each.startswith(("complete", "not")) for each in states]
            yield row(f"{label}: with a path", 100.0 * float(np.mean(found)), "%")
            yield row(f"{label}: with an optimal path", 100.0 * float(np.mean(optimal)), "%")


def far_queries(grid: OccupancyGrid, across: bool) -> list[tuple[Waypoint, Waypoint]]:
    """Return pairs of free positions at the left and the right of a map.

    They are connected, unless the map is divided: ``across``.
    """
    regions, _ = ndimage.label(~grid.occupied)
    largest = regions > 0 if across else regions == np.bincount(regions[regions > 0]).argmax()
    rng, pairs = np.random.default_rng(12), []
    cells = np.argwhere(largest)
    left = cells[cells[:, 1] < LARGE // 10]
    right = cells[cells[:, 1] > LARGE - LARGE // 10]
    for _ in range(LIMITED_PATHS):
        ends = np.stack([each[rng.integers(len(each))] for each in (left, right)])
        start, goal = grid.centres(ends).tolist()
        pairs.append((Waypoint(*start), Waypoint(*goal)))
    return pairs


def limited(planner: Planner, start: Waypoint, goal: Waypoint) -> tuple[float, float, str]:
    """Return overruns (processor time of this thread, elapsed time; ms), and the status.

    The status is that of the limit in processor time, which does not depend on other processes.
    """
    overruns, status = [], ""
    for clock in (perf_counter, thread_time):
        began = clock()
        try:
            status = planner.plan(start, goal, time_limit=TIME_LIMIT, clock=clock).status
        except NoPathYet:
            status = "none yet"
        except NoPathFound:
            status = "none"
        overruns.append(1e3 * (clock() - began - TIME_LIMIT))
    return overruns[1], overruns[0], status
