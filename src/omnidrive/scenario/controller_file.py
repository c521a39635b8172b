"""Files with the parameters of one controller, such as those that tuning writes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml

from omnidrive.components import Configured, find_component
from omnidrive.components.code import CodePermission, is_code
from omnidrive.errors import InvalidInput, InvalidScenario, one_line, short_repr
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.fuzzy.files.format import FORMATS

FORMAT = "omnidrive-controller-1"
"""Name and version of the file format."""


def is_controller_file(value: Any) -> bool:
    """Return whether the value of a controller in a scenario names a file."""
    return isinstance(value, str) and value.lower().endswith((".yaml", ".yml"))


def system_file(value: Any) -> str | None:
    """Return the name of the file of the fuzzy system of a controller, ``fuzzy.file``; or None.

    The suffix of a fuzzy system decides, not the type of the controller: a controller of one's own
    may have the same parameters, and its code is not imported for the names of its files.
    """
    fuzzy = value.get("fuzzy") if isinstance(value, dict) else None
    name = fuzzy.get("file") if isinstance(fuzzy, dict) else None
    return name if isinstance(name, str) and Path(name).suffix.lower() in FORMATS else None


def load_controller(path: StrPath) -> dict[str, Any]:
    """Read the file of a controller: its ``type`` and parameters, which the scenario checks.

    The path of its fuzzy system becomes relative to the working folder.

    Raises:
        InvalidScenario: The file is missing or malformed, or of another format.
    """
    path = to_path(path)
    data, name = read_yaml(path, "controller", InvalidScenario), one_line(str(path))
    found = data.get("format") if isinstance(data, dict) else None
    if found != FORMAT:
        got = "no format" if found is None else f"format: {short_repr(found)}"
        raise InvalidScenario(f"{name} is no controller file: it has {got}, need format: {FORMAT}")
    values = {key: value for key, value in data.items() if key != "format"}
    if not isinstance(values.get("type"), str):
        raise InvalidScenario(f"{name} needs 'type', the name of a controller")
    moved: dict[str, Any] = _system_moved(values, lambda each: str(path.parent / each))
    return moved


def permitted_controller(path: StrPath, permission: CodePermission) -> dict[str, Any]:
    """Read the file of a controller, whose code needs a permission in any case.

    Raises:
        InvalidScenario: As :func:`load_controller`.
        InvalidInput: Its type is code that is not allowed or cannot be imported.
    """
    values = load_controller(path)
    if is_code(values["type"]):
        try:
            find_component("controllers", values["type"], allow_code=permission)
        except InvalidInput as error:
            raise InvalidInput(f"{one_line(str(path))}: {error}") from None
    return values


def save_controller(controller: Configured, path: StrPath, comments: Sequence[str] = ()) -> None:
    """Write the file of a controller.

    Args:
        controller: The controller.
        path: The file.
        comments: Lines of comments at its beginning.

    Raises:
        CannotWrite: The file cannot be written.
    """
    head = "".join(f"# {one_line(line, 200)}\n" for line in comments)
    data = {"format": FORMAT, **controller.plain()}
    text = head + yaml.dump(data, Dumper=_Dumper, sort_keys=False, width=100)
    with output_file(to_path(path)) as part:
        part.write_text(text, encoding="utf-8")


def files_moved(controllers: Any, move: Callable[[str], str]) -> Any:
    """Return the value of the scenario key ``controllers`` with other names of its files."""

    def moved(value: Any) -> Any:
        """Return the value with the moved names of a controller file and a fuzzy system."""
        return move(value) if is_controller_file(value) else _system_moved(value, move)

    if isinstance(controllers, dict):
        return {label: moved(each) for label, each in controllers.items()}
    return list(map(moved, controllers)) if isinstance(controllers, list) else controllers


def _system_moved(value: Any, move: Callable[[str], str]) -> Any:
    """Return a controller with another name of the file of its fuzzy system."""
    if (name := system_file(value)) is None:
        return value
    return {**value, "fuzzy": {**value["fuzzy"], "file": move(name)}}


def label_of_file(name: str) -> str:
    """Return the label of a controller that is given by its file only: the name of the file."""
    return Path(name).stem


class _Dumper(yaml.SafeDumper):
    """Writes lists of numbers on one line, and texts of several lines as such."""


def _list(dumper: yaml.SafeDumper, data: list[Any]) -> yaml.Node:
    flat = not any(isinstance(each, list | dict) for each in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    style = "|" if "\n" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(list, _list)
_Dumper.add_representer(str, _text)
