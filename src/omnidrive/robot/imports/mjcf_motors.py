"""Motors of a compiled MuJoCo model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from omnidrive.robot.imports.mechanism import Joint
from omnidrive.robot.imports.wheel_mounts import listed

_JOINTS = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}


def add_motors(model: mujoco.MjModel, joints: list[Joint], ids: Sequence[int]) -> list[str]:
    """Add torque limits, speed limits and servo gains of actuators to hinges.

    The force of an actuator is ``gain u + bias`` (MuJoCo, XML reference, actuator/general): that of
    a velocity servo is ``kv u - kv speed``, that of a motor has no bias.

    Args:
        model: The model.
        joints: The hinges, which are replaced.
        ids: Their numbers in the model.

    Returns:
        Warnings about actuators that are not read.
    """
    unread = []
    index = {joint: k for k, joint in enumerate(ids)}
    for k, joint in enumerate(ids):
        if model.jnt_actfrclimited[joint]:
            limit = float(np.abs(model.jnt_actfrcrange[joint]).max())
            joints[k] = replace(joints[k], max_torque=limit)
    for i in range(len(model.actuator_gear)):
        on_joint = model.actuator_trntype[i] in _JOINTS
        joint = int(model.actuator_trnid[i, 0])
        changes = _changes(model, i) if on_joint and joint in index else None
        if changes is None:
            if not on_joint or joint in index:
                unread.append(model.actuator(i).name or f"actuator {i}")
            continue
        known = joints[index[joint]]
        if known.max_torque is not None and "max_torque" in changes:
            changes["max_torque"] = min(known.max_torque, changes["max_torque"])
        joints[index[joint]] = replace(known, **changes)
    if not unread:
        return []
    return [f"actuators other than motors and servos of one hinge are not read: {listed(unread)}"]


def _changes(model: mujoco.MjModel, i: int) -> dict[str, Any] | None:
    """Return what actuator i states about its joint; None: it is of another kind."""
    gear = abs(float(model.actuator_gear[i, 0]))
    gain, bias = model.actuator_gainprm[i], model.actuator_biasprm[i]
    plain = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE or not bias[:3].any()
    affine = model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_AFFINE
    found: dict[str, Any] = {}
    if model.actuator_forcelimited[i]:
        found["max_torque"] = gear * float(np.abs(model.actuator_forcerange[i]).max())
    control = model.actuator_ctrladr[i]
    largest = 0.0
    if model.actuator_ctrlnum[i] and model.actuator_ctrllimited[control]:
        largest = float(np.abs(model.actuator_ctrlrange[control]).max())
    voltage = model.actuator_ctrlspec[i] == mujoco.mjtCtrlInput.mjINPUT_VOLTAGE
    if model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_DCMOTOR and voltage and gear > 0.0:
        resistance, constant = float(gain[0]), float(gain[1])  # torque K (u - K speed) / R
        if largest and resistance > 0.0 and constant > 0.0:
            found.setdefault("max_torque", gear * constant * largest / resistance)
            found["max_speed"] = largest / (constant * gear)
            found["servo_gain"] = gear**2 * constant**2 / resistance
    if model.actuator_gaintype[i] != mujoco.mjtGain.mjGAIN_FIXED or not (plain or affine):
        return found or None
    kp, kv = -float(bias[1]), -float(bias[2])
    integrates = model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_INTEGRATOR
    if plain and not integrates:
        if largest and "max_torque" not in found:
            found["max_torque"] = gear * abs(float(gain[0])) * largest
    elif kp == 0.0 and kv > 0.0 and not integrates:
        found["servo_gain"] = gear**2 * kv
        if largest and gear > 0.0:
            found["max_speed"] = float(gain[0]) / kv * largest / gear
    elif kp > 0.0 and integrates and largest and gear > 0.0:  # intvelocity
        found["max_speed"] = float(gain[0]) / kp * largest / gear
    return found
