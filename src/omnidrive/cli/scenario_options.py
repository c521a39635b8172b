"""Scenario that the options which several verbs share define."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Any, get_args, get_type_hints

from omnidrive import scenario as scenarios
from omnidrive.choices import WAYPOINTS, PresetName
from omnidrive.cli.components import plant_data, reference_data
from omnidrive.cli.input_kind import check_map_name, input_kind
from omnidrive.cli.option_fields import OptionFields
from omnidrive.cli.options import choose_one, parse_coordinates, parse_waypoint
from omnidrive.errors import InvalidInput

_COST_OPTIONS = ("keepout", "speed_mask", "cost_radius", "cost_scaling", "cost_weight")
_PATH_OPTIONS = (
    "goal", "search", "cut_corners", "smooth", "timing", "heading", "max_jerk",
    "max_curvature", "max_curvature_rate", *_COST_OPTIONS
)  # fmt: skip
"""Options for planned paths only."""
_KEYS = {
    "search": "path.search", "cut_corners": "path.cut_corners", "smooth": "path.smooth",
    "timing": "timing.law", "heading": "timing.heading", "margin": "map.margin",
    "unknown": "map.unknown", "resolution": "map.resolution", "max_speed": "timing.max_speed",
    "max_jerk": "timing.max_jerk", "max_curvature": "path.max_curvature",
    "max_curvature_rate": "path.max_curvature_rate",
    "keepout": "costs.keepout", "speed_mask": "costs.speed", "cost_radius": "costs.radius",
    "cost_scaling": "costs.scaling", "cost_weight": "costs.weight",
}  # fmt: skip
"""Scenario key of each option that sets a single key."""


@dataclass(frozen=True, slots=True)
class ScenarioOptions(OptionFields):
    """Values of the shared options, and the scenario that they define."""

    @property
    def map_file(self) -> Path | None:
        """Map file given as argument or by ``--map``; None: no map file."""
        kind = self._kind
        if self.map is not None and kind in {"map", "scenario"}:
            raise InvalidInput(
                "a scenario or map argument and --map exclude each other; give one of them"
            )
        return Path(self.scenario) if kind == "map" else self.map

    @property
    def defines_motion(self) -> bool:
        """Whether the options name a motion that is not a planned path."""
        return self._motion not in (None, {"type": "path"})

    @property
    def _moves_without_scenario(self) -> bool:
        """Whether there is a motion that is not a planned path, but no scenario file."""
        return self.defines_motion and self._kind != "scenario"

    @property
    def _kind(self) -> str:
        """Kind of the argument: paper, scenario, map or waypoints."""
        return "paper" if self.scenario == "paper" else input_kind(Path(self.scenario))

    @property
    def _motion(self) -> dict[str, Any] | None:
        """Value of the scenario key `reference`; None: that of the scenario."""
        if self._kind != "waypoints":
            motion = None if self.reference is None else reference_data(self.reference)
            is_file = motion is not None and motion["type"] == WAYPOINTS
            return {**(motion or {}), **self._table_heading} if is_file else motion
        if self.reference is not None:
            raise InvalidInput(
                "a waypoint file as the argument and --reference exclude each other; give one of "
                "them"
            )
        return {"type": WAYPOINTS, "file": self.scenario, **self._table_heading}

    @property
    def _table_heading(self) -> dict[str, str]:
        """Parameter of a waypoint file for ``--heading``."""
        return {} if self.heading is None else {"heading": self.heading}

    def resolve(self, *, retimed: bool = True) -> scenarios.Scenario:
        """Return the scenario defined by the options.

        Args:
            retimed: Adapt the durations of the tasks to the path if the user defines the path.

        Raises:
            OmnidriveError: The options contradict each other or name something that does not
                exist.
        """
        from omnidrive.planning import Waypoint
        from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
        from omnidrive.scenario.scenario_path import allow_named

        preset = (
            choose_one("preset", self.preset, get_args(PresetName))
            if self.preset is not None
            else None
        )
        scenario = self._base(preset)
        present = scenario.reference
        changes: dict[str, object] = {}
        motion, on_map = self._motion, self.map_file is not None
        if motion is not None:
            changes["reference"] = motion
        if self.start is not None:
            changes["start"] = Waypoint(*parse_waypoint("start", self.start))
        if self.goal is not None:
            changes["goal"] = Waypoint(*parse_waypoint("goal", self.goal))
        if self.plant is not None:
            changes["plant"] = plant_data(self.plant, scenario.plant)
        if self.robot is not None and not (on_map or self._moves_without_scenario):
            changes["robot"] = scenarios.robot_section(self.robot, preset or scenario.preset)
        elif preset:
            radius = scenarios.robot_section(scenario.robot.name, preset).assumed_effective_radius
            changes["robot"] = scenario.robot.model_copy(
                update={"assumed_effective_radius": radius}
            )
        if preset:
            changes["preset"] = preset
        if self.seed is not None:
            changes["seed"] = self.seed
        if self.estimator is not None:
            changes["sensors"] = (
                (scenario.sensors or scenarios.SensorsSection()) if self.estimator else None
            )
        scenario = scenario.model_copy(update=changes)
        for name in ("plant", "reference"):
            allow_named(name, changes.get(name))
        data = self._with_keys(scenario_data(scenario))
        scenario = parse_scenario(data, "with these options")
        self._check_path_options(scenario)
        given = self.duration is not None or self.speed is not None
        if retimed and (on_map or given or scenario.reference != present):
            return scenarios.retime(scenario, duration=self.duration, speed=self.speed)
        return scenarios.lengthen(scenario) if retimed and self.max_speed is not None else scenario

    def _check_path_options(self, scenario: scenarios.Scenario) -> None:
        """Raise InvalidInput if an option has no effect on the scenario's reference."""
        if scenario.reference == "path":
            return
        is_file = scenario.reference.type == WAYPOINTS
        names = [*_PATH_OPTIONS, "start"] if is_file else [*_PATH_OPTIONS]
        if is_file and self._motion is not None:
            names.remove("heading")
        unused = [f"--{n.replace('_', '-')}" for n in names if getattr(self, n) is not None]
        if unused:
            raise InvalidInput(
                f"{', '.join(unused)}: not for the reference {scenario.reference.type}, only for a "
                "planned path"
            )

    def _with_keys(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the scenario data with the options of ``_KEYS`` applied."""
        of_table = self._motion is not None and self._motion["type"] == WAYPOINTS
        for field, key in _KEYS.items():
            value = None if field == "heading" and of_table else getattr(self, field)
            if field == "heading" and value is not None:
                data["timing"] |= _heading(value)
            elif value is not None:
                section, name = key.split(".")
                if data[section] is None:
                    data[section] = {}
                data[section][name] = str(value) if isinstance(value, Path) else value
        asked = any(getattr(self, name) is not None for name in _COST_OPTIONS)
        if self.search not in (None, "astar") and not asked:
            data["costs"] = None  # only astar has costs
        return data

    def _base(self, preset: PresetName | None) -> scenarios.Scenario:
        """Return the scenario of the arguments, to which the other options apply."""
        from omnidrive.planning import Waypoint

        file = self.map_file
        if self._moves_without_scenario:
            motion = self._motion or {}
            name = Path(str(motion.get("file", motion["type"]))).stem
            origin = Waypoint(0.0, 0.0)
            scenario = scenarios.map_scenario(
                "none" if file is None else str(file),
                origin,
                origin,
                robot=self.robot or "paper",
                name=_scenario_name(name),
                preset=preset or "paper",
            )
            return scenario.model_copy(update={"start": None, "goal": None})
        if file is not None:
            if self.start is None or self.goal is None:
                check_map_name(file)
                raise InvalidInput("a map needs --start X,Y and --goal X,Y (m, in the map frame)")
            return scenarios.map_scenario(
                str(file),
                Waypoint(*parse_waypoint("start", self.start)),
                Waypoint(*parse_waypoint("goal", self.goal)),
                robot=self.robot or "paper",
                name=_scenario_name(file.stem),
                preset=preset or "paper",
            )
        if self.scenario == "paper":
            return scenarios.paper_scenario(preset or "paper")
        path = Path(self.scenario)
        file = path / "scenario.yaml" if os.path.isdir(path) else path
        return scenarios.load_scenario(file, allow_code=self.allow_code)


def _heading(text: str) -> dict[str, Any]:
    """Return the keys of the section `timing` for a value of ``--heading``.

    Raises:
        InvalidInput: It is ``face`` without a point.
    """
    name, _, point = text.partition(":")
    if name != "face":
        return {"heading": text, "target": None}
    numbers = parse_coordinates(point)
    if len(numbers) != 2:
        raise InvalidInput(f"--heading {text}: a point is needed, such as face:3.5,2 (m)")
    return {"heading": name, "target": numbers}


def with_options(*left_out: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add the fields of :class:`ScenarioOptions` as options to a verb with a parameter ``shared``.

    typer creates options from the signature of a verb: the fields are inserted before its own
    parameters.

    Args:
        left_out: Fields that are not options of this verb.
    """
    hints = get_type_hints(ScenarioOptions, include_extras=True)
    shared_parameters = [
        Parameter(
            field.name, Parameter.KEYWORD_ONLY, default=field.default, annotation=hints[field.name]
        )
        for field in fields(ScenarioOptions)
        if field.name not in left_out
    ]

    def decorate(verb: Callable[..., None]) -> Callable[..., None]:
        """Return the verb with an argument for each shared option instead of ``shared``."""
        own = [
            parameter.replace(kind=Parameter.KEYWORD_ONLY)
            for parameter in signature(verb, eval_str=True).parameters.values()
            if parameter.name != "shared"
        ]

        @wraps(verb)
        def command(**given: Any) -> None:
            """Collect the shared options and call the verb; ``wraps`` replaces this text."""
            shared = ScenarioOptions(
                **{each.name: given.pop(each.name) for each in shared_parameters}
            )
            verb(shared=shared, **given)

        command.__signature__ = Signature([*shared_parameters, *own])  # type: ignore[attr-defined]
        return command

    return decorate


def _scenario_name(text: str) -> str:
    """Return ``text`` as a valid scenario name."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "_.-") else "_" for c in text)
    return plain.lstrip("_.-")[:60] or "map"
