"""Work of the verbs of `omnidrive fuzzy`."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, get_args

from matplotlib.figure import Figure

from omnidrive.choices import ALGORITHMS, Centroid, NoRule, OutOfRange, Reduction
from omnidrive.cli.fuzzy_systems.fuzzy_text import (
    evaluation_lines,
    fired_lines,
    outputs_table,
    rule_lines,
    rules_table,
    shortened_rule,
    summary_lines,
    variable_lines,
)
from omnidrive.cli.options import available_cores, choose_one, parse_coordinates
from omnidrive.cli.tables import print_tables
from omnidrive.cli.terminal import conclude, print_json, show, warn
from omnidrive.compiled import announce_compiling
from omnidrive.errors import InvalidInput, one_line, suggestion
from omnidrive.evaluation.figures import control_surface, membership_figure, rule_viewer
from omnidrive.evaluation.figures import save as save_figure
from omnidrive.files.number_text import parse_number
from omnidrive.files.output_file import create_folder
from omnidrive.fuzzy import (
    Footprint,
    FuzzySystem,
    Inference,
    InputVariable,
    OutputVariable,
    load,
    save,
)
from omnidrive.fuzzy.csv_rows import evaluate_csv
from omnidrive.study import check_new_file, check_new_folder


def show_system(
    file: Path,
    inputs: str | None,
    type2: str | None,
    out: Path | None,
    samples: int | None,
    choices: dict[str, Any],
    *,
    block: str | None,
    json: bool,
) -> None:
    """Print a system, its outputs for the inputs if they are given, and draw it into a folder.

    See :func:`parse_choices`.
    """
    if out is not None:
        check_new_folder(out)
    system = _load(file, type2, block)
    inference = _inference(system, samples, choices)
    given = None if inputs is None else _parse_inputs(inputs, system)
    if given is not None:
        with announce_compiling():
            inference.interval(*given)  # raises errors before anything is printed
    if json:
        print_json(_record(inference, given))
    else:
        _print_system(system)
    if given is not None:
        for variable, value in zip(system.inputs, given, strict=True):
            if not variable.low <= value <= variable.high:
                end = variable.low if value < variable.low else variable.high
                warn(f"{variable.name} = {value:g} is out of range: clamped to {end:g}")
    if given is not None and not json:
        for line in [*fired_lines(inference, given), ""]:
            show(line)
        print_tables([outputs_table(inference, given)])
        for line in evaluation_lines(inference):
            show(line)
    if out is not None:
        count = _save_figures(inference, given, out)
        conclude(f"{count} figures written to {out}", beside_json=json)


def _record(inference: Inference, given: list[float] | None) -> dict[str, Any]:
    """Return a system as JSON data; with inputs also the outputs and the rules that fire."""
    system = inference.system

    def variables(of: Sequence[InputVariable | OutputVariable]) -> list[dict[str, Any]]:
        """Return name, range and names of the sets of each variable."""
        return [
            {"name": v.name, "low": v.low, "high": v.high, "sets": [s.name for s in v.sets]}
            for v in of
        ]

    record: dict[str, Any] = {
        "name": system.name,
        "kind": "Sugeno" if system.is_sugeno else "Mamdani",
        "type": system.type,
        "inputs": variables(system.inputs),
        "outputs": variables(system.outputs),
        "rules": [shortened_rule(rule) for rule in system.rules],
    }
    if given is None:
        return record
    values = dict(zip((v.name for v in system.inputs), given, strict=True))
    minimum, greatest = inference.interval(*given)
    return record | {
        "given": values,
        "results": {
            name: {"value": value, "least": float(minimum[k]), "greatest": float(greatest[k])}
            for k, (name, value) in enumerate(inference(values).items())
        },
        "fired": [
            {"rule": each.number, "lower": each.lower, "upper": each.upper}
            for each in inference.fired_rules(*given)
        ],
    }


def convert_system(
    file: Path, out: Path, type2: str | None, block: str | None, force: bool
) -> None:
    """Write a system in the format of the suffix of ``out``."""
    system = _load(file, type2, block)
    check_new_file(out, force=force)
    save(system, out)
    conclude(f"written to {out}")


def parse_choices(
    *,
    centroid: str | None,
    reduction: str,
    algorithm: str | None,
    out_of_range: str = "clamp",
    no_rule: str = "default",
) -> dict[str, Any]:
    """Return the options of an inference; an unknown name is an error."""
    choices = {
        "centroid": None if centroid is None else _choice("--centroid", centroid, Centroid),
        "reduction": _choice("--reduction", reduction, Reduction),
        "out_of_range": _choice("--out-of-range", out_of_range, OutOfRange),
        "no_rule": _choice("--no-rule", no_rule, NoRule),
    }
    if algorithm is not None:
        choices["algorithm"] = choose_one("--algorithm", algorithm, ALGORITHMS)
    return choices


def evaluate_table(
    file: Path,
    type2: str | None,
    source: Path,
    target: Path,
    samples: int | None,
    choices: dict[str, Any],
    *,
    block: str | None,
    threads: int | None,
    force: bool,
) -> None:
    """Evaluate a system for every row of a table; see :func:`parse_choices`."""
    system = _load(file, type2, block)
    inference = _inference(system, samples, choices)
    check_new_file(target, force=force)
    with announce_compiling():
        result = evaluate_csv(inference, source, target, threads=threads or available_cores())
    if result.unused:
        shown = ", ".join(result.unused[:6]) + (", ..." if len(result.unused) > 6 else "")
        warn(f"columns ignored, because they are not inputs: {shown}")
    if result.outside:
        clamps = inference.options.out_of_range == "clamp"
        warn(
            f"{result.outside} of {result.rows} rows have an input out of its range: "
            f"{'clamped to the range' if clamps else 'used unchanged'}"
        )
    conclude(f"{result.rows} rows written to {target}")


def _inference(system: FuzzySystem, samples: int | None, choices: dict[str, Any]) -> Inference:
    """Return the inference of a system; options that do not apply to it are an error."""
    if "algorithm" in choices and system.type == 1:
        raise InvalidInput("--algorithm applies to type-2 systems, and this system is of type 1")
    inference = Inference(system, samples=101 if samples is None else samples, **choices)
    if samples is not None and (system.is_sugeno or inference.options.centroid == "exact"):
        raise InvalidInput("--samples applies to --centroid matlab, and this centroid is exact")
    return inference


def _choice(option: str, value: str, names: Any) -> Any:
    return choose_one(option, value, get_args(names))


def _load(file: Path, type2: str | None, block: str | None) -> FuzzySystem:
    """Load a system, convert it to type 2 if ``type2`` is given, and print warnings."""
    footprint = None if type2 is None else _parse_footprint(type2)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        system = load(file, block)
    for each in caught:
        warn(str(each.message))
    if footprint is None:
        return system
    if system.type > 1:
        raise InvalidInput(
            f"--type2 applies to type-1 systems; {one_line(str(file))} is of type {system.type}"
        )
    return system.with_footprint(footprint)


def _parse_footprint(text: str) -> Footprint:
    numbers = parse_coordinates(text)
    if not numbers:
        raise InvalidInput(
            f"--type2 must be SCALE,LAG or SCALE,LAG,LAG, such as 0.8,0.2; got "
            f"'{one_line(text, 60)}'"
        )
    return Footprint(*numbers)


def _parse_inputs(text: str, system: FuzzySystem) -> list[float]:
    """Parse ``NAME=X,NAME=Y`` in any order, or numbers in the order of the inputs."""
    names = [variable.name for variable in system.inputs]
    parts = text.split(",")
    if "=" not in text:
        if len(parts) != len(names):
            raise InvalidInput(
                f"--inputs needs {len(names)} numbers ({', '.join(names)}), got {len(parts)}"
            )
        return [_number(name, part) for name, part in zip(names, parts, strict=True)]
    given: dict[str, float] = {}
    for part in parts:
        name, _, value = part.rpartition("=")
        name = name.strip()
        if name not in names:
            raise InvalidInput(
                f"--inputs: there is no input {one_line(name, 60)!r}{suggestion(name, names)}"
            )
        if name in given:
            raise InvalidInput(f"--inputs: the input {name!r} appears twice")
        given[name] = _number(name, value)
    missing = [name for name in names if name not in given]
    if missing:
        raise InvalidInput(f"--inputs: the input {missing[0]!r} is missing")
    return [given[name] for name in names]


def _number(name: str, text: str) -> float:
    number = parse_number(text)
    if number is None:
        raise InvalidInput(
            f"--inputs: expected a number for {name!r}, got '{one_line(text.strip(), 60)}'"
        )
    return number


def _print_system(system: FuzzySystem) -> None:
    for line in [*summary_lines(system), *variable_lines(system), ""]:
        show(line)
    table = rules_table(system)
    if table is not None:
        print_tables([table])
        return
    for line in ["rules", *rule_lines(system), ""]:
        show(line)


def _save_figures(inference: Inference, given: list[float] | None, folder: Path) -> int:
    """Write all figures of a system and return their number."""
    system = inference.system
    figures: dict[str, Callable[[], Figure]] = {}
    for k, variable in enumerate(system.variables, 1):
        figures[f"sets-{k}-{_file_name_part(variable.name)}"] = partial(
            membership_figure, variable, inputs=[each.name for each in system.inputs]
        )
    for k, output in enumerate(system.outputs, 1):
        name = output.name
        figures[f"surface-{k}-{_file_name_part(name)}"] = partial(control_surface, inference, name)
    figures["rules"] = partial(rule_viewer, inference, given)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # characters that the font does not have
        # BLAS may set floating-point flags without an error; Matplotlib's projection reports them
        warnings.filterwarnings("ignore", "overflow encountered in dot")
        create_folder(folder)
        for name, draw in figures.items():
            save_figure(draw(), folder / f"{name}.png")
    return len(figures)


def _file_name_part(name: str) -> str:
    """Return a name with the characters that are safe in file names."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", name)[:40].strip("-") or "variable"
