"""``omnidrive new``: files for a controller or plant of one's own."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal, get_args

import typer

from omnidrive.cli.options import RESULTS_PANEL, choose_one, option
from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.files.bounded_file import one_line

Kind = Literal["controller", "plant"]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_TRY = {
    "controller": "omnidrive compare --controller {file}:{name} --controller holonomic-nmpc",
    "plant": "omnidrive run --plant {file}:{name} --controller feedforward",
}


def new(
    kind: Annotated[str, typer.Argument(help=f"{', '.join(get_args(Kind))}.", metavar="KIND")],
    name: Annotated[str, typer.Argument(help="Name of the class, such as MyController.")],
    out: Annotated[
        Path, option("FOLDER", "Folder of the new files.", RESULTS_PANEL, "--out")
    ] = Path(),
) -> None:
    """Write a commented, runnable file with a controller or plant, and a test of its laws.

    For example:

    * `omnidrive new controller MyController`
    * `omnidrive new plant MyPlant --out my_project`
    """
    chosen = choose_one("kind", kind, get_args(Kind))
    if not _NAME.fullmatch(name):
        raise InvalidInput(
            f"'{one_line(name, 60)}' cannot be the name of a class; use letters, digits and "
            "underscores, at most 40, such as MyController"
        )
    class_name = "".join(part[:1].upper() + part[1:] for part in name.split("_"))
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", class_name).lower()
    paths = {
        out / f"{module}.py": f"{chosen}.py.txt",
        out / f"test_{module}.py": f"test_{chosen}.py.txt",
    }
    existing = [path for path in paths if path.exists()]
    if existing:
        raise InvalidInput(f"{existing[0]} exists already; choose another name or --out FOLDER")
    for path, template in paths.items():
        text = (files("omnidrive.cli") / "templates" / template).read_text(encoding="utf-8")
        text = text.replace(f"My{chosen.capitalize()}", class_name)
        _write(path, text.replace(f"my_{chosen}", module))
        typer.echo(f"wrote {path}")
    file = out / f"{module}.py"
    typer.echo(f"try it:   {_TRY[chosen].format(file=file, name=class_name)}")
    typer.echo(f"test it:  python -m pytest {out / f'test_{module}.py'}")


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CannotWrite(f"cannot write {path}: {error.strerror or error}") from None
