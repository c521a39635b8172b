"""Options that several verbs share, and the scenario that they add up to."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from omnidrive.errors import InvalidInput
from omnidrive.maps import Unknown
from omnidrive.planning import MethodName, Place, SmoothingName
from omnidrive.reference import Heading
from omnidrive.robot import ROBOTS
from omnidrive.study import (
    PlantName,
    PresetName,
    Scenario,
    SensorsSection,
    TimingName,
    load_scenario,
    map_scenario,
    paper_scenario,
    retime,
    robot_section,
)
from omnidrive.study.scenario_file import parse_scenario, scenario_data

_WHERE, _HOW, _OUT = "Where to drive", "How to drive", "Results"
_HEAD = 65_536  # bytes of a YAML file in which a map names its picture
_PICTURE = re.compile(rb"""(?:^|[{,])\s*["']?image["']?\s*:""", re.MULTILINE)

ScenarioArgument = Annotated[
    str,
    typer.Argument(
        help="`paper`, or a scenario's YAML file, or the folder that it is in, or a map's file: "
        "of Nav2 (.yaml), MovingAI (.map), NumPy (.npy) or text (.txt)."
    ),
]
MapOption = Annotated[
    Path | None,
    typer.Option(
        "--map", metavar="FILE", help="The same for a map's file.", rich_help_panel=_WHERE
    ),
]
StartOption = Annotated[
    str | None,
    typer.Option(metavar="X,Y[,HEADING]", help="Start in m, m, rad.", rich_help_panel=_WHERE),
]
GoalOption = Annotated[
    str | None,
    typer.Option(metavar="X,Y[,HEADING]", help="Goal in m, m, rad.", rich_help_panel=_WHERE),
]
DurationOption = Annotated[
    float | None,
    typer.Option(metavar="S", help="Time for the path, in s.", rich_help_panel=_WHERE),
]
SpeedOption = Annotated[
    float | None,
    typer.Option(metavar="M/S", help="Mean speed instead, in m/s.", rich_help_panel=_WHERE),
]
RobotOption = Annotated[
    str | None,
    typer.Option(metavar="|".join(ROBOTS), help="Which robot drives.", rich_help_panel=_HOW),
]
PlantOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(PlantName)),
        help="What simulates it: MuJoCo with rollers or with balls, or kinematics alone.",
        rich_help_panel=_HOW,
    ),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(PresetName)),
        help="Take the paper's controllers from its text, from its published code with its slip in "
        "the wheel matrix, or as we would build them.",
        rich_help_panel=_HOW,
    ),
]
SeedOption = Annotated[
    int | None, typer.Option(metavar="N", help="Seed of the noise.", rich_help_panel=_HOW)
]
EstimatorOption = Annotated[
    bool | None,
    typer.Option(
        "--estimator/--no-estimator",
        help="Whether the controllers see what an estimator makes of wheel encoders, a gyro and a "
        "measured pose, or as in the paper the pose as it is measured.",
        show_default=False,
        rich_help_panel=_HOW,
    ),
]
OutOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="New folder for the results [default: runs/NAME-TIME].",
        rich_help_panel=_OUT,
    ),
]
JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print results.json instead of tables.", rich_help_panel=_OUT),
]
JobsOption = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        min=1,
        help="Runs at the same time; changes no number [default: every core].",
        rich_help_panel=_HOW,
    ),
]


SearchOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(MethodName)),
        help="How a way over the cells is searched: the shortest way (astar, and sooner on open or "
        "narrow maps jump-point), to any angle (lazy-theta), or greedy as in the paper.",
        rich_help_panel=_HOW,
    ),
]
SmoothOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(SmoothingName)),
        help="Smooth the way with a proof that nothing is hit, or plainly as in the paper.",
        rich_help_panel=_HOW,
    ),
]
TimingOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(TimingName)),
        help="Travel evenly as in the paper; from rest to rest within the wheels' limits; or also "
        "move the path and turn freely to save time.",
        rich_help_panel=_HOW,
    ),
]
CornersOption = Annotated[
    bool | None,
    typer.Option(
        "--cut-corners/--no-cut-corners",
        help="Whether diagonal moves may pass obstacles' corners, as in the paper.",
        show_default=False,
        rich_help_panel=_HOW,
    ),
]
HeadingOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(Heading)),
        help="Where the robot looks, with the timing `limits`.",
        rich_help_panel=_HOW,
    ),
]
MarginOption = Annotated[
    float | None,
    typer.Option(
        metavar="M", help="Room between robot and obstacles, in m.", rich_help_panel=_WHERE
    ),
]
UnknownOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(get_args(Unknown)),
        help="What unknown cells count as.",
        rich_help_panel=_WHERE,
    ),
]
ResolutionOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="Side of a cell in m, where the map does not say it [default: 1].",
        rich_help_panel=_WHERE,
    ),
]


@dataclass(frozen=True, slots=True)
class Demand:
    """What the shared options said; None where nothing."""

    scenario: str
    map: Path | None = None
    start: str | None = None
    goal: str | None = None
    duration: float | None = None
    speed: float | None = None
    robot: str | None = None
    plant: str | None = None
    preset: str | None = None
    seed: int | None = None
    details: Mapping[str, object] = field(default_factory=dict)
    """Values for keys of the scenario, such as ``path.search``; None where nothing."""
    estimator: bool | None = None

    @property
    def map_file(self) -> Path | None:
        """The map that is named, in one way or the other."""
        if self.map is not None and self.scenario != "paper":
            raise InvalidInput("give a scenario or map, or --map, not both")
        if self.map is None and self.scenario != "paper" and _is_map(Path(self.scenario)):
            return Path(self.scenario)
        return self.map

    def resolve(self, *, retimed: bool = True) -> Scenario:
        """The scenario that the options add up to.

        Args:
            retimed: Give it times that suit the path, where the path is the user's.

        Raises:
            OmnidriveError: They contradict each other or name something that is not there.
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
            changes["start"] = parse_place("start", self.start)
        if self.goal is not None and not on_map:
            changes["goal"] = parse_place("goal", self.goal)
        if self.plant is not None:
            changes["plant"] = choose_one("plant", self.plant, get_args(PlantName))
        if self.robot is not None and not on_map:
            name = choose_one("robot", self.robot, ROBOTS)
            changes["robot"] = robot_section(name, preset or scenario.preset)
        elif preset:
            changes["robot"] = robot_section(scenario.robot.name, preset)
        if preset:
            changes["preset"] = preset
        if self.seed is not None:
            changes["seed"] = self.seed
        if self.estimator is not None:
            changes["sensors"] = (scenario.sensors or SensorsSection()) if self.estimator else None
        scenario = scenario.model_copy(update=changes)
        scenario = parse_scenario(self._detailed(scenario_data(scenario)), "with these options")
        if retimed and (on_map or self.duration is not None or self.speed is not None):
            scenario = retime(scenario, duration=self.duration, speed=self.speed)
        return scenario

    def _detailed(self, data: dict[str, Any]) -> dict[str, Any]:
        """The scenario's data with the details put in."""
        for key, value in self.details.items():
            if value is not None:
                section, name = key.split(".")
                data[section][name] = value
        return data

    def _base(self, preset: PresetName | None) -> Scenario:
        file = self.map_file
        if file is not None:
            if self.start is None or self.goal is None:
                raise InvalidInput("a map needs --start X,Y and --goal X,Y (metres in the map)")
            return map_scenario(
                str(file),
                parse_place("start", self.start),
                parse_place("goal", self.goal),
                robot=choose_one("robot", self.robot or "paper", ROBOTS),
                name=_plain_name(file.stem),
                preset=preset or "paper",
            )
        if self.scenario == "paper":
            return paper_scenario(preset or "paper")
        path = Path(self.scenario)
        return load_scenario(path / "scenario.yaml" if path.is_dir() else path)


def _is_map(path: Path) -> bool:
    """Whether a file is a map and no scenario; one that cannot be read is no map."""
    if path.suffix.lower() not in {".yaml", ".yml"}:
        return path.suffix != "" or path.is_file()
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return _PICTURE.search(file.read(_HEAD)) is not None
    except OSError:
        return False


def _plain_name(text: str) -> str:
    """``text`` as a scenario may be called."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "_.-") else "_" for c in text)
    return plain.lstrip("_.-")[:60] or "map"


def two_or_three(text: str) -> list[float]:
    """Two or three numbers with commas between; none if that is not what ``text`` is."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        return []
    return numbers if len(numbers) in {2, 3} else []


def parse_place(name: str, text: str) -> Place:
    """Read ``X,Y`` or ``X,Y,HEADING``."""
    numbers = two_or_three(text)
    if not numbers:
        raise InvalidInput(
            f"--{name} must be X,Y or X,Y,HEADING in m, m, rad, such as 1.5,2 or 1.5,2,-0.78; "
            f"got '{text}'"
        )
    if len(numbers) == 3 and not abs(numbers[2]) <= 6.3:
        raise InvalidInput(
            f"--{name}: the heading is {numbers[2]:g} rad, need -6.3 to 6.3 rad (degrees?)"
        )
    return Place(*numbers)


def choose_many(name: str, text: str, options: Iterable[str]) -> tuple[str, ...]:
    """Read a comma-separated choice, kept in the order of ``options``."""
    wanted = {choose_one(name, part.strip(), options) for part in text.split(",")}
    return tuple(option for option in options if option in wanted)


def choose_one(name: str, value: str, options: Iterable[str]) -> Any:
    """``value``, which must be one of ``options``; what else it could be is said otherwise."""
    if value in options:
        return value
    near = get_close_matches(value, list(options), n=1, cutoff=0.5)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    raise InvalidInput(f"there is no {name} '{value}'; there are {', '.join(options)}{hint}")


def new_folder(name: str) -> Path:
    """A folder under runs/ that does not exist yet."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    base = Path("runs") / f"{name}-{stamp}"
    path, count = base, 1
    while path.exists():
        count += 1
        path = base.with_name(f"{base.name}-{count}")
    return path


def cores() -> int:
    """Cores that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
