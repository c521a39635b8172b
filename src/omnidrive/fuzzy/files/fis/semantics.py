"""Fuzzy system that a ``.fis`` file describes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import cast

from omnidrive.choices import Algorithm
from omnidrive.errors import closest, suggestion
from omnidrive.fuzzy.files.assembly import locate_errors
from omnidrive.fuzzy.files.fis.parser import (
    FisFile,
    RuleEntry,
    SetEntry,
    SystemEntry,
    VariableEntry,
    parse,
)
from omnidrive.fuzzy.membership import MATLAB_SHAPES, SHAPES, Membership
from omnidrive.fuzzy.position import LocatedText, malformed
from omnidrive.fuzzy.rules import And, Hedge, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import (
    Defuzzifier,
    Footprint,
    FuzzySet,
    InputVariable,
    LinearFunction,
    OutputVariable,
    Variable,
)

# From Matlab's and Octave's keywords to the names in this package.
CONJUNCTIONS = {
    "min": "min",
    "prod": "prod",
    "algebraic_product": "prod",
    "bounded_difference": "lukasiewicz",
    "drastic_product": "drastic",
    "einstein_product": "einstein",
    "hamacher_product": "hamacher",
    "nilpotent_minimum": "nilpotent",
}
DISJUNCTIONS = {
    "max": "max",
    "probor": "probor",
    "algebraic_sum": "probor",
    "bounded_sum": "bsum",
    "drastic_sum": "drastic",
    "einstein_sum": "einstein",
    "hamacher_sum": "hamacher",
    "nilpotent_maximum": "nilpotent",
}
IMPLICATIONS = {"min": "min", "prod": "prod", "algebraic_product": "prod"}
AGGREGATIONS = {**DISJUNCTIONS, "sum": "sum"}
MAMDANI_DEFUZZIFIERS = {each: each for each in ("centroid", "bisector", "mom", "som", "lom")}
SUGENO_DEFUZZIFIERS = {each: each for each in ("wtaver", "wtsum")}
TYPE_REDUCTIONS = {"karnikmendel": "km", "ekm": "ekm", "iasc": "iasc", "eiasc": "eiasc"}

_HEDGES: dict[str, tuple[Hedge, ...]] = {
    "": (),
    "01": ("seldom",),
    "05": ("somewhat",),
    "2": ("very",),
    "4": ("very", "very"),
}
"""Octave's and fuzzylite's hedges, by the decimals of a set's number."""

_MISSPELLED = 0.8  # similarity from which the name of a function is a known one, misspelled
_DEFAULT_LAG = (0.2, 0.2)
"""Matlab's LowerLag of a type-2 set without one; the LowerScale is then 1."""


def read_fis(text: str) -> FuzzySystem:
    """Return the system that the text of a ``.fis`` file describes.

    Files of all versions of Matlab are supported, and Octave's if they use operators that exist
    here. Octave's hedges somewhat, very and "very very" are the fractions .05, .2 and .4 of a set's
    number in a rule; fuzzylite's seldom is .01. Octave's "extremely" (.3), a cube, is refused.

    A file is of type 2 if it has a TypeReductionMethod, or if any set has a LowerScale and
    LowerLag: ``MF1='low':'trimf',[0 1 2],[0.9],[0.2 0.2]``. A set without them then has Matlab's
    default, scale 1 and lag 0.2. Matlab defines the lag of a curve that never reaches zero by an
    undocumented cut-off; :class:`~omnidrive.fuzzy.Footprint` needs none, so that such lower
    functions differ slightly from Matlab's.

    Counts (NumInputs, NumMFs, ...), the name and the version may be missing; counts must be right.
    Zeros after the parameters of a function, with which old files pad all to the same number, are
    ignored. A rule without an antecedent is refused.

    Raises:
        InvalidFuzzyFile: The text does not describe such a system; the message names the position
            and what was expected.
    """
    return _system_of(parse(text))


def _system_of(file: FisFile) -> FuzzySystem:
    head = file.system
    is_sugeno = _choice(head, "Type", {"mamdani": "mamdani", "sugeno": "sugeno"}) == "sugeno"
    algorithm = _choice(head, "TypeReductionMethod", TYPE_REDUCTIONS, "km")
    conjunction = _choice(head, "AndMethod", CONJUNCTIONS)
    disjunction = _choice(head, "OrMethod", DISJUNCTIONS)
    implication = _choice(head, "ImpMethod", IMPLICATIONS)
    aggregation = _choice(head, "AggMethod", AGGREGATIONS)
    defuzzifiers = SUGENO_DEFUZZIFIERS if is_sugeno else MAMDANI_DEFUZZIFIERS
    defuzzifier = cast("Defuzzifier", _choice(head, "DefuzzMethod", defuzzifiers))
    for variable in file.inputs:
        _check_sets(variable, False)
    for variable in file.outputs:
        _check_sets(variable, is_sugeno)
    _check_different([variable.name for variable in (*file.inputs, *file.outputs)])
    is_type2 = "typereductionmethod" in head.options or any(
        each.footprint for variable in (*file.inputs, *file.outputs) for each in variable.sets
    )
    inputs = tuple(_input(each, is_type2) for each in file.inputs)
    outputs = []
    for entry in file.outputs:
        sets = (
            tuple(_linear_function(each, len(inputs)) for each in entry.sets)
            if is_sugeno
            else tuple(_fuzzy_set(each, is_type2) for each in entry.sets)
        )
        with locate_errors(entry.position):
            outputs.append(
                OutputVariable(
                    entry.name.text, entry.low, entry.high, sets, aggregation, defuzzifier
                )
            )
    numbered = tuple(map(_NumberedSets, inputs)), tuple(map(_NumberedSets, outputs))
    rules = tuple(_rule(each, *numbered) for each in file.rules)
    with locate_errors(head.position):
        return FuzzySystem(
            head.options["name"].text if "name" in head.options else "",
            inputs,
            tuple(outputs),
            rules,
            conjunction,
            disjunction,
            implication,
            cast("Algorithm", algorithm),
        )


def _choice(
    head: SystemEntry, key: str, known: Mapping[str, str], default: str | None = None
) -> str:
    """Return this package's name of an operator."""
    token = head.options.get(key.lower())
    if token is None:
        if default is None:
            raise malformed(head.position, f"expected {key}=... in [System]")
        return default
    if token.text.lower() not in known:
        hint = suggestion(token.text, known)
        raise malformed(token.position, f"there is no {key} {token.text[:40]!r}{hint}")
    return known[token.text.lower()]


def _check_sets(variable: VariableEntry, are_functions: bool) -> None:
    """Check the shapes and the names of a variable's sets."""
    known = ("constant", "linear") if are_functions else MATLAB_SHAPES
    what = "function of a Sugeno output" if are_functions else "membership function"
    names: set[str] = set()
    for each in variable.sets:
        shape = each.shape.text
        if shape not in known:
            raise malformed(each.shape.position, _unknown_shape(shape, known, what))
        if are_functions and each.footprint:
            raise malformed(
                each.footprint_position, "a function of a Sugeno output has no footprint"
            )
        if each.name in names:
            raise malformed(each.position, f"the name {each.name[:40]!r} appears twice")
        names.add(each.name)


def _unknown_shape(shape: str, known: tuple[str, ...], what: str) -> str:
    """Return the message for a shape that this package does not have."""
    is_custom = known is MATLAB_SHAPES and shape not in {"constant", "linear"}
    if not is_custom or closest(shape, known, cutoff=_MISSPELLED):
        return f"there is no {what} {shape[:40]!r}{suggestion(shape, known, maximum=len(known))}"
    return (
        f"there is no {what} {shape[:40]!r}; custom functions are not supported: use one of "
        f"{', '.join(known)}, or points of the function, in Python Membership('pointsmf', "
        "(x1, y1, x2, y2, ...)), in a .fll file Discrete"
    )


def _check_different(names: Iterable[LocatedText]) -> None:
    seen: set[str] = set()
    for name in names:
        if name.text in seen:
            raise malformed(
                name.position, f"there are two variables {name.text[:40]!r}; rename one"
            )
        seen.add(name.text)


def _input(entry: VariableEntry, is_type2: bool) -> InputVariable:
    sets = tuple(_fuzzy_set(each, is_type2) for each in entry.sets)
    with locate_errors(entry.position):
        return InputVariable(entry.name.text, entry.low, entry.high, sets)


def _fuzzy_set(entry: SetEntry, is_type2: bool) -> FuzzySet:
    parameters = _unpadded(entry, len(SHAPES[entry.shape.text].parameters))
    with locate_errors(entry.position):
        lower = None
        if is_type2:
            scale = entry.footprint[0][0] if entry.footprint else 1.0
            lags = entry.footprint[1] if len(entry.footprint) > 1 else _DEFAULT_LAG
            lower = Footprint(scale, *lags)
        return FuzzySet(entry.name, Membership(entry.shape.text, parameters), lower)


def _unpadded(entry: SetEntry, count: int) -> tuple[float, ...]:
    """Return the leading ``count`` parameters if only zeros follow, otherwise all."""
    padding = entry.parameters[count:]
    return entry.parameters if any(padding) else entry.parameters[:count]


def _linear_function(entry: SetEntry, inputs: int) -> LinearFunction:
    expected = 1 if entry.shape.text == "constant" else inputs + 1
    parameters = _unpadded(entry, expected)
    if len(parameters) != expected:
        needs = "a number" if expected == 1 else f"{inputs} coefficients and a constant"
        raise malformed(
            entry.position,
            f"'{entry.shape.text}' needs {needs}, got {len(entry.parameters)} numbers",
        )
    *coefficients, constant = parameters
    with locate_errors(entry.position):
        return LinearFunction(entry.name, constant, tuple(coefficients))


class _NumberedSets:
    """Sets of a variable, which rules refer to by their numbers."""

    def __init__(self, variable: Variable) -> None:
        self.is_sugeno = isinstance(variable, OutputVariable) and variable.is_sugeno
        self._name = variable.name
        self._sets = [each.name for each in variable.sets]
        self._propositions: dict[str, Is | None] = {}

    def proposition(self, token: LocatedText) -> Is | None:
        """Return the proposition of a set's number; a minus means "not"; None for 0."""
        if token.text not in self._propositions:
            self._propositions[token.text] = self._read(token)
        return self._propositions[token.text]

    def _read(self, token: LocatedText) -> Is | None:
        position, word = token.position, token.text
        match = re.fullmatch(r"([+-]?)(\d{1,9})(?:\.(\d{0,20}))?", word)
        if match is None:
            raise malformed(
                position, f"expected the number of a set of {self._name!r}, got {word[:40]!r}"
            )
        sign, index, decimals = match[1], int(match[2]), (match[3] or "").rstrip("0")
        if index > len(self._sets) or (index == 0 and decimals):
            has = f"sets 1 to {len(self._sets)}" if self._sets else "no sets"
            raise malformed(position, f"{self._name!r} has {has}, got {word[:40]!r}")
        if decimals not in _HEDGES:
            known = "; ".join(f".{d} {' '.join(h)}" for d, h in _HEDGES.items() if d)
            what = "Octave's 'extremely', a cube," if decimals == "3" else "a hedge"
            raise malformed(
                position, f".{decimals} is {what} that is not supported; supported are {known}"
            )
        if index == 0:
            return None
        negation: tuple[Hedge, ...] = ("not",) if sign == "-" else ()
        return Is(self._name, self._sets[index - 1], negation + _HEDGES[decimals])


def _rule(
    entry: RuleEntry, inputs: tuple[_NumberedSets, ...], outputs: tuple[_NumberedSets, ...]
) -> Rule:
    antecedent = _propositions(inputs, entry.inputs)
    consequents = _propositions(outputs, entry.outputs)
    if not antecedent:
        raise malformed(
            entry.inputs[0].position, "the rule has no antecedent: the set of every input is 0"
        )
    start = entry.outputs[0].position
    if not consequents:
        raise malformed(start, "the rule has no consequent: the set of every output is 0")
    for each in consequents:
        if each.hedges and (outputs[0].is_sugeno or each.hedges != ("not",)):
            raise malformed(start, f"a consequent cannot be {' '.join(each.hedges)!r}")
    join = Or if entry.is_or else And
    with locate_errors(entry.weight_position):
        return Rule(
            antecedent[0] if len(antecedent) == 1 else join(antecedent), consequents, entry.weight
        )


def _propositions(
    variables: tuple[_NumberedSets, ...], tokens: tuple[LocatedText, ...]
) -> tuple[Is, ...]:
    found = (each.proposition(token) for each, token in zip(variables, tokens, strict=True))
    return tuple(each for each in found if each is not None)
