"""Robots described in MJCF, the XML of MuJoCo."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import mujoco
import numpy as np

from omnidrive.errors import InvalidRobot, one_line
from omnidrive.files.xml_elements import Element
from omnidrive.robot.imports.attributes import words
from omnidrive.robot.imports.mechanism import Body, Joint, Matrix, Mechanism, Motion, Shape
from omnidrive.robot.imports.mjcf_motors import add_motors
from omnidrive.robot.imports.mjcf_source import MjcfSource, ReadXml
from omnidrive.robot.imports.wheel_mounts import Vector, listed

_POINT = 1e-4  # m; radius of the sphere in place of a mesh; MuJoCo gives smaller ones no mass
_MIN_MASS = 1e-12  # kg; of a body without a known mass, which MuJoCo does not compile
_GEOM = mujoco.mjtGeom
_MESHES = {_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF, _GEOM.mjGEOM_HFIELD}
_ROUND = {_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE, _GEOM.mjGEOM_CYLINDER, _GEOM.mjGEOM_ELLIPSOID}

mujoco.set_mju_user_warning(lambda _: None)  # the default handler writes a file


def read_mjcf(root: Element, path: Path, read: ReadXml) -> Mechanism:
    """Return the mechanism of the first free body, or else of the first body, of an MJCF model.

    MuJoCo compiles the model, without meshes, materials and all that is no body or motor, so that
    defaults, frames, attached models and shortcuts of actuators mean what they mean there. The
    frame of the base is that of this body.

    Args:
        root: Root element of the model.
        path: Its file; included and attached files lie in the same folder or below.
        read: Returns the root element of another file.

    Raises:
        InvalidRobot: It is not such a model, or its files are missing or elsewhere.
    """
    source = MjcfSource(path, read)
    text = source.text(root)
    spec, unknown = _spec(text, source.models)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of massless bodies
        try:
            model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise _refusal(error) from None
    if unknown:
        source.warnings.append(
            "the mass of meshes is not read, so that the mass of the robot is unknown: "
            f"{listed(unknown)}"
        )
    return _Reader(model, bool(unknown)).mechanism(words(root), tuple(source.warnings))


def _spec(text: str, models: dict[str, bytes]) -> tuple[mujoco.MjSpec, list[str]]:
    """Return a specification without meshes, and the bodies of which they hold the mass."""
    try:
        spec = mujoco.MjSpec.from_string(text, include=models)
    except (ValueError, mujoco.FatalError) as error:
        raise _refusal(error) from None
    unknown: dict[str, None] = {}
    for geom in spec.geoms:
        if geom.type in _MESHES or geom.meshname:
            body, from_shapes = geom.parent, spec.compiler.inertiafromgeom == 1
            if np.isnan(geom.mass) and body.name != "world":
                if geom.density > 0.0 and (from_shapes or not body.explicitinertial):
                    unknown[body.name or "a body without a name"] = None
                geom.density = 0.0
            geom.type, geom.meshname, geom.hfieldname = _GEOM.mjGEOM_SPHERE, "", ""
            geom.size, geom.fromto = [_POINT, 0.0, 0.0], [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
    for joint in spec.joints:
        joint.align = 0
    compiler = spec.compiler
    compiler.alignfree = compiler.fusestatic = compiler.discardvisual = False
    compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE
    compiler.boundmass = max(compiler.boundmass, _MIN_MASS)
    compiler.boundinertia = max(compiler.boundinertia, 0.01 * _MIN_MASS)
    spec.memory = 1 << 20  # no contacts are computed
    return spec, list(unknown)


def _refusal(error: Exception) -> InvalidRobot:
    """Return the error of MuJoCo without line numbers, which are those of the reduced text."""
    text = re.sub(r", line \d+", "", str(error)).strip().replace("\n", "; ")
    return InvalidRobot(f"MuJoCo: {one_line(text, 300)}")


class _Reader:
    """Reads a compiled model in its initial pose, in the frame of the base."""

    def __init__(self, model: mujoco.MjModel, ignore_mass: bool) -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._ignore_mass = ignore_mass
        self._base = self._base_id()
        if model.body_jntnum[self._base] == 1 and self._is_free(self._base):
            start = model.jnt_qposadr[model.body_jntadr[self._base]]
            self._data.qpos[start : start + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        mujoco.mj_kinematics(model, self._data)
        self._turn: Matrix = self._data.xmat[self._base].reshape(3, 3).T.copy()
        self._origin: Vector = self._data.xpos[self._base].copy()

    def mechanism(self, words_: str, unread: tuple[str, ...]) -> Mechanism:
        """Return the bodies and hinges below the base."""
        model = self._model
        bodies: list[Body] = []
        joints: list[Joint] = []
        ids: list[int] = []
        index: dict[int, int] = {}
        for body in range(self._base, model.nbody):  # parents come before children
            parent = int(model.body_parentid[body])
            if body != self._base and parent not in index:
                continue
            index[body] = len(bodies)
            bodies.append(self._body(body, index.get(parent, -1)))
            first = int(model.body_jntadr[body])
            for joint in range(first, first + int(model.body_jntnum[body])):
                if body != self._base:
                    bodies[-1].motions.append(self._motion(joint))
                if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
                    joints.append(self._hinge(joint, index[body]))
                    ids.append(joint)
        notes = add_motors(model, joints, ids)
        name = model.names[: model.names.index(b"\0")].decode("utf-8", "replace") or "robot"
        name = "robot" if name == "MuJoCo Model" else name[:64]
        return Mechanism(name, bodies, joints, words_, (*unread, *notes))

    def _base_id(self) -> int:
        """Return the first free body of the world, or else the first body."""
        model = self._model
        roots = [i for i in range(1, model.nbody) if model.body_parentid[i] == 0]
        if not roots:
            raise InvalidRobot("there is no body in worldbody")
        return next((i for i in roots if self._is_free(i)), roots[0])

    def _is_free(self, body: int) -> bool:
        first, count = self._model.body_jntadr[body], self._model.body_jntnum[body]
        return bool(count and self._model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE)

    def _body(self, body: int, parent: int) -> Body:
        model, data = self._model, self._data
        found = Body(
            model.body(body).name or f"body{body}",
            parent,
            self._turn @ data.xmat[body].reshape(3, 3),
            self._place(data.xpos[body]),
        )
        if model.body_mass[body] > 10.0 * _MIN_MASS and not self._ignore_mass:
            up = (self._turn @ data.ximat[body].reshape(3, 3))[2]
            found.mass = float(model.body_mass[body])
            found.com = self._place(data.xipos[body])
            found.yaw_inertia = float(model.body_inertia[body] @ up**2)
        first = int(model.body_geomadr[body])
        for geom in range(first, first + int(model.body_geomnum[body])):
            shape = self._shape(geom)
            found.shapes += [] if shape is None else [shape]
        return found

    def _shape(self, geom: int) -> Shape | None:
        """Return a primitive shape; None in place of a mesh and for a plane."""
        model, data = self._model, self._data
        kind, (a, b, c) = _GEOM(model.geom_type[geom]), model.geom_size[geom].tolist()
        if kind not in _ROUND | {_GEOM.mjGEOM_BOX} or a <= _POINT:
            return None
        half = {
            _GEOM.mjGEOM_SPHERE: (a, a, a),
            _GEOM.mjGEOM_CAPSULE: (a, a, a + b),
            _GEOM.mjGEOM_CYLINDER: (a, a, b),
        }.get(kind, (a, b, c))
        axes = self._turn @ data.geom_xmat[geom].reshape(3, 3)
        return Shape(self._place(data.geom_xpos[geom]), axes, np.array(half), kind in _ROUND)

    def _motion(self, joint: int) -> Motion:
        kind = self._model.jnt_type[joint]
        turns = kind == mujoco.mjtJoint.mjJNT_HINGE
        has_axis = turns or kind == mujoco.mjtJoint.mjJNT_SLIDE
        axis = self._turn @ self._data.xaxis[joint] if has_axis else None
        return Motion(self._name(joint), axis, turns, bool(self._model.jnt_limited[joint]))

    def _hinge(self, joint: int, body: int) -> Joint:
        model = self._model
        inertia = float(model.dof_armature[model.jnt_dofadr[joint]])
        return Joint(
            self._name(joint),
            body,
            self._turn @ self._data.xaxis[joint],
            self._place(self._data.xanchor[joint]),
            inertia=inertia or None,
            turns_freely=not model.jnt_limited[joint],
        )

    def _name(self, joint: int) -> str:
        return self._model.joint(joint).name or f"joint{joint}"

    def _place(self, point: Vector) -> Vector:
        place: Vector = self._turn @ (point - self._origin)
        return place
