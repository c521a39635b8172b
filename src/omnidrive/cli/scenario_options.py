"""Options that several verbs share, and the scenario that they define."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer

from omnidrive.choices import Heading, MethodName, PresetName, SmoothingName, TimingName, Unknown
from omnidrive.cli.components import plant_data
from omnidrive.cli.options import (
    PATH_PANEL,
    RUN_PANEL,
    choice,
    choose_one,
    flag,
    option,
    parse_coordinates,
)
from omnidrive.errors import InvalidInput
from omnidrive.planning import Waypoint
from omnidrive.robot import ROBOTS
from omnidrive.study import (
    Scenario,
    SensorsSection,
    load_scenario,
    map_scenario,
    paper_scenario,
    retime,
    robot_section,
)
from omnidrive.study.scenario_file import parse_scenario, scenario_data

_HEAD = 65_536  # bytes of a YAML file that are searched for the key `image` of a map
_IMAGE_KEY = re.compile(rb"""(?:^|[{,])\s*["']?image["']?\s*:""", re.MULTILINE)
_KEYS = {
    "search": "path.search", "cut_corners": "path.cut_corners", "smooth": "path.smooth",
    "timing": "timing.law", "heading": "timing.heading", "margin": "map.margin",
    "unknown": "map.unknown", "resolution": "map.resolution",
}  # fmt: skip
"""Scenario key of each option that sets a single key."""


@dataclass(frozen=True, slots=True)
class ScenarioOptions:
    """Values of the shared options, one field per option; None: option not given."""

    scenario: Annotated[
        str,
        typer.Argument(
            help="`paper`, a scenario file (.yaml), the folder of a scenario, or a map file: Nav2 "
            "(.yaml), MovingAI (.map), NumPy (.npy) or text (.txt)."
        ),
    ] = "paper"
    map: Annotated[Path | None, option("FILE", "Map file.", PATH_PANEL)] = None
    start: Annotated[str | None, option("X,Y[,HEADING]", "Start, m, m, rad.", PATH_PANEL)] = None
    goal: Annotated[str | None, option("X,Y[,HEADING]", "Goal, m, m, rad.", PATH_PANEL)] = None
    duration: Annotated[float | None, option("S", "Duration of the path, s.", PATH_PANEL)] = None
    speed: Annotated[float | None, option("M/S", "Mean speed, m/s.", PATH_PANEL)] = None
    margin: Annotated[
        float | None, option("M", "Clearance between robot and obstacles, m.", PATH_PANEL)
    ] = None
    unknown: Annotated[
        str | None, choice(get_args(Unknown), "Treatment of unknown cells.", PATH_PANEL)
    ] = None
    resolution: Annotated[
        float | None,
        option("M", "Cell size, m, if the map file does not define it [default: 1].", PATH_PANEL),
    ] = None
    robot: Annotated[
        str | None,
        option("NAME|FILE", f"Robot: {', '.join(ROBOTS)}, or a robot file (.yaml).", RUN_PANEL),
    ] = None
    plant: Annotated[
        str | None,
        option(
            "NAME[,KEY=VALUE...]",
            "Simulated plant: mujoco-rollers; mujoco-balls; planar, a rigid body with wheel "
            "friction; kinematic; coppeliasim, a running CoppeliaSim; or your own as FILE.py:NAME.",
            RUN_PANEL,
        ),
    ] = None
    preset: Annotated[
        str | None,
        choice(
            get_args(PresetName),
            "Parameters of the controllers: from the text of the paper, from its published code "
            "(including the error in its wheel matrix), or recommended values.",
            RUN_PANEL,
        ),
    ] = None
    search: Annotated[
        str | None,
        choice(
            get_args(MethodName),
            "Grid search: shortest path (astar; jump-point, faster on open or narrow maps), "
            "any-angle path (lazy-theta), or greedy best-first as in the paper.",
            PATH_PANEL,
        ),
    ] = None
    cut_corners: Annotated[
        bool | None,
        flag(
            "Whether diagonal moves may cut the corners of obstacles, as in the paper.",
            PATH_PANEL,
            "--cut-corners/--no-cut-corners",
        ),
    ] = None
    smooth: Annotated[
        str | None,
        choice(
            get_args(SmoothingName),
            "Smoothing with certified clearance, or without checks as in the paper.",
            PATH_PANEL,
        ),
    ] = None
    timing: Annotated[
        str | None,
        choice(
            get_args(TimingName),
            "Timing: uniform as in the paper; from rest to rest within the wheel limits; or a "
            "minimum-time trajectory, which also changes path and heading.",
            PATH_PANEL,
        ),
    ] = None
    heading: Annotated[
        str | None,
        choice(get_args(Heading), "Heading of the robot, with the timing `limits`.", PATH_PANEL),
    ] = None
    estimator: Annotated[
        bool | None,
        flag(
            "Whether the controllers receive the pose estimated from wheel encoders, a gyro and a "
            "measured pose, or, as in the paper, the measured pose.",
            RUN_PANEL,
            "--estimator/--no-estimator",
        ),
    ] = None
    seed: Annotated[int | None, option("N", "Seed of the noise.", RUN_PANEL)] = None
    allow_code: Annotated[
        bool,
        flag(
            "Import code that the scenario file names, such as mine.py:MyController; only for "
            "files that you trust.",
            RUN_PANEL,
            "--allow-code",
        ),
    ] = False

    @property
    def map_file(self) -> Path | None:
        """Map file given as argument or by ``--map``; None: no map file."""
        if self.map is not None and self.scenario != "paper":
            raise InvalidInput(
                "a scenario or map argument and --map exclude each other; give one of them"
            )
        if self.map is None and self.scenario != "paper" and _is_map(Path(self.scenario)):
            return Path(self.scenario)
        return self.map

    def resolve(self, *, retimed: bool = True) -> Scenario:
        """Return the scenario defined by the options.

        Args:
            retimed: Adapt the durations of the tasks to the path if the user defines the path.

        Raises:
            OmnidriveError: The options contradict each other or name something that does not
                exist.
        """
        preset = (
            choose_one("preset", self.preset, get_args(PresetName))
            if self.preset is not None
            else None
        )
        scenario = self._base(preset)
        changes: dict[str, object] = {}
        on_map = self.map_file is not None
        if self.start is not None and not on_map:
            changes["start"] = parse_waypoint("start", self.start)
        if self.goal is not None and not on_map:
            changes["goal"] = parse_waypoint("goal", self.goal)
        if self.plant is not None:
            changes["plant"] = plant_data(self.plant)
        if self.robot is not None and not on_map:
            changes["robot"] = robot_section(self.robot, preset or scenario.preset)
        elif preset:
            radius = robot_section(scenario.robot.name, preset).assumed_effective_radius
            changes["robot"] = scenario.robot.model_copy(
                update={"assumed_effective_radius": radius}
            )
        if preset:
            changes["preset"] = preset
        if self.seed is not None:
            changes["seed"] = self.seed
        if self.estimator is not None:
            changes["sensors"] = (scenario.sensors or SensorsSection()) if self.estimator else None
        scenario = scenario.model_copy(update=changes)
        scenario = parse_scenario(self._with_keys(scenario_data(scenario)), "with these options")
        if retimed and (on_map or self.duration is not None or self.speed is not None):
            scenario = retime(scenario, duration=self.duration, speed=self.speed)
        return scenario

    def _with_keys(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return the scenario data with the options of ``_KEYS`` applied."""
        for field, key in _KEYS.items():
            value = getattr(self, field)
            if value is not None:
                section, name = key.split(".")
                data[section][name] = value
        return data

    def _base(self, preset: PresetName | None) -> Scenario:
        file = self.map_file
        if file is not None:
            if self.start is None or self.goal is None:
                raise InvalidInput("a map needs --start X,Y and --goal X,Y (m, in the map frame)")
            return map_scenario(
                str(file),
                parse_waypoint("start", self.start),
                parse_waypoint("goal", self.goal),
                robot=self.robot or "paper",
                name=_scenario_name(file.stem),
                preset=preset or "paper",
            )
        if self.scenario == "paper":
            return paper_scenario(preset or "paper")
        path = Path(self.scenario)
        file = path / "scenario.yaml" if path.is_dir() else path
        return load_scenario(file, allow_code=self.allow_code)


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
        own = [
            parameter.replace(kind=Parameter.KEYWORD_ONLY)
            for parameter in signature(verb, eval_str=True).parameters.values()
            if parameter.name != "shared"
        ]

        @wraps(verb)
        def command(**given: Any) -> None:
            shared = ScenarioOptions(
                **{each.name: given.pop(each.name) for each in shared_parameters}
            )
            verb(shared=shared, **given)

        command.__signature__ = Signature([*shared_parameters, *own])  # type: ignore[attr-defined]
        return command

    return decorate


def _is_map(path: Path) -> bool:
    """Return whether a file is a map, not a scenario; an unreadable YAML file counts as no map."""
    if path.suffix.lower() not in {".yaml", ".yml"}:
        return path.suffix != "" or path.is_file()
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return _IMAGE_KEY.search(file.read(_HEAD)) is not None
    except OSError:
        return False


def _scenario_name(text: str) -> str:
    """Return ``text`` as a valid scenario name."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "_.-") else "_" for c in text)
    return plain.lstrip("_.-")[:60] or "map"


def parse_waypoint(name: str, text: str) -> Waypoint:
    """Parse ``X,Y`` or ``X,Y,HEADING``."""
    numbers = parse_coordinates(text)
    if not numbers:
        raise InvalidInput(
            f"--{name} must be X,Y or X,Y,HEADING in m, m, rad, such as 1.5,2 or 1.5,2,-0.78; "
            f"got '{text}'"
        )
    if len(numbers) == 3 and not abs(numbers[2]) <= 6.3:
        raise InvalidInput(
            f"--{name}: the heading is {numbers[2]:g} rad, need -6.3 to 6.3 rad (degrees?)"
        )
    return Waypoint(*numbers)
