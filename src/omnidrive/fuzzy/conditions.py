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
            index = number[condition.variable, condition.set]
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
    c: Conditions,
    lower: Float[Array, " degrees"],
    upper: Float[Array, " degrees"],
    uncertain: bool,
) -> tuple[Float[Array, " rules"], Float[Array, " rules"]]:
    """Least and greatest strength of every rule; one array unless ``uncertain``.

    Args:
        c: The conditions.
        lower: Lower degrees of the sets; those of the nodes are filled in.
        upper: Upper degrees; the same array unless ``uncertain``.
        uncertain: Whether the bounds differ.
    """
    nodes, rules = len(c.nodes) // 2 - 1, len(c.weights)
    sets, first_rule = len(upper) - nodes, nodes - rules
    greatest = np.empty(rules)
    least = np.empty(rules) if uncertain else greatest
    for k in range(nodes):
        upper[sets + k] = _joined(c, k, upper, lower)
        if uncertain:
            lower[sets + k] = _joined(c, k, lower, upper)
        if k >= first_rule:
            greatest[k - first_rule] = upper[sets + k] * c.weights[k - first_rule]
            if uncertain:
                least[k - first_rule] = lower[sets + k] * c.weights[k - first_rule]
    return least, greatest


@compiled
def _joined(
    c: Conditions,
    k: int,
    degrees: Float[Array, " degrees"],
    others: Float[Array, " degrees"],
) -> float:
    """Degree of node ``k``; "not" turns a bound into the other one."""
    kind = c.nodes[2 * k]
    norm = c.norms[kind]
    joined: float = 1.0 - kind
    for t in range(c.nodes[2 * k + 1], c.nodes[2 * k + 3]):
        index, hedge = c.terms[2 * t], c.terms[2 * t + 1]
        each: float = degrees[index]
        if hedge >= 0:
            each = hedged(hedge, others[index] if hedge == _NOT else each)
        if kind == _AND:
            joined = conjoin(norm, joined, each)
            if joined <= 0.0:
                break
        else:
            joined = disjoin(norm, joined, each)
    return joined
