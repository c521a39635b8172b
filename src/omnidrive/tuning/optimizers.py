"""Optimisers of tuning: CMA-ES for one objective, NSGA-II for several."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, log
from typing import Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import MissingExtra
from omnidrive.tuning.space import ParameterSpace

Points = Float[Array, "points dimensions"]

_WORST = 1e12
"""Value of an objective that a run does not have, for NSGA-II, which computes with it."""

_RESTART = 0.5
"""Standard deviation, in scaled units, with which CMA-ES starts again from its best point."""


class Score(NamedTuple):
    """Result of one point; smaller is better."""

    objectives: tuple[float, ...]
    """Values of the objectives; infinite if a run lacks a metric."""
    violation: float
    """Sum of the relative violations of the limits; 0: all are kept."""

    @property
    def order(self) -> tuple[float, float]:
        """Key of the order by the first objective: points that keep the limits come first.

        Feasibility rules of Deb, "An efficient constraint handling method for genetic algorithms",
        Comput. Methods Appl. Mech. Eng. 186, 2000.
        """
        return self.violation, (self.objectives[0] if self.violation == 0.0 else 0.0)


class Optimizer(Protocol):
    """Proposes points in scaled coordinates, a generation at a time."""

    def ask(self) -> Points:
        """Return the points of the next generation."""
        ...

    def tell(self, scores: Sequence[Score]) -> None:
        """Take over the results of the points of the last generation, in their order."""
        ...


class CmaEs:
    """CMA-ES for one objective (Hansen, "The CMA evolution strategy: a tutorial", 2016).

    Whole numbers with a linear scale keep a margin of probability for their neighbours (Hamano,
    Saito, Nomura & Shirakawa, "CMA-ES with margin", GECCO 2022). Where it converges, it starts
    again from its best point.
    """

    def __init__(self, space: ParameterSpace, seed: int, *, population: int | None = None) -> None:
        """Start at the values before tuning with a standard deviation of one scaled unit.

        Args:
            space: The parameters.
            seed: Seed of the random numbers.
            population: Points per generation; None: 4 + 3 ln(dimensions), made even.

        Raises:
            MissingExtra: The extra `tuning` is not installed.
        """
        count = len(space.dimensions)
        default = 4 + int(3.0 * log(count)) if count > 1 else 4
        self._population = population or default + default % 2
        self._bounds = space.bounds
        self._steps = np.array(
            [
                1.0 / each.step if each.integer and not each.logarithmic else 0.0
                for each in space.dimensions
            ]
        )
        self._seed = seed
        self._best: tuple[tuple[float, float], Array] | None = None
        self._asked: list[tuple[Array, Array]] = []
        self._cma = self._started(np.zeros(count), 1.0)

    def _started(self, mean: Array, sigma: float) -> Any:
        """Return a new state of the algorithm."""
        try:
            from cmaes import CMAwM  # noqa: PLC0415 - of an extra
        except ImportError:
            raise missing_extra() from None
        self._seed += 1
        return CMAwM(
            mean=mean,
            sigma=sigma,
            bounds=self._bounds,
            steps=self._steps,
            seed=self._seed % 2**32,
            population_size=self._population,
        )

    def ask(self) -> Points:
        """Return the points of the next generation."""
        self._asked = [self._cma.ask() for _ in range(self._population)]
        return np.array([encoded for encoded, _ in self._asked])

    def tell(self, scores: Sequence[Score]) -> None:
        """Take over the results; only their order counts."""
        orders = [each.order for each in scores]
        ranks = [sorted(orders).index(each) for each in orders]  # equal scores have equal ranks
        self._cma.tell(
            [(raw, float(rank)) for (_, raw), rank in zip(self._asked, ranks, strict=True)]
        )
        first = min(range(len(orders)), key=orders.__getitem__)
        if self._best is None or orders[first] < self._best[0]:
            self._best = orders[first], self._asked[first][0]
        if self._cma.should_stop():
            self._cma = self._started(self._best[1], _RESTART)


class Nsga2:
    """NSGA-II for several objectives (Deb et al., IEEE Trans. Evol. Comput. 6, 2002)."""

    def __init__(
        self, space: ParameterSpace, objectives: int, seed: int, *, population: int = 24
    ) -> None:
        """Start with the values before tuning and points around them.

        Args:
            space: The parameters.
            objectives: Number of objectives.
            seed: Seed of the random numbers.
            population: Points per generation.

        Raises:
            MissingExtra: The extra `tuning` is not installed.
        """
        try:
            from pymoo.algorithms.moo.nsga2 import NSGA2  # noqa: PLC0415 - of an extra
            from pymoo.core.problem import Problem  # noqa: PLC0415
        except ImportError:
            raise missing_extra() from None
        bounds, count = space.bounds, len(space.dimensions)
        rng = np.random.default_rng(seed)
        start = np.clip(rng.normal(size=(population, count)), bounds[:, 0], bounds[:, 1])
        start[0] = 0.0
        self._problem = Problem(
            n_var=count, n_obj=objectives, n_ieq_constr=1, xl=bounds[:, 0], xu=bounds[:, 1]
        )
        self._algorithm = NSGA2(pop_size=population, sampling=start)
        self._algorithm.setup(
            self._problem, termination=("n_gen", 10**9), seed=seed % 2**32, verbose=False
        )
        self._asked: Any = None

    def ask(self) -> Points:
        """Return the points of the next generation."""
        self._asked = self._algorithm.ask()
        points: Points = np.array(self._asked.get("X"), dtype=float)
        return points

    def tell(self, scores: Sequence[Score]) -> None:
        """Take over the results; points that violate a limit are worse than all that do not."""
        from pymoo.core.evaluator import Evaluator  # noqa: PLC0415 - of an extra
        from pymoo.problems.static import StaticProblem  # noqa: PLC0415

        values = np.array([[_finite(x) for x in each.objectives] for each in scores])
        violations = np.array([[_finite(each.violation)] for each in scores])
        static = StaticProblem(self._problem, F=values, G=violations)
        Evaluator().eval(static, self._asked)
        self._algorithm.tell(infills=self._asked)


def missing_extra() -> MissingExtra:
    """Return the error that the optimisers are not installed."""
    return MissingExtra(
        "tuning needs cmaes and pymoo, which are not installed: pip install cmaes pymoo"
    )


def _finite(value: float) -> float:
    return value if isfinite(value) else _WORST


def front(scores: Sequence[Score]) -> list[int]:
    """Return the indices of the points that no other one dominates, by the first objective.

    Points that violate a limit are left out.
    """
    kept = [i for i, each in enumerate(scores) if each.violation == 0.0]
    found = [
        i
        for i in kept
        if not any(
            _dominates(scores[k].objectives, scores[i].objectives)
            or (k < i and scores[k].objectives == scores[i].objectives)
            for k in kept
        )
    ]
    return sorted(found, key=lambda i: scores[i].objectives)


def knee(scores: Sequence[Score]) -> int | None:
    """Return the index of the compromise of a front: that nearest to the best of each objective.

    The objectives are scaled to their ranges on the front. None: no point keeps the limits.
    """
    indices = front(scores)
    if not indices:
        return None
    values = np.array([scores[i].objectives for i in indices])
    low, high = values.min(axis=0), values.max(axis=0)
    scaled = (values - low) / np.where(high > low, high - low, 1.0)
    return indices[int(np.argmin((scaled**2).sum(axis=1)))]


def _dominates(first: Sequence[float], second: Sequence[float]) -> bool:
    pairs = list(zip(first, second, strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)
