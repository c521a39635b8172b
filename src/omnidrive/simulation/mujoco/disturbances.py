"""What else acts on a robot in MuJoCo, written into its model and its state."""

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
    WEAK,
    Disturbances,
    Impulse,
    Motor,
    Patch,
    Payload,
    PoseOffset,
)
from omnidrive.simulation.mujoco.mjcf_wheels import ball_friction

_BRAKE = 1e4  # N m s/rad of a locked wheel: under all its grip the rim creeps by 0.1 mm/s
_GIVES = 2e-5
_MOTORS = (
    "actuator_gainprm", "actuator_biasprm", "actuator_forcerange", "actuator_forcelimited",
)  # fmt: skip
_TYRES = ("geom_friction", "geom_priority", "pair_friction")
_MASSES = (
    "body_mass", "body_ipos", "body_iquat", "body_inertia", "body_subtreemass", "body_invweight0",
    "dof_invweight0", "dof_M0", "actuator_acc0", "actuator_length0", "cam_pos0", "cam_poscom0",
    "light_pos0", "light_poscom0",
)  # fmt: skip
"""And what ``mj_setConst`` derives from them."""
_STATISTICS = ("meaninertia", "meanmass", "meansize", "extent")


class MujocoDisturbances:
    """Conditions of one model; :meth:`clear` leaves no trace of them.

    Bodies `base` and `wheel{i}`, and actuators in the order of the wheels, are as
    :mod:`omnidrive.simulation.mujoco.mjcf` names them.
    """

    def __init__(self, model: mujoco.MjModel, mounts: tuple[Mount, ...]) -> None:
        self._model = model
        self._healthy = copy.copy(model)
        self._mounts = mounts
        self._base = model.body("base").id
        self._tyres = [_geoms_under(model, f"wheel{i}") for i in range(len(mounts))]
        self._now = Disturbances()

    @property
    def locked(self) -> list[int]:
        """Wheels that cannot turn."""
        return [i for i, motor in enumerate(self._now.motors) if motor == Motor.LOCKED]

    @property
    def patch(self) -> Patch | None:
        """The floor's patch; :meth:`tread` says to the wheels who stands in it."""
        return self._now.patch

    def clear(self) -> None:
        """Take all back, bit for bit."""
        if self._now == Disturbances():
            return
        for name in _MOTORS + _TYRES:
            getattr(self._model, name)[:] = getattr(self._healthy, name)
        self._restore_masses()
        self._model.opt.gravity[:] = self._healthy.opt.gravity
        self._now = Disturbances()

    def apply(self, disturbances: Disturbances, data: mujoco.MjData) -> None:
        """Let ``disturbances`` hold instead of those before; impulse and offset act at once.

        Raises:
            InvalidInput: They speak of wheels that the robot does not have.
        """
        if len(disturbances.motors) not in {0, len(self._mounts)}:
            raise InvalidInput(
                f"disturbances of {len(disturbances.motors)} motors for {len(self._mounts)} wheels"
            )
        before, self._now = self._now, disturbances
        if disturbances.motors != before.motors:
            self._motors(disturbances.motors)
        if disturbances.slope != before.slope:
            self._tilt(*disturbances.slope)
        if disturbances.payload != before.payload:
            self._load(disturbances.payload)
        if disturbances.patch != before.patch:
            self._lay(data)
        if any(disturbances.impulse):
            self._push(disturbances.impulse, data)
        if any(disturbances.offset):
            _move(disturbances.offset, data)

    def _motors(self, motors: tuple[Motor, ...]) -> None:
        model, healthy = self._model, self._healthy
        for name in _MOTORS:
            getattr(model, name)[:] = getattr(healthy, name)
        for i, motor in enumerate(motors):
            if motor == Motor.WEAK:
                model.actuator_forcerange[i] *= WEAK
            elif motor == Motor.DEAD:
                model.actuator_gainprm[i, :], model.actuator_biasprm[i, :] = 0.0, 0.0
            elif motor == Motor.LOCKED:  # a servo for no speed, about which axle it ever is
                model.actuator_gainprm[i, 0] = 0.0
                model.actuator_biasprm[i, 2] = -_BRAKE
                model.actuator_forcelimited[i] = 0

    def _tilt(self, along_x: float, along_y: float) -> None:
        """Gravity as a floor sees it that rises so much per metre, as projected on the level."""
        steep = np.array([along_x, along_y, 1.0])
        self._model.opt.gravity[:] = -GRAVITY * steep / np.linalg.norm(steep)
        if not (along_x or along_y):
            self._model.opt.gravity[:] = self._healthy.opt.gravity

    def _load(self, payload: Payload | None) -> None:
        """Add a point to the frame, as high as its centre of mass."""
        model, healthy, base = self._model, self._healthy, self._base
        self._restore_masses()
        if payload is None:
            return
        mass, centre = float(healthy.body_mass[base]), healthy.body_ipos[base].copy()
        place = np.array([payload.x, payload.y, centre[2]])
        total = mass + payload.mass
        common = (mass * centre + payload.mass * place) / total
        inertia = _turned(healthy.body_iquat[base], healthy.body_inertia[base])
        inertia += _parallel(mass, centre - common) + _parallel(payload.mass, place - common)
        principal, axes = np.linalg.eigh(inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        model.body_mass[base], model.body_ipos[base] = total, common
        model.body_inertia[base] = principal
        mujoco.mju_mat2Quat(model.body_iquat[base], axes.ravel())
        mujoco.mj_setConst(model, mujoco.MjData(model))
        if model.npair:
            harden_body(model)

    def _restore_masses(self) -> None:
        for name in _MASSES:
            getattr(self._model, name)[:] = getattr(self._healthy, name)
        for name in _STATISTICS:
            setattr(self._model.stat, name, getattr(self._healthy.stat, name))

    def _lay(self, data: mujoco.MjData) -> None:
        """MuJoCo takes the larger friction of two geoms unless one has priority: tyres get it."""
        for name in _TYRES:
            getattr(self._model, name)[:] = getattr(self._healthy, name)
        if self._now.patch is not None:
            self._model.geom_priority[list(chain(*self._tyres))] = 1
            self.tread(data)

    def tread(self, data: mujoco.MjData) -> None:
        """Give the tyres that stand in the patch its friction, and the others their own."""
        patch = self._now.patch
        if patch is None:
            return
        x, y = data.qpos[:2].tolist()
        w, _, _, z = data.qpos[3:7].tolist()
        c, s = w * w - z * z, 2.0 * w * z  # of the yaw; the robot stands upright
        for i, (mount, tyre) in enumerate(zip(self._mounts, self._tyres, strict=True)):
            across = x + c * mount.x - s * mount.y - patch.x
            along = y + s * mount.x + c * mount.y - patch.y
            inside = hypot(across, along) <= patch.radius
            own = self._healthy.geom_friction[tyre[0], 0]
            here = patch.friction if inside else own
            self._model.geom_friction[tyre, 0] = here
            if self._model.npair:  # of balls, in the wheels' order
                self._model.pair_friction[i, :2] = ball_friction(here)

    def _push(self, impulse: Impulse, data: mujoco.MjData) -> None:
        """The change of all velocities at once by which M dv = J^T impulse.

        The blow is at the height of the centre of mass, so that the robot does not nod.
        """
        model = self._model
        mujoco.mj_forward(model, data)
        force, torque = np.array([impulse.x, impulse.y, 0.0]), np.array([0, 0, impulse.yaw])
        point = np.array([*data.qpos[:2], data.subtree_com[self._base, 2]])
        along, change = np.zeros(model.nv), np.zeros((1, model.nv))
        mujoco.mj_applyFT(model, data, force, torque, point, self._base, along)
        mujoco.mj_solveM(model, data, change, along[None])
        data.qvel[:] += change[0]


def harden_body(model: mujoco.MjModel) -> None:
    """Let obstacles hold the body of a robot on balls harder, by what MuJoCo takes for its weight.

    All first tangents of a model of balls are soft (:data:`.mjcf_wheels.FREE`):
    without this, nothing would rub on the body. With it, a robot that presses to a wall rubs along
    it as one on rollers does.
    """
    model.body_invweight0[model.body("base").id] *= _GIVES


def _geoms_under(model: mujoco.MjModel, name: str) -> list[int]:
    """Geoms of a body and of all that hang from it."""
    root, found = model.body(name).id, []
    for geom in range(model.ngeom):
        body = model.geom_bodyid[geom]
        while body not in {0, root}:
            body = model.body_parentid[body]
        if body == root:
            found.append(geom)
    return found


def _turned(quaternion: Float[Array, " 4"], principal: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, quaternion)
    turn = axes.reshape(3, 3)
    inertia: Float[Array, "3 3"] = turn @ np.diag(principal) @ turn.T
    return inertia


def _parallel(mass: float, offset: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """What a mass adds to the inertia about a point that far from it (Steiner)."""
    added: Float[Array, "3 3"] = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return added


def _move(offset: PoseOffset, data: mujoco.MjData) -> None:
    """Shift the robot, and turn it with its velocity about the vertical through B."""
    data.qpos[:2] += offset.x, offset.y
    turn = np.array([cos(0.5 * offset.yaw), 0.0, 0.0, sin(0.5 * offset.yaw)])
    turned = np.zeros(4)
    mujoco.mju_mulQuat(turned, turn, data.qpos[3:7])
    data.qpos[3:7] = turned
    c, s = cos(offset.yaw), sin(offset.yaw)
    vx, vy = data.qvel[:2].tolist()
    data.qvel[:2] = c * vx - s * vy, s * vx + c * vy
