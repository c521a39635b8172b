"""Text of Matlab's ``.fis`` files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from omnidrive.errors import InvalidInput
from omnidrive.fuzzy.files.fis.semantics import (
    MAMDANI_DEFUZZIFIERS,
    SUGENO_DEFUZZIFIERS,
    TYPE_REDUCTIONS,
)
from omnidrive.fuzzy.membership import MATLAB_SHAPES, Membership
from omnidrive.fuzzy.rule_text import normalised, rule_text
from omnidrive.fuzzy.rules import Antecedent, Is, Or, Rule
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import Footprint, FuzzySet, LinearFunction, Variable


def write_fis(system: FuzzySystem) -> str:
    """Return the text of a ``.fis`` file, which :func:`read_fis` reads as an equal system.

    There are three exceptions: the propositions of an antecedent are in the order of the inputs; in
    a type-2 system, a set without a footprint gets one of scale 1 and lag 0, which is equivalent;
    and the algorithm of a type-1 system, which has no effect, is not written.

    Raises:
        InvalidInput: Matlab does not support a part of the system; the message names the part.
    """
    _check_operators(system)
    lines = _system_lines(system)
    both: tuple[tuple[str, Sequence[Variable]], ...] = (
        ("Input", system.inputs),
        ("Output", system.outputs),
    )
    for kind, variables in both:
        for index, variable in enumerate(variables, 1):
            lines += ["", f"[{kind}{index}]", *_variable_lines(variable, system.type == 2)]
    lines += ["", "[Rules]", *(_rule_line(system, rule) for rule in system.rules), ""]
    return "\n".join(lines)


def _system_lines(system: FuzzySystem) -> list[str]:
    output = system.outputs[0]
    lines = [
        "[System]",
        f"Name={_quoted(system.name)}",
        f"Type='{'sugeno' if system.is_sugeno else 'mamdani'}'",
        f"Version={'3.0' if system.type == 2 else '2.0'}",
        f"NumInputs={len(system.inputs)}",
        f"NumOutputs={len(system.outputs)}",
        f"NumRules={len(system.rules)}",
        f"AndMethod='{system.conjunction}'",
        f"OrMethod='{system.disjunction}'",
        f"ImpMethod='{system.implication}'",
        f"AggMethod='{output.aggregation}'",
        f"DefuzzMethod='{output.defuzzifier}'",
    ]
    if system.type == 2:
        keywords = {name: keyword for keyword, name in TYPE_REDUCTIONS.items()}
        lines.append(f"TypeReductionMethod='{keywords[system.algorithm]}'")
    return lines


def _check_operators(system: FuzzySystem) -> None:
    if system.type == 3:
        raise InvalidInput(
            "a .fis file cannot hold a type-3 system; save its "
            "with_secondary(None), which is of type 2"
        )
    first = system.outputs[0]
    for output in system.outputs[1:]:
        if (output.aggregation, output.defuzzifier) != (first.aggregation, first.defuzzifier):
            raise InvalidInput(
                f"a .fis file has one aggregation and one defuzzifier for all outputs, but "
                f"{first.name!r} has {first.aggregation} and {first.defuzzifier}, {output.name!r} "
                f"has {output.aggregation} and {output.defuzzifier}"
            )
    for output in system.outputs:
        if output.default is not None:
            raise InvalidInput(
                f"a .fis file cannot hold the default {output.default:g} of {output.name!r}; "
                "Matlab's default is always the middle of the range"
            )
    algorithm = system.algorithm if system.type == 2 else "km"
    defuzzifiers = SUGENO_DEFUZZIFIERS if system.is_sugeno else MAMDANI_DEFUZZIFIERS
    for what, name, known in (
        ("conjunction", system.conjunction, ("min", "prod")),
        ("disjunction", system.disjunction, ("max", "probor")),
        ("implication", system.implication, ("min", "prod")),
        ("aggregation", first.aggregation, ("max", "sum", "probor")),
        ("defuzzifier", first.defuzzifier, tuple(defuzzifiers)),
        ("type reduction", algorithm, tuple(TYPE_REDUCTIONS.values())),
    ):
        if name not in known:
            raise InvalidInput(
                f"a .fis file cannot hold the {what} {name!r}; Matlab has {', '.join(known)}"
            )


def _variable_lines(variable: Variable, is_type2: bool) -> Iterator[str]:
    yield f"Name={_quoted(variable.name)}"
    yield f"Range={_vector(variable.low, variable.high)}"
    yield f"NumMFs={len(variable.sets)}"
    sets: Sequence[FuzzySet | LinearFunction] = variable.sets
    for index, each in enumerate(sets, 1):
        line = f"MF{index}={_quoted(each.name)}:"
        if isinstance(each, LinearFunction):
            shape = "linear" if each.coefficients else "constant"
            yield f"{line}'{shape}',{_vector(*each.coefficients, each.constant)}"
        else:
            yield line + _set_text(each, variable.name, is_type2)


def _set_text(each: FuzzySet, variable: str, is_type2: bool) -> str:
    footprint = Footprint() if each.lower is None else each.lower
    if each.upper.shape not in MATLAB_SHAPES or isinstance(footprint, Membership):
        what = each.upper.shape
        if isinstance(footprint, Membership):
            what = "lower function but a footprint of the upper one"
        raise InvalidInput(
            f"a .fis file cannot hold set {each.name!r} of {variable!r}: Matlab has no {what}"
        )
    text = f"'{each.upper.shape}',{_vector(*each.upper.parameters)}"
    if is_type2:
        text += f",{_vector(footprint.scale)},{_vector(*footprint.lags)}"
    return text


def _rule_line(system: FuzzySystem, rule: Rule) -> str:
    antecedent = normalised(rule.antecedent)
    parts: tuple[Antecedent, ...] = (
        (antecedent,) if isinstance(antecedent, Is) else antecedent.parts
    )
    propositions = [part for part in parts if isinstance(part, Is)]
    missing = None
    if len(propositions) < len(parts):
        missing = "rules with both 'and' and 'or'; split it into several rules"
    elif len({each.variable for each in propositions}) < len(propositions):
        missing = "rules with two propositions about one input"
    elif any(each.hedges not in {(), ("not",)} for each in propositions):
        missing = "hedge but 'not'"
    if missing:
        shown = rule_text(rule)
        raise InvalidInput(
            f'a .fis file cannot hold the rule "{shown[:120]}{"..." * (len(shown) > 120)}": '
            f"Matlab has no {missing}"
        )
    inputs = " ".join(_indices(system.inputs, propositions))
    outputs = " ".join(_indices(system.outputs, rule.consequents))
    connective = 2 if isinstance(antecedent, Or) else 1
    return f"{inputs}, {outputs} ({_number(rule.weight)}) : {connective}"


def _indices(variables: tuple[Variable, ...], propositions: Sequence[Is]) -> Iterator[str]:
    by_variable = {each.variable: each for each in propositions}
    for variable in variables:
        proposition = by_variable.get(variable.name)
        if proposition is None:
            yield "0"
        else:
            index = [each.name for each in variable.sets].index(proposition.set) + 1
            yield f"-{index}" if proposition.hedges else str(index)


def _quoted(name: str) -> str:
    if not name.isprintable():
        raise InvalidInput(f"a .fis file cannot hold the name {name[:40]!r}: it is not printable")
    return "'" + name.replace("'", "''") + "'"


def _vector(*values: float) -> str:
    return f"[{' '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """Return the shortest text that reads as the same number."""
    return repr(float(value)).removesuffix(".0")
