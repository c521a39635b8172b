"""Former names and sections of scenarios, which are still accepted."""

from __future__ import annotations

import re
import warnings
from typing import Any

from omnidrive.components.configured import permission_in
from omnidrive.errors import short_repr
from omnidrive.study.controller_file import (
    is_controller_file,
    label_of_file,
    permitted_controller,
)
from omnidrive.study.section import Renamed, current_name

OLD_CONTROLLERS = {"nmpc": "unicycle-nmpc", "recommended": "holonomic-nmpc"}
"""Former and present names of controllers."""
OLD_PLANTS = {"rollers": "mujoco-rollers", "ball": "mujoco-balls"}
"""Former and present names of plants."""

_LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,39}")
_NMPCS = ("unicycle-nmpc", "holonomic-nmpc")
_CONTROLLER_SECTIONS = {
    "nmpc": _NMPCS,
    "feedforward": ("feedforward",),
    "holonomic_nmpc": ("holonomic-nmpc",),
    "recommended": ("holonomic-nmpc",),
}
"""Former sections of scenarios, and the controllers whose parameters they hold."""
_SCENE = "coppeliasim"  # former section of the plant of this name


def by_label(value: Any, info: Any) -> Any:
    """Return controllers by label; a list of names becomes a mapping, and files are read.

    Args:
        value: Value of the scenario key ``controllers``.
        info: Pydantic's, with the permission to import code: files need it, whoever names them.

    Raises:
        ValueError: Two labels are alike, also if they differ in case only, or a file is invalid.
    """
    if isinstance(value, list | tuple):
        if not all(isinstance(item, str) for item in value):
            raise ValueError("must be names, or a mapping of labels to controllers")
        names = [current_name(item, OLD_CONTROLLERS) for item in value]
        labels = [label_of_file(each) if is_controller_file(each) else each for each in names]
        named = list(zip(labels, [_current(each, info) for each in names], strict=True))
    elif isinstance(value, dict):
        named = [(label, _current(each, info)) for label, each in value.items()]
    else:
        return value
    for label, _ in named:
        if not (isinstance(label, str) and _LABEL.fullmatch(label)):
            raise ValueError(
                f"contains the label {short_repr(label)}, need letters, digits, '_', '.', '+' or "
                "'-', at most 40"
            )
    labels = [label.lower() for label, _ in named]
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise ValueError(f"contains the label '{twice[0]}' twice")
    return dict(named)


def _current(controller: Any, info: Any) -> Any:
    """Return a controller with the present name of its type; that of a file is read."""
    if is_controller_file(controller):
        controller = permitted_controller(controller, permission_in(info, default=False))
    if isinstance(controller, dict) and "type" in controller:
        return controller | {"type": current_name(controller["type"], OLD_CONTROLLERS)}
    return current_name(controller, OLD_CONTROLLERS)


def without_former_sections(data: dict[Any, Any], info: Any) -> dict[Any, Any]:
    """Move the values of former sections to the controllers and the plant that they configure."""
    found = {name: data[name] for name in (*_CONTROLLER_SECTIONS, _SCENE) if name in data}
    if not found:
        return data
    result = {key: value for key, value in data.items() if key not in found}
    controllers = result["controllers"] = by_label(data.get("controllers"), info)
    for section, values in found.items():
        if not isinstance(values, dict):
            raise ValueError(f"{section} must be a mapping, got {short_repr(values)}")  # noqa: TRY004
        if section == _SCENE and data.get("plant") == _SCENE:
            result["plant"] = {"type": _SCENE, **values}
            _note(section, f"plant: {{type: {_SCENE}, host: ...}}")
        types = _CONTROLLER_SECTIONS.get(section, ())
        for label, each in controllers.items() if isinstance(controllers, dict) else ():
            own = {"type": each} if isinstance(each, str) else each
            if isinstance(own, dict) and own.get("type") in types and values:
                controllers[label] = values | own
                _note(section, f"controllers: {{{label}: {{type: {own['type']}, ...}}}}")
    return result


def _note(section: str, present: str) -> None:
    warnings.warn(
        f"the values of '{section}' belong to what they configure; write {present}",
        Renamed,
        stacklevel=4,
    )
