"""How the verbs' options look, and how what they say is read."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from omnidrive.errors import InvalidInput, closest

PATH_PANEL, RUN_PANEL, RESULTS_PANEL = "Where to drive", "How to drive", "Results"
"""Panels of the help."""


def option(metavar: str, text: str, panel: str, *names: str, least: int | None = None) -> Any:
    """An option for `Annotated`.

    Args:
        metavar: What stands for its value in the help.
        text: What it does.
        panel: Under which heading the help has it.
        names: What it is called, if not as the parameter is.
        least: The least value.
    """
    return typer.Option(*names, metavar=metavar, help=text, rich_help_panel=panel, min=least)


def choice(of: Iterable[str], text: str, panel: str) -> Any:
    """An option whose value is one of some names; otherwise as :func:`option`."""
    return option("|".join(of), text, panel)


def flag(text: str, panel: str, *names: str) -> Any:
    """An option without a value; otherwise as :func:`option`."""
    return typer.Option(*names, help=text, rich_help_panel=panel, show_default=False)


FolderOption = Annotated[
    Path | None,
    option(
        "FOLDER", "New folder for the results [default: runs/NAME-TIME].", RESULTS_PANEL, "--out"
    ),
]
JsonOption = Annotated[bool, flag("Print results.json instead of tables.", RESULTS_PANEL, "--json")]


def parse_coordinates(text: str) -> list[float]:
    """Two or three numbers with commas between; none if that is not what ``text`` is."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return numbers if len(numbers) in {2, 3} else []


def choose_many(name: str, text: str, options: Iterable[str]) -> tuple[str, ...]:
    """Read a comma-separated choice, kept in the order of ``options``."""
    wanted = {choose_one(name, part.strip(), options) for part in text.split(",")}
    return tuple(option for option in options if option in wanted)


def choose_one(name: str, value: str, options: Iterable[str]) -> Any:
    """``value``, which must be one of ``options``; what else it could be is said otherwise."""
    if value in options:
        return value
    near = closest(value, options)
    hint = f"; did you mean '{near}'?" if near else ""
    raise InvalidInput(f"there is no {name} '{value}'; there are {', '.join(options)}{hint}")


def default_folder(name: str) -> Path:
    """A folder under runs/ that does not exist yet."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    base = Path("runs") / f"{name}-{stamp}"
    path, count = base, 1
    while path.exists():
        count += 1
        path = base.with_name(f"{base.name}-{count}")
    return path


def available_cores() -> int:
    """Cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
