"""Observers of a run, and plants that call them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import floor, isfinite
from typing import Protocol, cast, runtime_checkable

import mujoco
import numpy as np

from omnidrive.control import CommandValue
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import TIME_TOLERANCE
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.plant import (
    DisturbablePlant,
    Plant,
    PlantCapabilities,
    PlantState,
)
from omnidrive.visualization.display_model import DisplayModel, interpolate_pose


class RenderedPlant(Plant, Protocol):
    """A plant with the capability ``renders``: it is simulated in MuJoCo."""

    observer: Callable[[], None] | None
    """Called after every physics step; it must not change the simulation."""

    @property
    def model(self) -> mujoco.MjModel:
        """The MuJoCo model."""
        ...

    @property
    def data(self) -> mujoco.MjData:
        """The MuJoCo state."""
        ...


@dataclass(frozen=True, eq=False, slots=True)
class Scene:
    """The simulated world that observers receive.

    Attributes:
        model: MuJoCo model of the world.
        data: Its state, which changes during the run; read-only for observers.
        robot: The robot.
        reference: The motion that it tracks.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    robot: Robot
    reference: Reference

    @property
    def position(self) -> tuple[float, float]:
        """Position of the robot in W, m."""
        x, y = self.data.qpos[:2].tolist()
        return x, y


@runtime_checkable
class Observer(Protocol):
    """Object that is called with the scene of a run at regular simulated times."""

    @property
    def period(self) -> float:
        """Simulated time between two calls of ``update``, s."""
        ...

    def begin(self, scene: Scene) -> None:
        """Start a run with ``scene``."""
        ...

    def update(self, t: float) -> None:
        """Process the state of the scene at ``t`` (s)."""
        ...


def observe(
    plant: Plant,
    robot: Robot,
    reference: Reference,
    observers: Sequence[Observer],
    *,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> Plant:
    """Return a plant with the same motion that calls ``observers``, also between its samples.

    For a plant with the capability ``renders`` they receive its own model, after the first physics
    step at or after each period; for others a model of the robot at interpolated poses, one sample
    late.

    Args:
        plant: The plant.
        robot: Its robot.
        reference: The motion that it tracks.
        observers: Without any, ``plant`` itself is returned.
        obstacles: Map to draw around a plant without a model of its own.
        moving: Moving obstacles to draw there.
    """
    if not observers:
        return plant
    source = (
        _OwnWorld(cast(RenderedPlant, plant), robot, reference, observers)
        if plant.capabilities.renders
        else _ModelledWorld(robot, reference, observers, obstacles, moving)
    )
    kind = _ObservedDisturbable if plant.capabilities.disturbable else _Observed
    return kind(plant, source)


class _Clock:
    """Calls of an observer at the first instant that is not before n periods."""

    def __init__(self, observer: Observer) -> None:
        self.observer = observer
        self._count = 0

    @property
    def next(self) -> float:
        """Time of the next call, s."""
        return self._count * self.observer.period

    def begin(self, scene: Scene) -> None:
        """Call the observer at the start."""
        self.observer.begin(scene)
        self.observer.update(0.0)
        self._count = 1

    def tick(self, t: float) -> None:
        """Call the observer if the next call is due at ``t`` (s)."""
        if t > self.next - TIME_TOLERANCE:
            self._count = floor((t + TIME_TOLERANCE) / self.observer.period) + 1
            self.observer.update(t)


class _OwnWorld:
    """Observation of a plant that is simulated in MuJoCo."""

    def __init__(
        self,
        plant: RenderedPlant,
        robot: Robot,
        reference: Reference,
        observers: Sequence[Observer],
    ) -> None:
        self._scene = Scene(plant.model, plant.data, robot, reference)
        self._clocks = [_Clock(observer) for observer in observers]
        plant.observer = self._stepped

    def begin(self, state: PlantState) -> None:
        """Call the observers at the start of a run."""
        for clock in self._clocks:
            clock.begin(self._scene)

    def advance(self, state: PlantState, dt: float) -> None:
        """Do nothing: the observers were called in the physics steps."""

    def _stepped(self) -> None:
        for clock in self._clocks:
            clock.tick(self._scene.data.time)


class _ModelledWorld:
    """Observation of other plants: a model of the robot at the reported poses."""

    def __init__(
        self,
        robot: Robot,
        reference: Reference,
        observers: Sequence[Observer],
        obstacles: OccupancyGrid | None,
        moving: Sequence[MovingObstacle],
    ) -> None:
        self._display = DisplayModel(robot, obstacles=obstacles, moving=moving)
        self._scene = Scene(self._display.model, self._display.data, robot, reference)
        self._clocks = [_Clock(observer) for observer in observers]
        self._state = PlantState(Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0), 0.0)
        self._t, self._wheels = 0.0, np.zeros(len(robot.mounts))

    def begin(self, state: PlantState) -> None:
        """Call the observers at the start of a run."""
        self._t, self._state, self._wheels = 0.0, state, np.zeros(len(self._wheels))
        self._display.set_pose(0.0, state.pose, self._wheels)
        for clock in self._clocks:
            clock.begin(self._scene)

    def advance(self, state: PlantState, dt: float) -> None:
        """Call the observers at their times within one step of the plant."""
        if not all(map(isfinite, (*state.pose, *state.twist))):
            return
        angles = self._display.next_wheel_angles(self._state, state, self._wheels, dt)
        end = self._t + dt
        times = {
            clock.next + k * clock.observer.period
            for clock in self._clocks
            for k in range(floor((end + TIME_TOLERANCE - clock.next) / clock.observer.period) + 1)
        }
        for t in sorted(times):
            fraction = min(max((t - self._t) / dt, 0.0), 1.0)
            wheels = self._wheels + fraction * (angles - self._wheels)
            self._display.set_pose(t, interpolate_pose(self._state, state, dt, fraction), wheels)
            for clock in self._clocks:
                clock.tick(t)
        self._t, self._state, self._wheels = end, state, angles


class _Observed:
    """A plant whose steps are observed."""

    def __init__(self, plant: Plant, source: _OwnWorld | _ModelledWorld) -> None:
        self._plant, self._source = plant, source

    @property
    def capabilities(self) -> PlantCapabilities:
        """Capabilities of the plant."""
        return self._plant.capabilities

    def reset(self, pose: Pose) -> PlantState:
        """Reset the plant."""
        state = self._plant.reset(pose)
        self._source.begin(state)
        return state

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Step the plant."""
        state = self._plant.step(command, dt)
        self._source.advance(state, dt)
        return state

    def close(self) -> None:
        """Close the plant."""
        self._plant.close()


class _ObservedDisturbable(_Observed):
    """A disturbable plant whose steps are observed."""

    def apply(self, disturbances: Disturbances) -> None:
        """Apply the disturbances to the plant."""
        cast(DisturbablePlant, self._plant).apply(disturbances)
