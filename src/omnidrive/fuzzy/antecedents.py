"""Conditions of rules as the kernels read them: from degrees to the strengths of rules."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.fuzzy.norms import CONORMS, HEDGE_CODES, NORMS, apply_hedge, t_conorm, t_norm
from omnidrive.fuzzy.rules import And, Antecedent, Is
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.unsafe_views import part

FAINTEST = 1e-200
"""Strength up to which a rule does not fire: areas of such heights would be denormal numbers."""

_MIN = NORMS["min"]
_AND, _OR, _PLAIN, _NOT = 0, 1, -1, HEDGE_CODES["not"]


class Antecedents(NamedTuple):
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
    plain: Int[Array, " terms_by_rules"]
    """Where all conditions only join sets by "and": the first set of each, then the second, and so
    on; a condition with fewer has, instead, the number of all sets. Otherwise empty."""


def antecedents_of(system: FuzzySystem) -> Antecedents:
    """Conditions of a system's rules."""
    sets = [(variable.name, each.name) for variable in system.inputs for each in variable.sets]
    heads, terms = _nodes(system, {name: k for k, name in enumerate(sets)})
    return Antecedents(
        np.array([NORMS[system.conjunction], CONORMS[system.disjunction]]),
        heads,
        terms,
        _skips(heads, terms, len(system.rules)),
        np.array([rule.weight for rule in system.rules]),
        _plain(heads, terms, len(sets), len(system.rules)),
    )


def _nodes(
    system: FuzzySystem, number: dict[tuple[str, str], int]
) -> tuple[Int[Array, " heads"], Int[Array, " operands"]]:
    """Heads and terms of all nodes, given the number of each set: those within conditions first."""
    inner: list[tuple[int, list[int]]] = []

    def node(antecedent: Antecedent) -> tuple[int, list[int]]:
        """How a condition joins its operands, and their numbers."""
        if isinstance(antecedent, Is):
            return _AND, operand(antecedent)
        operands = [each for part in antecedent.parts for each in operand(part)]
        return _AND if isinstance(antecedent, And) else _OR, operands

    def operand(antecedent: Antecedent) -> list[int]:
        """Number of a degree, and the hedge under which it is taken."""
        if isinstance(antecedent, Is):
            index = number.get((antecedent.variable, antecedent.set), 0)  # "any" names no set
            first, *others = antecedent.hedges or (None,)
            for hedge in reversed(others):  # the one next to the set applies first
                inner.append((_AND, [index, HEDGE_CODES[str(hedge)]]))
                index = len(number) + len(inner) - 1
            return [index, _PLAIN if first is None else HEDGE_CODES[first]]
        inner.append(node(antecedent))
        return [len(number) + len(inner) - 1, _PLAIN]

    rules = [node(rule.antecedent) for rule in system.rules]
    heads: list[int] = []
    terms: list[int] = []
    for kind, operands in (*inner, *rules):
        heads += [kind, len(terms) // 2]
        terms += operands
    return np.array([*heads, _AND, len(terms) // 2]), np.array(terms)


def _skips(
    heads: Int[Array, " heads"], terms: Int[Array, " operands"], rules: int
) -> Int[Array, " nodes"]:
    """:attr:`Antecedents.skips`; a node within a condition must be found, and skips nothing."""
    count = len(heads) // 2 - 1
    skips = np.arange(1, count + 1)
    first = [terms[2 * heads[2 * k + 1]] if heads[2 * k] == _AND else -1 - k for k in range(count)]
    plain = [terms[2 * heads[2 * k + 1] + 1] == _PLAIN for k in range(count)]
    for k in range(count - 2, count - rules - 1, -1):
        if plain[k] and plain[k + 1] and first[k] == first[k + 1]:
            skips[k] = skips[k + 1]
    return skips


def _plain(
    heads: Int[Array, " heads"], terms: Int[Array, " operands"], sets: int, rules: int
) -> Int[Array, " terms_by_rules"]:
    """:attr:`Antecedents.plain`."""
    joins_sets = len(heads) == 2 * (rules + 1) and not heads[::2].any()
    if not joins_sets or (terms[1::2] != _PLAIN).any():
        return np.empty(0, dtype=np.int64)
    edges = heads[1::2]
    table = np.full((rules, np.diff(edges).max()), sets)
    for row, begin, end in zip(table, edges[:-1], edges[1:], strict=True):
        row[: end - begin] = terms[2 * begin : 2 * end : 2]
    return table.T.ravel()


@compiled
def fire(
    c: Antecedents, degrees: Float[Array, "2 degrees"], strengths: Float[Array, "2 rules"]
) -> None:
    """Fill in the least and greatest strength of every rule.

    Args:
        c: The conditions.
        degrees: Lower and upper degree of each set; those of the nodes are filled in.
        strengths: To fill in.
    """
    if len(c.plain) > 0:
        _fire_plain(c, degrees, strengths)
    else:
        _fire_any(c, degrees, strengths)


@compiled
def _fire_plain(
    c: Antecedents, degrees: Float[Array, "2 degrees"], strengths: Float[Array, "2 rules"]
) -> None:
    plain, weights, conjunction = c.plain, c.weights, c.norms[_AND]
    rules, sets = len(weights), degrees.shape[1] - len(c.skips)
    lower, upper, low, high = degrees[0], degrees[1], strengths[0], strengths[1]
    lower[sets] = upper[sets] = 1.0  # joining it changes nothing
    for r in range(rules):
        low[r] = high[r] = 1.0
    for begin in range(0, len(plain), rules):
        row = part(plain, begin, begin + rules)
        for r in range(rules):
            k = np.uint64(row[r])  # no look whether it counts from the end
            least, most = lower[k], upper[k]
            if conjunction == _MIN:
                low[r] = least if least < low[r] else low[r]
                high[r] = most if most < high[r] else high[r]
            else:
                low[r] = t_norm(conjunction, low[r], least)
                high[r] = t_norm(conjunction, high[r], most)
    for r in range(rules):
        weight = weights[r]
        low[r] = low[r] * weight if low[r] * weight > FAINTEST else 0.0
        high[r] = high[r] * weight if high[r] * weight > FAINTEST else 0.0


@compiled
def _fire_any(
    c: Antecedents, degrees: Float[Array, "2 degrees"], strengths: Float[Array, "2 rules"]
) -> None:
    nodes, terms, weights, skips = c.nodes, c.terms, c.weights, c.skips  # look-ups cost in loops
    conjunction, disjunction = c.norms[_AND], c.norms[_OR]
    count, rules = len(skips), len(weights)
    sets, first_rule = degrees.shape[1] - count, count - rules
    for r in range(rules):
        strengths[0, r] = strengths[1, r] = 0.0
    k = 0
    while k < count:
        kind, begin, end = nodes[2 * k], nodes[2 * k + 1], nodes[2 * k + 3]
        if kind == _AND and terms[2 * begin + 1] == _PLAIN and degrees[1, terms[2 * begin]] <= 0.0:
            degrees[0, sets + k] = degrees[1, sets + k] = 0.0
            k = skips[k]
            continue
        low: float = 1.0 - kind
        high: float = low
        for t in range(begin, end):
            index, hedge = terms[2 * t], terms[2 * t + 1]
            least: float = degrees[0, index]
            most: float = degrees[1, index]
            if hedge == _NOT:
                least, most = 1.0 - most, 1.0 - least
            elif hedge != _PLAIN:
                least, most = apply_hedge(hedge, least), apply_hedge(hedge, most)
            if kind == _AND:
                low, high = t_norm(conjunction, low, least), t_norm(conjunction, high, most)
                if high <= 0.0:
                    break
            else:
                low, high = t_conorm(disjunction, low, least), t_conorm(disjunction, high, most)
        degrees[0, sets + k], degrees[1, sets + k] = low, high
        if k >= first_rule:
            weight = weights[k - first_rule]
            if low * weight > FAINTEST:
                strengths[0, k - first_rule] = low * weight
            if high * weight > FAINTEST:
                strengths[1, k - first_rule] = high * weight
        k += 1
