"""``omnidrive schema``: JSON schemas of input files."""

from __future__ import annotations

from typing import Annotated

import typer

from omnidrive.cli.completion import one_of
from omnidrive.cli.options import choose_one
from omnidrive.cli.terminal import print_json

_KINDS = ("scenario", "robot")


def schema(
    kind: Annotated[
        str, typer.Argument(help="`scenario` or `robot`.", autocompletion=one_of(_KINDS))
    ] = "scenario",
) -> None:
    """Print the JSON schema of scenario or robot files, for editors.

    Editors with a YAML language server complete and check a file that names the schema in its first
    line: `# yaml-language-server: $schema=scenario.json`.

    For example:

    * `omnidrive schema > scenario.json`
    * `omnidrive schema robot > robot.json`
    """
    if choose_one("kind of file", kind, _KINDS) == "robot":
        from omnidrive.robot.robot_file import robot_schema

        print_json(robot_schema())
    else:
        from omnidrive.scenario.schema import scenario_schema

        print_json(scenario_schema())
