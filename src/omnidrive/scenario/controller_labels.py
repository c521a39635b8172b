"""Controllers of a scenario by their labels."""

from __future__ import annotations

import re
from typing import Any

from omnidrive.components.configured import permission_in
from omnidrive.errors import short_repr
from omnidrive.scenario.controller_file import (
    is_controller_file,
    label_of_file,
    permitted_controller,
)

_LABEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,39}")


def by_label(value: Any, info: Any) -> Any:
    """Return controllers by label; a list of names becomes a mapping, and files are read.

    Args:
        value: Value of the scenario key ``controllers``.
        info: Pydantic's, with the permission to import code, which files always need.

    Raises:
        ValueError: Two labels are alike, also if they differ in case only, or a file is invalid.
    """
    if isinstance(value, list | tuple):
        if not all(isinstance(item, str) for item in value):
            raise ValueError("must be names, or a mapping of labels to controllers")
        labels = [label_of_file(each) if is_controller_file(each) else each for each in value]
        named = list(zip(labels, [_read(each, info) for each in value], strict=True))
    elif isinstance(value, dict):
        named = [(label, _read(each, info)) for label, each in value.items()]
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


def _read(controller: Any, info: Any) -> Any:
    """Return a controller; that of a file is read."""
    if is_controller_file(controller):
        return permitted_controller(controller, permission_in(info, default=False))
    return controller
