"""Balanced random sample of groups of cells: all their combinations are too many."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

OF_CASE = 10
"""Weight of the balance of every case, relative to that of robots, sample times and plants."""


class Drawn(NamedTuple):
    """What the cells of a group have in common."""

    robot: str
    dt: float
    plant: str
    case: str
    reference: str


def sample(
    cases: Sequence[str],
    *,
    robots: Sequence[str],
    dts: Sequence[float],
    plants: Mapping[str, int],
    references: Sequence[str],
    seed: int,
) -> list[Drawn]:
    """Return one group per case, robot and sample time, with a plant and a reference.

    These are random of those that the case, the robot, the sample time and, for the reference, the
    plant have met least; ``plants`` with their shares.
    """
    rng, met = np.random.default_rng(seed), Counter[tuple[Hashable, str]]()

    def draw(shares: Mapping[str, int], *common: Hashable) -> str:
        case, *others = common
        shuffled = [list(shares)[i] for i in rng.permutation(len(shares)).tolist()]

        def meetings(value: str) -> float:
            of_others = sum(met[each, value] for each in others)
            return (OF_CASE * met[case, value] + of_others) / shares[value]

        chosen = min(shuffled, key=meetings)
        met.update((each, chosen) for each in common)
        return chosen

    combinations, drawn = list(product(robots, dts)), []
    for case in cases:
        for i in rng.permutation(len(combinations)).tolist():
            robot, dt = combinations[i]
            plant = draw(plants, case, robot, dt)
            reference = draw(dict.fromkeys(references, 1), case, robot, dt, plant)
            drawn.append(Drawn(robot, dt, plant, case, reference))
    return drawn
