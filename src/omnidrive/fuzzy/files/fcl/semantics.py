"""Fuzzy system that a text in the fuzzy control language describes."""

from __future__ import annotations

from math import isfinite

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
    assemble_system,
    connectives_in,
    locate_errors,
    repeated_consequent,
    stays_in_range,
)
from omnidrive.fuzzy.files.fcl.lexer import TERMS
from omnidrive.fuzzy.files.fcl.parser import (
    Choice,
    FclFile,
    NamedShapeEntry,
    PointsEntry,
    RuleBlockEntry,
    TermEntry,
    VariableEntry,
    parse,
)
from omnidrive.fuzzy.files.fll.semantics import read_term
from omnidrive.fuzzy.membership import Membership
from omnidrive.fuzzy.position import malformed
from omnidrive.fuzzy.rules import And, Or
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Defuzzifier,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
)

PARTNERS = {
    "min": "max",
    "prod": "probor",
    "lukasiewicz": "bsum",
    "drastic": "drastic",
    "nilpotent": "nilpotent",
    "hamacher": "einstein",
    "einstein": "einstein",
}
"""Disjunction that jFuzzyLogic uses with a conjunction, because IEC 61131-7 prescribes pairs.

A disjunction selects the first conjunction with that partner. The partner of Hamacher's product is
Einstein's sum."""

CORNERS: dict[str, tuple[float, ...]] = {
    "trimf": (0.0, 1.0, 0.0),
    "trapmf": (0.0, 1.0, 1.0, 0.0),
    "linsmf": (0.0, 1.0),
    "linzmf": (1.0, 0.0),
}
"""Degrees at the corners of the shapes that points can represent."""

_METHODS: tuple[Defuzzifier, ...] = ("centroid", "bisector", "mom", "lm", "rm", "wtaver", "wtsum")


def read_fcl(text: str) -> FuzzySystem:
    """Return the system that a text in the fuzzy control language describes.

    Both dialects are supported, and keywords in any case. Points that form a triangle, a trapezoid
    or a ramp are read as that shape. A text that the dialects interpret differently is refused. A
    missing range is the union of the supports of the sets, as in jFuzzyLogic.

    Raises:
        InvalidFuzzyFile: The text is malformed, or :class:`FuzzySystem` does not support a part.
    """
    return _Builder(parse(text)).system()


def simplest_shape(function: Membership) -> Membership:
    """Return the triangle, trapezoid or ramp that equals a ``pointsmf``, or else ``function``.

    A point at either end that only continues the constant beyond it is ignored.
    """
    if function.shape != "pointsmf":
        return function
    x, y = function.parameters[::2], function.parameters[1::2]
    first, last = 0, len(x)
    while last - first > 1 and y[first] == y[first + 1]:
        first += 1
    while last - first > 1 and y[last - 1] == y[last - 2]:
        last -= 1
    x, y = x[first:last], y[first:last]
    for shape, degrees in CORNERS.items():
        if y == degrees and (len(y) == 2 or x[0] < x[-1]):
            return Membership(shape, x)
    return function


def is_dsigm(a1: float, c1: float, a2: float, c2: float) -> bool:
    """Return whether jFuzzyLogic's DSIGM equals a ``dsigmf``: its difference is never negative."""
    return a1 == a2 and a1 * c1 <= a2 * c2


class _Builder:
    """Builder of the system; its methods raise InvalidFuzzyFile where the dialects disagree."""

    def __init__(self, file: FclFile) -> None:
        self._file = file
        self._blocks = file.rule_blocks
        self._rules = [rule for block in self._blocks for rule in block.rules]

    def system(self) -> FuzzySystem:
        """Return the system."""
        file = self._file
        input_sets = [_sets(each, is_input=True) for each in file.inputs.values()]
        output_sets = [_sets(each, is_input=False) for each in file.outputs.values()]
        aggregations = self._aggregations()
        inputs = []
        for variable, sets in zip(file.inputs.values(), input_sets, strict=True):
            with locate_errors(variable.position):
                fuzzy_sets = _simplified(variable, sets)
                limits = _limits(variable, sets)
                inputs.append(InputVariable(variable.name, *limits, fuzzy_sets))
        outputs = [
            self._output(variable, sets, aggregations.get(variable.name))
            for variable, sets in zip(file.outputs.values(), output_sets, strict=True)
        ]
        return assemble_system(file.name, inputs, outputs, self._rules, *self._operators())

    def _aggregations(self) -> dict[str, Choice]:
        """Return the ACCU of each output: its own (fuzzylite), or that of its rules' block."""
        outputs = self._file.outputs
        found = {v.name: v.aggregation for v in outputs.values() if v.aggregation}
        seen: set[str] = set()
        for block in self._blocks:
            concluded = block.outputs()
            shared = sorted(concluded & seen)
            if shared and not self._file.is_fuzzylite:
                raise malformed(
                    block.position,
                    f"a second RULEBLOCK has rules for {shared[0]!r}: expected all its rules in "
                    "one block",
                )
            seen |= concluded
            accu = block.operators.get("ACCU")
            for output in concluded if accu is not None else ():
                if accu is not None and found.setdefault(output, accu).name != accu.name:
                    raise malformed(accu.position, f"a second ACCU for output {output!r}")
        given = [each.operators["ACCU"] for each in self._blocks if "ACCU" in each.operators]
        for output in outputs if given else ():
            found.setdefault(output, given[0])
        return found

    def _output(
        self,
        variable: VariableEntry,
        sets: list[FuzzySet | LinearFunction],
        aggregation: Choice | None,
    ) -> OutputVariable:
        if variable.method is None:
            raise malformed(variable.position, f"{variable.name[:40]!r}: expected a METHOD")
        method: Defuzzifier = next(d for d in _METHODS if d == variable.method.name)
        with locate_errors(variable.position):
            functions = tuple(each for each in sets if isinstance(each, LinearFunction))
            fuzzy_sets = _simplified(variable, sets)
            if fuzzy_sets and aggregation is None:
                raise InvalidInput(
                    f"output {variable.name!r} needs an ACCU, because its default is MAX in IEC "
                    "61131-7 and SUM in jFuzzyLogic"
                )
            output = OutputVariable(
                variable.name,
                *_limits(variable, sets),
                functions or fuzzy_sets,
                aggregation.name if aggregation else "max",
                method,
                variable.default,
            )
        if variable.clipped is not None and not stays_in_range(output):
            raise malformed(
                variable.clipped,
                f"output {output.name!r} may leave its range: clipping is not supported",
            )
        if functions and aggregation is not None and aggregation.name != "sum":
            _check_not_repeated(output.name, aggregation, self._rules)
        return output

    def _operators(self) -> tuple[str, str, str]:
        """Return the names of conjunction, disjunction and implication."""
        chosen: dict[str, str] = {}
        for block in self._blocks:
            found = dict(block.operators)
            found.pop("ACCU", None)
            if not self._file.is_fuzzylite:
                _check_pair(block)
            used = connectives_in(block.rules)
            if And in used or "AND" in found:
                _set_operator(chosen, "AND", block, _conjunction(block))
            if Or in used or "OR" in found:
                _set_operator(chosen, "OR", block, _disjunction(block))
            if block.rules:
                act = found.get("ACT")
                _set_operator(chosen, "ACT", block, act.name if act else "min")
        conjunction = chosen.get("AND") or _conjunction_of(chosen.get("OR")) or "min"
        return (
            conjunction,
            chosen.get("OR") or PARTNERS[conjunction],
            chosen.get("ACT", "min"),
        )


def _sets(variable: VariableEntry, *, is_input: bool) -> list[FuzzySet | LinearFunction]:
    sets: list[FuzzySet | LinearFunction] = []
    for term in variable.terms:
        with locate_errors(term.position):
            each = _set(term)
            if is_input and isinstance(each, LinearFunction):
                raise InvalidInput(f"{term.name!r}: the terms of an input must be fuzzy sets")
            if sets and type(each) is not type(sets[0]):
                raise InvalidInput(f"output {variable.name!r} mixes fuzzy sets and functions")
        sets.append(each)
    return sets


def _set(term: TermEntry) -> FuzzySet | LinearFunction:
    value = term.value
    if isinstance(value, float):
        return LinearFunction(term.name, value)
    if isinstance(value, PointsEntry):
        with locate_errors(value.position):
            function = Membership("pointsmf", value.coordinates)
        return FuzzySet(term.name, function)
    if isinstance(value, NamedShapeEntry):
        return FuzzySet(term.name, _named_shape(value))
    return read_term(term.name, value.kind, value.parameters, value.inputs)


def _named_shape(entry: NamedShapeEntry) -> Membership:
    shape, order = TERMS[entry.keyword]
    values = entry.parameters
    if len(values) != len(order):
        raise malformed(
            entry.position, f"{entry.keyword}: expected {len(order)} numbers, got {len(values)}"
        )
    if entry.keyword == "DSIGM" and not is_dsigm(*values):
        raise malformed(
            entry.position,
            "DSIGM: its difference becomes negative, which jFuzzyLogic cuts off; supported are "
            "only equal slopes with the first sigmoid to the left",
        )
    with locate_errors(entry.position):
        return Membership(shape, tuple(values[k] for k in order))


def _simplified(
    variable: VariableEntry, sets: list[FuzzySet | LinearFunction]
) -> tuple[FuzzySet, ...]:
    """Return the fuzzy sets, with points replaced by the shape that they form."""
    return tuple(
        FuzzySet(each.name, simplest_shape(each.upper))
        if isinstance(term.value, PointsEntry)
        else each
        for term, each in zip(variable.terms, sets, strict=True)
        if isinstance(each, FuzzySet)
    )


def _limits(variable: VariableEntry, sets: list[FuzzySet | LinearFunction]) -> tuple[float, float]:
    """Return the range, or jFuzzyLogic's default: the union of the supports of the sets."""
    if variable.range is not None:
        return variable.range
    supports = [_support(each) for each in sets]
    known = [each for each in supports if each is not None]
    if not known or len(known) < len(supports):
        raise malformed(
            variable.position, f"{variable.name[:40]!r}: expected RANGE := (MIN .. MAX)"
        )
    low, high = min(low for low, _ in known), max(high for _, high in known)
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def _support(each: FuzzySet | LinearFunction) -> tuple[float, float] | None:
    """Return the interval that jFuzzyLogic uses as the support of a set; None: unknown."""
    if isinstance(each, LinearFunction):
        return (each.constant, each.constant) if not each.coefficients else None
    shape, p = each.upper.shape, each.upper.parameters
    if each.upper.is_piecewise_linear:
        x = p[::2] if shape == "pointsmf" else p
        return x[0], x[-1]
    if shape in {"gaussmf", "gauss2mf"}:
        ends = [c + side * abs(s) for s, c in zip(p[::2], p[1::2], strict=True) for side in (-4, 4)]
        return min(ends), max(ends)
    if shape == "sigmf" and p[0] != 0.0 and isfinite(9.0 / p[0]):
        half_width = 9.0 / abs(p[0])
        return p[1] - half_width, p[1] + half_width
    return None


def _check_not_repeated(output: str, aggregation: Choice, rules: list[LocatedRule]) -> None:
    repeated = repeated_consequent(output, rules)
    if repeated is not None:
        raise malformed(
            aggregation.position,
            f"this ACCU of rules with one singleton (line {repeated.position.line}) is not "
            "supported: expected SUM",
        )


def _set_operator(chosen: dict[str, str], key: str, block: RuleBlockEntry, name: str) -> None:
    if chosen.setdefault(key, name) != name:
        where = block.operators.get(key)
        raise malformed(
            where.position if where else block.position,
            f"RULEBLOCKs with different {key} are not supported",
        )


def _conjunction(block: RuleBlockEntry) -> str:
    if "AND" in block.operators:
        return block.operators["AND"].name
    return (_conjunction_of(block.operators["OR"].name) if "OR" in block.operators else "") or "min"


def _disjunction(block: RuleBlockEntry) -> str:
    if "OR" in block.operators:
        return block.operators["OR"].name
    return PARTNERS[block.operators["AND"].name] if "AND" in block.operators else "max"


def _conjunction_of(disjunction: str | None) -> str | None:
    return next((a for a, o in PARTNERS.items() if o == disjunction), None)


def _check_pair(block: RuleBlockEntry) -> None:
    """Refuse an operator that jFuzzyLogic would replace by the partner of a later one."""
    given = [key for key in block.operators if key in {"AND", "OR"}]
    if len(given) < 2:
        return
    conjunction, disjunction = _conjunction(block), _disjunction(block)
    if PARTNERS[conjunction] == disjunction:
        return
    first = given[0]
    if (And if first == "AND" else Or) in connectives_in(block.rules):
        raise malformed(
            block.operators[first].position,
            f"jFuzzyLogic replaces this {first} by the partner of the other operator: expected "
            "pairs, such as MIN and MAX, or PROD and ASUM",
        )
