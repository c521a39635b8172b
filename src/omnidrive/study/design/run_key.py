"""Keys of runs: hashes of all that their results depend on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache, lru_cache
from hashlib import sha256
from importlib.metadata import version
from json import dumps, loads
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4
from weakref import WeakKeyDictionary

import numpy as np

from omnidrive.choices import WAYPOINTS
from omnidrive.components import find_component
from omnidrive.components.code import NO_FILE
from omnidrive.components.entry_points import Group
from omnidrive.components.fields import plain
from omnidrive.errors import InvalidFuzzyFile, InvalidReference, OmnidriveError
from omnidrive.execution.versions import VERSIONS
from omnidrive.files.bounded_file import read_bounded
from omnidrive.maps import load_map
from omnidrive.scenario.controller_file import system_file
from omnidrive.scenario.run_settings import RunSettings
from omnidrive.scenario.scenario_path import CODE_SECTIONS
from omnidrive.scenario.variant import robot_in

_LEFT_OUT = ("format", "name", "tasks", "controllers", "seed", "plant_robot")
_MAX_BYTES = 10_000_000  # of a waypoint file or a fuzzy system


_PLANNED_BY = ("reference", "map", "start", "goal", "path", "timing", "robot")


class PlanKeys(NamedTuple):
    """Keys of what runs share: hashes of settings and of the content of files."""

    motion: str = ""
    """Of the planned motion."""
    plant_robot: str = ""
    """Of the simulated robot."""


class KeyMaker:
    """Maker of the keys of the runs of one study.

    A key is the SHA-256 of a canonical text of the scenario without its name, its tasks and its
    other controllers, the configuration of the controller, the run, the versions of this package
    and of numerical libraries, and the origins of components. Robots, maps, waypoint files and
    fuzzy systems count by their content, not by their names.
    """

    def __init__(self) -> None:
        self._texts: dict[str, tuple[Any, str]] = {}
        self._read_text = lru_cache(maxsize=256)(_section_text)
        self._versions = _versions()

    def scenario_text(self, data: Mapping[str, Any]) -> str:
        """Return the text of what all runs of a scenario have in common."""
        parts = [self._versions]
        for name in sorted(data):
            if name not in _LEFT_OUT:
                parts.append(self._text(name, data[name]))
        true = data["plant_robot"] or data["robot"]
        return "\n".join([*parts, self._text("plant_robot", true), str(data["seed"])])

    def plan_keys(self, data: Mapping[str, Any]) -> PlanKeys:
        """Return the keys of the motion and of the simulated robot of a scenario."""
        motion = "\n".join(self._text(name, data[name]) for name in _PLANNED_BY)
        robot = self._text("plant_robot", data["plant_robot"] or data["robot"])
        return PlanKeys(*(sha256(text.encode()).hexdigest() for text in (motion, robot)))

    def key(
        self,
        scenario_text: str,
        controller: Mapping[str, Any],
        settings: RunSettings,
        parts: Mapping[str, Any],
    ) -> str:
        """Return the key of a run.

        Args:
            scenario_text: Text of its scenario.
            controller: Data of its controller.
            settings: The run.
            parts: Further data of the task, such as the fault.
        """
        own = self._text(f"controllers.{settings.controller}", controller)
        text = "\n".join([scenario_text, own, _canonical([*settings[:-1], plain(dict(parts))])])
        return sha256(text.encode()).hexdigest()

    def _text(self, name: str, value: Any) -> str:
        """Return the text of a section; that of the same object is kept."""
        found = self._texts.get(name)
        if found is None or found[0] is not value:
            text = self._read_text(name.partition(".")[0], dumps(value))
            found = self._texts[name] = value, f"{name}: {text}"
        return found[1]


@cache
def _versions() -> str:
    """Return the versions of the packages that affect results."""
    return dumps({name: version(name) for name in VERSIONS})


def _section_text(head: str, data: str) -> str:
    """Return the text of a section from its data as JSON; files and code are read."""
    value = loads(data)
    if head in {"robot", "plant_robot"}:
        return _robot_text(value)
    if head == "map":
        return _map_text(value)
    if head == "reference" and isinstance(value, dict) and value["type"] == WAYPOINTS:
        value["file"] = _content(value["file"], "waypoint", InvalidReference)
    if head == "controllers":
        if (name := system_file(value)) is not None:
            value["fuzzy"]["file"] = _content(name, "fuzzy system", InvalidFuzzyFile)
        elif isinstance(fuzzy := value.get("fuzzy"), dict) and isinstance(fuzzy.get("file"), dict):
            fuzzy["file"]["name"] = Path(str(fuzzy["file"].get("name"))).suffix.lower()
    component = value and value["estimator"] if head == "sensors" else value
    text = _canonical(value)
    if head in CODE_SECTIONS and isinstance(component, dict):
        text += _origin(CODE_SECTIONS[head], component["type"])
    return text


def _canonical(value: Any) -> str:
    return dumps(value, sort_keys=True, separators=(",", ":"))


def _robot_text(section: dict[str, Any]) -> str:
    """Return the text of a robot, whatever its name or file."""
    content = plain(robot_in(section))
    content.pop("name")
    return _canonical([content, section["roller_phase"]])


def _map_text(section: dict[str, Any]) -> str:
    """Return the text of a map with the digest of its cells."""
    source = section.pop("source")
    if source == "none":
        return _canonical([source, section])
    options = {"resolution": section["resolution"], "unknown": section["unknown"]}
    try:
        grid = load_map(source, **options)
    except OmnidriveError as error:  # the run reports it
        return _canonical([source, section, str(error)])
    cells = sha256(np.packbits(grid.occupied).tobytes()).hexdigest()
    shape = list(grid.occupied.shape)
    place = [cells, shape, grid.resolution, list(grid.origin), grid.walled, grid.yaw]
    rest = {key: each for key, each in section.items() if key not in options}
    # the paper's map is planned on and measured with two different grids
    return _canonical([place, source if source == "paper" else "", rest])


def _content(file: str, kind: str, error: type[OmnidriveError]) -> list[str]:
    """Return the digest of a file, and its suffix, which selects the format; not its name."""
    content = read_bounded(Path(file), _MAX_BYTES, kind, error, excess="is too large")
    return [sha256(content).hexdigest(), Path(file).suffix.lower()]


def _origin(group: Group, name: str) -> str:
    """Return distribution and version of a component, or the hash of its code, as a text.

    An object of a session has no code in a file: another object of the same name is another one.
    """
    try:
        component = find_component(group, name, allow_code=False)
    except OmnidriveError:  # code that was not imported
        return f" {name}"
    if component.origin.endswith(NO_FILE):
        return f" {_session_keys.setdefault(component.factory, uuid4().hex)}"
    return f" {component.origin}"


_session_keys: WeakKeyDictionary[Any, str] = WeakKeyDictionary()


def plan_digest(keys: Iterable[str]) -> str:
    """Return the SHA-256 of the keys of many runs, in their order."""
    digest = sha256()
    for key in keys:
        digest.update(bytes.fromhex(key))
    return digest.hexdigest()
