"""What the folder of a study holds, read without what is needed to simulate."""

from __future__ import annotations

import shlex

from omnidrive.components.code import CodePermission
from omnidrive.errors import InvalidStore, one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.definition_file import load_definition
from omnidrive.study.output_paths import STORE_FILE
from omnidrive.study.scenario_file import load_scenario
from omnidrive.study.store import Store

DEFINITION_FILE = "study.yaml"
"""Name of the definition in the folder of a study."""

SCENARIO_FILE = "scenario.yaml"
"""Name of the scenario in the folder of a study of one scenario, which keeps all logs."""


def resume_command(folder: StrPath, *, allow_code: bool) -> str:
    """Return the command that continues the study in a folder, quoted for a shell.

    Args:
        folder: The folder.
        allow_code: Whether the study names code.
    """
    words = ["omnidrive", "study", "resume", str(to_path(folder))]
    return shlex.join([*words, "--allow-code"] if allow_code else words)


def load_study(
    folder: StrPath, *, allow_code: bool | CodePermission = False
) -> tuple[StudyDefinition, str]:
    """Return the definition in the folder of a study, and its stop rule as text, or "".

    Args:
        folder: The folder.
        allow_code: See :func:`~omnidrive.study.load_definition`.

    Raises:
        InvalidStore: The folder holds no study, or a damaged one.
        InvalidInput: The definition, or the scenario of a study of one scenario, is invalid.
    """
    path = to_path(folder)
    if (path / SCENARIO_FILE).is_file():
        scenario = load_scenario(path / SCENARIO_FILE, allow_code=allow_code)
        return StudyDefinition.from_scenario(scenario, series="all"), ""
    if not (path / DEFINITION_FILE).is_file():
        raise InvalidStore(f"there is no study in {one_line(str(path))}: no file {DEFINITION_FILE}")
    definition = load_definition(path / DEFINITION_FILE, allow_code=allow_code)
    if not (path / STORE_FILE).is_file():
        return definition, ""
    with Store(path, read_only=True) as store:
        return definition, store.fact("until") or ""
