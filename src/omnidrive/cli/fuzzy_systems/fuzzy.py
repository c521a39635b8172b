"""Command `omnidrive fuzzy`: show, convert and evaluate fuzzy systems in files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

from omnidrive.choices import ALGORITHMS, Centroid, NoRule, OutOfRange, Reduction
from omnidrive.cli.options import ForceOption, JsonOption, choice, option, verb_group

fuzzy = verb_group("Show, convert and evaluate fuzzy systems in files: .fis, .fll, .fcl, .fml.")

FileArgument = Annotated[
    Path,
    typer.Argument(metavar="FILE", help="File of a fuzzy system: .fis, .fll, .fcl, .fml or .xml."),
]
Type2Option = Annotated[
    str | None,
    option(
        "SCALE,LAG[,LAG]",
        "Convert a type-1 system to interval type 2. SCALE: peak of every lower function, "
        "0 to 1. LAG: degree of the upper function up to which the lower one is zero, on the left "
        "and the right side. Outputs of Sugeno systems have no fuzzy sets and are not changed.",
        None,
        "--type2",
    ),
]
BlockOption = Annotated[
    str | None, option("NAME", "FUNCTION_BLOCK of an .fcl file [default: the first].")
]
InOption = Annotated[
    Path,
    option(
        "INPUTS.csv",
        "One row per evaluation; columns have the names of the inputs, in any order. Other "
        "columns are ignored.",
        None,
        "--in",
    ),
]
OutOption = Annotated[
    Path,
    option(
        "OUTPUTS.csv", "One column per output; for type 2 also NAME_lower and NAME_upper.", None,
        "--out",
    ),
]  # fmt: skip
CentroidOption = Annotated[
    str | None,
    choice(
        get_args(Centroid),
        "Closed form, or sums over samples as in Matlab [default: exact if possible].",
    ),
]
SamplesOption = Annotated[
    int | None, option("N", "Number of samples for --centroid matlab [default: 101].")
]
ReductionOption = Annotated[
    str, choice(get_args(Reduction), "Type reduction: centroid, or centre of sets.")
]
AlgorithmOption = Annotated[
    str | None,
    choice(
        ALGORITHMS, "Algorithm of type reduction for type 2 [default: that of the file, else km]."
    ),
]
OutOfRangeOption = Annotated[
    str,
    choice(
        get_args(OutOfRange),
        "Policy for an input out of its range: clamp to the range, use unchanged, or raise an "
        "error.",
    ),
]
NoRuleOption = Annotated[
    str,
    choice(
        get_args(NoRule),
        "Policy if no rule fires: the default of the output (or else the middle of its "
        "range), or an error.",
    ),
]
ThreadsOption = Annotated[
    int | None,
    option(
        "N", "Number of threads; does not change the results [default: one per core].", minimum=1
    ),
]


@fuzzy.command()
def show(
    file: FileArgument,
    inputs: Annotated[
        str | None,
        option(
            "NAME=X,NAME=Y",
            "Also show the outputs for these inputs and the rules that fire; inputs are "
            "clamped to their ranges. Numbers without names are in the order of the inputs.",
        ),
    ] = None,
    type2: Type2Option = None,
    block: BlockOption = None,
    out: Annotated[
        Path | None,
        option(
            "FOLDER",
            "New folder for figures: sets, control surfaces and the rule viewer (for the "
            "given inputs or the middles of the ranges).",
        ),
    ] = None,
    centroid: CentroidOption = None,
    samples: SamplesOption = None,
    reduction: ReductionOption = "centroid",
    algorithm: AlgorithmOption = None,
    json: JsonOption = False,
) -> None:
    """Print the variables, sets and rules of a system; optionally draw them.

    For example:

    * `omnidrive fuzzy show tipper.fis`
    * `omnidrive fuzzy show tipper.fis --inputs "service=3,food=8" --out figures`
    * `omnidrive fuzzy show tipper.fis --inputs 3,8 --centroid matlab`
    """
    from omnidrive.cli.fuzzy_systems.fuzzy_actions import parse_choices, show_system

    choices = parse_choices(centroid=centroid, reduction=reduction, algorithm=algorithm)
    show_system(file, inputs, type2, out, samples, choices, block=block, json=json)


@fuzzy.command()
def convert(
    file: FileArgument,
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="File to write; its suffix selects the format.")
    ],
    type2: Type2Option = None,
    block: BlockOption = None,
    force: ForceOption = False,
) -> None:
    """Convert a system to another format without loss; unsupported parts are an error.

    For example:

    * `omnidrive fuzzy convert tipper.fis tipper.fll`
    * `omnidrive fuzzy convert tipper.fll tipper2.fis --type2 0.8,0.2`
    """
    from omnidrive.cli.fuzzy_systems.fuzzy_actions import convert_system

    convert_system(file, out, type2, block, force)


@fuzzy.command(name="eval")
def evaluate(
    file: FileArgument,
    source: InOption,
    target: OutOption,
    centroid: CentroidOption = None,
    samples: SamplesOption = None,
    type2: Type2Option = None,
    block: BlockOption = None,
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
    from omnidrive.cli.fuzzy_systems.fuzzy_actions import evaluate_table, parse_choices

    choices = parse_choices(
        centroid=centroid,
        reduction=reduction,
        algorithm=algorithm,
        out_of_range=out_of_range,
        no_rule=no_rule,
    )
    evaluate_table(
        file, type2, source, target, samples, choices, block=block, threads=threads, force=force
    )
