"""Command `omnidrive fuzzy`: show, convert and evaluate fuzzy systems in files."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, get_args

import typer
from matplotlib.figure import Figure
from rich.console import Console

from omnidrive.choices import ALGORITHMS, Centroid, NoRule, OutOfRange, Reduction
from omnidrive.cli.fuzzy_text import (
    fired_lines,
    outputs_table,
    rule_lines,
    rules_table,
    summary_lines,
    variable_lines,
)
from omnidrive.cli.options import (
    ForceOption,
    available_cores,
    check_overwrite,
    choose_one,
    parse_coordinates,
)
from omnidrive.cli.tables import print_tables
from omnidrive.compiled import announce_compiling
from omnidrive.errors import CannotWrite, InvalidInput, suggestion
from omnidrive.evaluation.figures import control_surface, membership_figure, rule_viewer
from omnidrive.evaluation.figures import save as save_figure
from omnidrive.files.bounded_file import one_line
from omnidrive.files.number_text import parse_number
from omnidrive.fuzzy import Footprint, FuzzySystem, Inference, load, save
from omnidrive.fuzzy.csv_rows import evaluate_csv

fuzzy = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    help="Show, convert and evaluate fuzzy systems in files: .fis, .fll, .fcl, .fml.",
)

FileArgument = Annotated[
    Path,
    typer.Argument(metavar="FILE", help="File of a fuzzy system: .fis, .fll, .fcl, .fml or .xml."),
]
Type2Option = Annotated[
    str | None,
    typer.Option(
        "--type2",
        metavar="SCALE,LAG[,LAG]",
        help="Convert a type-1 system to interval type 2. SCALE: peak of every lower function, "
        "0 to 1. LAG: degree of the upper function up to which the lower one is zero, on the left "
        "and the right side. Outputs of Sugeno systems have no fuzzy sets and are not changed.",
    ),
]
InOption = Annotated[
    Path,
    typer.Option(
        "--in",
        metavar="INPUTS.csv",
        help="One row per evaluation; columns have the names of the inputs, in any order. Other "
        "columns are ignored.",
    ),
]
OutOption = Annotated[
    Path,
    typer.Option(
        "--out",
        metavar="OUTPUTS.csv",
        help="One column per output; for type 2 also NAME_lower and NAME_upper.",
    ),
]
CentroidOption = Annotated[
    str | None,
    typer.Option(
        metavar="exact|matlab",
        help="Closed form, or sums over samples as in Matlab [default: exact if possible].",
    ),
]
SamplesOption = Annotated[
    int | None,
    typer.Option(metavar="N", help="Number of samples for --centroid matlab [default: 101]."),
]
ReductionOption = Annotated[
    str, typer.Option(metavar="centroid|cos", help="Type reduction: centroid, or centre of sets.")
]
AlgorithmOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(ALGORITHMS),
        help="Algorithm of type reduction for type 2 [default: that of the file, else km].",
    ),
]
OutOfRangeOption = Annotated[
    str,
    typer.Option(
        metavar="clamp|matlab|raise",
        help="Policy for an input out of its range: clamp to the range, use unchanged, or raise an "
        "error.",
    ),
]
NoRuleOption = Annotated[
    str,
    typer.Option(
        metavar="default|raise",
        help="Policy if no rule fires: the default of the output (or else the middle of its "
        "range), or an error.",
    ),
]
ThreadsOption = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        min=1,
        help="Number of threads; does not change the results [default: one per core].",
    ),
]


@fuzzy.command()
def show(
    file: FileArgument,
    inputs: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=X,NAME=Y",
            help="Also show the outputs for these inputs and the rules that fire; inputs are "
            "clamped to their ranges. Numbers without names are in the order of the inputs.",
        ),
    ] = None,
    type2: Type2Option = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="New folder for figures: sets, control surfaces and the rule viewer (for the "
            "given inputs or the middles of the ranges).",
        ),
    ] = None,
) -> None:
    """Print the variables, sets and rules of a system; optionally draw them.

    For example:

    * `omnidrive fuzzy show tipper.fis`
    * `omnidrive fuzzy show tipper.fis --inputs "service=3,food=8" --out figures`
    """
    system = _load(file, type2)
    inference = Inference(system)
    given = None if inputs is None else _parse_inputs(inputs, system)
    if given is not None:
        with announce_compiling():
            inference.interval(*given)  # raises errors before anything is printed
    if out is not None:
        _create_folder(out)
    _print_system(system)
    if given is not None:
        for variable, value in zip(system.inputs, given, strict=True):
            if not variable.low <= value <= variable.high:
                end = variable.low if value < variable.low else variable.high
                _warn(f"{variable.name} = {value:g} is out of range: clamped to {end:g}")
        for line in [*fired_lines(inference, given), ""]:
            typer.echo(line)
        print_tables([outputs_table(inference, given)])
    if out is not None:
        count = _save_figures(inference, given, out)
        typer.echo(f"{count} figures written to {one_line(str(out))}")


@fuzzy.command()
def convert(
    file: FileArgument,
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="File to write; its suffix selects the format.")
    ],
    type2: Type2Option = None,
    force: ForceOption = False,
) -> None:
    """Convert a system to another format without loss; unsupported parts are an error.

    For example:

    * `omnidrive fuzzy convert tipper.fis tipper.fll`
    * `omnidrive fuzzy convert tipper.fll tipper2.fis --type2 0.8,0.2`
    """
    system = _load(file, type2)
    check_overwrite(out, force)
    save(system, out)
    typer.echo(f"written to {one_line(str(out))}")


@fuzzy.command(name="eval")
def evaluate(
    file: FileArgument,
    source: InOption,
    target: OutOption,
    centroid: CentroidOption = None,
    samples: SamplesOption = None,
    type2: Type2Option = None,
    reduction: ReductionOption = "centroid",
    algorithm: AlgorithmOption = None,
    out_of_range: OutOfRangeOption = "clamp",
    no_rule: NoRuleOption = "default",
    threads: ThreadsOption = None,
    force: ForceOption = False,
) -> None:
    """Evaluate a system for every row of a table.

    Numbers are written with the digits that are needed to read the same number. For an invalid
    value, the error names the line and the column, and no file is written.

    For example:

    * `omnidrive fuzzy eval tipper.fis --in inputs.csv --out outputs.csv`
    * `omnidrive fuzzy eval tipper.fis --in inputs.csv --out outputs.csv --type2 0.8,0.2
      --reduction cos`
    """
    choices = {
        "centroid": None if centroid is None else _choice("--centroid", centroid, Centroid),
        "reduction": _choice("--reduction", reduction, Reduction),
        "out_of_range": _choice("--out-of-range", out_of_range, OutOfRange),
        "no_rule": _choice("--no-rule", no_rule, NoRule),
    }
    if algorithm is not None:
        choices["algorithm"] = choose_one("--algorithm", algorithm, ALGORITHMS)
    system = _load(file, type2)
    if algorithm is not None and system.type == 1:
        raise InvalidInput("--algorithm applies to type-2 systems, and this system is of type 1")
    inference = Inference(system, samples=101 if samples is None else samples, **choices)
    if samples is not None and (system.is_sugeno or inference.options.centroid == "exact"):
        raise InvalidInput("--samples applies to --centroid matlab, and this centroid is exact")
    check_overwrite(target, force)
    with announce_compiling():
        result = evaluate_csv(inference, source, target, threads=threads or available_cores())
    if result.unused:
        shown = ", ".join(result.unused[:6]) + (", ..." if len(result.unused) > 6 else "")
        _warn(f"columns ignored, because they are not inputs: {shown}")
    typer.echo(f"{result.rows} rows written to {one_line(str(target))}")


def _choice(option: str, value: str, names: Any) -> Any:
    return choose_one(option, value, get_args(names))


def _load(file: Path, type2: str | None) -> FuzzySystem:
    """Load a system, convert it to type 2 if ``type2`` is given, and print warnings."""
    footprint = None if type2 is None else _parse_footprint(type2)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        system = load(file)
    for each in caught:
        _warn(str(each.message))
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


def _create_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
        empty = not any(path.iterdir())
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(f"cannot write to {one_line(str(path))}: {reason}") from None
    if not empty:
        raise CannotWrite(f"{one_line(str(path))} is not empty; choose a new folder with --out")


def _print_system(system: FuzzySystem) -> None:
    for line in [*summary_lines(system), *variable_lines(system), ""]:
        typer.echo(line)
    table = rules_table(system)
    if table is not None:
        print_tables([table])
        return
    for line in ["rules", *rule_lines(system), ""]:
        typer.echo(line)


def _save_figures(inference: Inference, given: list[float] | None, folder: Path) -> int:
    """Write all figures of a system and return their number."""
    system = inference.system
    figures: dict[str, Callable[[], Figure]] = {}
    for k, variable in enumerate(system.variables, 1):
        figures[f"sets-{k}-{_file_name_part(variable.name)}"] = partial(membership_figure, variable)
    for k, output in enumerate(system.outputs, 1):
        name = output.name
        figures[f"surface-{k}-{_file_name_part(name)}"] = partial(control_surface, inference, name)
    figures["rules"] = partial(rule_viewer, inference, given)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # characters that the font does not have
        # BLAS may set floating-point flags without an error; Matplotlib's projection reports them
        warnings.filterwarnings("ignore", "overflow encountered in dot")
        for name, draw in figures.items():
            path = folder / f"{name}.png"
            try:
                save_figure(draw(), path)
            except OSError as error:
                reason = error.strerror or error
                raise CannotWrite(f"cannot write {one_line(str(path))}: {reason}") from None
    return len(figures)


def _file_name_part(name: str) -> str:
    """Return a name with the characters that are safe in file names."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", name)[:40].strip("-") or "variable"


def _warn(message: str) -> None:
    Console(stderr=True).print(f"omnidrive: {message}", markup=False, highlight=False)
