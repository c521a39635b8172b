"""``omnidrive list``: installed components and their parameters."""

from __future__ import annotations

import json as json_format
from shutil import get_terminal_size
from textwrap import fill
from typing import Annotated, Any

import typer

from omnidrive import components
from omnidrive.cli.completion import one_of
from omnidrive.cli.options import JsonOption, choose_one
from omnidrive.cli.terminal import print_json, show
from omnidrive.components import GROUPS, component_names
from omnidrive.errors import InvalidInput, OmnidriveError


def list(  # the name of the verb
    group: Annotated[
        str,
        typer.Argument(
            help=f"{', '.join(GROUPS)}.", metavar="GROUP", autocompletion=one_of(GROUPS)
        ),
    ],
    name: Annotated[
        str | None,
        typer.Argument(
            help="Show only this one; an installed component or your own as FILE.py:NAME.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """List controllers, plants, robots, maps, estimators, references and links.

    Parameters are shown with unit, range and default.

    For example:

    * `omnidrive list controllers`
    * `omnidrive list plants coppeliasim`
    * `omnidrive list controllers mine.py:MyController`
    """
    chosen = choose_one("group", group, GROUPS)
    if name is not None:
        found: dict[str, components.Component | str] = {
            name: components.find_component(chosen, name, allow_code=True)
        }
    else:
        found = {each: _try_to_find(chosen, each) for each in component_names(chosen)}
    if not found:
        raise InvalidInput(f"no {chosen} are installed")
    if json:
        data = [_record(name, component) for name, component in found.items()]
        print_json(data)
        return
    for each, component in found.items():
        _print(each, component)


def _try_to_find(group: Any, name: str) -> components.Component | str:
    """Return a component, or the reason for which it cannot be imported."""
    try:
        component = components.find_component(group, name)
        component.parameters  # noqa: B018 - reads the signature and the class of the parameters
    except OmnidriveError as error:
        return str(error)
    return component


def _record(name: str, component: components.Component | str) -> dict[str, Any]:
    if isinstance(component, str):
        return {"name": name, "error": component}
    parameters = [
        {
            "name": each.name,
            "type": each.kind,
            "unit": each.unit,
            "range": each.range,
            "required": each.default is ...,
            "default": None if each.default is ... else components.plain(each.default),
            "description": each.doc,
        }
        for each in component.parameters
    ]
    return {
        "name": name,
        "summary": component.summary,
        "origin": component.origin,
        "parameters": parameters,
    }


def _print(name: str, component: components.Component | str) -> None:
    """Print one component: name, origin and summary, then a line for each parameter."""
    if isinstance(component, str):
        show(f"  {component}", name, bold=True)
        return
    summary = f"\n    {component.summary}" if component.summary else ""
    show(f"  ({component.origin}){summary}", name, bold=True)
    for each in component.parameters:
        width = min(get_terminal_size().columns, 100)
        show(fill(_line(each), width, initial_indent=" " * 4, subsequent_indent=" " * 8))


def _line(parameter: components.Parameter) -> str:
    """Return a parameter as text, such as ``horizon = 15 steps (integer, 1 to 200): Number``."""
    value = (
        "required"
        if parameter.default is ...
        else json_format.dumps(components.plain(parameter.default))
    )
    unit = f" {parameter.unit}" if parameter.unit and parameter.default is not None else ""
    limits = parameter.range
    span = f", {limits[0]:g} to {limits[1]:g}" if limits else ""
    doc = f": {parameter.doc}" if parameter.doc else ""
    return f"{parameter.name} = {value}{unit} ({parameter.kind}{span}){doc}"
