"""Disturbances of a robot in MuJoCo, applied to its model and its state."""

from __future__ import annotations

import copy
from itertools import chain
from math import cos, hypot, sin

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot import GRAVITY, Mount
from omnidrive.simulation.disturbances.disturbances import (
    WEAK_TORQUE_FACTOR,
    Disturbances,
    Impulse,
    Motor,
    Patch,
    Payload,
    PoseOffset,
)
from omnidrive.simulation.mujoco.wheels import ball_friction

_BRAKE = 1e4  # N m s/rad; a locked wheel creeps at most 0.1 mm/s at its friction limit
_BODY_SOFTNESS = 2e-5  # factor of the inverse weight that contacts of the body are scaled with
_MOTORS = (
    "actuator_gainprm", "actuator_biasprm", "actuator_forcerange", "actuator_forcelimited",
)  # fmt: skip
_FRICTION = ("geom_friction", "geom_priority", "pair_friction")
_MASSES = (
    "body_mass", "body_ipos", "body_iquat", "body_inertia", "body_subtreemass", "body_invweight0",
    "dof_invweight0", "dof_M0", "actuator_acc0", "actuator_length0", "cam_pos0", "cam_poscom0",
    "light_pos0", "light_poscom0",
)  # fmt: skip
"""With the quantities that ``mj_setConst`` derives from the masses."""
_STATISTICS = ("meaninertia", "meanmass", "meansize", "extent")


class MujocoDisturbances:
    """Disturbances of one model; :meth:`clear` restores it exactly.

    The model has the bodies `base` and `wheel{i}`, and actuators in the order of the wheels, as in
    :mod:`omnidrive.simulation.mujoco.robot_model`.
    """

    def __init__(self, model: mujoco.MjModel, mounts: tuple[Mount, ...]) -> None:
        self._model = model
        self._nominal = copy.copy(model)
        self._mounts = mounts
        self._base = model.body("base").id
        self.tyre_geoms = [_subtree_geoms(model, f"wheel{i}") for i in range(len(mounts))]
        self._active = Disturbances()

    @property
    def locked(self) -> list[int]:
        """Indices of the locked wheels."""
        return [i for i, motor in enumerate(self._active.motors) if motor == Motor.LOCKED]

    @property
    def patch(self) -> Patch | None:
        """Disc of other friction; :meth:`update_patch` applies it to the wheels inside."""
        return self._active.patch

    def clear(self) -> None:
        """Remove all disturbances and restore the model bit for bit."""
        if self._active == Disturbances():
            return
        for name in _MOTORS + _FRICTION:
            getattr(self._model, name)[:] = getattr(self._nominal, name)
        self._restore_masses()
        self._model.opt.gravity[:] = self._nominal.opt.gravity
        self._active = Disturbances()

    def apply(self, disturbances: Disturbances, data: mujoco.MjData) -> None:
        """Replace the active disturbances; impulse and pose offset act once, immediately.

        Raises:
            InvalidInput: The number of motors differs from the number of wheels.
        """
        if len(disturbances.motors) not in {0, len(self._mounts)}:
            raise InvalidInput(
                f"disturbances of {len(disturbances.motors)} motors for {len(self._mounts)} wheels"
            )
        before, self._active = self._active, disturbances
        if disturbances.motors != before.motors:
            self._set_motors(disturbances.motors)
        if disturbances.slope != before.slope:
            self._set_slope(*disturbances.slope)
        if disturbances.payload != before.payload:
            self._set_payload(disturbances.payload)
        if disturbances.patch != before.patch:
            self._set_patch(data)
        if any(disturbances.impulse):
            self._apply_impulse(disturbances.impulse, data)
        if any(disturbances.offset):
            _apply_offset(disturbances.offset, data)

    def _set_motors(self, motors: tuple[Motor, ...]) -> None:
        model, nominal = self._model, self._nominal
        for name in _MOTORS:
            getattr(model, name)[:] = getattr(nominal, name)
        for i, motor in enumerate(motors):
            if motor == Motor.WEAK:
                model.actuator_forcerange[i] *= WEAK_TORQUE_FACTOR
            elif motor == Motor.DEAD:
                model.actuator_gainprm[i, :], model.actuator_biasprm[i, :] = 0.0, 0.0
            elif motor == Motor.LOCKED:  # a servo with set point 0, for any axle
                model.actuator_gainprm[i, 0] = 0.0
                model.actuator_biasprm[i, 2] = -_BRAKE
                model.actuator_forcelimited[i] = 0

    def _set_slope(self, along_x: float, along_y: float) -> None:
        """Set gravity in the frame of a floor with this rise per horizontal metre along x and y."""
        normal = np.array([along_x, along_y, 1.0])
        self._model.opt.gravity[:] = -GRAVITY * normal / np.linalg.norm(normal)
        if not (along_x or along_y):
            self._model.opt.gravity[:] = self._nominal.opt.gravity

    def _set_payload(self, payload: Payload | None) -> None:
        """Add a point mass to the body, at the height of its centre of mass."""
        model, nominal, base = self._model, self._nominal, self._base
        self._restore_masses()
        if payload is None:
            return
        mass, centre = float(nominal.body_mass[base]), nominal.body_ipos[base].copy()
        position = np.array([payload.x, payload.y, centre[2]])
        total = mass + payload.mass
        com = (mass * centre + payload.mass * position) / total
        inertia = _inertia_matrix(nominal.body_iquat[base], nominal.body_inertia[base])
        inertia += _parallel_axis_term(mass, centre - com) + _parallel_axis_term(
            payload.mass, position - com
        )
        principal, axes = np.linalg.eigh(inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        model.body_mass[base], model.body_ipos[base] = total, com
        model.body_inertia[base] = principal
        mujoco.mju_mat2Quat(model.body_iquat[base], axes.ravel())
        mujoco.mj_setConst(model, mujoco.MjData(model))
        if model.npair:
            stiffen_body_contacts(model)

    def _restore_masses(self) -> None:
        for name in _MASSES:
            getattr(self._model, name)[:] = getattr(self._nominal, name)
        for name in _STATISTICS:
            setattr(self._model.stat, name, getattr(self._nominal.stat, name))

    def _set_patch(self, data: mujoco.MjData) -> None:
        """Give tyres priority: otherwise MuJoCo takes the larger friction of the two geoms."""
        for name in _FRICTION:
            getattr(self._model, name)[:] = getattr(self._nominal, name)
        if self._active.patch is not None:
            self._model.geom_priority[list(chain(*self.tyre_geoms))] = 1
            self.update_patch(data)

    def update_patch(self, data: mujoco.MjData) -> None:
        """Set the friction of every tyre: that of the patch inside it, the nominal one outside."""
        patch = self._active.patch
        if patch is None:
            return
        x, y = data.qpos[:2].tolist()
        w, _, _, z = data.qpos[3:7].tolist()
        c, s = w * w - z * z, 2.0 * w * z  # of the yaw; the robot is upright
        for i, (mount, tyre) in enumerate(zip(self._mounts, self.tyre_geoms, strict=True)):
            dx = x + c * mount.x - s * mount.y - patch.x
            dy = y + s * mount.x + c * mount.y - patch.y
            inside = hypot(dx, dy) <= patch.radius
            nominal = self._nominal.geom_friction[tyre[0], 0]
            friction = patch.friction if inside else nominal
            self._model.geom_friction[tyre, 0] = friction
            if self._model.npair:  # contacts of balls, in the order of the wheels
                self._model.pair_friction[i, :2] = ball_friction(friction)

    def _apply_impulse(self, impulse: Impulse, data: mujoco.MjData) -> None:
        """Add the change of velocity dv with M dv = J^T impulse.

        The impulse acts at the height of the centre of mass, so that the robot does not pitch.
        """
        model = self._model
        mujoco.mj_forward(model, data)
        force, torque = np.array([impulse.x, impulse.y, 0.0]), np.array([0, 0, impulse.yaw])
        point = np.array([*data.qpos[:2], data.subtree_com[self._base, 2]])
        generalised, change = np.zeros(model.nv), np.zeros((1, model.nv))
        mujoco.mj_applyFT(model, data, force, torque, point, self._base, generalised)
        mujoco.mj_solveM(model, data, change, generalised[None])
        data.qvel[:] += change[0]


def stiffen_body_contacts(model: mujoco.MjModel) -> None:
    """Stiffen contacts between obstacles and the body of a robot with wheels of the model `ball`.

    The first tangent of all contacts in such a model is soft
    (:data:`.wheels.ROLLING_FRICTION_RATIO`), which would leave the body without friction. Reducing
    the body's inverse weight, with which MuJoCo scales contacts, restores the friction that the
    model with rollers has.
    """
    model.body_invweight0[model.body("base").id] *= _BODY_SOFTNESS


def _subtree_geoms(model: mujoco.MjModel, name: str) -> list[int]:
    """Return the ids of the geoms of a body and of its descendants."""
    root, found = model.body(name).id, []
    for geom in range(model.ngeom):
        body = model.geom_bodyid[geom]
        while body not in {0, root}:
            body = model.body_parentid[body]
        if body == root:
            found.append(geom)
    return found


def _inertia_matrix(
    quaternion: Float[Array, " 4"], principal: Float[Array, " 3"]
) -> Float[Array, "3 3"]:
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, quaternion)
    turn = axes.reshape(3, 3)
    inertia: Float[Array, "3 3"] = turn @ np.diag(principal) @ turn.T
    return inertia


def _parallel_axis_term(mass: float, offset: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """Return the inertia of a point mass at ``offset`` (parallel axis theorem)."""
    added: Float[Array, "3 3"] = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return added


def _apply_offset(offset: PoseOffset, data: mujoco.MjData) -> None:
    """Shift the robot, and rotate it with its velocity about the vertical through B."""
    data.qpos[:2] += offset.x, offset.y
    turn = np.array([cos(0.5 * offset.yaw), 0.0, 0.0, sin(0.5 * offset.yaw)])
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, turn, data.qpos[3:7])
    data.qpos[3:7] = turned
    c, s = cos(offset.yaw), sin(offset.yaw)
    vx, vy = data.qvel[:2].tolist()
    data.qvel[:2] = c * vx - s * vy, s * vx + c * vy
