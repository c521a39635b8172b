"""How much faster ways over grids are found here than by other libraries.

All take turns in one run, on the same maps and queries; each time is that of a whole Python call,
warm: ours is ``search(grid, start, goal)``, which keeps nothing between calls, while what a peer
makes of a map once is not timed. Of every query the median over the rounds counts, of a map the
median over its queries. The lengths of ours are checked against each other and must be no longer
than any peer's whose moves are the same.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from figures import at_most, publish, ratio, row
from peer_process import PeerProcess, PeersMissing
from planning_worlds import maze, queries, rooms, scattered
from rich.console import Console

from omnidrive.maps import OccupancyGrid
from omnidrive.planning import GridSearch, search

QUERIES, ROUNDS = {512: 9, 4096: 5}, 5
PATIENCE = 15.0  # s that a solver may take for the queries of a round and still have another
SAME_MOVES = ("rustworkx", "rustworkx Dijkstra", "networkx", "python-pathfinding")
SLOW = SAME_MOVES  # one query, or the graph of the map, takes minutes on 4096 x 4096 cells
PEERS = ("pyastar2d", "tcod", "tcod AStar", "scikit-image", *SAME_MOVES)

console = Console(width=120)


@dataclass(frozen=True)
class World:
    """A kind of map, and what is asked of the searches on it."""

    name: str
    make: Callable[[int, np.random.Generator], np.ndarray]
    large_target: float = 1.0
    """Least ratio of the fastest peer's time to ours on 4096 x 4096 cells; 1 on others."""
    jump_target: float | None = None
    """Least ratio of A*'s time to jump-point search's, both with the map kept."""


WORLDS = (
    World("random 10 %", scattered(0.1), large_target=4.0),
    World("random 20 %", scattered(0.2), large_target=2.0),
    World("maze", maze(8), jump_target=5.0),
    World("rooms", rooms(31), jump_target=5.0),
)


@dataclass
class Outcome:
    """Seconds of every round and query, and lengths of every query."""

    seconds: list[list[float]] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)

    @property
    def typical(self) -> float:
        return float(np.median(np.median(self.seconds, axis=0)))


Solver = Callable[[list], tuple[list[float], list[float]]]


def here(find: Callable) -> Solver:
    """Ours: ``find`` takes a start and a goal."""

    def solve(asked: list) -> tuple[list[float], list[float]]:
        seconds, lengths = [], []
        for start, goal in asked:
            began = perf_counter()
            found = find(start, goal)
            seconds.append(perf_counter() - began)
            lengths.append(found.cost)
        return seconds, lengths

    return solve


def there(peer: str, file: Path, process: PeerProcess) -> Solver:
    """A peer in its process."""

    def solve(asked: list) -> tuple[list[float], list[float]]:
        answer = process.ask({"peer": peer, "map": str(file), "queries": asked})
        return answer["seconds"], answer["lengths"]

    return solve


def contest(solvers: dict[str, Solver], asked: list, rounds: int) -> dict[str, Outcome]:
    """All solvers in turn; who is slow has fewer rounds."""
    outcomes = {name: Outcome() for name in solvers}
    for solver in solvers.values():
        solver(asked[:1])
    for _ in range(rounds):
        for name, solver in solvers.items():
            outcome = outcomes[name]
            if outcome.seconds and sum(outcome.seconds[0]) > PATIENCE:
                continue
            seconds, outcome.lengths = solver(asked)
            outcome.seconds.append(seconds)
    return outcomes


def world_rows(
    world: World, size: int, process: PeerProcess | None, rounds: int
) -> Iterator[dict[str, Any]]:
    occupied = world.make(size, np.random.default_rng(size))
    asked = queries(occupied, QUERIES[size], np.random.default_rng(size + 1))
    grid = OccupancyGrid(occupied, 0.05)
    kept = GridSearch(grid)
    solvers = {
        "A*": here(lambda a, b: search(grid, a, b)),
        "jump points": here(lambda a, b: search(grid, a, b, method="jump-point")),
        "A*, map kept": here(kept.search),
        "jump points, map kept": here(lambda a, b: kept.search(a, b, method="jump-point")),
    }
    ours, peers = list(solvers), [p for p in PEERS if size < 4096 or p not in SLOW]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "map.npy"
        np.save(file, occupied)
        if process is not None:
            solvers |= {peer: there(peer, file, process) for peer in peers}
        outcomes = contest(solvers, asked, rounds)
    yield from figures(world, size, ours, outcomes)


def figures(
    world: World, size: int, ours: list[str], outcomes: dict[str, Outcome]
) -> Iterator[dict[str, Any]]:
    title, first = f"{world.name}, {size}", outcomes["A*"]
    peers = [name for name in outcomes if name not in ours]
    fastest = min(peers, key=lambda name: outcomes[name].typical, default=None)
    if fastest is not None:
        target = world.large_target if size == 4096 else 1.0
        times = outcomes[fastest].typical / first.typical
        yield ratio(f"{title}: A* faster than the fastest peer ({fastest})", times, target)
    times = first.typical / outcomes["jump points"].typical
    yield row(f"{title}: jump points faster than A*", times, "1")
    times = outcomes["A*, map kept"].typical / outcomes["jump points, map kept"].typical
    name = f"{title}: jump points faster than A*, map kept"
    if world.jump_target is None:
        yield row(name, times, "1")
    else:
        yield ratio(name, times, world.jump_target)
    for name, outcome in outcomes.items():
        yield row(f"{title}: {name}", outcome.typical * 1e3, "ms")
        longer = 100.0 * (np.array(outcome.lengths) / first.lengths - 1.0)
        what = f"{title}: {name}, longer than A*'s by"
        if name in (*ours, *SAME_MOVES):
            yield at_most(f"{what} at most", np.abs(longer).max(), "%", 1e-9)
        elif name != "A*":
            yield row(what, longer.mean(), "%")


def peer_process() -> PeerProcess | None:
    """The peers, or a line that says why not."""
    try:
        process = PeerProcess("planning_peers.py")
        process.ask("ready?")
    except PeersMissing as error:
        console.print(f"Without peers: {error}; make bench-planning installs them.")
        return None
    return process


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(QUERIES))
    arguments = parser.parse_args()
    process, rows = peer_process(), []
    for size in arguments.sizes:
        for world in WORLDS:
            console.print(f"{world.name}, {size} x {size} cells")
            rows += world_rows(world, size, process, arguments.rounds)
    if process is not None:
        process.close()
        console.print(f"Left out on 4096 x 4096 cells, minutes each: {', '.join(SLOW)}.")
    publish("planning", sorted(rows, key=lambda r: not r["target"]))


if __name__ == "__main__":
    main()
