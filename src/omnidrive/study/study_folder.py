"""What the folder of a study holds, read without what is needed to simulate."""

from __future__ import annotations

import json
import shlex
from hashlib import sha256
from pathlib import Path

from omnidrive.components.code import CodePermission
from omnidrive.errors import InvalidStore, one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.definition_file import load_definition
from omnidrive.study.output_paths import STORE_FILE
from omnidrive.study.scenario_file import load_scenario
from omnidrive.study.store import Store

DEFINITION_FILE = "study.yaml"
"""Name of the definition in the folder of a study."""

SCENARIO_FILE = "scenario.yaml"
"""Name of the scenario in the folder of a study of one scenario, which keeps all logs."""


DESCRIPTIONS = ("name", "question", "repetitions", "series")
"""Keys of a definition that change none of its runs."""

_FILE_FACT = "file"  # fact about the study: hash of the file that defines it


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
        InvalidStore: The folder holds no study, a damaged one, or one whose definition or scenario
            was changed after its runs were computed.
        InvalidInput: The definition, or the scenario of a study of one scenario, is invalid.
    """
    path = to_path(folder)
    if (path / SCENARIO_FILE).is_file():
        scenario = load_scenario(path / SCENARIO_FILE, allow_code=allow_code)
        if (path / STORE_FILE).is_file():
            with Store(path, read_only=True) as store:
                check_unchanged(store, path / SCENARIO_FILE)
        return StudyDefinition.from_scenario(scenario, series="all"), ""
    if not (path / DEFINITION_FILE).is_file():
        raise InvalidStore(f"there is no study in {one_line(str(path))}: no file {DEFINITION_FILE}")
    definition = load_definition(path / DEFINITION_FILE, allow_code=allow_code)
    if not (path / STORE_FILE).is_file():
        return definition, ""
    with Store(path, read_only=True) as store:
        check_unchanged(store, path / DEFINITION_FILE)
        return definition, store.fact("until") or ""


def note_file(store: Store, file: Path) -> None:
    """Store the hash of the file that defines a study; descriptions and comments do not count.

    Raises:
        InvalidStore: The file cannot be read.
        CannotWrite: The hash cannot be stored.
    """
    store.note(_FILE_FACT, _file_hash(file))


def check_unchanged(store: Store, file: Path) -> None:
    """Check the file that defines a study against the hash of :func:`note_file`.

    Raises:
        InvalidStore: The file cannot be read, or was changed after the runs were computed.
    """
    if store.fact(_FILE_FACT) not in {None, _file_hash(file)}:
        verb = "compare" if file.name == SCENARIO_FILE else "study"
        again = shlex.join(["omnidrive", verb, str(file), "--out", "FOLDER"])
        raise InvalidStore(
            f"{one_line(str(file))} was changed after its runs were computed; restore it, or "
            f"compute the changed study in another folder: {one_line(again)}"
        )


def _file_hash(file: Path) -> str:
    """Return the SHA-256 of the values in a YAML file that determine runs."""
    data = read_yaml(file, "study", InvalidStore)
    kept = {k: v for k, v in data.items() if k not in DESCRIPTIONS} if isinstance(data, dict) else 0
    return sha256(json.dumps(kept, sort_keys=True, default=str).encode()).hexdigest()
