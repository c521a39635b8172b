"""Evaluation time of the paper's fuzzy system, compared with other libraries.

All are timed in turns in one run, on the same inputs; each time is that of whole Python calls,
after a first call. The ratios are those of medians. The other libraries run in an environment
of their own: see fuzzy_peers.py.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
from figures import publish, ratio, row
from peer_process import PeerProcess, PeersMissing

from omnidrive.control.pid import gain_tuning_system
from omnidrive.control.pid.rules import published_rules
from omnidrive.fuzzy import Footprint, FuzzySystem, Inference, LookupSurface, Secondary
from omnidrive.fuzzy.rules import propositions

ROUNDS = 9
CALLS = 10_000  # of this library, per round
PEER_CALLS = {"scikit-fuzzy": 2, "simpful": 10, "pyit2fls centre of sets": 10}  # 30 for others
BATCH, PEER_BATCH = 1_000_000, 20_000
FOOTPRINT = Footprint(scale=1.0, left=0.3)

TYPE_1 = gain_tuning_system(published_rules())
TYPE_2 = TYPE_1.with_footprint(FOOTPRINT)
TYPE_3 = TYPE_1.with_footprint(FOOTPRINT, secondary=Secondary())
EXACT = Inference(TYPE_1)
MATLAB = Inference(TYPE_1, centroid="matlab")
CENTROID = Inference(TYPE_2, centroid="matlab")
CENTRE_OF_SETS = Inference(TYPE_2, reduction="cos", centroid="matlab")

OURS: dict[str, Inference] = {
    "type 1 exact": EXACT,
    "type 1 matlab": MATLAB,
    "type 2 centroid, matlab": CENTROID,
    "type 2 centroid, exact": Inference(TYPE_2),
    "type 2 centre of sets": CENTRE_OF_SETS,
    "type 3 centre of sets, 10 slices": Inference(TYPE_3, reduction="cos"),
}
COUNTERPARTS: dict[str, tuple[Inference, float]] = {
    "scikit-fuzzy": (EXACT, 0.01),  # integrates by trapezoids on its own grid
    "simpful": (MATLAB, 1e-9),
    "pyfuzzylite": (EXACT, 0.01),  # samples at the middles of intervals
    "pyfuzzylite batch": (EXACT, 0.01),
    "pyit2fls": (EXACT, 0.01),  # integrates by trapezoids
    "pyit2fls centroid": (CENTROID, 1e-9),
    "pyit2fls centre of sets": (CENTRE_OF_SETS, 1e-9),
}
"""Inference that each peer is compared with, and the tolerance; the outputs have range 0.2."""


class Peers:
    """The other libraries, in a process of their own."""

    def __init__(self, system: FuzzySystem) -> None:
        try:
            self._process = PeerProcess("fuzzy")
        except PeersMissing as error:
            sys.exit(f"{error}.")
        self._system = described(system)

    def time(self, peer: str, rows: np.ndarray) -> float:
        """Return seconds per row; exit if the peer's outputs differ by more than the tolerance."""
        answer = self._process.request(
            {"peer": peer, "system": self._system, "rows": rows.tolist()}
        )
        inference, tolerance = COUNTERPARTS[peer]
        difference = np.abs(np.array(answer["outputs"]) - inference(rows)).max()
        if not difference <= tolerance:
            sys.exit(
                f"{peer} differs by {difference:g}, more than {tolerance:g}: no fair comparison"
            )
        return answer["seconds"]

    def close(self) -> None:
        self._process.close()


def described(system: FuzzySystem) -> dict[str, object]:
    """Return the system as plain lists, with the lower triangles of its type-2 form."""

    def lower(a: float, b: float, c: float) -> list[float]:
        return [a + FOOTPRINT.left * (b - a), b, c - FOOTPRINT.left * (c - b)]

    def plain(v):
        sets = {each.name: each.upper.parameters for each in v.sets}
        inner = {name: lower(*abc) for name, abc in sets.items()}
        return {"name": v.name, "low": v.low, "high": v.high, "sets": sets, "lower": inner}

    return {
        "inputs": [plain(v) for v in system.inputs],
        "outputs": [plain(v) for v in system.outputs],
        "rules": [
            [[t.set for t in propositions(rule.antecedent)], [t.set for t in rule.consequents]]
            for rule in system.rules
        ],
    }


def calls(function: Callable, rows: list[list[float]]) -> float:
    """Return seconds per call, one row at a time."""
    function(*rows[0])
    began = perf_counter()
    for pair in rows:
        function(*pair)
    return (perf_counter() - began) / len(rows)


def batch(inference: Inference | LookupSurface, rows: np.ndarray, **options: int) -> float:
    """Return seconds per row of one call with all rows."""
    inference.batch(rows[:1])
    began = perf_counter()
    inference.batch(rows, **options)
    return (perf_counter() - began) / len(rows)


def measured() -> dict[str, float]:
    """Return median seconds per evaluation by name; all are timed in turns."""
    rng = np.random.default_rng(1)
    rows = rng.uniform(-1.0, 1.0, (BATCH, 2))
    single = rows[:CALLS].tolist()
    cores = os.cpu_count() or 1
    surface = LookupSurface(EXACT)
    peers = Peers(TYPE_1)
    times: dict[str, list[float]] = {}

    def note(name: str, seconds: float) -> None:
        times.setdefault(name, []).append(seconds)

    for k in range(ROUNDS):
        for name, inference in OURS.items():
            few = single if "type 3" not in name else single[: CALLS // 20]
            note(name, calls(inference, few))
            many = rows if "type 3" not in name else rows[: BATCH // 100]
            note(f"{name}, batch", batch(inference, many))
            if cores > 1:
                note(f"{name}, batch, {cores} threads", batch(inference, many, threads=cores))
        note("lookup surface", calls(surface, single))
        note("lookup surface, batch", batch(surface, rows))
        for peer in COUNTERPARTS:
            count = PEER_BATCH if peer.endswith("batch") else PEER_CALLS.get(peer, 30)
            note(peer, peers.time(peer, rows[k * count : (k + 1) * count]))
    peers.close()
    return {name: median(values) for name, values in times.items()}


def figures(t: dict[str, float]) -> list[dict[str, object]]:
    best = min(t[peer] for peer in ("scikit-fuzzy", "simpful", "pyfuzzylite", "pyit2fls"))
    cores = os.cpu_count() or 1
    rows = [
        ratio("type 1, one input pair, exact: faster than the best peer",
              best / t["type 1 exact"], 2000),
        ratio("type 1, one input pair, matlab: faster than the best peer",
              best / t["type 1 matlab"], 2000),
        ratio("type 1, batch, exact, one thread: faster than pyfuzzylite's batch",
              t["pyfuzzylite batch"] / t["type 1 exact, batch"], 18),
        ratio("type 1, batch, matlab, one thread: faster than pyfuzzylite's batch",
              t["pyfuzzylite batch"] / t["type 1 matlab, batch"], 25),
        ratio("type 2 centroid, one input pair: faster than pyit2fls",
              t["pyit2fls centroid"] / t["type 2 centroid, matlab"], 1500),
        ratio("type 2 centre of sets, one input pair: faster than pyit2fls",
              t["pyit2fls centre of sets"] / t["type 2 centre of sets"], 10_000),
        ratio("type 2 centroid, batch: faster than a loop over pyit2fls",
              t["pyit2fls centroid"] / t["type 2 centroid, matlab, batch"], 3000),
        ratio("type 2 centre of sets, batch: faster than a loop over pyit2fls",
              t["pyit2fls centre of sets"] / t["type 2 centre of sets, batch"], 3000),
    ]  # fmt: skip
    if cores > 1:
        for name in ("type 1 exact, batch", "type 2 centroid, matlab, batch"):
            gain = t[name] / t[f"{name}, {cores} threads"]
            rows.append(
                ratio(f"{name}: {cores} threads against one", gain, 1.0 + 0.5 * (cores - 1))
            )
    rows += [row(name, seconds * 1e6, "us") for name, seconds in t.items()]
    for nodes in (101, 201, 401):
        for error in LookupSurface(EXACT, nodes=nodes).errors:
            rows.append(
                row(f"lookup surface, {nodes} nodes: greatest error of {error.output}",
                    error.size, "of a range of 0.2")
            )  # fmt: skip
    return rows


def main() -> None:
    publish("fuzzy", figures(measured()))


if __name__ == "__main__":
    main()
