"""From what a text in the fuzzy control language says to a system."""

from __future__ import annotations

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.assembly import (
    LocatedRule,
    all_joins,
    assembled,
    locate_errors,
    shared_conclusion,
    stays_in_range,
)
from omnidrive.fuzzy.files.fcl_parts import Chosen, DeclaredVariable, RuleBlock
from omnidrive.fuzzy.files.fcl_words import (
    PARTNERS,
)
from omnidrive.fuzzy.files.source import malformed
from omnidrive.fuzzy.rules import And, Or
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import Defuzzifier, InputVariable, LinearFunction, OutputVariable


def system_of(
    name: str,
    inputs: dict[str, DeclaredVariable],
    outputs: dict[str, DeclaredVariable],
    blocks: list[RuleBlock],
    is_fuzzylite: bool,
) -> FuzzySystem:
    """System of all parts; where the dialects would understand it differently, it is refused.

    Raises:
        InvalidFuzzyFile: The parts do not fit.
    """
    return _Meaning(inputs, outputs, blocks, is_fuzzylite).system(name)


class _Meaning:
    def __init__(
        self,
        inputs: dict[str, DeclaredVariable],
        outputs: dict[str, DeclaredVariable],
        blocks: list[RuleBlock],
        is_fuzzylite: bool,
    ) -> None:
        self._inputs = inputs
        self._outputs = outputs
        self._blocks = blocks
        self._is_fuzzylite = is_fuzzylite

    def system(self, name: str) -> FuzzySystem:
        """The system that the file describes; ``name`` is for lack of one in the format."""
        rules = [each for block in self._blocks for each in block.rules]
        aggregations = self._aggregations()
        inputs = []
        for variable in self._inputs.values():
            with locate_errors(variable.position):
                fuzzy = variable.fuzzy_sets()
                inputs.append(InputVariable(variable.name, *variable.limits(), fuzzy))
        outputs = [
            self._output(variable, aggregations.get(variable.name), rules)
            for variable in self._outputs.values()
        ]
        conjunction, disjunction, implication = self._operators()
        return assembled(name, inputs, outputs, rules, conjunction, disjunction, implication)

    def _aggregations(self) -> dict[str, Chosen]:
        """ACCU of each output: its own (fuzzylite), or that of the block with its rules."""
        found = {v.name: v.aggregation for v in self._outputs.values() if v.aggregation}
        concluded: set[str] = set()
        for block in self._blocks:
            outputs = block.outputs()
            shared = sorted(outputs & concluded)
            if shared and not self._is_fuzzylite:
                raise malformed(
                    block.position,
                    f"a second RULEBLOCK concludes about {shared[0]!r}: expected one for all its "
                    "rules",
                )
            concluded |= outputs
            accu = block.operators.get("ACCU")
            for output in outputs if accu is not None else ():
                if accu is not None and found.setdefault(output, accu).name != accu.name:
                    raise malformed(accu.position, f"a second ACCU for output {output!r}")
        given = [each.operators["ACCU"] for each in self._blocks if "ACCU" in each.operators]
        for output in self._outputs if given else ():
            found.setdefault(output, given[0])
        return found

    def _output(
        self, variable: DeclaredVariable, aggregation: Chosen | None, rules: list[LocatedRule]
    ) -> OutputVariable:
        if variable.method is None:
            raise malformed(variable.position, f"{variable.name[:40]!r}: expected a METHOD")
        method: Defuzzifier = next(d for d in _METHODS if d == variable.method.name)
        with locate_errors(variable.position):
            functions = tuple(each for each in variable.sets if isinstance(each, LinearFunction))
            fuzzy = variable.fuzzy_sets()
            if fuzzy and aggregation is None:
                raise InvalidInput(
                    f"output {variable.name!r} needs an ACCU: where there is none, IEC 61131-7 "
                    "takes MAX, jFuzzyLogic SUM; write one"
                )
            output = OutputVariable(
                variable.name,
                *variable.limits(),
                functions or fuzzy,
                aggregation.name if aggregation else "max",
                method,
                variable.default,
            )
        if variable.clips is not None and not stays_in_range(output):
            raise malformed(
                variable.clips,
                f"output {output.name!r} may leave its range: clipping cannot be expressed",
            )
        if functions and aggregation is not None and aggregation.name != "sum":
            shared = shared_conclusion(output.name, rules)
            if shared is not None:
                raise malformed(
                    aggregation.position,
                    f"this ACCU joins rules with one singleton (line {shared.position.line}) as no "
                    "system here does: expected SUM",
                )
        return output

    def _operators(self) -> tuple[str, str, str]:
        chosen: dict[str, str] = {}
        for block in self._blocks:
            found = dict(block.operators)
            found.pop("ACCU", None)
            if not self._is_fuzzylite:
                self._check_pair(block)
            used = all_joins(block.rules)
            if And in used or "AND" in found:
                self._agree(chosen, "AND", block, self._conjunction(block))
            if Or in used or "OR" in found:
                self._agree(chosen, "OR", block, self._disjunction(block))
            if block.rules:
                act = found.get("ACT")
                self._agree(chosen, "ACT", block, act.name if act else "min")
        conjunction = chosen.get("AND") or _and_of(chosen.get("OR")) or "min"
        return (
            conjunction,
            chosen.get("OR") or PARTNERS[conjunction],
            chosen.get("ACT", "min"),
        )

    def _agree(self, chosen: dict[str, str], key: str, block: RuleBlock, name: str) -> None:
        if chosen.setdefault(key, name) != name:
            where = block.operators.get(key)
            raise malformed(
                where.position if where else block.position,
                f"RULEBLOCKs with different {key} cannot be expressed",
            )

    def _conjunction(self, block: RuleBlock) -> str:
        if "AND" in block.operators:
            return block.operators["AND"].name
        return (_and_of(block.operators["OR"].name) if "OR" in block.operators else "") or "min"

    def _disjunction(self, block: RuleBlock) -> str:
        if "OR" in block.operators:
            return block.operators["OR"].name
        return PARTNERS[block.operators["AND"].name] if "AND" in block.operators else "max"

    def _check_pair(self, block: RuleBlock) -> None:
        """Refuse an operator that jFuzzyLogic would replace by the partner of a later one."""
        given = [key for key in block.operators if key in {"AND", "OR"}]
        if len(given) < 2:
            return
        conjunction, disjunction = self._conjunction(block), self._disjunction(block)
        if PARTNERS[conjunction] == disjunction:
            return
        first = given[0]
        if (And if first == "AND" else Or) in all_joins(block.rules):
            raise malformed(
                block.operators[first].position,
                f"{first} is no partner of the other operator, which jFuzzyLogic lets replace it: "
                "expected pairs, such as MIN and MAX, or PROD and ASUM",
            )


_METHODS: tuple[Defuzzifier, ...] = ("centroid", "bisector", "mom", "lm", "rm", "wtaver", "wtsum")


def _and_of(disjunction: str | None) -> str | None:
    return next((a for a, o in PARTNERS.items() if o == disjunction), None)
