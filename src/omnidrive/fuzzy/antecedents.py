"""Antecedents of the rules of a system as flat arrays, and the firing strengths that follow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_slice
from omnidrive.fuzzy.norms import CONORMS, HEDGE_CODES, NORMS, apply_hedge, t_conorm, t_norm
from omnidrive.fuzzy.rules import And, Antecedent, Is
from omnidrive.fuzzy.system import FuzzySystem

MIN_STRENGTH = 1e-200
"""Greatest strength that counts as zero: areas of such heights would be denormal numbers."""

_MIN = NORMS["min"]
_AND, _OR, _NO_HEDGE, _NOT = 0, 1, -1, HEDGE_CODES["not"]


class Antecedents(NamedTuple):
    """Antecedents of all rules as flat arrays for the kernels.

    Sets and nodes have degrees, numbered sets first. A node is a conjunction or a disjunction of
    degrees of sets and of earlier nodes; the last nodes are the antecedents of the rules.
    """

    norms: Int[Array, " 2"]
    """Codes of the t-norm and of the t-conorm."""
    nodes: Int[Array, " heads"]
    """Kind (conjunction or disjunction) and first operand of each node, then a sentinel."""
    operands: Int[Array, " operands"]
    """Number of the degree and code of the hedge of each operand."""
    skip_to: Int[Array, " nodes"]
    """Node to continue with after a node whose first operand has degree 0.

    The nodes in between are conjunctions with the same first operand: their degree is 0 as well."""
    weights: Float[Array, " rules"]
    conjunctions: Int[Array, " operands_by_rules"]
    """Number of the set of each operand, first operands of all rules first.

    For systems whose antecedents are all plain conjunctions of sets; otherwise empty. Shorter
    antecedents are padded with the number of sets, whose degree is 1."""


def antecedents_of(system: FuzzySystem) -> Antecedents:
    """Return the antecedents of a system's rules."""
    sets = [(variable.name, each.name) for variable in system.inputs for each in variable.sets]
    heads, operands = _nodes(system, {name: k for k, name in enumerate(sets)})
    return Antecedents(
        np.array([NORMS[system.conjunction], CONORMS[system.disjunction]]),
        heads,
        operands,
        _skip_targets(heads, operands, len(system.rules)),
        np.array([rule.weight for rule in system.rules]),
        _conjunction_table(heads, operands, len(sets), len(system.rules)),
    )


def _nodes(
    system: FuzzySystem, number: dict[tuple[str, str], int]
) -> tuple[Int[Array, " heads"], Int[Array, " operands"]]:
    """Return heads and operands of all nodes, inner nodes first, given the number of each set."""
    inner: list[tuple[int, list[int]]] = []

    def node(antecedent: Antecedent) -> tuple[int, list[int]]:
        """Return the kind of a node and its operands."""
        if isinstance(antecedent, Is):
            return _AND, operand(antecedent)
        operands = [each for part in antecedent.parts for each in operand(part)]
        return _AND if isinstance(antecedent, And) else _OR, operands

    def operand(antecedent: Antecedent) -> list[int]:
        """Return the number of a degree and the code of its hedge."""
        if isinstance(antecedent, Is):
            index = number.get((antecedent.variable, antecedent.set), 0)  # "any" has no set
            first, *others = antecedent.hedges or (None,)
            for hedge in reversed(others):  # the innermost hedge applies first
                inner.append((_AND, [index, HEDGE_CODES[str(hedge)]]))
                index = len(number) + len(inner) - 1
            return [index, _NO_HEDGE if first is None else HEDGE_CODES[first]]
        inner.append(node(antecedent))
        return [len(number) + len(inner) - 1, _NO_HEDGE]

    rules = [node(rule.antecedent) for rule in system.rules]
    heads: list[int] = []
    flat: list[int] = []
    for kind, operands in (*inner, *rules):
        heads += [kind, len(flat) // 2]
        flat += operands
    return np.array([*heads, _AND, len(flat) // 2]), np.array(flat)


def _skip_targets(
    heads: Int[Array, " heads"], operands: Int[Array, " operands"], rules: int
) -> Int[Array, " nodes"]:
    """:attr:`Antecedents.skip_to`; an inner node is always computed and skips nothing."""
    count = len(heads) // 2 - 1
    skip_to = np.arange(1, count + 1)
    first = [
        operands[2 * heads[2 * k + 1]] if heads[2 * k] == _AND else -1 - k for k in range(count)
    ]
    unhedged = [operands[2 * heads[2 * k + 1] + 1] == _NO_HEDGE for k in range(count)]
    for k in range(count - 2, count - rules - 1, -1):
        if unhedged[k] and unhedged[k + 1] and first[k] == first[k + 1]:
            skip_to[k] = skip_to[k + 1]
    return skip_to


def _conjunction_table(
    heads: Int[Array, " heads"], operands: Int[Array, " operands"], sets: int, rules: int
) -> Int[Array, " operands_by_rules"]:
    """:attr:`Antecedents.conjunctions`."""
    only_conjunctions = len(heads) == 2 * (rules + 1) and not heads[::2].any()
    if not only_conjunctions or (operands[1::2] != _NO_HEDGE).any():
        return np.empty(0, dtype=np.int64)
    edges = heads[1::2]
    table = np.full((rules, np.diff(edges).max()), sets)
    for row, begin, end in zip(table, edges[:-1], edges[1:], strict=True):
        row[: end - begin] = operands[2 * begin : 2 * end : 2]
    return table.T.ravel()


@compiled
def fire(
    c: Antecedents, degrees: Float[Array, "2 degrees"], strengths: Float[Array, "2 rules"]
) -> None:
    """Fill in the lower and upper firing strength of every rule.

    A firing strength is the degree of the antecedent times the weight of the rule.

    Args:
        c: The antecedents.
        degrees: Lower and upper degree of each set; the degrees of the nodes are filled in.
        strengths: Result.
    """
    if len(c.conjunctions) > 0:
        _fire_conjunctions(c, degrees, strengths)
    else:
        _fire_nodes(c, degrees, strengths)


@compiled
def _fire_conjunctions(
    c: Antecedents, degrees: Float[Array, "2 degrees"], strengths: Float[Array, "2 rules"]
) -> None:
    conjunctions, weights, conjunction = c.conjunctions, c.weights, c.norms[_AND]
    rules, sets = len(weights), degrees.shape[1] - len(c.skip_to)
    lower, upper, low, high = degrees[0], degrees[1], strengths[0], strengths[1]
    lower[sets] = upper[sets] = 1.0  # the neutral element pads short antecedents
    for r in range(rules):
        low[r] = high[r] = 1.0
    for begin in range(0, len(conjunctions), rules):
        row = unsafe_slice(conjunctions, begin, begin + rules)
        for r in range(rules):
            k = np.uint64(row[r])  # unsigned: no check for a negative index
            minimum, maximum = lower[k], upper[k]
            if conjunction == _MIN:
                low[r] = minimum if minimum < low[r] else low[r]
                high[r] = maximum if maximum < high[r] else high[r]
            else:
                low[r] = t_norm(conjunction, low[r], minimum)
                high[r] = t_norm(conjunction, high[r], maximum)
    for r in range(rules):
        weight = weights[r]
        low[r] = low[r] * weight if low[r] * weight > MIN_STRENGTH else 0.0
        high[r] = high[r] * weight if high[r] * weight > MIN_STRENGTH else 0.0


@compiled
def _fire_nodes(
    c: Antecedents, degrees: Float[Array, "2 degrees"], strengths: Float[Array, "2 rules"]
) -> None:
    nodes, operands, weights, skip_to = c.nodes, c.operands, c.weights, c.skip_to
    conjunction, disjunction = c.norms[_AND], c.norms[_OR]
    count, rules = len(skip_to), len(weights)
    sets, first_rule = degrees.shape[1] - count, count - rules
    for r in range(rules):
        strengths[0, r] = strengths[1, r] = 0.0
    k = 0
    while k < count:
        kind, begin, end = nodes[2 * k], nodes[2 * k + 1], nodes[2 * k + 3]
        if (
            kind == _AND
            and operands[2 * begin + 1] == _NO_HEDGE
            and degrees[1, operands[2 * begin]] <= 0.0
        ):
            degrees[0, sets + k] = degrees[1, sets + k] = 0.0
            k = skip_to[k]
            continue
        low: float = 1.0 - kind
        high: float = low
        for t in range(begin, end):
            index, hedge = operands[2 * t], operands[2 * t + 1]
            minimum: float = degrees[0, index]
            maximum: float = degrees[1, index]
            if hedge == _NOT:
                minimum, maximum = 1.0 - maximum, 1.0 - minimum
            elif hedge != _NO_HEDGE:
                minimum, maximum = apply_hedge(hedge, minimum), apply_hedge(hedge, maximum)
            if kind == _AND:
                low, high = t_norm(conjunction, low, minimum), t_norm(conjunction, high, maximum)
                if high <= 0.0:
                    break
            else:
                low, high = (
                    t_conorm(disjunction, low, minimum),
                    t_conorm(disjunction, high, maximum),
                )
        degrees[0, sets + k], degrees[1, sets + k] = low, high
        if k >= first_rule:
            weight = weights[k - first_rule]
            if low * weight > MIN_STRENGTH:
                strengths[0, k - first_rule] = low * weight
            if high * weight > MIN_STRENGTH:
                strengths[1, k - first_rule] = high * weight
        k += 1
