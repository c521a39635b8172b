"""``omnidrive new``: files for a controller, plant or robot of one's own."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import typer

from omnidrive.cli.completion import component, one_of
from omnidrive.cli.options import RESULTS_PANEL, choose_one, option
from omnidrive.cli.terminal import show
from omnidrive.components import component_names
from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.files.bounded_file import one_line

if TYPE_CHECKING:
    from omnidrive.robot import Robot

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
    file = out / (f"{module}.yaml" if chosen == "robot" else f"{module}.py")
    test = None if chosen == "robot" else out / f"test_{module}.py"
    for path in filter(None, (file, test)):
        if path.exists():
            raise InvalidInput(f"{path} exists already; choose another name or --out FOLDER")
    if chosen == "robot":
        from omnidrive.robot import named_robot, save_robot

        source = named_robot(like or "small")
    with _write_errors(file):
        out.mkdir(parents=True, exist_ok=True)
        if test is None:
            save_robot(replace(source, name=module), file, notes=_robot_notes(source))
        else:
            file.write_text(_filled(f"{chosen}.py.txt", chosen, class_name, module), "utf-8")
            test.write_text(_filled(f"test_{chosen}.py.txt", chosen, class_name, module), "utf-8")
    for path in filter(None, (file, test)):
        show(f"wrote {path}")
    for command in _TRY[chosen]:
        show(f"  {command.format(file=file, name=class_name, test=test)}")


def _names(name: str) -> tuple[str, str]:
    """Return the name of a class, such as MyLaw, and of its module, such as my_law."""
    class_name = "".join(part[:1].upper() + part[1:] for part in name.split("_"))
    boundary = r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])"
    return class_name, re.sub(boundary, "_", class_name).lower()


def _robot_notes(source: Robot) -> list[str]:
    """Return the comments at the top of a robot file that is a copy of a named robot."""
    kind = "mecanum" if any(mount.roller_angle for mount in source.mounts) else "omni"
    return [
        f"A copy of the robot {source.name}, which has {len(source.mounts)} {kind} wheels; replace "
        "its numbers by those of your robot (docs/robots.md).",
        "`omnidrive robot import` writes such a file from URDF, MJCF or ros2_control parameters.",
    ]


def _filled(template: str, kind: Kind, class_name: str, module: str) -> str:
    """Return a template with the names of the class and of its module."""
    text = (files("omnidrive.cli") / "templates" / template).read_text(encoding="utf-8")
    return text.replace(f"My{kind.capitalize()}", class_name).replace(f"my_{kind}", module)


@contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    """Convert an :class:`OSError` to :class:`CannotWrite`."""
    try:
        yield
    except OSError as error:
        raise CannotWrite(f"cannot write {path}: {error.strerror or error}") from None
