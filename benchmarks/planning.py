"""How much faster ways over grids are found here than by other libraries.

All take turns in one run, on the same maps and queries; each time is that of a whole Python call,
warm: ours is ``search(grid, start, goal)``, which keeps nothing between calls, while what a peer
makes of a map once is not timed. Of every query the median over the rounds counts, of a map the
median over its queries. Who takes long for the first query answers only this one, once, and the
ratio is that of this query. The lengths of ours are checked against each other and must be no
longer than any peer's whose moves are the same.
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
from scipy.ndimage import label
from timed import timed

from omnidrive.maps import OccupancyGrid, maze_map, random_map, rooms_map
from omnidrive.planning import GridSearch, search

QUERIES, ROUNDS = {512: 9, 4096: 5}, 5
SLOW = 2.5  # s for a query from which a solver has no other
PATIENCE = 10.0  # s that a solver may have taken in all and still have another round
SAME_MOVES = ("rustworkx", "rustworkx Dijkstra", "networkx", "python-pathfinding")
LARGE = 4096
NOT_LARGE = SAME_MOVES  # one query, or the graph of the map, takes minutes on 4096 x 4096 cells
PEERS = ("pyastar2d", "tcod", "tcod AStar", "scikit-image", *SAME_MOVES)


@dataclass(frozen=True)
class World:
    """A kind of map, and what is asked of the searches on it."""

    name: str
    make: Callable[[int, np.random.Generator], OccupancyGrid]
    large_target: float = 1.0
    """Least ratio of the fastest peer's time to ours on 4096 x 4096 cells; 1 on others."""
    jump_target: float | None = None
    """Least ratio of A*'s time to jump-point search's, of whole calls and with the map kept."""


WORLDS = (
    World("random 10 %", lambda size, rng: random_map(size, size, 0.1, rng), large_target=4.0),
    World("random 20 %", lambda size, rng: random_map(size, size, 0.2, rng), large_target=2.0),
    World("maze", lambda size, rng: maze_map(size, size, 8, rng), jump_target=5.0),
    World("rooms", lambda size, rng: rooms_map(size, size, 31, rng), jump_target=5.0),
)


def queries(occupied: np.ndarray, count: int, rng: np.random.Generator) -> list:
    """Pairs of cells of the largest region, at least half the map apart."""
    regions, _ = label(~occupied)
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
    """Seconds of every round and query, and lengths of every query."""

    seconds: list[list[float]] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)

    def typical(self, count: int | None = None) -> float:
        """Median over the first queries, all if not given."""
        return float(np.median(np.median(self.seconds, axis=0)[:count]))

    def once(self, asked: list) -> bool:
        """Whether only the first query was answered."""
        return 0 < len(self.lengths) < len(asked)


Solver = Callable[[list], tuple[list[float], list[float]]]


def here(find: Callable) -> Solver:
    """Ours: ``find`` takes a start and a goal."""

    def solve(asked: list) -> tuple[list[float], list[float]]:
        seconds, found = timed(find, asked)
        return seconds, [each.cost for each in found]

    return solve


def there(peer: str, file: Path, process: PeerProcess) -> Solver:
    """A peer in its process."""

    def solve(asked: list) -> tuple[list[float], list[float]]:
        answer = process.request({"peer": peer, "map": str(file), "queries": asked})
        return answer["seconds"], answer["lengths"]

    return solve


def contest(solvers: dict[str, Solver], asked: list, rounds: int) -> dict[str, Outcome]:
    """All solvers in turn; who is slow has fewer rounds, or none after the first query."""
    outcomes = {name: Outcome() for name in solvers}
    for name, solver in solvers.items():
        seconds, lengths = solver(asked[:1])
        if seconds[0] >= SLOW and name in PEERS:
            outcomes[name] = Outcome([seconds], lengths)
    for _ in range(rounds):
        for name, solver in solvers.items():
            outcome = outcomes[name]
            if outcome.once(asked) or np.sum(outcome.seconds) > PATIENCE:
                continue
            seconds, outcome.lengths = solver(asked)
            outcome.seconds.append(seconds)
    return outcomes


def world_rows(
    world: World, size: int, process: PeerProcess | None, rounds: int
) -> Iterator[dict[str, Any]]:
    grid = world.make(size, np.random.default_rng(size))
    asked = queries(grid.occupied, QUERIES[size], np.random.default_rng(size + 1))
    kept = GridSearch(grid)
    solvers = {
        "A*": here(lambda a, b: search(grid, a, b)),
        "jump points": here(lambda a, b: search(grid, a, b, method="jump-point")),
        "A*, map kept": here(kept.search),
        "jump points, map kept": here(lambda a, b: kept.search(a, b, method="jump-point")),
    }
    ours, peers = list(solvers), [p for p in PEERS if size < LARGE or p not in NOT_LARGE]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "map.npy"
        np.save(file, grid.occupied)
        if process is not None:
            solvers |= {peer: there(peer, file, process) for peer in peers}
        outcomes = contest(solvers, asked, rounds)
    yield from figures(world, size, ours, outcomes)


def figures(
    world: World, size: int, ours: list[str], outcomes: dict[str, Outcome]
) -> Iterator[dict[str, Any]]:
    title, first = f"{world.name}, {size}", outcomes["A*"]
    peers = [name for name in outcomes if name not in ours]
    ratios = {p: outcomes[p].typical() / first.typical(len(outcomes[p].lengths)) for p in peers}
    fastest = min(peers, key=ratios.__getitem__, default=None)
    if fastest is not None:
        target = world.large_target if size == LARGE else 1.0
        name = f"{title}: A* faster than the fastest peer ({fastest})"
        yield ratio(name, ratios[fastest], target)
    for kept in ("", ", map kept"):
        times = outcomes["A*" + kept].typical() / outcomes["jump points" + kept].typical()
        name = f"{title}: jump points faster than A*{kept}"
        if world.jump_target is None:
            yield row(name, times, "1")
        else:
            yield ratio(name, times, world.jump_target)
    for name, outcome in outcomes.items():
        once = len(outcome.lengths) < len(first.lengths)
        yield row(f"{title}: {name}{', one query, once' * once}", outcome.typical() * 1e3, "ms")
        longer = 100.0 * (np.array(outcome.lengths) / first.lengths[: len(outcome.lengths)] - 1.0)
        what = f"{title}: {name}, longer than A*'s by"
        if name in (*ours, *SAME_MOVES):
            yield at_most(f"{what} at most", np.abs(longer).max(), "%", 1e-9)
        else:
            yield row(what, longer.mean(), "%")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(QUERIES))
    arguments = parser.parse_args()
    process, rows = PeerProcess.if_available("planning"), []
    for size in arguments.sizes:
        for world in WORLDS:
            console.print(f"{world.name}, {size} x {size} cells")
            rows += world_rows(world, size, process, arguments.rounds)
    if process is not None:
        process.close()
        console.print(f"Left out on 4096 x 4096 cells, minutes each: {', '.join(NOT_LARGE)}.")
    publish("planning", rows)


if __name__ == "__main__":
    main()
