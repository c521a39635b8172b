"""Sections of a scenario: robot, map, timing, sensors and watchdog."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, get_args

from pydantic import BeforeValidator, Field, model_validator

from omnidrive.choices import Heading, PresetName, TimingName, Unknown
from omnidrive.components import Configured, OfGroup, configure
from omnidrive.estimation import (
    EncoderSettings,
    GyroSettings,
    PoseFixSettings,
    SensorSettings,
)
from omnidrive.maps import is_named_map
from omnidrive.parameter import Bounds, check_choice
from omnidrive.robot import Robot, force_share, named_robot
from omnidrive.robot.outline import outline_of, outline_radius
from omnidrive.scenario.section import Section
from omnidrive.simulation.moving_obstacle import (
    MAX_MOVING_OBSTACLES,
    MAX_PATH_POINTS,
    MovingObstacle,
)

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
    outline: Annotated[tuple[tuple[_Offset, _Offset], ...], BeforeValidator(outline_of)] | None = (
        None
    )
    """Corners (x, y) of the robot seen from above in B, m: a simple polygon around the origin,
    convex or not, also as text in the form of Nav2's `footprint`. The radius of the body is then
    that of the circle through its farthest corner. Where this circle has no path, planning uses the
    polygon."""
    motor_lag: Annotated[float, Bounds(0.0, 2.0, "s")] | None = None
    """Time constant with which the set points of the servos follow the command, s."""
    lag: tuple[_Lag, _Lag] | None = None
    """Time constants with which translation and rotation follow commands, s, s."""
    roller_phase: bool = False
    """Whether the initial wheel angles are random, uniform in one roller pitch and drawn from the
    seed of the scenario for each repeat; otherwise they are 0. For the plants `mujoco-rollers` and
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
    motion; `strafe-least`: as near to it as smooth turns from the heading of the start and to that
    of the goal allow; `fixed`: heading of the start; `face`: toward the point ``target``;
    `goal-first`, `goal-last`: turn from the heading of the start to that of the goal within a metre
    of the start or the goal; `fastest`: the constant angle to the direction of motion with the
    shortest duration, because the top speed of an omni robot depends on the direction; `free`:
    optimised for time (needs the extra `casadi`)."""
    target: tuple[_Coordinate, _Coordinate] | None = None
    """Point (x, y) in W that the robot faces with the heading `face`, m."""
    traction: Annotated[float, Bounds(0.01, 100.0, "1")] = force_share.REFERENCES
    """Maximum acceleration, as a multiple of that at the friction and torque limits. Plans of
    `holonomic-nmpc` use at most 0.8 of it; a faster motion is followed with a delay."""
    wheel_acceleration: Annotated[float, Bounds(0.01, 1e5, "rad/s^2")] | None = None
    """Maximum angular acceleration of a wheel, rad/s^2. None: no limit other than `traction`."""
    max_speed: Annotated[float, Bounds(0.001, 100.0, "m/s")] | None = None
    """Largest speed of the motion, planned or not, m/s. None: no limit other than that of the
    wheels."""
    max_jerk: Annotated[float, Bounds(0.001, 1e5, "m/s^3")] | None = None
    """Largest jerk of the robot's centre with the laws `limits` and `minimum-time`, m/s^3. The
    motion then starts and ends without acceleration. None: the acceleration may jump."""
    max_yaw_jerk: Annotated[float, Bounds(0.001, 1e5, "rad/s^3")] | None = None
    """Largest yaw jerk, likewise, rad/s^3; not with heading `tangent`. None: no limit."""

    @model_validator(mode="after")
    def _check_heading(self) -> TimingSection:
        if self.heading != "path" and self.law != "limits":
            raise ValueError(f"heading: '{self.heading}' needs the law limits, not {self.law}")
        if self.law == "uniform" and (self.max_jerk or self.max_yaw_jerk):
            raise ValueError("max_jerk, max_yaw_jerk: need the law limits or minimum-time")
        if (self.heading == "face") != (self.target is not None):
            raise ValueError("target: a point for the heading 'face', and only for it")
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

    def with_paper_noise(self) -> SensorsSection:
        """Return the same sensors with the noise of the paper in the pose fixes."""
        fixes = self.fixes and replace(self.fixes, law="paper")
        return self.model_copy(update={"fixes": fixes})


class WatchdogSection(Section):
    """Limits beyond which the watchdog stops the robot.

    See :class:`~omnidrive.control.supervision.WatchdogLimits`.
    """

    enabled: bool = True
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


def robot_of(section: RobotSection) -> Robot:
    """Return the robot with the parameters of the section.

    Raises:
        InvalidInput: The name is unknown, or the parameters are not those of a possible robot.
        InvalidRobot: The robot file is invalid.
    """
    changes = section.model_dump(exclude={"name", "roller_phase"}, exclude_none=True)
    if section.outline is not None:
        changes["body_radius"] = outline_radius(section.outline)
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
