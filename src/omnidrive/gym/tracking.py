"""The environment `omnidrive/Tracking-v0`: any plant has to follow any reference."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import hypot, isfinite, pi
from typing import Any, cast, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from jaxtyping import Float32, UInt8

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.estimation import LatestFix, StateEstimator
from omnidrive.geometry import BodyTwist, Pose, twist_between, wrap
from omnidrive.gym.observation import ObservationModel, top_speed
from omnidrive.gym.renderer import Renderer
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.reference import Reference, shortest_duration, time_uniformly
from omnidrive.robot import Robot, named_robot
from omnidrive.simulation import PerfectSensors, Plant, PlantState, Sensors
from omnidrive.study import PlantName, make_plant, paper_scenario, plan_scenario
from omnidrive.study.section import OLD_PLANTS, current_name

_REST = BodyTwist(0.0, 0.0, 0.0)


class TrackingEnv(gymnasium.Env[Array, Array]):
    """A robot that has to follow a reference, one sample per step.

    **Action**: three numbers from -1 to 1, the body twist to hold for a sample, divided by
    ``max_twist``; larger ones are cut. The wheels' limits cut the twist once more.

    **Observation**: see :class:`~omnidrive.gym.observation.ObservationLaw`. It is of what the
    sensor makes of the robot's pose, and of the true twist; with a sensor, of the twist from one
    of its poses to the next.

    **Reward**: ``-((d / lost[0])^2 + (h / lost[1])^2 + effort |change of the action|^2)``, where d
    and h are the true errors in position and heading after the step. The step that loses the
    robot costs the worst of the first two terms, 2, for every step that is left as well.

    **End**: terminated when ``d > lost[0]``, ``h > lost[1]`` or the plant's state is not finite;
    truncated at the end of the reference.

    **Info**: ``t`` in s; ``pose``, the true one, ``measured`` and ``target``, each in m, m, rad;
    ``error``: d in m and h in rad.

    The same seed gives the same run, whatever was run before.

    Attributes:
        max_twist: Twist of an action of ones, in m/s, m/s and rad/s.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        *,
        plant: str | Callable[[Robot], Plant] = "mujoco-rollers",
        robot: str | Robot = "paper",
        reference: Reference | None = None,
        sensors: Callable[[np.random.Generator], Sensors] | None = None,
        estimator: Callable[[], StateEstimator] = LatestFix,
        obstacles: OccupancyGrid | None = None,
        dt: float = 0.1,
        preview: int = 5,
        max_twist: BodyTwist | None = None,
        spread: tuple[float, float] = (0.05, 0.05),
        lost: tuple[float, float] = (1.0, 0.5 * pi),
        effort: float = 0.05,
        render_mode: str | None = None,
        render_size: tuple[int, int] = (640, 360),
    ) -> None:
        """Build the plant.

        Args:
            plant: Its name, or what makes one.
            robot: Its name, or the robot itself.
            reference: What to track; by default the paper's path, in 20 s or as fast as it can.
            sensors: Makes the simulated sensors with a random generator; by default exact ones.
            estimator: Makes the estimator of the pose from their readings.
            obstacles: A map that stands around the robot, where the plant has obstacles.
            dt: Sample time in s.
            preview: How many set points ahead are observed, 0 to 100.
            max_twist: Twist of an action of ones, in m/s, m/s, rad/s; by default the fastest
                along each axis alone that the wheels allow.
            spread: A run starts off the reference by up to so much: in m along x and y each, and
                in rad.
            lost: Errors in m and in rad, up to pi, beyond which the run is lost.
            effort: Weight of changes of the action in the reward.
            render_mode: `rgb_array` for pictures.
            render_size: Their width and height in pixels.

        Raises:
            InvalidInput: A number is out of its range, or there is no such plant or robot.
            InvalidReference: The robot cannot follow the reference.
        """
        self._robot = named_robot(robot) if isinstance(robot, str) else robot
        _check(
            plant=plant, dt=dt, preview=preview, max_twist=max_twist, spread=spread, lost=lost,
            effort=effort, render_mode=render_mode,
        )  # fmt: skip
        self._reference = reference or _usual_reference(self._robot)
        self._plant = _made(plant, self._robot, obstacles)
        self._make_sensors, self._make_estimator = sensors, estimator
        self._dt, self._effort = dt, effort
        self._spread, self._lost = spread, lost
        self._last = max(round(self._reference.duration / dt), 1)
        self.max_twist = np.array(max_twist or max_axis_twist(self._robot), dtype=float)
        self._law = ObservationModel(
            self._reference, dt, preview, lost, self.max_twist, top_speed(self._reference, dt)
        )
        self.observation_space = spaces.Box(-1.0, 1.0, (self._law.size,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / dt), 1)}
        self.render_mode = render_mode
        self._picture = Renderer(self._plant, self._robot, self._reference, render_size, obstacles)
        self._k, self._begun, self._running = 0, False, False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32[Array, " numbers"], dict[str, Any]]:
        """Begin a run.

        Args:
            seed: Of everything that is drawn from now on.
            options: ``{"offset": (m, m, rad)}``: by how much the robot starts off the reference,
                instead of by chance.

        Raises:
            InvalidInput: There is another option, or the offset is not three finite numbers.
        """
        super().reset(seed=seed)
        start = Pose(*(np.array(self._reference.at(0.0).pose) + self._offset(options)).tolist())
        self._k, self._begun, self._running = 0, True, True
        self._action = np.zeros(3)
        self._state = self._plant.reset(start)
        make = self._make_sensors
        self._sensors = make(self.np_random) if make else PerfectSensors()
        self._sensors.reset(start)
        self._estimator = self._make_estimator()
        self._estimator.reset(start)
        self._seen = self._estimator.update(self._sensors.read(0.0, self._state)).pose
        self._twist = _REST
        self._picture.begin(self._state)
        return self._observation(), self._info()

    def step(
        self, action: Array
    ) -> tuple[Float32[Array, " numbers"], float, bool, bool, dict[str, Any]]:
        """Hold an action for one sample.

        Raises:
            InvalidInput: It is not three numbers.
            ResetNeeded: No run is under way.
        """
        if not self._running:
            raise gymnasium.error.ResetNeeded("this run is over: call reset() before step()")
        given = np.asarray(action, dtype=float)
        if given.shape != (3,) or not np.isfinite(given).all():
            raise InvalidInput(f"an action is three numbers from -1 to 1, got {action}")
        before, self._action = self._action, np.clip(given, -1.0, 1.0)
        twist = BodyTwist(*(self._action * self.max_twist).tolist())
        state = self._plant.step(twist, self._dt)
        self._k += 1
        failed = not all(map(isfinite, (*state.pose, *state.twist)))
        if not failed:
            self._take(state)
        distance, turned = self._error()
        lost = failed or distance > self._lost[0] or turned > self._lost[1]
        cost = 2.0 if lost else (distance / self._lost[0]) ** 2 + (turned / self._lost[1]) ** 2
        cost += self._effort * float(((self._action - before) ** 2).sum())
        if lost:
            cost += 2.0 * (self._last - self._k)
        over = self._k >= self._last
        self._running = not (lost or over)
        return self._observation(), -cost, lost, over, self._info()

    def render(self) -> UInt8[Array, "height width 3"] | None:
        """A picture of the robot, its reference and the way that it has gone.

        Raises:
            CannotDraw: There is no OpenGL.
        """
        if self.render_mode is None:
            return None
        if not self._begun:
            raise gymnasium.error.ResetNeeded("there is nothing to see: call reset() first")
        return self._picture.draw(self._time)

    def close(self) -> None:
        """Release the renderer and the plant."""
        self._picture.close()
        self._plant.close()

    @property
    def _time(self) -> float:
        return self._k * self._dt  # never a running sum: it drifts

    def _offset(self, options: dict[str, Any] | None) -> Array:
        options = options or {}
        if set(options) - {"offset"}:
            raise InvalidInput(f"the only option of reset is offset, got {', '.join(options)}")
        if "offset" not in options:
            across, turn = self._spread
            return self.np_random.uniform(-1.0, 1.0, 3) * [across, across, turn]
        offset = np.asarray(options["offset"], dtype=float)
        if offset.shape != (3,) or not np.isfinite(offset).all():
            raise InvalidInput(f"an offset is three numbers in m, m, rad; got {options['offset']}")
        return offset

    def _take(self, state: PlantState) -> None:
        """Estimate the pose after a step of the plant."""
        seen = self._estimator.update(self._sensors.read(self._time, state)).pose
        self._twist = (
            twist_between(self._seen, seen, self._dt) if self._make_sensors else state.twist
        )
        self._state, self._seen = state, seen
        self._picture.moved(state, self._dt)

    def _error(self) -> tuple[float, float]:
        """True errors in position and heading, in m and rad."""
        target, pose = self._reference.at(self._time).pose, self._state.pose
        return hypot(pose.x - target.x, pose.y - target.y), abs(wrap(pose.yaw - target.yaw))

    def _observation(self) -> Float32[Array, " numbers"]:
        return self._law.observe(self._time, self._seen, self._twist, self._action)

    def _info(self) -> dict[str, Any]:
        return {
            "t": self._time,
            "pose": np.array(self._state.pose),
            "measured": np.array(self._seen),
            "target": np.array(self._reference.at(self._time).pose),
            "error": np.array(self._error()),
        }


def max_axis_twist(robot: Robot) -> BodyTwist:
    """The fastest along each axis alone that the wheels of ``robot`` allow; m/s, m/s, rad/s."""
    chassis = robot.chassis
    per_wheel = np.abs(chassis.jacobian).max(axis=0)
    return BodyTwist(*(chassis.max_wheel_speed / per_wheel).tolist())


@cache
def _paper_path() -> SplinePath:
    return plan_scenario(paper_scenario()).path


def _made(
    plant: str | Callable[[Robot], Plant], robot: Robot, obstacles: OccupancyGrid | None
) -> Plant:
    """The plant of that name, or that is made so."""
    if isinstance(plant, str):
        name = current_name(plant, OLD_PLANTS)
        return make_plant(robot, cast(PlantName, name), obstacles=obstacles)
    return plant(robot)


def _usual_reference(robot: Robot) -> Reference:
    path, chassis = _paper_path(), robot.chassis
    return time_uniformly(path, max(20.0, shortest_duration(path, chassis)), chassis)


def _check(
    *,
    plant: str | Callable[[Robot], Plant],
    dt: float,
    preview: int,
    max_twist: BodyTwist | None,
    spread: tuple[float, float],
    lost: tuple[float, float],
    effort: float,
    render_mode: str | None,
) -> None:
    """Refuse what makes no environment."""
    plants = get_args(PlantName)
    wrong = {
        f"there is no plant '{plant}'; there are {', '.join(plants)}": isinstance(plant, str)
        and plant not in (*plants, *OLD_PLANTS),
        f"dt is {dt:g} s, need 0.001 to 1 s": not 0.001 <= dt <= 1.0,
        f"preview is {preview}, need 0 to 100": not 0 <= preview <= 100,
        f"max_twist is {max_twist}, need positive numbers": max_twist is not None
        and not all(isfinite(most) and most > 0.0 for most in max_twist),
        f"spread is {spread}, need 0 to 10 m and 0 to pi rad": not (
            0.0 <= spread[0] <= 10.0 and 0.0 <= spread[1] <= pi
        ),
        f"lost is {lost}, need 0.001 to 1000 m and 0.001 to pi rad": not (
            0.001 <= lost[0] <= 1000.0 and 0.001 <= lost[1] <= pi
        ),
        f"effort is {effort:g}, need 0 to 1000": not 0.0 <= effort <= 1000.0,
        f"render_mode is '{render_mode}', need rgb_array or None": render_mode
        not in {None, "rgb_array"},
    }
    for why, so in wrong.items():
        if so:
            raise InvalidInput(why)
