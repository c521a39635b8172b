"""Reads the fuzzy control language (FCL), IEC 61131-7, in both its dialects."""

from __future__ import annotations

from collections.abc import Callable

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import (
    locate_errors,
)
from omnidrive.fuzzy.files.fcl_meaning import system_of
from omnidrive.fuzzy.files.fcl_parts import Chosen, DeclaredVariable, RuleBlock
from omnidrive.fuzzy.files.fcl_rules import RuleReader
from omnidrive.fuzzy.files.fcl_terms import TERMS, read_named, read_points
from omnidrive.fuzzy.files.fcl_text import FclText, Token
from omnidrive.fuzzy.files.fcl_words import (
    ACTIVATIONS,
    AGGREGATIONS,
    BLOCK_WORDS,
    CONJUNCTIONS,
    DISJUNCTIONS,
    METHODS,
    SECTIONS,
    ours,
)
from omnidrive.fuzzy.files.fll_terms import READ as FLL_TERMS
from omnidrive.fuzzy.files.fll_terms import Word, read_term
from omnidrive.fuzzy.files.source import malformed
from omnidrive.fuzzy.system import MAX_RULES, MAX_VARIABLES, FuzzySystem
from omnidrive.fuzzy.variables import MAX_SETS, FuzzySet, LinearFunction


class FclReader:
    """Reads one text; see :func:`omnidrive.fuzzy.files.fcl.read_fcl`."""

    def __init__(self, text: str) -> None:
        self._text = FclText(text)
        self._inputs: dict[str, DeclaredVariable] = {}
        self._outputs: dict[str, DeclaredVariable] = {}
        self._blocks: list[RuleBlock] = []
        self._is_fuzzylite = False

    def system(self) -> FuzzySystem:
        """The system that it describes."""
        text = self._text
        start = text.expect("FUNCTION_BLOCK")
        name = text.rest_of_line(start.position.line, *SECTIONS)
        sections = {
            "VAR_INPUT": lambda: self._variables(self._inputs),
            "VAR_OUTPUT": lambda: self._variables(self._outputs),
            "FUZZIFY": self._fuzzify,
            "DEFUZZIFY": self._defuzzify,
            "RULEBLOCK": self._rule_block,
        }
        while (section := text.expect(*SECTIONS).key) != "END_FUNCTION_BLOCK":
            sections[section]()
        text.accept(";")
        if text.next.key == "FUNCTION_BLOCK":
            raise malformed(text.next.position, "a second FUNCTION_BLOCK: expected one in a file")
        if text.next.kind != "end":
            text.fail("the end")
        return system_of(name, self._inputs, self._outputs, self._blocks, self._is_fuzzylite)

    def _variables(self, variables: dict[str, DeclaredVariable]) -> None:
        text = self._text
        last: DeclaredVariable | None = None
        while not text.accept("END_VAR"):
            token = text.name("a variable, or END_VAR")
            if token.key == "RANGE" and text.next.key == ":=":
                if last is None:
                    raise malformed(token.position, "RANGE: expected a variable before it")
                last.once(token)
                last.range = self._range()
                continue
            text.expect(":")
            text.expect("REAL", "LREAL")
            text.accept(";")
            if token.text in self._inputs or token.text in self._outputs:
                raise malformed(token.position, f"variable {token.text[:40]!r} is there twice")
            if len(variables) >= MAX_VARIABLES:
                raise malformed(token.position, f"more than {MAX_VARIABLES} variables")
            last = variables[token.text] = DeclaredVariable(token.text, token.position)

    def _range(self) -> tuple[float, float]:
        text = self._text
        text.expect(":=")
        text.expect("(")
        low = text.number()
        text.expect("..")
        high = text.number()
        text.expect(")")
        text.accept(";")
        return low, high

    def _variable(self, variables: dict[str, DeclaredVariable], section: str) -> DeclaredVariable:
        token = self._text.name("a variable")
        variable = variables.get(token.text)
        if variable is None:
            known = ", ".join(list(variables)[:12]) or "none"
            raise malformed(
                token.position, f"{section} of {token.text[:40]!r}: expected a variable of: {known}"
            )
        if section in variable.seen:
            raise malformed(token.position, f"a second {section} of {token.text[:40]!r}")
        variable.seen.add(section)
        return variable

    def _fuzzify(self) -> None:
        variable = self._variable(self._inputs, "FUZZIFY")
        while (token := self._text.expect("TERM", "RANGE", "ENABLED", "END_FUZZIFY")).key != (
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
        while (token := self._text.expect(*statements, "END_DEFUZZIFY")).key in statements:
            statements[token.key](token)

    def _output_range(self, variable: DeclaredVariable, token: Token) -> None:
        variable.once(token)
        variable.range = self._range()

    def _method(self, variable: DeclaredVariable, token: Token) -> None:
        variable.once(token)
        variable.method = self._choice(METHODS)

    def _accumulation(self, variable: DeclaredVariable, token: Token) -> None:
        variable.once(token)
        self._is_fuzzylite = True
        if not self._accept_none():
            variable.aggregation = self._choice(AGGREGATIONS)

    def _default(self, variable: DeclaredVariable, token: Token) -> None:
        text = self._text
        variable.once(token)
        text.expect(":=")
        if text.next.key != "NC" and not text.accept("NAN"):
            variable.default = text.number()
        if text.next.key in {"NC", "|"}:
            raise malformed(
                text.next.position,
                "an output that keeps its previous value (NC) cannot be expressed; give it a "
                "default",
            )
        text.accept(";")

    def _lock(self, variable: DeclaredVariable, token: Token) -> None:
        text = self._text
        variable.once(token)
        self._is_fuzzylite = True
        text.expect(":")
        what = text.expect("RANGE", "PREVIOUS")
        if what.key == "PREVIOUS" or text.next.key == "|":
            raise malformed(
                what.position, "an output that keeps its previous value cannot be expressed"
            )
        variable.clips = what.position
        text.accept(";")

    def _enabled(self, token: Token) -> None:
        self._is_fuzzylite = True
        self._text.expect(":")
        if self._text.expect("TRUE", "FALSE").key == "FALSE":
            raise malformed(token.position, "what is not enabled cannot be expressed; remove it")
        self._text.accept(";")

    def _accept_none(self) -> bool:
        """Take ``: NONE;``, fuzzylite's word for no operator."""
        self._text.expect(":")
        return self._text.accept("NONE") and (self._text.accept(";") or True)

    def _choice(self, known: dict[str, str]) -> Chosen:
        text = self._text
        text.accept(":")
        if text.next.key not in known:
            text.fail(f"one of {', '.join(known)}")
        token = text.take()
        text.accept(";")
        return Chosen(known[token.key], token.position)

    def _term(self, variable: DeclaredVariable) -> None:
        text = self._text
        name = text.name("a set")
        if len(variable.sets) >= MAX_SETS:
            raise malformed(name.position, f"more than {MAX_SETS} sets")
        text.expect(":=")
        with locate_errors(name.position):
            if text.next.key == "(":
                variable.drawn.add(name.text)
            each = self._shape(name)
            text.accept(";")
            is_input = variable.name in self._inputs
            if is_input and isinstance(each, LinearFunction):
                raise InvalidInput(f"{name.text!r}: an input is made of fuzzy sets")
            if variable.sets and type(each) is not type(variable.sets[0]):
                raise InvalidInput(f"output {variable.name!r} mixes fuzzy sets and functions")
        variable.sets.append(each)

    def _shape(self, name: Token) -> FuzzySet | LinearFunction:
        text = self._text
        if text.next.kind == "number":
            return LinearFunction(name.text, text.number())
        if text.next.key == "(":
            return FuzzySet(name.text, read_points(text))
        kind = text.name("a number, points, or a shape")
        if kind.key in TERMS:
            return FuzzySet(name.text, read_named(kind, text.numbers()))
        if kind.text not in FLL_TERMS:
            known = ", ".join((*TERMS, *FLL_TERMS))
            raise malformed(
                kind.position, f"a term {kind.text[:40]!r} cannot be read, only points, {known}"
            )
        self._is_fuzzylite = True
        words = []
        while text.next.kind == "number" or text.next.key in {"INF", "+", "-"}:
            sign = text.take() if text.next.key in {"+", "-"} else None
            if sign is not None and text.next.key != "INF":
                text.fail("a number")
            token = text.take()
            words.append(Word((sign.text if sign else "") + token.text, token.position))
        return read_term(name.text, Word(kind.text, kind.position), words, len(self._inputs))

    def _rule_block(self) -> None:
        text = self._text
        start = text.next
        block = RuleBlock(start.position)
        while text.next.key not in BLOCK_WORDS and text.next.kind != "end":
            text.take()
        sets_of = {
            v.name: {each.name for each in v.sets}
            for v in (*self._inputs.values(), *self._outputs.values())
        }
        rules = RuleReader(text, sets_of, lambda: self._is_fuzzylite)
        operators = {
            "AND": CONJUNCTIONS,
            "OR": DISJUNCTIONS,
            "ACT": ours(ACTIVATIONS),
            "ACCU": AGGREGATIONS,
        }
        while (token := text.expect(*BLOCK_WORDS)).key != "END_RULEBLOCK":
            if token.key == "RULE":
                if len(block.rules) >= MAX_RULES:
                    raise malformed(token.position, f"more than {MAX_RULES} rules")
                text.take()
                text.expect(":")
                block.rules.append(rules.rule())
            elif token.key == "ENABLED":
                self._enabled(token)
            else:
                if token.key in block.operators:
                    raise malformed(token.position, f"{token.key} is there twice")
                if not self._accept_none():
                    block.operators[token.key] = self._choice(operators[token.key])
        text.accept(";")
        self._blocks.append(block)
