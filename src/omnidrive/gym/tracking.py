"""The environment `omnidrive/Tracking-v0`: tracking of any reference with any plant."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import hypot, isfinite, pi
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from jaxtyping import Float32, UInt8

from omnidrive.arrays import Array
from omnidrive.control.controller import STOP
from omnidrive.errors import InvalidInput, short_repr
from omnidrive.estimation import LatestFix, StateEstimator
from omnidrive.geometry import BodyTwist, Pose, twist_between, wrap
from omnidrive.gym.observation import ObservationModel, top_speed
from omnidrive.gym.renderer import Renderer
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import Bounds, check_choice, check_number
from omnidrive.planning import SplinePath
from omnidrive.reference import Reference, shortest_duration, time_uniformly
from omnidrive.robot import Robot, named_robot
from omnidrive.scenario import make_plant, paper_scenario, plan_scenario
from omnidrive.simulation import PerfectSensors, Plant, PlantState, Sensors

_BOUNDS = {
    "dt": (Bounds(0.001, 1.0, "s"),),
    "smoothness_weight": (Bounds(0.0, 1000.0, ""),),
    "start_spread": (Bounds(0.0, 10.0, "m"), Bounds(0.0, pi, "rad")),
    "max_error": (Bounds(0.001, 1000.0, "m"), Bounds(0.001, pi, "rad")),
    "max_twist": (Bounds(1e-6, 1e6, "m/s"), Bounds(1e-6, 1e6, "m/s"), Bounds(1e-6, 1e6, "rad/s")),
}
"""Ranges of the numbers that the arguments of the environment consist of."""


class TrackingEnv(gymnasium.Env[Array, Array]):
    """Tracking of a reference by a robot, one sample per step.

    **Action**: three numbers from -1 to 1, the body twist to hold for a sample, divided by
    ``max_twist``; larger numbers are clipped. The plant also applies the limits of the wheels.

    **Observation**: see :class:`~omnidrive.gym.observation.ObservationModel`. It contains the
    estimated pose and the true twist; with ``sensors``, the twist between two estimated poses.

    **Reward**: ``-((d / max_error[0])^2 + (h / max_error[1])^2 + smoothness_weight * |change of the
    action|^2)``, where d and h are the true errors in position and heading after the step. A step
    that terminates the run costs the maximum of the first two terms, 2, and again 2 for every
    remaining step.

    **End**: terminated when ``d > max_error[0]``, ``h > max_error[1]`` or the state of the plant is
    not finite; truncated at the end of the reference.

    **Info**: ``t`` in s; ``pose`` (true), ``measured`` (estimated) and ``target``, each in m, m,
    rad; ``error``: d in m and h in rad.

    The same seed gives the same run, independently of previous runs.

    Attributes:
        max_twist: Twist of an action of ones; m/s, m/s, rad/s.
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
        start_spread: tuple[float, float] = (0.05, 0.05),
        max_error: tuple[float, float] = (1.0, 0.5 * pi),
        smoothness_weight: float = 0.05,
        render_mode: str | None = None,
        render_size: tuple[int, int] = (640, 360),
    ) -> None:
        """Build the environment.

        Args:
            plant: Name of the plant, or a factory of one.
            robot: Name of the robot, or the robot.
            reference: Reference to track; by default the paper's path in 20 s or longer.
            sensors: Factory of the simulated sensors from a generator; by default exact sensors.
            estimator: Factory of the state estimator that receives their readings.
            obstacles: Map of the obstacles, for plants with collisions.
            dt: Sample time, s.
            preview: Number of future reference poses in an observation, 0 to 100.
            max_twist: Twist of an action of ones; by default that of :func:`max_axis_twist`.
            start_spread: Largest initial offset in x and in y (m), and in heading (rad).
            max_error: Errors in position (m) and heading (rad, up to pi) that terminate a run.
            smoothness_weight: Weight of changes of the action in the reward.
            render_mode: `rgb_array` for pictures.
            render_size: Width and height of the pictures, pixels.

        Raises:
            InvalidInput: A number is out of its range, or the plant or the robot is unknown.
            InvalidReference: The robot cannot follow the default reference.
        """
        self._robot = named_robot(robot) if isinstance(robot, str) else robot
        _check_settings(
            preview, render_mode, dt=dt, max_twist=max_twist, start_spread=start_spread,
            max_error=max_error, smoothness_weight=smoothness_weight,
        )  # fmt: skip
        self._reference = reference or _default_reference(self._robot)
        self._plant = _build_plant(plant, self._robot, obstacles)
        self._make_sensors, self._make_estimator = sensors, estimator
        self._dt, self._smoothness_weight = dt, smoothness_weight
        self._start_spread, self._max_error = start_spread, max_error
        self.max_twist = np.array(max_twist or max_axis_twist(self._robot), dtype=float)
        self._last = max(round(self._reference.duration / dt), 1)
        self._observation_model = ObservationModel(
            self._reference, dt, preview, max_error, self.max_twist, top_speed(self._reference, dt)
        )
        self.observation_space = spaces.Box(-1.0, 1.0, (self._observation_model.size,), np.float32)
        self.action_space, self.render_mode = spaces.Box(-1.0, 1.0, (3,), np.float32), render_mode
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / dt), 1)}
        self._renderer = Renderer(self._plant, self._robot, self._reference, render_size, obstacles)
        self._k, self._has_reset, self._running = 0, False, False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32[Array, " numbers"], dict[str, Any]]:
        """Start a run.

        Args:
            seed: Seed of all random numbers from now on.
            options: ``{"offset": (m, m, rad)}`` sets the initial offset from the reference, which
                is random otherwise.

        Raises:
            InvalidInput: There is another option, or the offset is not three finite numbers.
        """
        super().reset(seed=seed)
        start = Pose(*(np.array(self._reference.at(0.0).pose) + self._offset(options)).tolist())
        self._k, self._has_reset, self._running = 0, True, True
        self._action = np.zeros(3)
        self._state = self._plant.reset(start)
        make = self._make_sensors
        self._sensors = make(self.np_random) if make else PerfectSensors()
        self._sensors.reset(start)
        self._estimator = self._make_estimator()
        self._estimator.reset(start)
        self._estimate = self._estimator.update(self._sensors.read(0.0, self._state)).pose
        self._twist = STOP
        self._renderer.begin(self._state)
        return self._observation(), self._info()

    def step(
        self, action: Array
    ) -> tuple[Float32[Array, " numbers"], float, bool, bool, dict[str, Any]]:
        """Hold an action for one sample.

        Raises:
            InvalidInput: The action is not three finite numbers.
            ResetNeeded: ``reset`` was not called, or the run has ended.
        """
        if not self._running:
            raise gymnasium.error.ResetNeeded("the run has ended: call reset() before step()")
        values = _numbers("an action", action, 3, "shares of max_twist, -1 to 1")
        before, self._action = self._action, np.clip(values, -1.0, 1.0)
        twist = BodyTwist(*(self._action * self.max_twist).tolist())
        state = self._plant.step(twist, self._dt)
        self._k += 1
        failed = not all(map(isfinite, (*state.pose, *state.twist)))
        if not failed:
            self._update_estimate(state)
        distance, heading = self._error()
        farthest, most_turned = self._max_error
        lost = failed or distance > farthest or heading > most_turned
        cost = 2.0 if lost else (distance / farthest) ** 2 + (heading / most_turned) ** 2
        cost += self._smoothness_weight * float(((self._action - before) ** 2).sum())
        if lost:
            cost += 2.0 * (self._last - self._k)
        ended = self._k >= self._last
        self._running = not (lost or ended)
        return self._observation(), -cost, lost, ended, self._info()

    def render(self) -> UInt8[Array, "height width 3"] | None:
        """Draw the robot, its reference and its trail.

        Raises:
            CannotDraw: OpenGL is not available.
            ResetNeeded: ``reset`` was not called.
        """
        if self.render_mode is None:
            return None
        if not self._has_reset:
            raise gymnasium.error.ResetNeeded("there is no state to draw: call reset() first")
        return self._renderer.draw(self._time)

    def close(self) -> None:
        """Release the renderer and the plant."""
        self._renderer.close()
        self._plant.close()

    @property
    def _time(self) -> float:
        return self._k * self._dt  # a running sum would accumulate rounding errors

    def _offset(self, options: dict[str, Any] | None) -> Array:
        options = options or {}
        if set(options) - {"offset"}:
            raise InvalidInput(f"the only option of reset is offset, got {short_repr(options)}")
        if "offset" not in options:
            position, heading = self._start_spread
            return self.np_random.uniform(-1.0, 1.0, 3) * [position, position, heading]
        return _numbers("offset", options["offset"], 3, "m, m, rad")

    def _update_estimate(self, state: PlantState) -> None:
        """Update the estimate after a step of the plant."""
        estimate = self._estimator.update(self._sensors.read(self._time, state)).pose
        self._twist = (
            twist_between(self._estimate, estimate, self._dt) if self._make_sensors else state.twist
        )
        self._state, self._estimate = state, estimate
        self._renderer.advance(state, self._dt)

    def _error(self) -> tuple[float, float]:
        """Return the true errors in position (m) and heading (rad)."""
        target, pose = self._reference.at(self._time).pose, self._state.pose
        return hypot(pose.x - target.x, pose.y - target.y), abs(wrap(pose.yaw - target.yaw))

    def _observation(self) -> Float32[Array, " numbers"]:
        return self._observation_model.observe(
            self._time, self._estimate, self._twist, self._action
        )

    def _info(self) -> dict[str, Any]:
        return {
            "t": self._time,
            "pose": np.array(self._state.pose),
            "measured": np.array(self._estimate),
            "target": np.array(self._reference.at(self._time).pose),
            "error": np.array(self._error()),
        }


def max_axis_twist(robot: Robot) -> BodyTwist:
    """Return the largest twist along each axis alone that the wheels permit; m/s, m/s, rad/s."""
    chassis = robot.chassis
    per_wheel = np.abs(chassis.jacobian).max(axis=0)
    return BodyTwist(*(chassis.max_wheel_speed / per_wheel).tolist())


@cache
def _paper_path() -> SplinePath:
    path = plan_scenario(paper_scenario()).path
    assert isinstance(path, SplinePath)
    return path


def _build_plant(
    plant: str | Callable[[Robot], Plant], robot: Robot, obstacles: OccupancyGrid | None
) -> Plant:
    """Build the plant from its name or factory."""
    if isinstance(plant, str):
        return make_plant(robot, plant, obstacles=obstacles)
    return plant(robot)


def _default_reference(robot: Robot) -> Reference:
    path, chassis = _paper_path(), robot.chassis
    return time_uniformly(path, max(20.0, shortest_duration(path, chassis)), chassis)


def _check_settings(preview: object, render_mode: object, **settings: object) -> None:
    """Raise InvalidInput for the first invalid argument of the environment."""
    check_number("preview", preview, Bounds(0, 100, "poses"))
    if not isinstance(preview, int):
        raise InvalidInput(f"preview is {preview}, need a whole number")
    if render_mode is not None:
        check_choice("render_mode", render_mode, TrackingEnv.metadata["render_modes"])
    for name, bounds in _BOUNDS.items():
        value = settings[name]
        if len(bounds) == 1:
            check_number(name, value, bounds[0])
            continue
        if value is None:  # the default of max_twist
            continue
        units = ", ".join(bound.unit for bound in bounds)
        for number, bound in zip(_numbers(name, value, len(bounds), units), bounds, strict=True):
            check_number(name, number, bound)


def _numbers(name: str, values: object, count: int, units: str) -> Array:
    """Return ``count`` finite numbers as an array.

    Raises:
        InvalidInput: ``values`` is something else; the message states the name and the units.
    """
    try:
        found = np.asarray(values)
    except ValueError:  # a list of lists of different lengths
        found = np.empty(0)
    if found.dtype.kind not in "fiub" or found.shape != (count,) or not np.isfinite(found).all():
        raise InvalidInput(f"{name} must be {count} numbers ({units}), got {short_repr(values)}")
    return found.astype(float)
