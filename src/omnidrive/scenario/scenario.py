"""Scenarios: all settings of a study, as data that can be saved and loaded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, WrapValidator, model_validator

from omnidrive.choices import WAYPOINTS, PresetName
from omnidrive.components import (
    Configured,
    OfGroup,
    component_names,
    configure,
    find_component,
)
from omnidrive.components.component import UnreadComponent
from omnidrive.errors import InvalidInput, OmnidriveError
from omnidrive.parameter import Bounds
from omnidrive.planning import PathOptions, Waypoint
from omnidrive.scenario.controller_labels import by_label
from omnidrive.scenario.cost_section import CostSection
from omnidrive.scenario.section import Section
from omnidrive.scenario.sections import (
    MapSection,
    RobotSection,
    SensorsSection,
    TimingSection,
    WatchdogSection,
    robot_section,
)
from omnidrive.scenario.tasks import Faults, Tasks, study_tasks
from omnidrive.simulation.components import static_capabilities
from omnidrive.simulation.disturbances import PLANT_FAULTS
from omnidrive.simulation.plant import PlantCapabilities

_PAPERS = ("fuzzy_t1", "fuzzy_t2", "unicycle-nmpc", "holonomic-nmpc")
_ALL = ("pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3", "unicycle-nmpc", "feedforward", "holonomic-nmpc")
DEFAULT_CONTROLLERS: dict[PresetName, tuple[str, ...]] = {
    "paper": _PAPERS,
    "published-code": _PAPERS,
    "recommended": _ALL,
}
"""Default controllers of a study, by preset."""

MAX_CONTROLLERS = 50
"""Maximum number of controllers of a study."""

MAX_STEPS = 200_000
"""Maximum number of samples of one run: an hour at 50 Hz, with a log below one gigabyte."""

MAX_NOISE_STEPS = 1_000_000
"""Maximum number of samples of one controller's noise runs per duration, all kept in memory."""

NEED_FORCES = tuple(kind for kind in PLANT_FAULTS if kind != "pose-jump")
"""Kinds of faults that need a plant that simulates forces."""


def path_or_component(value: Any, handler: Callable[[Any], Any]) -> Any:
    """Return `path` for a planned path, and otherwise what ``handler`` makes of the value."""
    return "path" if value in ("path", {"type": "path"}) else handler(value)


class Scenario(Section):
    """All settings of a study.

    Lengths are in m, angles in rad, times in s. Two studies of one scenario with the same versions
    on the same machine have bitwise equal results, except for computing times.
    """

    format: Literal["omnidrive-scenario-1"] = "omnidrive-scenario-1"
    """Name and version of the file format."""
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,63}$")]
    """Name of the study, for titles."""
    seed: Annotated[int, Bounds(0, 2**53, "")] = 1
    """Seed of all random numbers."""
    robot: RobotSection
    """Model of the robot in controllers and estimators: a name, or keys."""
    plant_robot: RobotSection | None = None
    """The simulated robot: a name, or keys. None: the same as ``robot``."""
    plant: Annotated[Configured, OfGroup("plants")] = Field(
        default_factory=lambda: configure("plants", "mujoco-rollers")
    )
    """Simulated plant: a name, or `type` and parameters."""
    sample_time: Annotated[float, Bounds(0.005, 1.0, "s")] = 0.1
    """Sample time of controllers and log, s."""
    reference: Annotated[
        Configured | Literal["path"], OfGroup("references"), WrapValidator(path_or_component)
    ] = "path"
    """Motion to follow. `path`: the planned path from ``start`` to ``goal``, timed as in
    ``timing``. Otherwise a name, or `type` and parameters, such as `{type: circle, radius: 1.5}` or
    `{type: waypoints, file: w.csv}`; it is slowed down or sped up to the durations of the tasks."""
    map: MapSection = MapSection(source="none")
    """Map; needed for a planned path."""
    start: Waypoint | None = None
    """Start in W; m, m, rad. The heading may be omitted. Needed for a planned path; shapes begin
    there, by default at the origin; waypoint files have a start of their own."""
    goal: Waypoint | None = None
    """Goal in W; m, m, rad. The heading may be omitted. Needed for a planned path, not used by
    other references."""
    path: PathOptions = PathOptions()
    """Options of search and smoothing, for a planned path."""
    costs: CostSection | None = None
    """Costs of a planned path, with keep-out and speed zones. None: the shortest path."""
    timing: TimingSection = TimingSection()
    """Timing of a planned path, and limits of speed and acceleration of every motion."""
    controllers: Annotated[
        dict[str, Annotated[Configured, OfGroup("controllers")]],
        Field(min_length=1, max_length=MAX_CONTROLLERS),
        BeforeValidator(by_label),
    ]
    """Controllers to compare, by label: a name, `type` and parameters, or a file (.yaml) with them,
    such as `omnidrive tune` writes. A list of names or files stands for controllers that are
    labelled by their names. In a scenario file, the path of a file is relative to that file."""
    preset: PresetName = "paper"
    """Parameters of the controllers of the paper: from its text, from its published code, or
    recommended values. They apply to `pid` and the fuzzy PIDs. `unicycle-nmpc` has the weights of
    the text and the limits of the robot in the preset `recommended`; `holonomic-nmpc`, the
    recommended controller, and `feedforward` are the same in every preset."""
    faults: Faults = ()
    """Faults and disturbances in every run, in addition to those of the task `faults`."""
    watchdog: WatchdogSection = WatchdogSection()
    wheel_monitor: bool = True
    """Whether failed wheels are detected and compensated for."""
    sensors: SensorsSection | None = None
    """Simulated sensors. None: the controllers receive the true pose; in the task `noise`, with the
    noise of the paper."""
    tasks: Tasks

    @property
    def plant_capabilities(self) -> PlantCapabilities:
        """Capabilities of the scenario's plant; all, if its code was not imported."""
        if isinstance(self.plant.component, UnreadComponent):
            return PlantCapabilities(*[True] * len(PlantCapabilities._fields))
        return static_capabilities(self.plant.component.factory)

    @property
    def true_robot(self) -> RobotSection:
        """The section of the simulated robot."""
        return self.plant_robot or self.robot

    @property
    def odometry(self) -> bool:
        """Whether the pose is estimated from wheel angles, so that slip causes errors."""
        return self.sensors is not None and self.sensors.estimator is not None

    @property
    def is_importable(self) -> bool:
        """Whether another process can import controllers and plant: none is of a session."""
        return all(each.is_importable for each in (*self.controllers.values(), self.plant))

    @property
    def predictive(self) -> tuple[str, ...]:
        """Labels of the controllers with a parameter ``horizon``."""
        return tuple(k for k, each in self.controllers.items() if each.has_parameter("horizon"))

    def with_values(self, **values: Any) -> Scenario:
        """Return the scenario with other values of some keys, which are checked.

        Raises:
            pydantic.ValidationError: A key is unknown, or a value is invalid.
        """
        return type(self).model_validate({**dict(self), **values})

    @model_validator(mode="before")
    @classmethod
    def _robots_by_name(cls, data: Any) -> Any:
        """Replace names of robots by their sections, as ``--robot`` does."""
        if not isinstance(data, dict):
            return data
        preset: PresetName = "paper"
        if data.get("preset") in get_args(PresetName):
            preset = data["preset"]
        named = {key: data[key] for key in ("robot", "plant_robot") if type(data.get(key)) is str}
        return data | {key: robot_section(name, preset) for key, name in named.items()}

    @model_validator(mode="after")
    def _check_path(self) -> Scenario:
        absent = [name for name in ("start", "goal") if getattr(self, name) is None]
        absent = [*(["map"] if self.map.source == "none" else []), *absent]
        if self.reference == "path" and absent:
            raise ValueError(
                f"{', '.join(absent)} missing: a planned path needs a map, a start and a goal; "
                f"other motions are set by reference, such as circle or {WAYPOINTS}"
            )
        return self

    @model_validator(mode="after")
    def _check_controllers(self) -> Scenario:
        for label, each in self.controllers.items():
            try:
                each.resolved(self.preset)
            except InvalidInput as error:
                raise ValueError(f"controllers.{label}.{error}") from None
        return self

    @model_validator(mode="after")
    def _check_moving_obstacles(self) -> Scenario:
        if self.map.moving and not self.plant_capabilities.collides:
            raise ValueError(
                f"map.moving: the plant {self.plant.type} has no obstacles; use "
                f"{_plants_with('collides')}"
            )
        return self

    @model_validator(mode="after")
    def _check_costs(self) -> Scenario:
        if self.costs is None:
            return self
        if self.path.search != "astar":
            raise ValueError(
                f"costs: the search {self.path.search} has none; use path.search: astar, or leave "
                "out costs"
            )
        if self.costs.speed is not None and self.timing.law != "limits":
            raise ValueError("costs.speed: speed zones need timing.law: limits")
        return self

    @model_validator(mode="after")
    def _check_samples(self) -> Scenario:
        steps = self.tasks.longest / self.sample_time
        if steps > MAX_STEPS:
            raise ValueError(
                f"has a run of {steps:.0f} samples, need at most {MAX_STEPS}: "
                "shorten the longest duration or lengthen sample_time"
            )
        steps = self.tasks.noise_duration / self.sample_time
        if steps > MAX_NOISE_STEPS:
            raise ValueError(
                f"has {steps:.0f} samples with noise, need at most {MAX_NOISE_STEPS}: "
                "lower tasks.noise.repeats or shorten its longest duration"
            )
        return self

    @model_validator(mode="after")
    def _check_faults(self) -> Scenario:
        task = self.tasks.faults
        of_task = [(fault, task.duration) for fault in task.faults] if task else []
        for fault, end in (*((f, self.tasks.shortest) for f in self.faults), *of_task):
            if fault.at >= end:
                raise ValueError(
                    f"fault {fault.kind} begins at {fault.at:g} s, but a run ends at {end:g} s: "
                    "use an earlier time"
                )
            if not self.plant_capabilities.forces and fault.kind in NEED_FORCES:
                raise ValueError(
                    f"fault {fault.kind} needs forces, which the plant {self.plant.type} does not "
                    f"have; use {_plants_with('disturbable', 'forces')}"
                )
        return self


def _plants_with(*capabilities: str) -> str:
    """Return the names of the plants of this package that have all capabilities, for messages."""
    names = [
        name
        for name in component_names("plants")
        if all(getattr(_capabilities_of(name), each) for each in capabilities)
    ]
    return f"{', '.join(names[:-1])} or {names[-1]}"


def _capabilities_of(plant: str) -> PlantCapabilities:
    try:
        return static_capabilities(find_component("plants", plant).factory)
    except OmnidriveError:  # of another distribution, which cannot be imported
        return PlantCapabilities()


def paper_scenario(preset: PresetName = "paper") -> Scenario:
    """Return the study of the paper with the controllers of a preset.

    Raises:
        InvalidInput: The preset is unknown.
    """
    return Scenario(
        name="paper",
        robot=robot_section("paper", preset),
        map=MapSection(source="paper", margin=0.0),
        start=Waypoint(1.0, 1.0, 0.0),
        goal=Waypoint(8.0, 6.0),
        path=PathOptions("greedy", cut_corners=True, smooth="spline", turn_within=0.0),
        controllers={name: configure("controllers", name) for name in DEFAULT_CONTROLLERS[preset]},
        preset=preset,
        tasks=study_tasks(20.0),
    )


def map_scenario(
    source: str,
    start: Waypoint,
    goal: Waypoint,
    *,
    robot: str,
    name: str,
    preset: PresetName = "paper",
) -> Scenario:
    """Return the tasks of the paper on another map, with motion from rest to rest.

    The durations are those of the paper; :func:`~omnidrive.scenario.retime` adapts them to the
    path.

    Args:
        source: Map file.
        start: Start in W; m, m, rad.
        goal: Goal in W; m, m, rad.
        robot: Name or file of the robot.
        name: Name of the study.
        preset: Parameters of the controllers.

    Raises:
        InvalidInput: The robot or the preset is unknown.
    """
    paper = paper_scenario(preset)
    return paper.model_copy(
        update={
            "name": name,
            "robot": robot_section(robot, preset),
            "map": MapSection(source=source),
            "start": start,
            "goal": goal,
            "path": PathOptions(),
            "costs": CostSection(),
            "timing": TimingSection(law="limits"),
        }
    )
