"""Scenarios: one study as data, written to a file, read back, run anywhere."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from omnidrive.control import FeedforwardGains, HolonomicParameters
from omnidrive.estimation import (
    EncoderSettings,
    EstimatorSettings,
    GyroSettings,
    PoseFixSettings,
    SensorSettings,
)
from omnidrive.maps import Unknown
from omnidrive.parameter import Bounds
from omnidrive.planning import PathOptions, Waypoint
from omnidrive.reference import Heading
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation.disturbances import PLANT_FAULTS
from omnidrive.simulation.moving_obstacle import (
    MAX_MOVING_OBSTACLES,
    MAX_PATH_POINTS,
    MovingObstacle,
)
from omnidrive.simulation.plant import PlantCapabilities
from omnidrive.study.coppeliasim import CoppeliaSimSection
from omnidrive.study.section import OLD_CONTROLLERS, OLD_PLANTS, Section, UniqueItems, accepts
from omnidrive.study.tasks import (
    Faults,
    Horizon,
    Tasks,
    study_tasks,
)

ControllerName = Literal[
    "pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3", "unicycle-nmpc", "feedforward", "holonomic-nmpc"
]
_Controller = Annotated[ControllerName, accepts(OLD_CONTROLLERS)]
PREDICTIVE: tuple[ControllerName, ...] = ("unicycle-nmpc", "holonomic-nmpc")
"""Controllers with a prediction horizon."""
PlantName = Literal["mujoco-rollers", "mujoco-balls", "planar", "kinematic", "coppeliasim"]
_MUJOCO = PlantCapabilities(disturbable=True, collides=True, renders=True, forces=True)
PLANT_CAPABILITIES: dict[PlantName, PlantCapabilities] = {
    "mujoco-rollers": _MUJOCO,
    "mujoco-balls": _MUJOCO,
    "planar": PlantCapabilities(disturbable=True, forces=True),
    "kinematic": PlantCapabilities(disturbable=True),
    "coppeliasim": PlantCapabilities(exclusive=True, forces=True),
}
"""Capabilities of each plant, known without building it."""
PresetName = Literal["paper", "published-code", "recommended"]
TimingName = Literal["uniform", "limits", "minimum-time"]

_PAPERS: tuple[ControllerName, ...] = ("fuzzy_t1", "fuzzy_t2", "unicycle-nmpc", "holonomic-nmpc")
DEFAULT_CONTROLLERS: dict[PresetName, tuple[ControllerName, ...]] = {
    "paper": _PAPERS,
    "published-code": _PAPERS,
    "recommended": get_args(ControllerName),
}
"""Controllers of a study that names none, by preset."""

MAX_STEPS = 200_000
"""Maximum number of samples of one run: an hour at 50 Hz, with a log below one gigabyte."""

MAX_NOISE_STEPS = 1_000_000
"""Maximum number of samples of one controller's noise runs per duration, all kept in memory."""

NEED_FORCES = tuple(kind for kind in PLANT_FAULTS if kind != "pose-jump")
"""Kinds of faults that need a plant with forces."""

_Instant = Annotated[float, Bounds(0.0, 36_000.0, "s")]
_Coordinate = Annotated[float, Bounds(-1e5, 1e5, "m")]
_Offset = Annotated[float, Bounds(-10.0, 10.0, "m")]
_Lag = Annotated[float, Bounds(0.0, 10.0, "s")]


class RobotSection(Section):
    """Which robot, in what it differs from it, and what its wheel controller believes.

    None: as the named robot is. Its lags, by which the recommended controller foretells it, are
    those of the named robot whatever else is changed: give those of the changed robot, as
    :func:`omnidrive.simulation.identify_lag` finds them, where they matter.
    """

    old_keys = {"assumed_arm": "assumed_effective_radius"}  # noqa: RUF012

    name: str
    assumed_effective_radius: Annotated[float, Bounds(0.01, 10.0, "m")] | None = None
    """Distance to the wheels by which commands become wheel speeds; None: the true one."""
    mass: Annotated[float, Bounds(0.1, 10_000.0, "kg")] | None = None
    """In total."""
    body_inertia: Annotated[float, Bounds(1e-6, 1e5, "kg m^2")] | None = None
    """Yaw inertia of all but the wheels, about its own centre of mass."""
    com: tuple[_Offset, _Offset] | None = None
    """Centre of mass in B; between the wheels, or one would lift off."""
    friction: Annotated[float, Bounds(0.001, 5.0, "1")] | None = None
    """Coulomb coefficient between rollers and floor."""
    max_torque: Annotated[float, Bounds(1e-3, 1e4, "N m")] | None = None
    """That a motor gives at its wheel."""
    servo_gain: Annotated[float, Bounds(1e-4, 1e4, "N m s/rad")] | None = None
    """Torque per unit of wheel-speed error."""
    motor_lag: Annotated[float, Bounds(0.0, 2.0, "s")] | None = None
    """Time constant with which the servos' set points follow the command."""
    lag: tuple[_Lag, _Lag] | None = None
    """Time constants with which translation and rotation follow commands."""
    roller_phase: bool = False
    """Whether the angles at which the rollers stand at first are drawn from the scenario's seed,
    anew for each repeat; else all wheels stand alike. Plant `rollers` only."""


class MovingSection(Section):
    """A disc that moves on a given path, whatever stands in its way."""

    radius: Annotated[float, Bounds(0.01, 100.0, "m")]
    path: Annotated[
        tuple[tuple[_Instant, _Coordinate, _Coordinate], ...],
        Field(min_length=1, max_length=MAX_PATH_POINTS),
    ]
    """When it is where: t (s), x (m), y (m), the times growing; evenly in between, at rest before
    and after."""
    loop: bool = False
    """Whether it starts again at the last of the times."""

    @model_validator(mode="after")
    def _moves(self) -> MovingSection:
        self.obstacle()
        return self

    def obstacle(self) -> MovingObstacle:
        """The same for the plant."""
        times = tuple(t for t, _, _ in self.path)
        return MovingObstacle(self.radius, times, tuple((x, y) for _, x, y in self.path), self.loop)


class MapSection(Section):
    """Which map, and how far from its obstacles to stay."""

    source: str
    """`paper`, or a map's file, relative to the scenario's: of Nav2 (.yaml), MovingAI (.map), NumPy
    (.npy) or text (.txt)."""
    margin: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.05
    """Room between the robot's body and obstacles, and no less than half a cell's diagonal; the map
    `paper` is inflated already."""
    unknown: Unknown = "occupied"
    """What cells count as of which the map does not say whether they are free."""
    resolution: Annotated[float, Bounds(0.001, 10.0, "m")] | None = None
    """Side of a cell, where the map's file does not say it; 1 m if neither does."""
    moving: Annotated[tuple[MovingSection, ...], Field(max_length=MAX_MOVING_OBSTACLES)] = ()
    """What moves there while the robot follows its path; on the plants `rollers` and `ball`.
    Nobody plans around it."""

    @model_validator(mode="after")
    def _resolution_has_a_use(self) -> MapSection:
        if self.source == "paper" and self.resolution is not None:
            raise ValueError(
                "resolution is for maps whose file does not say it, and the map paper has its own"
            )
        return self


class TimingSection(Section):
    """When the robot is to be where on its path."""

    law: TimingName = "uniform"
    """`uniform`: the spline's parameter grows evenly, as in the paper, from a start in motion;
    `limits`: from rest to rest, the fastest motion within the wheels' limits, slowed down evenly to
    the duration asked for; `minimum-time`: the same on a path that is itself moved to be fast, and
    with free headings (needs the extra `casadi`)."""
    heading: Heading = "path"
    """Of `limits`: `path`: as the path says; `tangent`; `fixed`: the start's; `free`: as is best
    for time (needs the extra `casadi`)."""
    traction: Annotated[float, Bounds(0.01, 100.0, "1")] = 0.85
    """Acceleration at most, as a multiple of what the wheels can push."""
    wheel_acceleration: Annotated[float, Bounds(0.01, 1e5, "rad/s^2")] | None = None
    """Of every wheel, at most; None for no limit but traction."""

    @model_validator(mode="after")
    def _heading_has_a_use(self) -> TimingSection:
        if self.heading != "path" and self.law != "limits":
            raise ValueError(f"heading: '{self.heading}' is for the law limits, not {self.law}")
        return self


class NmpcSection(Section):
    """The NMPC's prediction horizon and solver."""

    horizon: Horizon = 15
    solver: Literal["sqp", "rti", "casadi"] = "sqp"


class HolonomicNmpcSection(Section):
    """Weights of the recommended NMPC, and how hard it may accelerate."""

    weights: HolonomicParameters = HolonomicParameters()
    traction: Annotated[float, Bounds(0.1, 100.0, "1")] = 0.85
    """Acceleration that a plan may ask for, as a multiple of what the wheels can push."""
    may_spin: bool | None = None
    """Whether wheels may spin where the robot does not get along as planned. It then follows more
    closely, but its odometry is lost by decimetres at a hard start: say false for robots that
    have no other measurement of their pose. None: unless an estimator rests on odometry."""


class SensorsSection(Section):
    """What the controller sees instead of the true pose; by default with an estimator."""

    encoders: EncoderSettings = EncoderSettings()
    gyro: GyroSettings | None = GyroSettings()
    """None: there is none."""
    fixes: PoseFixSettings | None = PoseFixSettings()
    """Measurements of the pose; in the task noise, their law is the paper's. None: there are none,
    and odometry has to do."""
    estimator: EstimatorSettings | None = EstimatorSettings()
    """What makes a pose of all; None: the controller sees the latest fix as it is."""

    @model_validator(mode="after")
    def _something_to_see(self) -> SensorsSection:
        if self.estimator is None and self.fixes is None:
            raise ValueError("has neither fixes nor an estimator: nothing would tell the pose")
        return self

    @property
    def settings(self) -> SensorSettings:
        """Of the sensors alone."""
        return SensorSettings(self.encoders, self.gyro, self.fixes)


class WatchdogSection(Section):
    """When a run is stopped because the robot is lost.

    See :class:`~omnidrive.control.supervision.WatchdogLimits`.
    """

    on: bool = True
    error: Annotated[float, Bounds(0.01, 1e6, "m")] | None = None
    """Distance to the reference, on top of that at the start; None: twice the robot's radius, and
    no less than 1 m."""
    position_sigma: Annotated[float, Bounds(1e-3, 1e6, "m")] = 0.5
    """Standard deviation of the position."""
    age: Annotated[float, Bounds(0.01, 1e6, "s")] = 1.5
    """Time since a pose was measured."""
    patience: Annotated[float, Bounds(0.0, 60.0, "s")] = 0.3
    """For which a limit has to be exceeded."""


class Scenario(Section):
    """Everything that decides a study, and nothing computed.

    Lengths are in m, angles in rad, times in s. Two runs of one scenario with the same versions on
    the same machine give the same numbers, bit for bit.
    """

    old_keys = {"recommended": "holonomic_nmpc"}  # noqa: RUF012

    format: Literal["omnidrive-scenario-1"] = "omnidrive-scenario-1"
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.-]{0,63}$")]
    seed: Annotated[int, Bounds(0, 2**53, "")] = 1
    robot: RobotSection
    plant: Annotated[PlantName, accepts(OLD_PLANTS)] = "mujoco-rollers"
    coppeliasim: CoppeliaSimSection = CoppeliaSimSection()
    """For the plant of that name."""
    sample_time: Annotated[float, Bounds(0.005, 1.0, "s")] = 0.1
    map: MapSection
    start: Waypoint
    goal: Waypoint
    path: PathOptions = PathOptions()
    timing: TimingSection = TimingSection()
    controllers: Annotated[tuple[_Controller, ...], Field(min_length=1), UniqueItems]
    preset: PresetName = "paper"
    """Whether the paper's controllers follow its text, its published code, or what we recommend.

    The classical `pid` follows the fuzzy PIDs. `nmpc` is the paper's, with its text's weights where
    the preset is ours; our own is the controller `recommended`, the same in every preset."""
    nmpc: NmpcSection = NmpcSection()
    feedforward: FeedforwardGains = FeedforwardGains()
    holonomic_nmpc: HolonomicNmpcSection = HolonomicNmpcSection()
    faults: Faults = ()
    """What goes wrong in every run, on top of the task `faults`."""
    watchdog: WatchdogSection = WatchdogSection()
    wheel_monitor: bool = True
    """Whether dead and locked wheels are looked for, and made up for."""
    sensors: SensorsSection | None = None
    """None: the controllers see the true pose, with the paper's noise in the task noise."""
    tasks: Tasks

    @property
    def plant_capabilities(self) -> PlantCapabilities:
        """Capabilities of the scenario's plant."""
        return PLANT_CAPABILITIES[self.plant]

    @property
    def wheels_may_spin(self) -> bool:
        """See :attr:`HolonomicNmpcSection.may_spin`."""
        if self.holonomic_nmpc.may_spin is None:
            return self.sensors is None or self.sensors.estimator is None
        return self.holonomic_nmpc.may_spin

    @model_validator(mode="after")
    def _movers_can_be_met(self) -> Scenario:
        if self.map.moving and not self.plant_capabilities.collides:
            raise ValueError(
                f"map.moving: the plant {self.plant} has no obstacles; use "
                f"{_plants_with('collides')}"
            )
        return self

    @model_validator(mode="after")
    def _bounded(self) -> Scenario:
        steps = self.tasks.longest / self.sample_time
        if steps > MAX_STEPS:
            raise ValueError(
                f"asks for a run of {steps:.0f} samples, need at most {MAX_STEPS}: "
                "shorten the longest duration or lengthen sample_time"
            )
        steps = self.tasks.noise_duration / self.sample_time
        if steps > MAX_NOISE_STEPS:
            raise ValueError(
                f"asks for {steps:.0f} samples with noise, need at most {MAX_NOISE_STEPS}: "
                "lower tasks.noise.repeats or shorten its longest duration"
            )
        return self

    @model_validator(mode="after")
    def _faults_can_be(self) -> Scenario:
        task = self.tasks.faults
        of_task = [(fault, task.duration) for fault in task.faults] if task else []
        for fault, ends in (*((f, self.tasks.shortest) for f in self.faults), *of_task):
            if fault.at >= ends:
                raise ValueError(
                    f"fault {fault.kind} begins at {fault.at:g} s, after a run's end at "
                    f"{ends:g} s: let it begin earlier"
                )
            if not self.plant_capabilities.forces and fault.kind in NEED_FORCES:
                raise ValueError(
                    f"fault {fault.kind} needs forces, which the plant {self.plant} does not have; "
                    f"use {_plants_with('disturbable', 'forces')}"
                )
        return self


def _plants_with(*capabilities: str) -> str:
    """Names of the plants that have all capabilities, for messages."""
    names = [
        n for n, has in PLANT_CAPABILITIES.items() if all(getattr(has, c) for c in capabilities)
    ]
    return f"{', '.join(names[:-1])} or {names[-1]}"


def robot_of(section: RobotSection) -> Robot:
    """The named robot with what the section says of it instead.

    Raises:
        InvalidInput: There is no such robot, or it could not stand or move as it is changed.
    """
    changes = section.model_dump(exclude={"name", "roller_phase"}, exclude_none=True)
    return replace(named_robot(section.name), **changes)


def robot_section(name: str, preset: PresetName) -> RobotSection:
    """The robot as ``preset`` drives it; ``published-code`` takes over the code's slip.

    The slip: a wheel's x coordinate, 0.5 m on the robot `paper`, stands for its distance from the
    centre, 0.7071 m.

    Raises:
        InvalidInput: There is no such robot.
    """
    slip = named_robot(name).effective_radius / 2**0.5 if preset == "published-code" else None
    return RobotSection(name=name, assumed_effective_radius=slip)


def paper_scenario(preset: PresetName = "paper") -> Scenario:
    """The paper's study, with its controllers as ``preset`` has them."""
    return Scenario(
        name="paper",
        robot=robot_section("paper", preset),
        map=MapSection(source="paper", margin=0.0),
        start=Waypoint(1.0, 1.0, 0.0),
        goal=Waypoint(8.0, 6.0),
        path=PathOptions("greedy", cut_corners=True, smooth="spline", turn_within=0.0),
        controllers=DEFAULT_CONTROLLERS[preset],
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
    """The paper's study on another map, from rest to rest; ``source`` is the map's file.

    The times are the paper's; see :func:`~omnidrive.study.retime` for times that suit the path.
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
