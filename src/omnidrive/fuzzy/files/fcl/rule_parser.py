"""Rules of a text in the fuzzy control language."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from omnidrive.errors import InvalidInput
from omnidrive.files.position import Position
from omnidrive.fuzzy.files.assembly import LocatedRule, locate_errors
from omnidrive.fuzzy.files.fcl.lexer import TokenStream
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.rule_text import normalised
from omnidrive.fuzzy.rules import (
    HEDGES,
    MAX_DEPTH,
    MAX_HEDGES,
    And,
    Antecedent,
    Hedge,
    Is,
    Or,
    Rule,
    negated,
)

_AFTER_PROPOSITION = frozenset(
    {"AND", "OR", "THEN", "WITH", ")", "(", ",", ";", "RULE", "END_RULEBLOCK", ""}
)


class RuleParser:
    """Parser of rules: ``IF a IS b AND NOT c IS d THEN x IS y, z IS w WITH 0.5``.

    Args:
        tokens: The tokens.
        sets_of: Names of the sets of each variable; a set may have the name of a hedge.
        and_binds_tighter: Returns whether AND is known to bind tighter than OR. It does in IEC
            61131-7 and in fuzzylite; jFuzzyLogic evaluates from left to right.

    Attributes:
        negated: Position of the first group after NOT; None: there is none.
    """

    def __init__(
        self,
        tokens: TokenStream,
        sets_of: Mapping[str, set[str]],
        and_binds_tighter: Callable[[], bool],
    ) -> None:
        self._tokens = tokens
        self._sets_of = sets_of
        self._and_binds_tighter = and_binds_tighter
        self.negated: Position | None = None

    def rule(self) -> LocatedRule:
        """Parse the rule that begins at the next token."""
        tokens = self._tokens
        position = tokens.expect("IF").position
        antecedent = self._disjunction(0)
        tokens.expect("THEN")
        consequents = [self._proposition()]
        while tokens.accept(",", "AND"):
            consequents.append(self._proposition())
        weight_position = tokens.next.position
        weight = tokens.number() if tokens.accept("WITH") else 1.0
        tokens.accept(";")
        if not 0.0 <= weight <= 1.0:
            raise malformed(weight_position, f"a weight must lie in [0, 1], got {weight:g}")
        with locate_errors(position):
            if any(each.hedges for each in consequents):
                raise InvalidInput("NOT or a hedge in a consequent is not supported")
            return LocatedRule(Rule(normalised(antecedent), tuple(consequents), weight), position)

    def _disjunction(self, depth: int) -> Antecedent:
        groups = [[self._operand(depth)]]
        while self._tokens.next.key in {"AND", "OR"}:
            connective = self._tokens.take()
            if connective.key == "OR":
                groups.append([self._operand(depth)])
                continue
            if len(groups) > 1 and not self._and_binds_tighter():
                raise malformed(
                    connective.position,
                    "AND after OR: IEC 61131-7 evaluates AND first, jFuzzyLogic from left to "
                    "right; write parentheses",
                )
            groups[-1].append(self._operand(depth))
        return Or(tuple(And(tuple(each)) for each in groups))

    def _operand(self, depth: int) -> Antecedent:
        tokens = self._tokens
        negations: tuple[Hedge, ...] = ()
        while tokens.next.key == "NOT":
            if len(negations) >= MAX_HEDGES:
                tokens.fail(f"at most {MAX_HEDGES} hedges")
            tokens.take()
            negations += ("not",)
        opening = tokens.next
        if not tokens.accept("("):
            return self._proposition().hedged(negations)
        if depth >= MAX_DEPTH:
            raise malformed(opening.position, f"parentheses are nested more than {MAX_DEPTH} deep")
        inner = self._disjunction(depth + 1)
        tokens.expect(")")
        if not negations:
            return inner
        inner = normalised(inner)
        if isinstance(inner, Is):
            return inner.hedged(negations)
        self.negated = self.negated or opening.position
        with locate_errors(opening.position):
            return negated(inner) if len(negations) % 2 else inner

    def _proposition(self) -> Is:
        tokens = self._tokens
        variable = tokens.name("a variable")
        tokens.expect("IS")
        hedges: list[Hedge] = []
        while (hedge := self._hedge(variable.text)) is not None:
            if len(hedges) >= MAX_HEDGES:
                tokens.fail(f"at most {MAX_HEDGES} hedges")
            position = tokens.take().position
            hedges.append(hedge)
            if hedge == "any":
                break
        with locate_errors(variable.position):
            if "any" in hedges:
                if tokens.next.key not in _AFTER_PROPOSITION:
                    raise malformed(position, f"expected no set after 'any', got {tokens.next}")
                return Is(variable.text, "", tuple(hedges))
            name = tokens.name(f"a set of {variable.text[:40]!r}").text
            return Is(variable.text, name, tuple(hedges))

    def _hedge(self, variable: str) -> Hedge | None:
        token = self._tokens.next
        if token.kind != "word" or token.text in self._sets_of.get(variable, ()):
            return None
        return next((hedge for hedge in HEDGES if hedge == token.text.lower()), None)
