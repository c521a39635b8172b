"""Declaration and parsing of the options of the verbs."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from omnidrive.cli.completion import Complete, one_of, some_of
from omnidrive.errors import InvalidInput
from omnidrive.files.number_text import parse_number
from omnidrive.parameter import check_choice

PATH_PANEL, RUN_PANEL, RESULTS_PANEL = "Map and path", "Simulation", "Results"
"""Panels of the help text."""


def verb_group(text: str, default: str | None = None) -> typer.Typer:
    """Return an empty group of verbs, such as `omnidrive robot`.

    Args:
        text: Help text.
        default: Verb that may be omitted. None: none.
    """

    class Group(TyperGroup):
        """Group of verbs, one of which may be omitted."""

        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            """Insert the default verb unless a verb or the help is asked for."""
            known = {*self.commands, "--help", "-h"}
            if default is not None and args and args[0] not in known:
                args = [default, *args]
            return super().parse_args(ctx, args)

    return typer.Typer(
        cls=Group,
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode="markdown",
        help=text,
    )


def option(
    metavar: str,
    text: str,
    panel: str | None = None,
    *names: str,
    minimum: int | None = None,
    complete: Complete | None = None,
) -> Any:
    """Return a typer option, for use in ``Annotated``.

    Args:
        metavar: Placeholder of the value in the help text.
        text: Help text.
        panel: Panel of the help text. None: the first one.
        names: Option names; default: derived from the parameter name.
        minimum: Minimum value.
        complete: Completion of its value in a shell; by default files.
    """
    return typer.Option(
        *names,
        metavar=metavar,
        help=text,
        rich_help_panel=panel,
        min=minimum,
        autocompletion=complete,
    )


def choice(of: Iterable[str], text: str, panel: str | None = None) -> Any:
    """Return an option whose value is one of the names ``of``; see :func:`option`."""
    names = list(of)
    return option("|".join(names), text, panel, complete=one_of(names))


def flag(text: str, panel: str | None = None, *names: str) -> Any:
    """Return a boolean option; see :func:`option`."""
    return typer.Option(*names, help=text, rich_help_panel=panel, show_default=False)


FolderOption = Annotated[
    Path | None,
    option(
        "FOLDER",
        "New folder for the results [default: runs/NAME-TIME].",
        RESULTS_PANEL,
        "--out",
    ),
]
ForceOption = Annotated[bool, flag("Replace an existing file.", None, "--force")]
FIGURE_FORMATS = ("svg", "pdf", "png")
"""Formats of figures."""


FiguresOption = Annotated[
    str | None,
    option(
        "A,B,...",
        f"Formats of the figures: {', '.join(FIGURE_FORMATS)}; none: no figures [default: svg].",
        RESULTS_PANEL,
        "--figures",
        complete=some_of((*FIGURE_FORMATS, "none")),
    ),
]
FullOption = Annotated[
    bool,
    flag(
        "Print all tables with all columns, also paired differences and fuzzy rules.",
        RESULTS_PANEL,
        "--full",
    ),
]
ResultsJsonOption = Annotated[
    bool, flag("Print results.json instead of tables.", RESULTS_PANEL, "--json")
]
JsonOption = Annotated[bool, flag("Print JSON.", RESULTS_PANEL, "--json")]


def figure_formats(text: str | None) -> tuple[str, ...]:
    """Return the formats of figures that ``--figures`` names; empty: no figures.

    Raises:
        InvalidInput: There is no such format.
    """
    if text is None or text.strip() == "none":
        return ("svg",) if text is None else ()
    return choose_many("figure format", text, FIGURE_FORMATS)


def parse_coordinates(text: str) -> list[float]:
    """Parse two or three comma-separated numbers; return an empty list for any other text."""
    numbers = [number for part in text.split(",") if (number := parse_number(part)) is not None]
    return numbers if len(numbers) == text.count(",") + 1 and len(numbers) in {2, 3} else []


def parse_waypoint(name: str, text: str) -> list[float]:
    """Parse ``X,Y`` or ``X,Y,HEADING`` in m, m, rad.

    Args:
        name: Name of the option, for messages.
        text: Its value.

    Raises:
        InvalidInput: The text has another form, or the heading is not within 6.3 rad of zero.
    """
    numbers = parse_coordinates(text)
    if not numbers:
        raise InvalidInput(
            f"--{name} must be X,Y or X,Y,HEADING in m, m, rad, such as 1.5,2 or 1.5,2,-0.78; "
            f"got '{text}'"
        )
    if len(numbers) == 3 and not abs(numbers[2]) <= 6.3:
        raise InvalidInput(
            f"--{name}: the heading is {numbers[2]:g} rad, need -6.3 to 6.3 rad (degrees?)"
        )
    return numbers


def choose_many(name: str, text: str, options: Collection[str]) -> tuple[str, ...]:
    """Parse a comma-separated selection; the result has the order of ``options``.

    Raises:
        InvalidInput: A part is not one of ``options``.
    """
    selected = {choose_one(name, part.strip(), options) for part in text.split(",")}
    return tuple(option for option in options if option in selected)


def choose_one(name: str, value: str, options: Collection[str]) -> Any:
    """Return ``value`` if it is one of ``options``.

    Raises:
        InvalidInput: It is not; the message lists the options and the closest one.
    """
    check_choice(name, value, options)
    return value


def default_folder(name: str) -> Path:
    """Return the folder under runs/ for the results of a study, with the present time."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    return Path("runs") / f"{name}-{stamp}"


def available_cores() -> int:
    """Return the number of cores available to this process."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
