"""``omnidrive new``: files for a controller, plant or robot of one's own."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.resources import files
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from shlex import quote
from typing import Annotated, Literal, get_args

import typer

from omnidrive.cli.completion import component, one_of
from omnidrive.cli.options import RESULTS_PANEL, choose_one, option
from omnidrive.cli.terminal import show
from omnidrive.components import component_names
from omnidrive.errors import InvalidInput, one_line
from omnidrive.files.output_file import output_file

Kind = Literal["controller", "plant", "robot"]
_KindArgument = Annotated[
    str,
    typer.Argument(
        help=f"{', '.join(get_args(Kind))}.",
        metavar="KIND",
        autocompletion=one_of(get_args(Kind)),
    ),
]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_TRY: dict[Kind, tuple[str, ...]] = {
    "controller": (
        "omnidrive compare --controller {file}:{name} --controller holonomic-nmpc",
        "python {test}",
    ),
    "plant": (
        "omnidrive run --plant {file}:{name} --controller feedforward",
        "python {test}",
    ),
    "robot": ("omnidrive robot show {file}", "omnidrive compare --robot {file}"),
}
"""Commands that use the written files."""


def new(
    kind: _KindArgument,
    name: Annotated[
        str, typer.Argument(help="Name of the class, such as MyController, or of the robot.")
    ],
    out: Annotated[
        Path, option("FOLDER", "Folder of the new files.", RESULTS_PANEL, "--out")
    ] = Path(),
    like: Annotated[
        str | None,
        option(
            "ROBOT",
            f"Robot that a robot file is copied from: {', '.join(component_names('robots'))} "
            "[default: small].",
            RESULTS_PANEL,
            complete=component("robots"),
        ),
    ] = None,
) -> None:
    """Write a commented, runnable file with a controller, plant or robot of your own.

    A controller or plant comes with a test of its laws.

    For example:

    * `omnidrive new controller MyController`
    * `omnidrive new plant MyPlant --out my_project`
    * `omnidrive new robot my_base --like mecanum`
    """
    chosen: Kind = choose_one("kind", kind, get_args(Kind))
    if not _NAME.fullmatch(name):
        raise InvalidInput(
            f"'{one_line(name, 60)}' cannot be used as a name; use letters, digits and "
            "underscores, at most 40, such as MyController"
        )
    if like is not None and chosen != "robot":
        raise InvalidInput(f"--like: not for a {chosen}, only for a robot")
    class_name, module = _names(name)
    texts = {out / file: text for file, text in _texts(chosen, class_name, module, like).items()}
    for path in texts:
        if path.exists():
            raise InvalidInput(f"{path} exists already; choose another name or --out FOLDER")
    if chosen != "robot" and (iskeyword(module) or find_spec(module) is not None):
        raise InvalidInput(
            f"'{module}' is a Python keyword or the name of an installed module, which {module}.py "
            f"would hide; use another name, such as My{class_name}"
        )
    for path, text in texts.items():
        with output_file(path) as part:
            out.mkdir(parents=True, exist_ok=True)
            part.write_text(text, encoding="utf-8")
        show(f"wrote {path}")
    file, *tests = texts
    for command in _TRY[chosen]:
        test = quote("".join(map(str, tests)))
        show(f"  {command.format(file=quote(str(file)), name=class_name, test=test)}")


def _names(name: str) -> tuple[str, str]:
    """Return the name of a class, such as MyLaw, and of its module, such as my_law."""
    class_name = "".join(part[:1].upper() + part[1:] for part in name.split("_"))
    boundary = r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])"
    return class_name, re.sub(boundary, "_", class_name).lower()


def _texts(kind: Kind, class_name: str, module: str, like: str | None) -> dict[str, str]:
    """Return the contents of the new files by name; of a controller or plant the test is last."""
    if kind == "robot":
        return {f"{module}.yaml": _robot_file(like or "small", module)}
    return {
        f"{module}.py": _filled(f"{kind}.py.txt", kind, class_name, module),
        f"test_{module}.py": _filled(f"test_{kind}.py.txt", kind, class_name, module),
    }


def _robot_file(like: str, name: str) -> str:
    """Return the content of a robot file that is a copy of a named robot under another name."""
    from omnidrive.robot import named_robot
    from omnidrive.robot.robot_file import robot_text

    source = named_robot(like)
    kind = "mecanum" if any(mount.is_mecanum for mount in source.mounts) else "omni"
    notes = (
        f"A copy of the robot {source.name}, which has {len(source.mounts)} {kind} wheels; replace "
        "its numbers by those of your robot (docs/robots.md).",
        "`omnidrive robot import` writes such a file from URDF, MJCF or ros2_control parameters.",
    )
    return robot_text(replace(source, name=name), notes=notes)


def _filled(template: str, kind: Kind, class_name: str, module: str) -> str:
    """Return a template with the names of the class and of its module."""
    text = (files("omnidrive.cli") / "templates" / template).read_text(encoding="utf-8")
    return text.replace(f"My{kind.capitalize()}", class_name).replace(f"my_{kind}", module)
