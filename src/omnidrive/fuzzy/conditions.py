"""Conditions of rules as the kernels read them: from degrees to the strengths of rules."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.fuzzy.norms import CONORMS, HEDGE_CODES, NORMS, conjoin, disjoin, hedged
from omnidrive.fuzzy.system import And, Condition, FuzzySystem, Is

Array = np.ndarray

FAINTEST = 1e-200
"""Strength up to which a rule does not fire: areas of such heights would be denormal numbers."""

_AND, _OR, _PLAIN, _NOT = 0, 1, -1, HEDGE_CODES["not"]


class Conditions(NamedTuple):
    """The conditions of all rules, flat.

    A degree is that of a set or of a node. A node joins the degrees of sets and of nodes before
    it; the last nodes are the conditions of the rules.
    """

    norms: Int[Array, " 2"]
    """What "and" and "or" do."""
    nodes: Int[Array, " heads"]
    """Of each node: and or or, first term; then a sentinel."""
    terms: Int[Array, " operands"]
    """Of each term: the degree that it takes, and under which hedge."""
    skips: Int[Array, " nodes"]
    """The first node after each that does not begin, like it, with "x is A and": none of those
    between holds where x is not A at all."""
    weights: Float[Array, " rules"]


def conditions_of(system: FuzzySystem) -> Conditions:
    """Conditions of a system's rules."""
    sets = [(variable.name, each.name) for variable in system.inputs for each in variable.sets]
    heads, terms = _nodes(system, {name: k for k, name in enumerate(sets)})
    return Conditions(
        np.array([NORMS[system.conjunction], CONORMS[system.disjunction]]),
        heads,
        terms,
        _skips(heads, terms, len(system.rules)),
        np.array([rule.weight for rule in system.rules]),
    )


def _nodes(
    system: FuzzySystem, number: dict[tuple[str, str], int]
) -> tuple[Int[Array, " heads"], Int[Array, " operands"]]:
    """Heads and terms of all nodes, given the number of each set: those within conditions first."""
    inner: list[tuple[int, list[int]]] = []

    def node(condition: Condition) -> tuple[int, list[int]]:
        if isinstance(condition, Is):
            return _AND, operand(condition)
        operands = [each for part in condition.parts for each in operand(part)]
        return _AND if isinstance(condition, And) else _OR, operands

    def operand(condition: Condition) -> list[int]:
        """Number of a degree, and the hedge under which it is taken."""
        if isinstance(condition, Is):
            index = number.get((condition.variable, condition.set), 0)  # "any" names no set
            first, *others = condition.hedges or (None,)
            for hedge in reversed(others):  # the one next to the set applies first
                inner.append((_AND, [index, HEDGE_CODES[str(hedge)]]))
                index = len(number) + len(inner) - 1
            return [index, _PLAIN if first is None else HEDGE_CODES[first]]
        inner.append(node(condition))
        return [len(number) + len(inner) - 1, _PLAIN]

    rules = [node(rule.condition) for rule in system.rules]
    heads: list[int] = []
    terms: list[int] = []
    for kind, operands in (*inner, *rules):
        heads += [kind, len(terms) // 2]
        terms += operands
    return np.array([*heads, _AND, len(terms) // 2]), np.array(terms)


def _skips(
    heads: Int[Array, " heads"], terms: Int[Array, " operands"], rules: int
) -> Int[Array, " nodes"]:
    """:attr:`Conditions.skips`; a node within a condition must be found, and skips nothing."""
    count = len(heads) // 2 - 1
    skips = np.arange(1, count + 1)
    first = [terms[2 * heads[2 * k + 1]] if heads[2 * k] == _AND else -1 - k for k in range(count)]
    plain = [terms[2 * heads[2 * k + 1] + 1] == _PLAIN for k in range(count)]
    for k in range(count - 2, count - rules - 1, -1):
        if plain[k] and plain[k + 1] and first[k] == first[k + 1]:
            skips[k] = skips[k + 1]
    return skips


@compiled
def room(c: Conditions) -> int:
    """How many degrees the nodes need, after those of the sets."""
    return len(c.skips)


@compiled
def fire(
    c: Conditions, degrees: Float[Array, "2 degrees"], uncertain: bool
) -> Float[Array, "2 rules"]:
    """Least and greatest strength of every rule; only the greatest unless ``uncertain``.

    Args:
        c: The conditions.
        degrees: Lower and upper degree of each set; those of the nodes are filled in.
        uncertain: Whether the bounds differ; if not, there are only upper degrees.
    """
    nodes, terms, weights, skips = c.nodes, c.terms, c.weights, c.skips  # look-ups cost in loops
    conjunction, disjunction = c.norms[_AND], c.norms[_OR]
    count, rules = len(skips), len(weights)
    sets, first_rule = degrees.shape[1] - count, count - rules
    strengths = np.zeros((2, rules))
    k = 0
    while k < count:
        kind, begin, end = nodes[2 * k], nodes[2 * k + 1], nodes[2 * k + 3]
        if kind == _AND and terms[2 * begin + 1] == _PLAIN and degrees[1, terms[2 * begin]] <= 0.0:
            degrees[0, sets + k] = degrees[1, sets + k] = 0.0
            k = skips[k]
            continue
        for other in range(2 if uncertain else 1):
            bound = 1 - other
            joined: float = 1.0 - kind
            for t in range(begin, end):
                index, hedge = terms[2 * t], terms[2 * t + 1]
                each: float = degrees[bound, index]
                if hedge != _PLAIN:
                    if hedge == _NOT and uncertain:  # "not" turns one bound into the other
                        each = degrees[other, index]
                    each = hedged(hedge, each)
                if kind == _AND:
                    joined = conjoin(conjunction, joined, each)
                    if joined <= 0.0:
                        break
                else:
                    joined = disjoin(disjunction, joined, each)
            degrees[bound, sets + k] = joined
            if k >= first_rule:
                strength = joined * weights[k - first_rule]
                strengths[bound, k - first_rule] = strength if strength > FAINTEST else 0.0
            if bound == 1 and joined <= 0.0:  # then so is the lower degree
                degrees[0, sets + k] = 0.0
                break
        k += 1
    return strengths
