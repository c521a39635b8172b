"""Syntax tree of a text in the fuzzy control language."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from omnidrive.files.position import Position
from omnidrive.fuzzy.files.assembly import LocatedRule
from omnidrive.fuzzy.files.fcl.lexer import (
    ACTIVATIONS,
    BLOCK_KEYWORDS,
    FUZZYLITE,
    IEC,
    SECTIONS,
    TERMS,
    Token,
    TokenStream,
)
from omnidrive.fuzzy.files.fcl.rule_parser import RuleParser
from omnidrive.fuzzy.files.fll.semantics import TERM_CLASSES
from omnidrive.fuzzy.membership import MAX_POINTS
from omnidrive.fuzzy.position import LocatedText, malformed
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES
from omnidrive.fuzzy.variables import MAX_SETS


def _names(*tables: dict[str, str]) -> dict[str, str]:
    """Return the names in this package by the keywords of several dialects, in upper case."""
    return {keyword.upper(): name for table in tables for name, keyword in table.items()}


_CONJUNCTIONS = _names(IEC.conjunctions, FUZZYLITE.conjunctions)
_DISJUNCTIONS = {**_names(IEC.disjunctions, FUZZYLITE.disjunctions), "PROBOR": "probor"}
_AGGREGATIONS = {**_names(IEC.aggregations, FUZZYLITE.aggregations), **_DISJUNCTIONS}
_METHODS = _names(IEC.methods, FUZZYLITE.methods)
_OPERATORS = {
    "AND": _CONJUNCTIONS,
    "OR": _DISJUNCTIONS,
    "ACT": _names(ACTIVATIONS),
    "ACCU": _AGGREGATIONS,
}


class Choice(NamedTuple):
    """Name of an operator in this package, and the position of its keyword."""

    name: str
    position: Position


class PointsEntry(NamedTuple):
    """Points ``(x, degree) (x, degree) ...``, flat."""

    coordinates: tuple[float, ...]
    position: Position


class NamedShapeEntry(NamedTuple):
    """Shape of jFuzzyLogic: a keyword and parameters."""

    keyword: str
    parameters: tuple[float, ...]
    position: Position


class FllTermEntry(NamedTuple):
    """Class and parameters of fuzzylite."""

    kind: LocatedText
    parameters: tuple[LocatedText, ...]
    inputs: int
    """Number of inputs declared before the term."""


class TermEntry(NamedTuple):
    """Statement ``TERM name := value``; a number is the value of a singleton."""

    name: str
    position: Position
    value: float | PointsEntry | NamedShapeEntry | FllTermEntry


class VariableEntry:
    """Declaration of a variable with its FUZZIFY or DEFUZZIFY section.

    Attributes:
        name: Name of the variable.
        position: Position of its declaration.
        range: Least and greatest value; None if the text has no RANGE.
        terms: Its terms.
        method: Defuzzifier of an output.
        aggregation: ACCU of an output (fuzzylite).
        default: DEFAULT of an output.
        clipped: Position of fuzzylite's LOCK : RANGE.
        keys: Statements that have been read, in upper case.
    """

    def __init__(self, name: str, position: Position) -> None:
        self.name = name
        self.position = position
        self.range: tuple[float, float] | None = None
        self.terms: list[TermEntry] = []
        self.method: Choice | None = None
        self.aggregation: Choice | None = None
        self.default: float | None = None
        self.clipped: Position | None = None
        self.keys: set[str] = set()

    def once(self, token: Token) -> None:
        """Refuse a repeated statement."""
        if token.key in self.keys:
            raise malformed(token.position, f"{token.key} appears twice")
        self.keys.add(token.key)


class RuleBlockEntry:
    """Section RULEBLOCK.

    Attributes:
        position: Position of its name.
        operators: Choices of AND, OR, ACT and ACCU.
        rules: Its rules.
    """

    def __init__(self, position: Position) -> None:
        self.position = position
        self.operators: dict[str, Choice] = {}
        self.rules: list[LocatedRule] = []

    def outputs(self) -> set[str]:
        """Return the names of the outputs in the consequents."""
        return {each.variable for rule in self.rules for each in rule.rule.consequents}


class FclFile(NamedTuple):
    """Section FUNCTION_BLOCK."""

    name: str
    inputs: dict[str, VariableEntry]
    outputs: dict[str, VariableEntry]
    rule_blocks: list[RuleBlockEntry]
    is_fuzzylite: bool
    """Whether a statement exists only in fuzzylite's dialect."""


def parse(text: str) -> FclFile:
    """Parse a text in either dialect; keywords are accepted in any case.

    Raises:
        InvalidFuzzyFile: The syntax is wrong, a name is unknown or repeated, or a statement is not
            supported.
    """
    return _Parser(text).file()


class _Parser:
    """Recursive descent over the sections."""

    def __init__(self, text: str) -> None:
        self._tokens = TokenStream(text)
        self._inputs: dict[str, VariableEntry] = {}
        self._outputs: dict[str, VariableEntry] = {}
        self._blocks: list[RuleBlockEntry] = []
        self._is_fuzzylite = False

    def file(self) -> FclFile:
        """Parse the whole text."""
        tokens = self._tokens
        start = tokens.expect("FUNCTION_BLOCK")
        name = tokens.rest_of_line(start.position.line, *SECTIONS)
        sections = {
            "VAR_INPUT": lambda: self._declarations(self._inputs),
            "VAR_OUTPUT": lambda: self._declarations(self._outputs),
            "FUZZIFY": self._fuzzify,
            "DEFUZZIFY": self._defuzzify,
            "RULEBLOCK": self._rule_block,
        }
        while (section := tokens.expect(*SECTIONS).key) != "END_FUNCTION_BLOCK":
            sections[section]()
        tokens.accept(";")
        if tokens.next.key == "FUNCTION_BLOCK":
            raise malformed(tokens.next.position, "a second FUNCTION_BLOCK: expected one in a file")
        if tokens.next.kind != "end":
            tokens.fail("the end")
        return FclFile(name, self._inputs, self._outputs, self._blocks, self._is_fuzzylite)

    def _declarations(self, variables: dict[str, VariableEntry]) -> None:
        tokens = self._tokens
        last: VariableEntry | None = None
        while not tokens.accept("END_VAR"):
            token = tokens.name("a variable, or END_VAR")
            if token.key == "RANGE" and tokens.next.key == ":=":
                if last is None:
                    raise malformed(token.position, "RANGE: expected a variable before it")
                last.once(token)
                last.range = self._range()
                continue
            tokens.expect(":")
            tokens.expect("REAL", "LREAL")
            tokens.accept(";")
            if token.text in self._inputs or token.text in self._outputs:
                raise malformed(token.position, f"variable {token.text[:40]!r} appears twice")
            if len(variables) >= MAX_VARIABLES:
                raise malformed(token.position, f"more than {MAX_VARIABLES} variables")
            last = variables[token.text] = VariableEntry(token.text, token.position)

    def _range(self) -> tuple[float, float]:
        tokens = self._tokens
        tokens.expect(":=")
        tokens.expect("(")
        low = tokens.number()
        tokens.expect("..")
        high = tokens.number()
        tokens.expect(")")
        tokens.accept(";")
        return low, high

    def _variable(self, variables: dict[str, VariableEntry], section: str) -> VariableEntry:
        token = self._tokens.name("a variable")
        variable = variables.get(token.text)
        if variable is None:
            known = ", ".join(list(variables)[:12]) or "none"
            raise malformed(
                token.position, f"{section} of {token.text[:40]!r}: expected a variable of: {known}"
            )
        if section in variable.keys:
            raise malformed(token.position, f"a second {section} of {token.text[:40]!r}")
        variable.keys.add(section)
        return variable

    def _fuzzify(self) -> None:
        variable = self._variable(self._inputs, "FUZZIFY")
        while (token := self._tokens.expect("TERM", "RANGE", "ENABLED", "END_FUZZIFY")).key != (
            "END_FUZZIFY"
        ):
            if token.key == "TERM":
                self._term(variable)
            elif token.key == "RANGE":
                variable.once(token)
                self._is_fuzzylite = True
                variable.range = self._range()
            else:
                self._enabled(token)

    def _defuzzify(self) -> None:
        variable = self._variable(self._outputs, "DEFUZZIFY")
        statements: dict[str, Callable[[Token], None]] = {
            "TERM": lambda _: self._term(variable),
            "RANGE": lambda token: self._output_range(variable, token),
            "METHOD": lambda token: self._method(variable, token),
            "ACCU": lambda token: self._accumulation(variable, token),
            "DEFAULT": lambda token: self._default(variable, token),
            "ENABLED": self._enabled,
            "LOCK": lambda token: self._lock(variable, token),
        }
        while (token := self._tokens.expect(*statements, "END_DEFUZZIFY")).key in statements:
            statements[token.key](token)

    def _output_range(self, variable: VariableEntry, token: Token) -> None:
        variable.once(token)
        variable.range = self._range()

    def _method(self, variable: VariableEntry, token: Token) -> None:
        variable.once(token)
        variable.method = self._choice(_METHODS)

    def _accumulation(self, variable: VariableEntry, token: Token) -> None:
        variable.once(token)
        self._is_fuzzylite = True
        if not self._accept_none():
            variable.aggregation = self._choice(_AGGREGATIONS)

    def _default(self, variable: VariableEntry, token: Token) -> None:
        tokens = self._tokens
        variable.once(token)
        tokens.expect(":=")
        if tokens.next.key != "NC" and not tokens.accept("NAN"):
            variable.default = tokens.number()
        if tokens.next.key in {"NC", "|"}:
            raise malformed(
                tokens.next.position,
                "an output that keeps its previous value (NC) is not supported; give it a default",
            )
        tokens.accept(";")

    def _lock(self, variable: VariableEntry, token: Token) -> None:
        tokens = self._tokens
        variable.once(token)
        self._is_fuzzylite = True
        tokens.expect(":")
        what = tokens.expect("RANGE", "PREVIOUS")
        if what.key == "PREVIOUS" or tokens.next.key == "|":
            raise malformed(
                what.position, "an output that keeps its previous value is not supported"
            )
        variable.clipped = what.position
        tokens.accept(";")

    def _enabled(self, token: Token) -> None:
        self._is_fuzzylite = True
        self._tokens.expect(":")
        if self._tokens.expect("TRUE", "FALSE").key == "FALSE":
            raise malformed(
                token.position, "a section that is not enabled is not supported; remove it"
            )
        self._tokens.accept(";")

    def _accept_none(self) -> bool:
        """Consume ``: NONE;``, fuzzylite's keyword for no operator."""
        self._tokens.expect(":")
        return self._tokens.accept("NONE") and (self._tokens.accept(";") or True)

    def _choice(self, known: dict[str, str]) -> Choice:
        tokens = self._tokens
        tokens.accept(":")
        if tokens.next.key not in known:
            tokens.fail(f"one of {', '.join(known)}")
        token = tokens.take()
        tokens.accept(";")
        return Choice(known[token.key], token.position)

    def _term(self, variable: VariableEntry) -> None:
        tokens = self._tokens
        name = tokens.name("a set")
        if len(variable.terms) >= MAX_SETS:
            raise malformed(name.position, f"more than {MAX_SETS} sets")
        tokens.expect(":=")
        variable.terms.append(TermEntry(name.text, name.position, self._term_value()))
        tokens.accept(";")

    def _term_value(self) -> float | PointsEntry | NamedShapeEntry | FllTermEntry:
        tokens = self._tokens
        if tokens.next.kind == "number":
            return tokens.number()
        if tokens.next.key == "(":
            return self._points()
        kind = tokens.name("a number, points, or a shape")
        if kind.key in TERMS:
            values = []
            while tokens.next.kind == "number":
                values.append(tokens.number())
            return NamedShapeEntry(kind.key, tuple(values), kind.position)
        if kind.text not in TERM_CLASSES:
            known = ", ".join((*TERMS, *TERM_CLASSES))
            raise malformed(
                kind.position, f"a term {kind.text[:40]!r} is not supported, only points, {known}"
            )
        self._is_fuzzylite = True
        parameters = []
        while tokens.next.kind == "number" or tokens.next.key in {"INF", "+", "-"}:
            sign = tokens.take() if tokens.next.key in {"+", "-"} else None
            if sign is not None and tokens.next.key != "INF":
                tokens.fail("a number")
            token = tokens.take()
            parameters.append(LocatedText((sign.text if sign else "") + token.text, token.position))
        return FllTermEntry(
            LocatedText(kind.text, kind.position), tuple(parameters), len(self._inputs)
        )

    def _points(self) -> PointsEntry:
        tokens = self._tokens
        coordinates: list[float] = []
        start = tokens.next.position
        while tokens.accept("("):
            coordinates.append(tokens.number())
            tokens.expect(",")
            coordinates.append(tokens.number())
            tokens.expect(")")
            if len(coordinates) > 2 * MAX_POINTS:
                raise malformed(start, f"more than {MAX_POINTS} points")
        return PointsEntry(tuple(coordinates), start)

    def _rule_block(self) -> None:
        tokens = self._tokens
        start = tokens.next
        block = RuleBlockEntry(start.position)
        while tokens.next.key not in BLOCK_KEYWORDS and tokens.next.kind != "end":
            tokens.take()
        variables = (*self._inputs.values(), *self._outputs.values())
        sets_of = {v.name: {each.name for each in v.terms} for v in variables}
        rules = RuleParser(tokens, sets_of, lambda: self._is_fuzzylite)
        while (token := tokens.expect(*BLOCK_KEYWORDS)).key != "END_RULEBLOCK":
            if token.key == "RULE":
                if len(block.rules) >= MAX_RULES:
                    raise malformed(token.position, f"more than {MAX_RULES} rules")
                tokens.take()
                tokens.expect(":")
                block.rules.append(rules.rule())
            elif token.key == "ENABLED":
                self._enabled(token)
            else:
                if token.key in block.operators:
                    raise malformed(token.position, f"{token.key} appears twice")
                if not self._accept_none():
                    block.operators[token.key] = self._choice(_OPERATORS[token.key])
        tokens.accept(";")
        self._blocks.append(block)
