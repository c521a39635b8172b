"""Syntax tree of a text in the fuzzy control language."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile, one_line
from omnidrive.files.position import Position
from omnidrive.fuzzy.files.assembly import LocatedRule
from omnidrive.fuzzy.files.fcl.lexer import (
    ACTIVATIONS,
    BLOCK_KEYWORDS,
    FUZZYLITE,
    IEC,
    SECTIONS,
    Token,
    TokenStream,
)
from omnidrive.fuzzy.files.fcl.rule_parser import RuleParser
from omnidrive.fuzzy.files.fcl.term_parser import FllTermEntry, TermEntry, term_value
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES
from omnidrive.fuzzy.variables import MAX_SETS


def _names(*tables: dict[str, str]) -> dict[str, str]:
    """Return the names in this package by the keywords of several dialects, in upper case."""
    return {keyword.upper(): name for table in tables for name, keyword in table.items()}


_CONJUNCTIONS = _names(IEC.conjunctions, FUZZYLITE.conjunctions)
_DISJUNCTIONS = {**_names(IEC.disjunctions, FUZZYLITE.disjunctions), "PROBOR": "probor"}
_AGGREGATIONS = {**_names(IEC.aggregations, FUZZYLITE.aggregations), **_DISJUNCTIONS}
_METHODS = {**_names(IEC.methods, FUZZYLITE.methods), "COGF": "wtaver"}
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
        negated: Position of the first group after NOT; None: there is none.
        rules: Its rules.
    """

    def __init__(self, position: Position) -> None:
        self.position = position
        self.operators: dict[str, Choice] = {}
        self.negated: Position | None = None
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
    unread: tuple[str, ...]
    """Names of the other FUNCTION_BLOCKs of the text."""


def parse(text: str, block: str | None = None) -> FclFile:
    """Parse a text in either dialect; keywords are accepted in any case.

    Args:
        text: The text.
        block: Name of the FUNCTION_BLOCK to read; None: the first.

    Raises:
        InvalidFuzzyFile: The syntax is wrong, a name is unknown or repeated, a statement is not
            supported, or there is no such block.
    """
    return _Parser(text).file(block)


def short_names(names: Sequence[str]) -> str:
    """Return the first four names, quoted and shortened, for a message."""
    shown = ", ".join(repr(one_line(each, 40)) for each in names[:4])
    return shown + (", ..." if len(names) > 4 else "")


class _Parser:
    """Recursive descent over the sections."""

    def __init__(self, text: str) -> None:
        self._tokens = TokenStream(text)
        self._inputs: dict[str, VariableEntry] = {}
        self._outputs: dict[str, VariableEntry] = {}
        self._blocks: list[RuleBlockEntry] = []
        self._is_fuzzylite = False

    def file(self, block: str | None) -> FclFile:
        """Parse the whole text, but only skip all blocks other than ``block``."""
        tokens = self._tokens
        skipped: list[str] = []
        name = self._block_name()
        while block is not None and name != block:
            skipped.append(name)
            self._skip_block()
            if tokens.next.kind == "end":
                raise InvalidFuzzyFile(
                    f"there is no FUNCTION_BLOCK {one_line(block, 40)!r}; there are "
                    f"{short_names(skipped)}"
                )
            name = self._block_name()
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
        return FclFile(
            name, self._inputs, self._outputs, self._blocks, self._is_fuzzylite,
            (*skipped, *self._unread()),
        )  # fmt: skip

    def _unread(self) -> list[str]:
        """Skip the FUNCTION_BLOCKs that follow and return their names."""
        names = []
        while self._tokens.next.kind != "end":
            names.append(self._block_name())
            self._skip_block()
        return names

    def _block_name(self) -> str:
        start = self._tokens.expect("FUNCTION_BLOCK")
        return self._tokens.rest_of_line(start.position.line, *SECTIONS)

    def _skip_block(self) -> None:
        """Skip the rest of a FUNCTION_BLOCK."""
        tokens = self._tokens
        while not tokens.accept("END_FUNCTION_BLOCK"):
            if tokens.next.kind == "end" or tokens.next.key == "FUNCTION_BLOCK":
                tokens.fail("END_FUNCTION_BLOCK")
            tokens.take()
        tokens.accept(";")

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
        value = term_value(tokens, self._inputs)
        self._is_fuzzylite = self._is_fuzzylite or isinstance(value, FllTermEntry)
        variable.terms.append(TermEntry(name.text, name.position, value))
        tokens.accept(";")

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
        block.negated = rules.negated
        self._blocks.append(block)
