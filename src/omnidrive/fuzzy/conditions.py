"""Conditions of rules as the kernels read them: from degrees to the strengths of rules."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.compiled import compiled
from omnidrive.fuzzy.norms import CONORMS, HEDGE_CODES, NORMS, conjoin, disjoin, hedged
from omnidrive.fuzzy.system import And, Condition, FuzzySystem, Is

Array = np.ndarray

_AND, _OR, _PLAIN, _NOT = 0, 1, -1, HEDGE_CODES["not"]


class Conditions(NamedTuple):
    """The conditions of all rules, flat.

    A degree is that of a set or of a node. A node joins the degrees of sets and of nodes before
    it; the last nodes are the conditions of the rules.
    """

    norms: Int[Array, " 2"]
    """What "and" and "or" do."""
    nodes: Int[Array, " 2*nodes+2"]
    """Of each node: and or or, first term; then a sentinel."""
    terms: Int[Array, " 2*terms"]
    """Of each term: the degree that it takes, and under which hedge."""
    weights: Float[Array, " rules"]


def conditions_of(system: FuzzySystem) -> Conditions:
    """Conditions of a system's rules."""
    sets = [(variable.name, each.name) for variable in system.inputs for each in variable.sets]
    heads, terms = _nodes(system, {name: k for k, name in enumerate(sets)})
    return Conditions(
        np.array([NORMS[system.conjunction], CONORMS[system.disjunction]]),
        heads,
        terms,
        np.array([rule.weight for rule in system.rules]),
    )


def _nodes(
    system: FuzzySystem, number: dict[tuple[str, str], int]
) -> tuple[Int[Array, " 2*nodes+2"], Int[Array, " 2*terms"]]:
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


@compiled
def room(c: Conditions) -> int:
    """How many degrees the nodes need, after those of the sets."""
    return len(c.nodes) // 2 - 1


@compiled
def fire(
    c: Conditions, degrees: Float[Array, "2 degrees"], uncertain: bool
) -> Float[Array, "2 rules"]:
    """Least and greatest strength of every rule; they are equal unless ``uncertain``.

    Args:
        c: The conditions.
        degrees: Lower and upper degree of each set; those of the nodes are filled in.
        uncertain: Whether the bounds differ; if not, there are only upper degrees.
    """
    nodes, terms, weights = c.nodes, c.terms, c.weights  # locals: each look-up costs in the loop
    conjunction, disjunction = c.norms[_AND], c.norms[_OR]
    count, rules = len(nodes) // 2 - 1, len(weights)
    sets, first_rule = degrees.shape[1] - count, count - rules
    strengths = np.empty((2, rules))
    for k in range(count):
        kind = nodes[2 * k]
        for bound in range(0 if uncertain else 1, 2):
            joined: float = 1.0 - kind
            for t in range(nodes[2 * k + 1], nodes[2 * k + 3]):
                index, hedge = terms[2 * t], terms[2 * t + 1]
                each: float = degrees[bound, index]
                if hedge >= 0:
                    if hedge == _NOT and uncertain:  # "not" turns one bound into the other
                        each = degrees[1 - bound, index]
                    each = hedged(hedge, each)
                if kind == _AND:
                    joined = conjoin(conjunction, joined, each)
                    if joined <= 0.0:
                        break
                else:
                    joined = disjoin(disjunction, joined, each)
            degrees[bound, sets + k] = joined
            if k >= first_rule:
                strengths[bound, k - first_rule] = joined * weights[k - first_rule]
    if not uncertain:
        strengths[0] = strengths[1]
    return strengths
