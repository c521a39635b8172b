"""Fuzzy systems as data: variables, rules and operators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from omnidrive.choices import ALGORITHMS, Algorithm
from omnidrive.errors import InvalidInput, suggestion
from omnidrive.fuzzy.checks import check_unique
from omnidrive.fuzzy.drawing import sets_svg
from omnidrive.fuzzy.norms import CONORMS, IMPLICATIONS, NORMS
from omnidrive.fuzzy.rules import Is, Rule, propositions
from omnidrive.fuzzy.variables import (
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Secondary,
    Variable,
)
from omnidrive.notebook import captioned, facts_html
from omnidrive.parameter import check_choice

MAX_VARIABLES, MAX_RULES = 64, 100_000
_MAX_DRAWINGS, _MAX_NAMES = 8, 7  # in notebooks


@dataclass(frozen=True, slots=True)
class FuzzySystem:
    """A Mamdani or Sugeno system of type 1, interval type 2 or interval type 3.

    Attributes:
        name: Name of the system.
        inputs: Input variables, in the order of the input values.
        outputs: Output variables, in the order of the output values.
        rules: All rules; their order has no effect.
        conjunction: t-norm of "and"; a name of :data:`~omnidrive.fuzzy.norms.NORMS`.
        disjunction: t-conorm of "or"; a name of :data:`~omnidrive.fuzzy.norms.CONORMS`.
        implication: How a firing strength shapes a consequent: ``min`` clips, ``prod`` scales.
        algorithm: Algorithm of type reduction for a type-2 or type-3 system.

    Raises:
        InvalidInput: A name is missing, used twice or unknown, or an operator is unknown.
    """

    name: str
    inputs: tuple[InputVariable, ...]
    outputs: tuple[OutputVariable, ...]
    rules: tuple[Rule, ...]
    conjunction: str = "min"
    disjunction: str = "max"
    implication: str = "min"
    algorithm: Algorithm = "km"

    def __post_init__(self) -> None:
        for what, variables in (("input", self.inputs), ("output", self.outputs)):
            if not 1 <= len(variables) <= MAX_VARIABLES:
                raise InvalidInput(
                    f"a fuzzy system needs 1 to {MAX_VARIABLES} {what}s, got {len(variables)}"
                )
        check_unique("variables", [v.name for v in self.variables])
        check_choice("conjunction", self.conjunction, NORMS)
        check_choice("disjunction", self.disjunction, CONORMS)
        check_choice("implication", self.implication, IMPLICATIONS)
        check_choice("type reduction", self.algorithm, ALGORITHMS)
        if len({v.is_sugeno for v in self.outputs}) > 1:
            raise InvalidInput("either all outputs need fuzzy sets, or all linear functions")
        for output in self.outputs:
            for each in output.sets:
                count = len(self.inputs)
                if isinstance(each, LinearFunction) and len(each.coefficients) not in {0, count}:
                    raise InvalidInput(
                        f"function {each.name!r} of {output.name!r} needs {count} coefficients, "
                        f"one per input, or none, got {len(each.coefficients)}"
                    )
        if not 1 <= len(self.rules) <= MAX_RULES:
            raise InvalidInput(
                f"a fuzzy system needs 1 to {MAX_RULES} rules, got {len(self.rules)}"
            )
        sets_of = {v.name: {each.name for each in v.sets} for v in self.variables}
        inputs = tuple(v.name for v in self.inputs)
        outputs = tuple(v.name for v in self.outputs)
        for number, rule in enumerate(self.rules, 1):
            for proposition in propositions(rule.antecedent):
                _check_proposition(number, "input", proposition, inputs, sets_of)
            for proposition in rule.consequents:
                _check_proposition(number, "output", proposition, outputs, sets_of)
                if proposition.hedges not in {(), ("not",)} or (
                    proposition.hedges and self.is_sugeno
                ):
                    raise InvalidInput(
                        f"rule {number}: a consequent cannot be {' '.join(proposition.hedges)!r}"
                    )
            if len({each.variable for each in rule.consequents}) < len(rule.consequents):
                raise InvalidInput(f"rule {number} has two consequents for one output")

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Inputs, then outputs."""
        return (*self.inputs, *self.outputs)

    @property
    def is_sugeno(self) -> bool:
        """Whether consequents are linear functions (Takagi, Sugeno & Kang), not sets (Mamdani)."""
        return self.outputs[0].is_sugeno

    @property
    def type(self) -> int:
        """1, 2 or 3: the greatest type of any set."""
        sets = [s for v in self.variables for s in v.sets if isinstance(s, FuzzySet)]
        if any(s.secondary is not None for s in sets):
            return 3
        return 2 if any(s.lower is not None for s in sets) else 1

    def _repr_html_(self) -> str:
        """Return variables with their sets, rules and operators for notebooks."""
        kind = "Sugeno" if self.is_sugeno else "Mamdani"
        facts = {
            v.name: f"{what} {v.low:g} to {v.high:g}; {_listed([each.name for each in v.sets])}"
            for what, variables in (("input", self.inputs), ("output", self.outputs))
            for v in variables
        }
        facts["rules"] = f"{len(self.rules)}; and: {self.conjunction}, or: {self.disjunction}"
        drawings = (captioned(sets_svg(v), v.name) for v in self.variables[:_MAX_DRAWINGS])
        title = f"Fuzzy system {self.name}: {kind}, type {self.type}"
        return facts_html(title, facts, *drawings)

    def with_footprint(
        self,
        inputs: Footprint,
        outputs: Footprint | None = None,
        secondary: Secondary | None = None,
    ) -> FuzzySystem:
        """Return the system with a footprint of uncertainty for every set.

        Args:
            inputs: Footprint of every set of an input.
            outputs: Footprint of every set of an output; None: the same as of the inputs.
            secondary: Secondary membership of every set, for type 3; None: type 2.
        """
        outputs = inputs if outputs is None else outputs

        def uncertain(each: FuzzySet, footprint: Footprint) -> FuzzySet:
            """Return the set with the footprint and the secondary membership."""
            return replace(each, lower=footprint, secondary=secondary)

        return replace(
            self,
            inputs=tuple(
                replace(v, sets=tuple(uncertain(s, inputs) for s in v.sets)) for v in self.inputs
            ),
            outputs=tuple(
                v
                if v.is_sugeno
                else replace(
                    v, sets=tuple(uncertain(s, outputs) for s in v.sets if isinstance(s, FuzzySet))
                )
                for v in self.outputs
            ),
        )

    def with_secondary(self, secondary: Secondary | None) -> FuzzySystem:
        """Return the system of type 2 or 3 with another secondary membership of every set.

        Args:
            secondary: Secondary membership, for type 3; None: type 2.

        Raises:
            InvalidInput: A set has no footprint.
        """

        def changed(sets: Sequence[FuzzySet | LinearFunction]) -> tuple[FuzzySet, ...]:
            """Return the sets with the secondary membership."""
            return tuple(replace(s, secondary=secondary) for s in sets if isinstance(s, FuzzySet))

        return replace(
            self,
            inputs=tuple(replace(v, sets=changed(v.sets)) for v in self.inputs),
            outputs=tuple(
                v if v.is_sugeno else replace(v, sets=changed(v.sets)) for v in self.outputs
            ),
        )


def _listed(names: Sequence[str]) -> str:
    """Return the first seven names, separated by commas."""
    return ", ".join(names[:_MAX_NAMES]) + (", ..." if len(names) > _MAX_NAMES else "")


def _check_proposition(
    number: int,
    what: str,
    proposition: Is,
    variables: tuple[str, ...],
    sets_of: dict[str, set[str]],
) -> None:
    if proposition.variable not in variables:
        hint = suggestion(proposition.variable, variables)
        raise InvalidInput(f"rule {number}: there is no {what} {proposition.variable[:40]!r}{hint}")
    if proposition.set and proposition.set not in sets_of[proposition.variable]:
        known = sorted(sets_of[proposition.variable])
        raise InvalidInput(
            f"rule {number}: {proposition.variable!r} has no set {proposition.set[:40]!r}"
            f"{suggestion(proposition.set, known)}"
        )
