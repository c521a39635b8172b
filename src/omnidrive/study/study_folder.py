"""What the folder of a study holds, read without what is needed to simulate."""

from __future__ import annotations

import json
import shlex
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from omnidrive.components.code import CodePermission
from omnidrive.errors import InvalidStore, one_line
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.study.output_paths import DEFINITION_FILE, STORE_FILE
from omnidrive.study.storage.store import Store

if TYPE_CHECKING:
    from omnidrive.study.design.definition import StudyDefinition
    from omnidrive.study.design.run_plan import RunPlan

SCENARIO_FILE = "scenario.yaml"
"""Name of the scenario in the folder of a study of one scenario, which keeps all logs."""

DESCRIPTIONS = ("name", "question", "repetitions", "series")
"""Keys of a definition that change none of its runs."""

_MAX_WITHIN = 4  # studies in folders of a folder that a message names
_MAX_BYTES = 10_000_000  # of the file that defines a study
_FILE_FACT = "file"  # fact about the study: hash of the file that defines it
_OUTLINE_FACT = "outline"  # fact about the study: JSON of its outline, with the hash of that text


class StudyOutline(NamedTuple):
    """What the status of a study states beside its stored runs."""

    name: str
    """Name of the study."""
    planned: int
    """Number of its runs."""
    names_code: bool
    """Whether it names code."""


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
    from omnidrive.scenario.scenario_file import load_scenario  # noqa: PLC0415
    from omnidrive.study.design.definition import StudyDefinition  # noqa: PLC0415 - takes two seconds
    from omnidrive.study.design.definition_file import load_definition  # noqa: PLC0415

    path = to_path(folder)
    if (path / SCENARIO_FILE).is_file():
        scenario = load_scenario(path / SCENARIO_FILE, allow_code=allow_code)
        if (path / STORE_FILE).is_file():
            with Store(path, read_only=True) as store:
                check_unchanged(store, path / SCENARIO_FILE)
        return StudyDefinition.from_scenario(scenario, series="all"), ""
    if not (path / DEFINITION_FILE).is_file():
        raise InvalidStore(
            f"there is no study in {one_line(str(path))}: no file {DEFINITION_FILE}{_within(path)}"
        )
    definition = load_definition(path / DEFINITION_FILE, allow_code=allow_code)
    if not (path / STORE_FILE).is_file():
        return definition, ""
    with Store(path, read_only=True) as store:
        check_unchanged(store, path / DEFINITION_FILE)
        return definition, store.fact("until") or ""


def _within(folder: Path) -> str:
    """Return a hint to studies in the folders of a folder, such as that of a tuning."""
    found = sorted(each.parent for each in folder.glob(f"*/{DEFINITION_FILE}"))
    if not found:
        return ""
    shown = ", ".join(one_line(str(each)) for each in found[:_MAX_WITHIN])
    return f"; there are studies in {shown}" + (", ..." if len(found) > _MAX_WITHIN else "")


def study_outline(folder: StrPath) -> tuple[StudyOutline, str]:
    """Return the outline of a study and its stop rule as text, or "".

    The store holds the outline of the file that the study had when it was begun or continued; if
    that is another one, it is computed, which takes seconds.

    Raises:
        InvalidStore, InvalidInput: As :func:`load_study`, whose permission is not needed.
    """
    path = to_path(folder)
    file = path / (SCENARIO_FILE if (path / SCENARIO_FILE).is_file() else DEFINITION_FILE)
    if file.is_file() and (path / STORE_FILE).is_file():
        with Store(path, read_only=True) as store:
            stored = _stored_outline(store, file)
            if stored is not None:
                return stored, store.fact("until") or ""
    from omnidrive.study.design.run_plan import RunPlan  # noqa: PLC0415

    definition, until = load_study(path, allow_code=CodePermission.UNREAD)
    return _outline(RunPlan(definition)), until


def _stored_outline(store: Store, file: Path) -> StudyOutline | None:
    """Return the outline in a store; None: there is none for the present bytes of the file."""
    try:
        name, planned, names_code, content = json.loads(store.fact(_OUTLINE_FACT) or "[]")
    except (ValueError, TypeError, RecursionError):
        return None
    types = isinstance(name, str) and type(planned) is int and isinstance(names_code, bool)
    if not types or planned < 1 or content != _bytes_hash(file):
        return None
    return StudyOutline(name, planned, names_code)


def _outline(plan: RunPlan) -> StudyOutline:
    definition = plan.definition
    return StudyOutline(definition.name, len(plan), definition.names_code)


def note_file(store: Store, file: Path, plan: RunPlan) -> None:
    """Store the hash of the file that defines a study, and the outline of the study.

    Descriptions and comments do not count in the hash.

    Args:
        store: The store.
        file: The file.
        plan: Its runs.

    Raises:
        InvalidStore: The file cannot be read.
        CannotWrite: The facts cannot be stored.
    """
    store.note(_FILE_FACT, _file_hash(file))
    content = _bytes_hash(file)
    store.note(_OUTLINE_FACT, json.dumps([*_outline(plan), content]))


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


def _bytes_hash(file: Path) -> str:
    """Return the SHA-256 of a file."""
    content = read_bounded(file, _MAX_BYTES, "study", InvalidStore, excess="is too large")
    return sha256(content).hexdigest()


def _file_hash(file: Path) -> str:
    """Return the SHA-256 of the values in a YAML file that determine runs."""
    data = read_yaml(file, "study", InvalidStore)
    kept = {k: v for k, v in data.items() if k not in DESCRIPTIONS} if isinstance(data, dict) else 0
    return sha256(json.dumps(kept, sort_keys=True, default=str).encode()).hexdigest()
