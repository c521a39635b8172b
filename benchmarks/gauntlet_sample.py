"""Balanced random sample of groups of cells: all their combinations are too many."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

OF_CASE = 10
"""Weight of the balance of every case, relative to that of robots, sample times and plants."""


Value = TypeVar("Value", bound=Hashable)


class Drawn(NamedTuple):
    """What the cells of a group have in common."""

    robot: str
    dt: float
    plant: str
    case: str
    reference: str


def sample(
    cases: Mapping[str, int],
    *,
    robots: Sequence[str],
    dts: Sequence[float],
    plants: Mapping[str, int],
    references: Sequence[str],
    seed: int,
) -> list[Drawn]:
    """Return random groups, with every robot, sample time, plant and reference about equally often.

    Each of them is random of those that what was drawn before has met least: the case, the robot
    with this case, and so on. ``cases`` with their numbers of groups, ``plants`` with their shares.
    """
    rng, met = np.random.default_rng(seed), Counter[tuple[Hashable, Hashable]]()

    def draw(shares: Mapping[Value, int], *common: Hashable) -> Value:
        """Draw a value; of what it is drawn for, tuples are those with the case."""
        weights = {each: OF_CASE if isinstance(each, tuple) else 1 for each in common}
        shuffled = [list(shares)[i] for i in rng.permutation(len(shares)).tolist()]

        def meetings(value: Value) -> float:
            return sum(weights[each] * met[each, value] for each in common) / shares[value]

        chosen = min(shuffled, key=meetings)
        met.update((each, chosen) for each in common)
        return chosen

    drawn = []
    for case, count in cases.items():
        for _ in range(count):
            robot = draw(dict.fromkeys(robots, 1), (case,))
            dt = draw(dict.fromkeys(dts, 1), (case, robot), (case,), robot)
            plant = draw(plants, (case,), robot, dt)
            common = (case, robot, dt), (case,), robot, dt, plant
            reference = draw(dict.fromkeys(references, 1), *common)
            drawn.append(Drawn(robot, dt, plant, case, reference))
    return list(dict.fromkeys(drawn))
