"""Fuzzy system that a text in the fuzzy control language describes."""

from __future__ import annotations

import warnings

from omnidrive.errors import InvalidInput, one_line
from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
    assemble_system,
    connectives_in,
    locate_errors,
    of_one_kind,
    repeated_consequent,
    stays_in_range,
)
from omnidrive.fuzzy.files.fcl.parser import (
    Choice,
    FclFile,
    RuleBlockEntry,
    VariableEntry,
    parse,
    short_names,
)
from omnidrive.fuzzy.files.fcl.term_parser import SingletonsEntry
from omnidrive.fuzzy.files.fcl.term_semantics import limits_of, sets_of, simplified
from omnidrive.fuzzy.norms import CONORMS, NORMS
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

_METHODS: tuple[Defuzzifier, ...] = ("centroid", "bisector", "mom", "lm", "rm", "wtaver", "wtsum")


class UnreadBlockWarning(UserWarning):
    """A text has FUNCTION_BLOCKs that are not read."""


def read_fcl(text: str, block: str | None = None, *, source: str = "") -> FuzzySystem:
    """Return the system that a text in the fuzzy control language describes.

    Both dialects are supported, and keywords in any case. Points that form a triangle, a trapezoid
    or a ramp are read as that shape. A text that the dialects interpret differently is refused. A
    missing range is the union of the supports of the sets, as in jFuzzyLogic; that of linear
    functions is the range of their values, and that of an input without sets is unlimited.

    NOT before a group is expanded by De Morgan's laws. The weighted average of singletons becomes
    the centroid of fuzzy singletons where their degrees are not summed, or where another output
    has fuzzy sets.

    Args:
        text: The text.
        block: Name of the FUNCTION_BLOCK to read; None: the first.
        source: Name of the file, for the warning.

    Warns:
        UnreadBlockWarning: The text has several FUNCTION_BLOCKs, and ``block`` is None.

    Raises:
        InvalidFuzzyFile: The text is malformed, there is no such block, or :class:`FuzzySystem`
            does not support a part.
    """
    file = parse(text, block)
    system = _Builder(file).system()
    if file.unread and block is None:
        where = f"{source}: " if source else ""
        warnings.warn(
            f"{where}only the first FUNCTION_BLOCK, {one_line(file.name, 40)!r}, is read, not "
            f"{short_names(file.unread)}; name another one as block (--block NAME)",
            UnreadBlockWarning,
            stacklevel=3 if source else 2,
        )
    return system


class _Builder:
    """Builder of the system; its methods raise InvalidFuzzyFile where the dialects disagree."""

    def __init__(self, file: FclFile) -> None:
        self._file = file
        self._blocks = file.rule_blocks
        self._rules = [rule for block in self._blocks for rule in block.rules]

    def system(self) -> FuzzySystem:
        """Return the system."""
        file = self._file
        names = tuple(file.inputs)
        input_sets = [sets_of(each, names, is_input=True) for each in file.inputs.values()]
        output_sets = [sets_of(each, names, is_input=False) for each in file.outputs.values()]
        aggregations = self._aggregations()
        inputs = []
        for variable, sets in zip(file.inputs.values(), input_sets, strict=True):
            with locate_errors(variable.position):
                fuzzy_sets = simplified(variable, sets)
                limits = limits_of(variable, sets, ())
                inputs.append(InputVariable(variable.name, *limits, fuzzy_sets))
        outputs = [
            self._output(variable, sets, aggregations.get(variable.name), inputs)
            for variable, sets in zip(file.outputs.values(), output_sets, strict=True)
        ]
        outputs = self._aggregated(outputs, aggregations)
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
        inputs: list[InputVariable],
    ) -> OutputVariable:
        if variable.method is None:
            raise malformed(variable.position, f"{variable.name[:40]!r}: expected a METHOD")
        method: Defuzzifier = next(d for d in _METHODS if d == variable.method.name)
        with locate_errors(variable.position):
            functions = tuple(each for each in sets if isinstance(each, LinearFunction))
            fuzzy_sets = simplified(variable, sets)
            if method == "wtaver" and any(
                isinstance(each.value, SingletonsEntry) for each in variable.terms
            ):
                method = "centroid"  # the same for singletons
            if fuzzy_sets and aggregation is None:
                raise InvalidInput(
                    f"output {variable.name!r} needs an ACCU, because its default is MAX in IEC "
                    "61131-7 and SUM in jFuzzyLogic"
                )
            output = OutputVariable(
                variable.name,
                *limits_of(variable, sets, inputs),
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
        return output

    def _aggregated(
        self, outputs: list[OutputVariable], aggregations: dict[str, Choice]
    ) -> list[OutputVariable]:
        """Return the outputs with constants as fuzzy singletons where their mean differs."""
        chosen = {name: each.name for name, each in aggregations.items()}
        differing = [
            each.name
            for each in outputs
            if each.is_sugeno
            and chosen.get(each.name, "sum") != "sum"
            and _shares_points(each, self._rules)
        ]
        found = of_one_kind(outputs, chosen, differing)
        if differing and found[0].is_sugeno:
            raise malformed(
                aggregations[differing[0]].position,
                f"this ACCU of rules with one function of {differing[0][:40]!r} is not supported: "
                "expected SUM",
            )
        return found

    def _operators(self) -> tuple[str, str, str]:
        """Return the names of conjunction, disjunction and implication."""
        chosen: dict[str, str] = {}
        for block in self._blocks:
            found = dict(block.operators)
            found.pop("ACCU", None)
            if not self._file.is_fuzzylite:
                _check_pair(block)
            used = connectives_in(block.rules)
            _check_negated(block)
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


def _shares_points(output: OutputVariable, rules: list[LocatedRule]) -> bool:
    """Return whether two rules conclude one function, or constants that are equal."""
    constants = [
        each.constant
        for each in output.sets
        if isinstance(each, LinearFunction) and not any(each.coefficients)
    ]
    repeated = repeated_consequent(output.name, rules)
    return repeated is not None or len(set(constants)) < len(constants)


def _check_negated(block: RuleBlockEntry) -> None:
    """Refuse NOT before a group unless De Morgan's laws hold for the operators."""
    conjunction, disjunction = _conjunction(block), _disjunction(block)
    if block.negated is not None and NORMS[conjunction] != CONORMS[disjunction]:
        raise malformed(
            block.negated,
            f"NOT before a group needs an OR that is the dual of AND, not {conjunction!r} and "
            f"{disjunction!r}; use such a pair, as MIN and MAX, or write NOT before each set",
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
