"""Rules of the fuzzy control language: ``IF a IS b AND NOT c IS d THEN x IS y, z IS w``."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import LocatedRule, locate_errors
from omnidrive.fuzzy.files.fcl_text import FclText, Token
from omnidrive.fuzzy.files.source import malformed
from omnidrive.fuzzy.rule_text import normalised
from omnidrive.fuzzy.rules import HEDGES, MAX_DEPTH, And, Antecedent, Hedge, Is, Or, Rule

MAX_HEDGES = 10
"""Most hedges before a set."""

_AFTER = frozenset({"AND", "OR", "THEN", "WITH", ")", "(", ",", ";", "RULE", "END_RULEBLOCK", ""})


class RuleReader:
    """Reads rules one after another.

    Args:
        text: From which they are read.
        sets_of: Names of the sets of each variable: a set may be called as a hedge is.
        binds_tighter: Whether it is known here that AND binds tighter than OR. IEC 61131-7 and
            fuzzylite say so; jFuzzyLogic joins from the left.
    """

    def __init__(
        self, text: FclText, sets_of: Mapping[str, set[str]], binds_tighter: Callable[[], bool]
    ) -> None:
        self._text = text
        self._sets_of = sets_of
        self._binds_tighter = binds_tighter

    def rule(self) -> LocatedRule:
        """The rule that begins here.

        Raises:
            InvalidFuzzyFile: There is none.
        """
        text = self._text
        position = text.expect("IF").position
        antecedent = self._any_of(0)
        text.expect("THEN")
        consequents = [self._term()]
        while text.accept(",", "AND"):
            consequents.append(self._term())
        weight_position = text.next.position
        weight = text.number() if text.accept("WITH") else 1.0
        text.accept(";")
        if not 0.0 <= weight <= 1.0:
            raise malformed(weight_position, f"a weight must lie in [0, 1], got {weight:g}")
        with locate_errors(position):
            if any(term.hedges for term in consequents):
                raise InvalidInput("NOT or a hedge in a consequent cannot be expressed")
            return LocatedRule(Rule(normalised(antecedent), tuple(consequents), weight), position)

    def _any_of(self, depth: int) -> Antecedent:
        groups = [[self._part(depth)]]
        while self._text.next.key in {"AND", "OR"}:
            join = self._text.take()
            if join.key == "OR":
                groups.append([self._part(depth)])
                continue
            if len(groups) > 1 and not self._binds_tighter():
                raise malformed(
                    join.position,
                    "AND after OR: IEC 61131-7 joins it first, jFuzzyLogic from the left; write "
                    "parentheses",
                )
            groups[-1].append(self._part(depth))
        return Or(tuple(And(tuple(each)) for each in groups))

    def _part(self, depth: int) -> Antecedent:
        text = self._text
        negations: tuple[Hedge, ...] = ()
        while text.next.key == "NOT":
            if len(negations) >= MAX_HEDGES:
                text.fail(f"at most {MAX_HEDGES} hedges")
            text.take()
            negations += ("not",)
        opening = text.next
        if not text.accept("("):
            term = self._term()
            return Is(term.variable, term.set, negations + term.hedges)
        if depth >= MAX_DEPTH:
            raise malformed(opening.position, f"parentheses are nested more than {MAX_DEPTH} deep")
        inner = self._any_of(depth + 1)
        text.expect(")")
        if not negations:
            return inner
        inner = normalised(inner)
        if not isinstance(inner, Is):
            raise malformed(
                opening.position, "NOT before a group cannot be expressed; write it before each set"
            )
        return Is(inner.variable, inner.set, negations + inner.hedges)

    def _term(self) -> Is:
        text = self._text
        variable = text.name("a variable")
        text.expect("IS")
        hedges: list[Hedge] = []
        while (hedge := self._hedge(variable.text)) is not None:
            if len(hedges) >= MAX_HEDGES:
                text.fail(f"at most {MAX_HEDGES} hedges")
            position = text.take().position
            hedges.append(hedge)
            if hedge == "any":
                break
        with locate_errors(variable.position):
            if "any" in hedges:
                if text.next.key not in _AFTER:
                    raise malformed(position, f"expected no set after 'any', got {text.next}")
                return Is(variable.text, "", tuple(hedges))
            return Is(variable.text, self._set(variable).text, tuple(hedges))

    def _hedge(self, variable: str) -> Hedge | None:
        token = self._text.next
        if token.kind != "word" or token.text in self._sets_of.get(variable, ()):
            return None
        return next((hedge for hedge in HEDGES if hedge == token.text.lower()), None)

    def _set(self, variable: Token) -> Token:
        return self._text.name(f"a set of {variable.text[:40]!r}")


def iec_rule(rule: Rule) -> str:
    """Text of a rule, as IEC 61131-7 and jFuzzyLogic read it alike.

    Raises:
        InvalidInput: It has hedges other than "not".
    """
    consequents = ", ".join(f"{term.variable} IS {term.set}" for term in rule.consequents)
    weight = "" if rule.weight == 1.0 else f" WITH {_real(rule.weight)}"
    return f"IF {_text(normalised(rule.antecedent), top=True)} THEN {consequents}{weight};"


def _text(antecedent: Antecedent, top: bool = False) -> str:
    if isinstance(antecedent, Is):
        if antecedent.hedges not in {(), ("not",)}:
            raise InvalidInput(
                f"IEC 61131-7 has no hedges but NOT ({antecedent.variable} is "
                f"{' '.join(antecedent.hedges)} {antecedent.set}); fuzzylite's dialect has: "
                "write_fcl(system, 'fuzzylite')"
            )
        return f"{antecedent.variable} IS {'NOT ' if antecedent.hedges else ''}{antecedent.set}"
    joined = f" {'AND' if isinstance(antecedent, And) else 'OR'} ".join(
        map(_text, antecedent.parts)
    )
    return joined if top else f"({joined})"


def _real(value: float) -> str:
    return repr(float(value))
