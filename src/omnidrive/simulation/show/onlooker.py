"""Who sees a run as it happens, and how a plant is made to show itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, isfinite
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Reference
from omnidrive.robot import Robot
from omnidrive.simulation.conditions import Conditions
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco_plant import MujocoPlant
from omnidrive.simulation.plant import DisturbablePlant, Measurement, Plant
from omnidrive.simulation.show.puppet import Puppet, between

_EARLY = 1e-9  # s


@dataclass(frozen=True, eq=False, slots=True)
class Scene:
    """What there is to see.

    Attributes:
        model: The world as MuJoCo has it.
        data: Its state, which changes as the run goes on; only to be looked at.
        robot: Who drives.
        reference: What it should do.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    robot: Robot
    reference: Reference

    @property
    def place(self) -> tuple[float, float]:
        """Where the robot is, in W, in m."""
        x, y = self.data.qpos[:2].tolist()
        return x, y


@runtime_checkable
class Onlooker(Protocol):
    """Sees a run as it happens."""

    @property
    def period(self) -> float:
        """Simulated time from one look to the next, in s."""
        ...

    def begin(self, scene: Scene) -> None:
        """A run begins."""
        ...

    def look(self, t: float) -> None:
        """The scene now shows the world at ``t`` (s)."""
        ...


def watched(
    plant: Plant,
    robot: Robot,
    reference: Reference,
    onlookers: Sequence[Onlooker],
    *,
    obstacles: OccupancyGrid | None = None,
    moving: Sequence[MovingObstacle] = (),
) -> Plant:
    """The same plant, seen by ``onlookers`` between its samples as well; it moves as before.

    Of a :class:`~omnidrive.simulation.MujocoPlant` they see the very world, to the next physics
    step; of others the robot's model at interpolated poses, one sample late.

    Args:
        plant: What moves.
        robot: Who it is.
        reference: What it should do.
        onlookers: Who sees it; with none, this is ``plant`` itself.
        obstacles: The map around a plant that has none of its own.
        moving: What moves there, likewise.
    """
    if not onlookers:
        return plant
    watch = (
        _World(plant, robot, reference, onlookers)
        if isinstance(plant, MujocoPlant)
        else _Model(robot, reference, onlookers, obstacles, moving)
    )
    kind = _WatchedDisturbable if isinstance(plant, DisturbablePlant) else _Watched
    return kind(plant, watch)


class _Clock:
    """Tells an onlooker when to look: at the first moment that is no earlier than n periods."""

    def __init__(self, onlooker: Onlooker) -> None:
        self.onlooker = onlooker
        self._count = 0

    @property
    def next(self) -> float:
        """Time of the next look, in s."""
        return self._count * self.onlooker.period

    def begin(self, scene: Scene) -> None:
        """Look at the start."""
        self.onlooker.begin(scene)
        self.onlooker.look(0.0)
        self._count = 1

    def tick(self, t: float) -> None:
        """Look if it is time."""
        if t > self.next - _EARLY:
            self._count = floor((t + _EARLY) / self.onlooker.period) + 1
            self.onlooker.look(t)


class _World:
    """A MuJoCo plant's own world is seen."""

    def __init__(
        self,
        plant: MujocoPlant,
        robot: Robot,
        reference: Reference,
        onlookers: Sequence[Onlooker],
    ) -> None:
        self._scene = Scene(plant.model, plant.data, robot, reference)
        self._clocks = [_Clock(onlooker) for onlooker in onlookers]
        plant.observer = self._stepped

    def begin(self, state: Measurement) -> None:
        """The plant was reset."""
        for clock in self._clocks:
            clock.begin(self._scene)

    def moved(self, state: Measurement, dt: float) -> None:
        """All was seen in the steps."""

    def _stepped(self) -> None:
        for clock in self._clocks:
            clock.tick(self._scene.data.time)


class _Model:
    """The robot's model is put where the plant says that the robot is."""

    def __init__(
        self,
        robot: Robot,
        reference: Reference,
        onlookers: Sequence[Onlooker],
        obstacles: OccupancyGrid | None,
        moving: Sequence[MovingObstacle],
    ) -> None:
        self._puppet = Puppet(robot, obstacles=obstacles, moving=moving)
        self._scene = Scene(self._puppet.model, self._puppet.data, robot, reference)
        self._clocks = [_Clock(onlooker) for onlooker in onlookers]
        self._state = Measurement(Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0), 0.0)
        self._t, self._wheels = 0.0, np.zeros(len(robot.mounts))

    def begin(self, state: Measurement) -> None:
        """The plant was reset."""
        self._t, self._state, self._wheels = 0.0, state, np.zeros(len(self._wheels))
        self._puppet.put(0.0, state.pose, self._wheels)
        for clock in self._clocks:
            clock.begin(self._scene)

    def moved(self, state: Measurement, dt: float) -> None:
        """The plant made one step: show what was in between."""
        if not all(map(isfinite, (*state.pose, *state.twist))):
            return
        turned = self._puppet.rolled(self._state, state, self._wheels, dt)
        end = self._t + dt
        times = {
            clock.next + k * clock.onlooker.period
            for clock in self._clocks
            for k in range(floor((end + _EARLY - clock.next) / clock.onlooker.period) + 1)
        }
        for t in sorted(times):
            part = min(max((t - self._t) / dt, 0.0), 1.0)
            wheels = self._wheels + part * (turned - self._wheels)
            self._puppet.put(t, between(self._state, state, dt, part), wheels)
            for clock in self._clocks:
                clock.tick(t)
        self._t, self._state, self._wheels = end, state, turned


class _Watched:
    """A plant that is seen."""

    def __init__(self, plant: Plant, watch: _World | _Model) -> None:
        self._plant, self._watch = plant, watch

    def reset(self, pose: Pose) -> Measurement:
        """As the plant does."""
        state = self._plant.reset(pose)
        self._watch.begin(state)
        return state

    def step(self, twist: BodyTwist, dt: float) -> Measurement:
        """As the plant does."""
        state = self._plant.step(twist, dt)
        self._watch.moved(state, dt)
        return state


class _WatchedDisturbable(_Watched):
    """A plant that is seen, and on which more acts than the command."""

    def impose(self, conditions: Conditions) -> None:
        """As the plant does."""
        assert isinstance(self._plant, DisturbablePlant)
        self._plant.impose(conditions)
