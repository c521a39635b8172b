"""Scenarios: all settings of a study, as data that can be saved and loaded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, WrapValidator, model_validator

from omnidrive.choices import WAYPOINTS, Heading, PresetName, TimingName, Unknown
from omnidrive.components import (
    Configured,
    OfGroup,
    component_names,
    configure,
    find_component,
)
from omnidrive.errors import OmnidriveError
from omnidrive.estimation import (
    EncoderSettings,
    GyroSettings,
    PoseFixSettings,
    SensorSettings,
)
from omnidrive.maps import is_named_map
from omnidrive.parameter import Bounds, check_choice
from omnidrive.planning import PathOptions, Waypoint
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation.components import static_capabilities
from omnidrive.simulation.disturbances import PLANT_FAULTS
from omnidrive.simulation.moving_obstacle import (
    MAX_MOVING_OBSTACLES,
    MAX_PATH_POINTS,
    MovingObstacle,
)
from omnidrive.simulation.plant import PlantCapabilities
from omnidrive.study.former import OLD_PLANTS, by_label, without_former_sections
from omnidrive.study.section import Section, accepts
from omnidrive.study.tasks import Faults, Tasks, study_tasks

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

_Time = Annotated[float, Bounds(0.0, 36_000.0, "s")]
_Coordinate = Annotated[float, Bounds(-1e5, 1e5, "m")]
_Offset = Annotated[float, Bounds(-10.0, 10.0, "m")]
_Lag = Annotated[float, Bounds(0.0, 10.0, "s")]


class RobotSection(Section):
    """Robot, and parameters that replace its own. None: the value of the robot.

    A changed mass, inertia, friction or motor does not change ``lag``, from which the controller
    `holonomic-nmpc` predicts the motion. Identify it with :func:`omnidrive.simulation.identify_lag`
    if the difference matters.
    """

    old_keys = {"assumed_arm": "assumed_effective_radius"}  # noqa: RUF012

    name: str
    """Name of an installed robot, or a robot file (.yaml). In a scenario file, its path is relative
    to that file."""
    assumed_effective_radius: Annotated[float, Bounds(0.01, 10.0, "m")] | None = None
    """Effective radius, m, in the wheel matrix that converts commands to wheel speeds. None: the
    true effective radius."""
    mass: Annotated[float, Bounds(0.1, 10_000.0, "kg")] | None = None
    """Total mass, wheels included, kg."""
    body_inertia: Annotated[float, Bounds(1e-6, 1e5, "kg m^2")] | None = None
    """Yaw moment of inertia of the body without wheels about its centre of mass, kg m^2."""
    com: tuple[_Offset, _Offset] | None = None
    """Centre of mass in B, m; it must be inside the support polygon of the wheels."""
    friction: Annotated[float, Bounds(0.001, 5.0, "1")] | None = None
    """Coefficient of Coulomb friction between rollers and floor, dimensionless."""
    max_torque: Annotated[float, Bounds(1e-3, 1e4, "N m")] | None = None
    """Maximum torque of a motor at its wheel, N m."""
    servo_gain: Annotated[float, Bounds(1e-4, 1e4, "N m s/rad")] | None = None
    """Gain of the wheel velocity servos, N m s/rad."""
    motor_lag: Annotated[float, Bounds(0.0, 2.0, "s")] | None = None
    """Time constant with which the set points of the servos follow the command, s."""
    lag: tuple[_Lag, _Lag] | None = None
    """Time constants with which translation and rotation follow commands, s, s."""
    roller_phase: bool = False
    """Whether the initial angles of the rollers are random, drawn from the seed of the scenario for
    each repeat; otherwise they are equal at all wheels. For the plants `mujoco-rollers` and
    `planar`."""


class MovingSection(Section):
    """Disc-shaped obstacle that moves along a given path; collisions do not change its motion."""

    radius: Annotated[float, Bounds(0.01, 100.0, "m")]
    """Radius of the disc, m."""
    path: Annotated[
        tuple[tuple[_Time, _Coordinate, _Coordinate], ...],
        Field(min_length=1, max_length=MAX_PATH_POINTS),
    ]
    """Points (t, x, y) in s, m, m with increasing times. The position is interpolated linearly; the
    disc rests before the first point and after the last."""
    loop: bool = False
    """Whether the motion starts again at the last time."""

    @model_validator(mode="after")
    def _check_path(self) -> MovingSection:
        self.obstacle()
        return self

    def obstacle(self) -> MovingObstacle:
        """Return the obstacle of the plant."""
        times = tuple(t for t, _, _ in self.path)
        return MovingObstacle(self.radius, times, tuple((x, y) for _, x, y in self.path), self.loop)


class MapSection(Section):
    """Map, and clearance to its obstacles."""

    source: str
    """Name of an installed map, such as `paper`; `none`, a floor without obstacles, for references
    other than a planned path; or a map file: Nav2 (.yaml), MovingAI (.map), NumPy (.npy), text
    (.txt) or a format of an installed distribution. In a scenario file, its path is relative to
    that file."""
    margin: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.05
    """Clearance between the robot's body and obstacles, m, at least half the diagonal of a cell.
    The map `paper` is already inflated."""
    unknown: Unknown = "occupied"
    """Treatment of cells that are neither free nor occupied in the map."""
    resolution: Annotated[float, Bounds(0.001, 10.0, "m")] | None = None
    """Cell size, m, if the map file does not define it. None: as in the file, else 1 m."""
    moving: Annotated[tuple[MovingSection, ...], Field(max_length=MAX_MOVING_OBSTACLES)] = ()
    """Moving obstacles, for the plants `mujoco-rollers` and `mujoco-balls`. Neither planning nor
    control takes them into account."""

    @property
    def is_file(self) -> bool:
        """Whether the source is a map file."""
        return self.source != "none" and not is_named_map(self.source)

    @model_validator(mode="after")
    def _check_resolution(self) -> MapSection:
        if not self.is_file and self.resolution is not None:
            raise ValueError(
                "resolution is for map files that do not define it; the map "
                f"{self.source} has a fixed one"
            )
        return self


class TimingSection(Section):
    """Timing of the motion along the path."""

    law: TimingName = "uniform"
    """`uniform`: the parameter of the spline is proportional to time, as in the paper; the speed is
    not zero at the start. `limits`: the fastest motion from rest to rest within the wheel limits,
    slowed uniformly to the duration of the task. `minimum-time`: as `limits`, with path and
    headings optimised for time (needs the extra `casadi`)."""
    heading: Heading = "path"
    """Heading with the law `limits`. `path`: headings of the planned path; `tangent`: direction of
    motion; `fixed`: heading of the start; `free`: optimised for time (needs the extra
    `casadi`)."""
    traction: Annotated[float, Bounds(0.01, 100.0, "1")] = 0.85
    """Maximum acceleration, as a multiple of that at the friction and torque limits."""
    wheel_acceleration: Annotated[float, Bounds(0.01, 1e5, "rad/s^2")] | None = None
    """Maximum angular acceleration of a wheel, rad/s^2. None: no limit other than `traction`."""

    @model_validator(mode="after")
    def _check_heading(self) -> TimingSection:
        if self.heading != "path" and self.law != "limits":
            raise ValueError(f"heading: '{self.heading}' needs the law limits, not {self.law}")
        return self


class SensorsSection(Section):
    """Simulated sensors, and the estimator that computes the state from their readings."""

    encoders: EncoderSettings = EncoderSettings()
    """Wheel encoders."""
    gyro: GyroSettings | None = GyroSettings()
    """Yaw-rate gyro. None: no gyro."""
    fixes: PoseFixSettings | None = PoseFixSettings()
    """Pose fixes; in the task `noise`, their noise is that of the paper. None: no pose fixes, only
    odometry."""
    estimator: Annotated[Configured, OfGroup("estimators", "kalman")] | None = Field(
        default_factory=lambda: configure("estimators", "kalman")
    )
    """State estimator, `kalman` by default. None: the controller receives the latest pose fix."""

    @model_validator(mode="after")
    def _check_pose_source(self) -> SensorsSection:
        if self.estimator is None and self.fixes is None:
            raise ValueError("has neither fixes nor an estimator, so the controller has no pose")
        return self

    @property
    def settings(self) -> SensorSettings:
        """Settings of the sensors without the estimator."""
        return SensorSettings(self.encoders, self.gyro, self.fixes)


class WatchdogSection(Section):
    """Limits beyond which the watchdog stops the robot.

    See :class:`~omnidrive.control.supervision.WatchdogLimits`.
    """

    on: bool = True
    """Whether the watchdog is active."""
    error: Annotated[float, Bounds(0.01, 1e6, "m")] | None = None
    """Distance to the reference, m, in addition to that at the start. None: twice the radius of the
    robot's body, but at least 1 m."""
    position_sigma: Annotated[float, Bounds(1e-3, 1e6, "m")] = 0.5
    """Standard deviation of the estimated position, m."""
    age: Annotated[float, Bounds(0.01, 1e6, "s")] = 1.5
    """Age of the last pose fix, s."""
    patience: Annotated[float, Bounds(0.0, 60.0, "s")] = 0.3
    """Time for which a limit must be exceeded before the robot is stopped, s."""


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
    """The robot, as far as controllers and estimators know it."""
    plant_robot: RobotSection | None = None
    """The simulated robot. None: the same as ``robot``."""
    plant: Annotated[Configured, OfGroup("plants"), accepts(OLD_PLANTS)] = Field(
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
    timing: TimingSection = TimingSection()
    """Timing of a planned path, and limits of the acceleration of every motion."""
    controllers: Annotated[
        dict[str, Annotated[Configured, OfGroup("controllers")]],
        Field(min_length=1, max_length=MAX_CONTROLLERS),
        BeforeValidator(by_label),
    ]
    """Controllers to compare, by label: a name, or `type` and parameters. A list of names stands
    for controllers that are labelled by their names."""
    preset: PresetName = "paper"
    """Parameters of the controllers of the paper: from its text, from its published code, or
    recommended values. They apply to `pid` and the fuzzy PIDs. `unicycle-nmpc` has the weights of
    the text in the preset `recommended`; `holonomic-nmpc` and `feedforward` are the same in every
    preset."""
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
        """Capabilities of the scenario's plant."""
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
    def _former_sections(cls, data: Any) -> Any:
        return without_former_sections(data) if isinstance(data, dict) else data

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
    def _check_moving_obstacles(self) -> Scenario:
        if self.map.moving and not self.plant_capabilities.collides:
            raise ValueError(
                f"map.moving: the plant {self.plant.type} has no obstacles; use "
                f"{_plants_with('collides')}"
            )
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


def path_or_component(value: Any, handler: Callable[[Any], Any]) -> Any:
    """Return `path` for a planned path, and otherwise what ``handler`` makes of the value."""
    return "path" if value in ("path", {"type": "path"}) else handler(value)


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


def robot_of(section: RobotSection) -> Robot:
    """Return the robot with the parameters of the section.

    Raises:
        InvalidInput: The name is unknown, or the parameters are not those of a possible robot.
        InvalidRobot: The robot file is invalid.
    """
    changes = section.model_dump(exclude={"name", "roller_phase"}, exclude_none=True)
    return replace(named_robot(section.name), **changes)


def robot_section(name: str, preset: PresetName) -> RobotSection:
    """Return the section of a robot, by name or file, with the wheel matrix of a preset.

    The preset `published-code` reproduces an error of the published code: its wheel matrix contains
    the x coordinate of a wheel, 0.5 m for the robot `paper`, instead of the distance of the wheel
    from the centre, 0.7071 m.

    Raises:
        InvalidInput: The name of the robot or of the preset is unknown.
    """
    check_choice("preset", preset, get_args(PresetName))
    radius = named_robot(name).effective_radius / 2**0.5 if preset == "published-code" else None
    return RobotSection(name=name, assumed_effective_radius=radius)


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

    The durations are those of the paper; :func:`~omnidrive.study.retime` adapts them to the path.

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
            "timing": TimingSection(law="limits"),
        }
    )
