"""t-norms, t-conorms and hedges on degrees of membership."""

from __future__ import annotations

from math import sqrt

from omnidrive.compiled import compiled

NORMS: dict[str, int] = {
    "min": 0,
    "prod": 1,
    "lukasiewicz": 2,
    "drastic": 3,
    "einstein": 4,
    "hamacher": 5,
    "nilpotent": 6,
}
"""Codes of the t-norms, which evaluate "and". ``lukasiewicz`` is the bounded difference."""

CONORMS: dict[str, int] = {
    "max": 0,
    "probor": 1,
    "bsum": 2,
    "drastic": 3,
    "einstein": 4,
    "hamacher": 5,
    "nilpotent": 6,
}
"""Codes of the t-conorms, which evaluate "or".

``probor`` is the probabilistic sum a + b - a b, ``bsum`` the bounded sum."""

AGGREGATIONS: dict[str, int] = {**CONORMS, "sum": 7}
"""Codes of the aggregations: the t-conorms, and Matlab's ``sum``, which may exceed 1."""

IMPLICATIONS: dict[str, int] = {"min": 0, "prod": 1}
"""Codes of the implications: ``min`` clips the consequent, ``prod`` scales it."""


@compiled
def _probabilistic_sum(a: float, b: float) -> float:
    """Return a + b - a b; exactly 1 if a degree is 1, and the other degree if one is 0."""
    maximum = max(a, b)
    return maximum + min(a, b) * (1.0 - maximum)


@compiled
def t_norm(norm: int, a: float, b: float) -> float:  # noqa: PLR0911
    """Return the t-norm of two degrees (Klement, Mesiar & Pap, "Triangular Norms", 2000)."""
    if norm == 0:
        return min(a, b)
    if norm == 1:
        return a * b
    if norm == 2:
        return max(0.0, min(a, b) - (1.0 - max(a, b)))
    if norm == 3:
        return min(a, b) if max(a, b) == 1.0 else 0.0
    if norm == 4:
        return a * b / (2.0 - _probabilistic_sum(a, b))
    if norm == 5:
        return a * b / _probabilistic_sum(a, b) if a + b > 0.0 else 0.0
    return min(a, b) if min(a, b) > 1.0 - max(a, b) else 0.0


@compiled
def t_conorm(conorm: int, a: float, b: float) -> float:  # noqa: PLR0911
    """Return the t-conorm of two degrees, or their sum.

    The t-conorm is the dual of the :func:`t_norm` with the same code.
    """
    if conorm == 0:
        return max(a, b)
    if conorm == 1:
        return _probabilistic_sum(a, b)
    if conorm == 2:
        return min(1.0, a + b)
    if conorm == 3:
        return max(a, b) if min(a, b) == 0.0 else 1.0
    if conorm == 4:
        return (a + b) / (1.0 + a * b)
    if conorm == 5:
        rest = (1.0 - a) + a * (1.0 - b)  # 1 - a b, without cancellation near a = b = 1
        return (a * (1.0 - b) + b * (1.0 - a)) / rest if rest > 0.0 else 1.0
    if conorm == 6:
        return max(a, b) if a + b < 1.0 else 1.0
    return a + b


HEDGE_CODES: dict[str, int] = {
    "not": 0,
    "any": 1,
    "very": 2,
    "somewhat": 3,
    "extremely": 4,
    "seldom": 5,
}
"""Codes of the hedges. All but "not" are monotone.

fuzzylite's definitions (after Zadeh 1972)."""


@compiled
def apply_hedge(hedge: int, a: float) -> float:
    """Return the degree of membership modified by a hedge."""
    if hedge == 0:
        return 1.0 - a
    if hedge == 1:
        return 1.0
    if hedge == 2:
        return a * a
    if hedge == 3:
        return sqrt(a)
    if hedge == 4:
        return 2.0 * a * a if a <= 0.5 else 1.0 - 2.0 * (1.0 - a) ** 2
    return sqrt(0.5 * a) if a <= 0.5 else 1.0 - sqrt(0.5 * (1.0 - a))
