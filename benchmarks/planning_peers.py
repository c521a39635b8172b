"""Service that times the queries of the planning benchmark in other libraries.

It runs in a separate environment. A request is ``{"peer": name, "map": file, "queries": [[start,
goal], ...]}``; the answer contains the seconds and the path lengths in cells (a diagonal move
counts sqrt(2)) of all queries. The preparation of a map, an array or a graph, is not timed.
"""

import sys
from math import hypot, sqrt

try:
    import networkx as nx
    import numpy as np
    import pyastar2d
    import rustworkx as rx
    import tcod.path
    from pathfinding.core.diagonal_movement import DiagonalMovement
    from pathfinding.core.grid import Grid
    from pathfinding.core.heuristic import octile as pathfinding_octile
    from pathfinding.finder.a_star import AStarFinder
    from peer_service import serve
    from skimage.graph import route_through_array
    from timing import time_calls
except ImportError as error:
    sys.exit(str(error))

DIAGONAL = sqrt(2.0)


def octile(a, b):
    dr, dc = abs(a[0] - b[0]), abs(a[1] - b[1])
    return max(dr, dc) + (DIAGONAL - 1.0) * min(dr, dc)


def moves(occupied):
    """Return the moves over eight neighbours without cutting corners: cell pairs and lengths."""
    free, number = ~occupied, np.arange(occupied.size).reshape(occupied.shape)
    right, down = free[:, :-1] & free[:, 1:], free[:-1] & free[1:]
    block = free[:-1, :-1] & free[:-1, 1:] & free[1:, :-1] & free[1:, 1:]
    return [
        (number[:, :-1][right], number[:, 1:][right], 1.0),
        (number[:-1][down], number[1:][down], 1.0),
        (number[:-1, :-1][block], number[1:, 1:][block], DIAGONAL),
        (number[:-1, 1:][block], number[1:, :-1][block], DIAGONAL),
    ]


class PyAStar2D:
    """A* in which diagonal moves cost as much as straight ones and cut corners."""

    def __init__(self, occupied):
        self.weights = np.where(occupied, np.inf, 1.0).astype(np.float32)

    def __call__(self, start, goal):
        return pyastar2d.astar_path(self.weights, start, goal, allow_diagonal=True)


class Tcod:
    """A* with integer lengths 70 and 99; cuts corners."""

    def __init__(self, occupied):
        self.cost = (~occupied).astype(np.int8)

    def __call__(self, start, goal):
        graph = tcod.path.SimpleGraph(cost=self.cost, cardinal=70, diagonal=99)
        finder = tcod.path.Pathfinder(graph)
        finder.add_root(start)
        return finder.path_to(goal)


class OldTcod:
    """The older A* of libtcod; cuts corners."""

    def __init__(self, occupied):
        self.cost = (~occupied).astype(np.float32)

    def __call__(self, start, goal):
        path = tcod.path.AStar(self.cost, diagonal=DIAGONAL).get_path(*start, *goal)
        return [start, *path]


class ScikitImage:
    """Dijkstra's algorithm; cuts corners."""

    def __init__(self, occupied):
        self.costs = np.where(occupied, -1.0, 1.0)

    def __call__(self, start, goal):
        return route_through_array(self.costs, start, goal, fully_connected=True, geometric=True)[0]


class Rustworkx:
    """A* with lengths and heuristic as Python callbacks, as its interface requires."""

    def __init__(self, occupied):
        self.cols = occupied.shape[1]
        self.graph = rx.PyGraph(multigraph=False)
        self.graph.add_nodes_from([divmod(i, self.cols) for i in range(occupied.size)])
        for a, b, length in moves(occupied):
            self.graph.add_edges_from(
                list(zip(a.tolist(), b.tolist(), [length] * len(a), strict=True))
            )

    def __call__(self, start, goal):
        first, last = (r * self.cols + c for r, c in (start, goal))
        found = rx.graph_astar_shortest_path(
            self.graph, first, lambda node: node == goal, float, lambda node: octile(node, goal)
        )
        assert found[-1] == last
        return [divmod(i, self.cols) for i in found]


class RustworkxDijkstra(Rustworkx):
    """Dijkstra's algorithm, with lengths as a Python callback."""

    def __call__(self, start, goal):
        first, last = (r * self.cols + c for r, c in (start, goal))
        found = rx.dijkstra_shortest_paths(self.graph, first, last, weight_fn=float)
        return [divmod(i, self.cols) for i in found[last]]


class NetworkX:
    def __init__(self, occupied):
        cols, self.graph = occupied.shape[1], nx.Graph()
        for a, b, length in moves(occupied):
            pairs = ((divmod(i, cols), divmod(j, cols)) for i, j in zip(a.tolist(), b.tolist()))  # noqa: B905
            self.graph.add_edges_from(pairs, weight=length)

    def __call__(self, start, goal):
        return nx.astar_path(self.graph, start, goal, heuristic=octile)


class PythonPathfinding:
    def __init__(self, occupied):
        self.grid = Grid(matrix=(~occupied).astype(int).tolist())
        self.finder = AStarFinder(
            diagonal_movement=DiagonalMovement.only_when_no_obstacle, heuristic=pathfinding_octile
        )

    def __call__(self, start, goal):
        self.grid.cleanup()
        ends = (self.grid.node(c, r) for r, c in (start, goal))
        path, _ = self.finder.find_path(*ends, self.grid)
        return [(node.y, node.x) for node in path]


PEERS = {
    "pyastar2d": PyAStar2D,
    "tcod": Tcod,
    "tcod AStar": OldTcod,
    "scikit-image": ScikitImage,
    "rustworkx": Rustworkx,
    "rustworkx Dijkstra": RustworkxDijkstra,
    "networkx": NetworkX,
    "python-pathfinding": PythonPathfinding,
}


prepared = {}


def answer(request):
    key = request["peer"], request["map"]
    if key not in prepared:
        if any(map_ != request["map"] for _, map_ in prepared):
            prepared.clear()
        prepared[key] = PEERS[request["peer"]](np.load(request["map"]))
    queries = [(tuple(start), tuple(goal)) for start, goal in request["queries"]]
    seconds, paths = time_calls(prepared[key], queries)
    return {"seconds": seconds, "lengths": list(map(length, paths, queries))}


def length(path, ends):
    path = np.asarray(path)
    assert (tuple(path[0]), tuple(path[-1])) == ends, (path[0], path[-1])
    return sum(hypot(*step) for step in np.diff(path, axis=0).tolist())


if __name__ == "__main__":
    serve(answer)
