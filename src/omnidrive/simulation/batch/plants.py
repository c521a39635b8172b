"""The plants that compiled loops can simulate."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from math import nan
from typing import Any, NamedTuple, cast

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compilable, compiled
from omnidrive.errors import InvalidInput, kind_of
from omnidrive.geometry import Pose
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.kinematic import KinematicModel, KinematicPlant, KinematicState, follow
from omnidrive.simulation.planar.dynamics import integrate
from omnidrive.simulation.planar.plant import PlanarPlant
from omnidrive.simulation.planar.state import PlanarState
from omnidrive.simulation.plant import DisturbablePlant, Plant, count_steps

_Vector = Float[Array, " 3"]
MOTION = np.dtype([("pose", "f8", 3), ("twist", "f8", 3), ("work", "f8"), ("saturated", "f8")])
"""True motion: pose (m, m, rad), body twist (m/s, m/s, rad/s), work (J), saturated limits."""

compilable(count_steps)


class PlantKernels(NamedTuple):
    """A plant as kernels; ``model`` and ``state`` are named tuples of the plant's arrays.

    ``motion`` is a record of :data:`MOTION`, filled in.
    """

    start: Callable[..., None]
    """``start(initial, state, pose, motion)``: set the state to the initial one, at ``pose``."""
    step: Callable[..., None]
    """``step(model, state, command, dt, motion)``: execute a body twist for ``dt`` (s)."""
    wheels: Callable[..., None]
    """``wheels(state, speeds, torques, angles)``: fill in what the plant has of the speeds (rad/s),
    torques (N m) and angles (rad)."""


class BatchPlant:
    """A copy of a plant, the arrays of which compiled loops read and change.

    Args:
        plant: A :class:`KinematicPlant` or :class:`PlanarPlant`; it is not changed.

    Raises:
        InvalidInput: It is another plant.
    """

    def __init__(self, plant: Plant) -> None:
        if type(plant) is KinematicPlant:
            self.kernels, self.forces = _KINEMATIC, False
        elif type(plant) is PlanarPlant:
            self.kernels, self.forces = _PLANAR, True
        else:
            raise InvalidInput(
                f"a batch simulates the plants kinematic and planar, got {kind_of(plant)}: use "
                "simulate, or make_plant(robot, 'planar')"
            )
        own: Any = copy(plant)
        own.reset(Pose(0.0, 0.0, 0.0))
        self.plant: Plant = own
        self.wheels = len(own.robot.mounts)
        self.initial = type(own._state)(*(array.copy() for array in own._state))

    def apply(self, disturbances: Disturbances) -> None:
        """Set the disturbances of the plant, see ``DisturbablePlant.apply``."""
        cast(DisturbablePlant, self.plant).apply(disturbances)

    @property
    def model(self) -> Any:
        """Parameters of the plant; those of ``apply`` from then on."""
        own: Any = self.plant
        if self.forces:
            return _PlanarData(own._model.body, own._model.wheels, own.timestep)
        return own._model

    @property
    def state(self) -> Any:
        """State of the plant."""
        own: Any = self.plant
        return own._state


class _PlanarData(NamedTuple):
    bodies: Array
    wheels: Array
    timestep: float


@compiled
def _start_kinematic(
    initial: KinematicState, state: KinematicState, pose: _Vector, motion: Any
) -> None:
    state.twist[:], state.speeds[:] = initial.twist, initial.speeds
    for i in range(3):
        state.pose[i] = pose[i]
    _measure_kinematic(state, motion)
    motion.saturated = 0.0


@compiled
def _step_kinematic(
    model: KinematicModel, state: KinematicState, command: _Vector, dt: float, motion: Any
) -> None:
    scaled = follow(
        model.drive, model.inverse, model.max_wheel_speed, state.pose, state.twist, state.speeds,
        command[0], command[1], command[2], dt,
    )  # fmt: skip
    _measure_kinematic(state, motion)
    motion.saturated = 1.0 if scaled else 0.0


@compiled
def _measure_kinematic(state: KinematicState, motion: Any) -> None:
    for i in range(3):
        motion.pose[i], motion.twist[i] = state.pose[i], state.twist[i]
    motion.work = nan


@compiled
def _kinematic_wheels(state: KinematicState, speeds: Array, torques: Array, angles: Array) -> None:
    for i in range(len(speeds)):
        speeds[i] = state.speeds[i]


@compiled
def _start_planar(initial: PlanarState, state: PlanarState, pose: _Vector, motion: Any) -> None:
    state.motion[:], state.wheels[:] = initial.motion, initial.wheels
    state.rollers[:] = initial.rollers
    body = state.motion[0]
    body.x, body.y, body.yaw = pose[0], pose[1], pose[2]
    _measure_planar(state, motion)


@compiled
def _step_planar(
    model: _PlanarData, state: PlanarState, command: _Vector, dt: float, motion: Any
) -> None:
    steps = count_steps(dt, model.timestep)
    integrate(
        model.bodies, model.wheels, state.motion, state.wheels, state.rollers,
        command[0], command[1], command[2], dt / steps, steps,
    )  # fmt: skip
    _measure_planar(state, motion)


@compiled
def _measure_planar(state: PlanarState, motion: Any) -> None:
    body, pose, twist = state.motion[0], motion.pose, motion.twist
    pose[0], pose[1], pose[2] = body.x, body.y, body.yaw
    twist[0], twist[1], twist[2] = body.vx, body.vy, body.yaw_rate
    motion.work, motion.saturated = body.work, body.saturated


@compiled
def _planar_wheels(state: PlanarState, speeds: Array, torques: Array, angles: Array) -> None:
    for i in range(len(speeds)):
        speeds[i], torques[i] = state.wheels[i].speed, state.wheels[i].torque
        angles[i] = state.wheels[i].angle


_KINEMATIC = PlantKernels(_start_kinematic, _step_kinematic, _kinematic_wheels)
_PLANAR = PlantKernels(_start_planar, _step_planar, _planar_wheels)
