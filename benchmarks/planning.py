"""Times of grid searches compared with other libraries.

All solvers run alternately in one session, on the same maps and queries. Each time is that of a
whole warm Python call. Ours is ``search(grid, start, goal)``, which keeps nothing between calls;
the preparation of a map by a peer is not timed. The result of a query is the median over the
rounds, that of a map the median over its queries. A peer that is slow on the first query answers
only this query, once, and the ratio refers to it. Our path lengths are checked against each other
and must not exceed those of peers with the same moves.

Rows on paths (planning_paths.py) compare plans with costs with the shortest ones, and headings;
they give the processor time of plans of the polygon of a robot, and measure time limits. Rows on
motions through waypoints (planning_motions.py) need files of Choreo and PathPlanner (--motions).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from figures import at_most, console, publish, ratio, row
from peer_process import PeerProcess
from planning_motions import motion_rows
from planning_paths import cost_rows, footprint_rows, heading_rows
from planning_time_limits import time_limit_rows
from scipy import ndimage
from timing import time_calls

from omnidrive.maps import OccupancyGrid, maze_map, random_map, rooms_map
from omnidrive.planning import GridSearch, search

QUERIES, ROUNDS = {512: 9, 4096: 5}, 5
SLOW = 2.5  # s per query above which a peer answers only the first query
PATIENCE = 10.0  # s in total above which a solver gets no further round
SAME_MOVES = ("rustworkx", "rustworkx Dijkstra", "networkx", "python-pathfinding")
LARGE = 4096
NOT_LARGE = SAME_MOVES  # one query, or building the graph, takes minutes on 4096 x 4096 cells
PEERS = ("pyastar2d", "tcod", "tcod AStar", "scikit-image", *SAME_MOVES)


@dataclass(frozen=True)
class MapKind:
    """Kind of map and targets of the searches on it."""

    name: str
    make: Callable[[int, np.random.Generator], OccupancyGrid]
    large_target: float = 1.0
    """Target ratio of the fastest peer's time to ours on 4096 x 4096 cells; 1 on smaller maps."""
    jump_target: float | None = None
    """Target ratio of the times of A* and jump-point search, for whole calls and a prepared map."""


MAP_KINDS = (
    MapKind("random 10 %", lambda size, rng: random_map(size, size, 0.1, rng), large_target=4.0),
    MapKind("random 20 %", lambda size, rng: random_map(size, size, 0.2, rng), large_target=2.0),
    MapKind("maze", lambda size, rng: maze_map(size, size, 8, rng), jump_target=5.0),
    MapKind("rooms", lambda size, rng: rooms_map(size, size, 31, rng), jump_target=5.0),
)


def queries(occupied: np.ndarray, count: int, rng: np.random.Generator) -> list:
    """Draw pairs of cells of the largest region at least half the map apart."""
    regions, _ = ndimage.label(~occupied)
    sizes = np.bincount(regions.ravel())
    sizes[0] = 0
    cells = np.argwhere(regions == sizes.argmax())
    chosen: list = []
    while len(chosen) < count:
        a, b = cells[rng.integers(len(cells), size=2)].tolist()
        if np.hypot(a[0] - b[0], a[1] - b[1]) >= 0.5 * len(occupied):
            chosen.append((tuple(a), tuple(b)))
    return chosen


@dataclass
class Outcome:
    """Seconds of every round and query, and the path length of every query."""

    seconds: list[list[float]] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)

    def typical(self, count: int | None = None) -> float:
        """Return the median over the first ``count`` queries; None for all."""
        return float(np.median(np.median(self.seconds, axis=0)[:count]))

    def is_partial(self, pairs: list) -> bool:
        """Whether only the first query was answered."""
        return 0 < len(self.lengths) < len(pairs)


Solver = Callable[[list], tuple[list[float], list[float]]]


def own_solver(find: Callable) -> Solver:
    """Create a solver from a function of start and goal."""

    def solve(pairs: list) -> tuple[list[float], list[float]]:
        seconds, found = time_calls(find, pairs)
        return seconds, [each.cost for each in found]

    return solve


def peer_solver(peer: str, file: Path, process: PeerProcess) -> Solver:
    """Create a solver that queries a peer in its process."""

    def solve(pairs: list) -> tuple[list[float], list[float]]:
        answer = process.request({"peer": peer, "map": str(file), "queries": pairs})
        return answer["seconds"], answer["lengths"]

    return solve


def run_solvers(solvers: dict[str, Solver], pairs: list, rounds: int) -> dict[str, Outcome]:
    """Run all solvers alternately; slow ones get fewer rounds or only the first query."""
    outcomes = {name: Outcome() for name in solvers}
    for name, solver in solvers.items():
        seconds, lengths = solver(pairs[:1])
        if seconds[0] >= SLOW and name in PEERS:
            outcomes[name] = Outcome([seconds], lengths)
    for _ in range(rounds):
        for name, solver in solvers.items():
            outcome = outcomes[name]
            if outcome.is_partial(pairs) or np.sum(outcome.seconds) > PATIENCE:
                continue
            seconds, outcome.lengths = solver(pairs)
            outcome.seconds.append(seconds)
    return outcomes


def map_rows(
    kind: MapKind, size: int, process: PeerProcess | None, rounds: int
) -> Iterator[dict[str, Any]]:
    grid = kind.make(size, np.random.default_rng(size))
    pairs = queries(grid.occupied, QUERIES[size], np.random.default_rng(size + 1))
    prepared = GridSearch(grid)
    solvers = {
        "A*": own_solver(lambda a, b: search(grid, a, b)),
        "jump points": own_solver(lambda a, b: search(grid, a, b, method="jump-point")),
        "A*, map prepared": own_solver(prepared.search),
        "jump points, map prepared": own_solver(
            lambda a, b: prepared.search(a, b, method="jump-point")
        ),
    }
    ours, peers = list(solvers), [p for p in PEERS if size < LARGE or p not in NOT_LARGE]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "map.npy"
        np.save(file, grid.occupied)
        if process is not None:
            solvers |= {peer: peer_solver(peer, file, process) for peer in peers}
        outcomes = run_solvers(solvers, pairs, rounds)
    yield from figures(kind, size, ours, outcomes)


def figures(
    kind: MapKind, size: int, ours: list[str], outcomes: dict[str, Outcome]
) -> Iterator[dict[str, Any]]:
    title, first = f"{kind.name}, {size}", outcomes["A*"]
    peers = [name for name in outcomes if name not in ours]
    ratios = {p: outcomes[p].typical() / first.typical(len(outcomes[p].lengths)) for p in peers}
    fastest = min(peers, key=ratios.__getitem__, default=None)
    if fastest is not None:
        target = kind.large_target if size == LARGE else 1.0
        name = f"{title}: A* faster than the fastest peer ({fastest})"
        yield ratio(name, ratios[fastest], target)
    for suffix in ("", ", map prepared"):
        times = outcomes["A*" + suffix].typical() / outcomes["jump points" + suffix].typical()
        name = f"{title}: jump points faster than A*{suffix}"
        if kind.jump_target is None:
            yield row(name, times, "1")
        else:
            yield ratio(name, times, kind.jump_target)
    for name, outcome in outcomes.items():
        once = len(outcome.lengths) < len(first.lengths)
        yield row(f"{title}: {name}{', one query, once' * once}", outcome.typical() * 1e3, "ms")
        longer = 100.0 * (np.array(outcome.lengths) / first.lengths[: len(outcome.lengths)] - 1.0)
        label = f"{title}: {name}, longer than A*'s by"
        if name in (*ours, *SAME_MOVES):
            yield at_most(f"{label} at most", np.abs(longer).max(), "%", 1e-9)
        else:
            yield row(label, longer.mean(), "%")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(QUERIES))
    parser.add_argument("--maps", type=Path, nargs="*", default=[], help="map files with costs")
    parser.add_argument("--motions", type=Path, help="folder with .traj, .path and .chor files")
    parser.add_argument("--motions-only", action="store_true", help="only rows on these files")
    parser.add_argument("--paths-only", action="store_true", help="no searches beside peers")
    arguments = parser.parse_args()
    if arguments.motions_only:
        publish("planning-motions", list(motion_rows(arguments.motions)))
        return
    rows = [*cost_rows(arguments.maps), *time_limit_rows(), *heading_rows(), *footprint_rows()]
    rows += motion_rows(arguments.motions)
    if arguments.paths_only:
        publish("planning", rows)
        return
    process = PeerProcess.if_available("planning")
    for size in arguments.sizes:
        for kind in MAP_KINDS:
            console.print(f"{kind.name}, {size} x {size} cells")
            rows += map_rows(kind, size, process, arguments.rounds)
    if process is not None:
        process.close()
        console.print(f"Omitted on 4096 x 4096 cells (minutes each): {', '.join(NOT_LARGE)}.")
    publish("planning", rows)


if __name__ == "__main__":
    main()
