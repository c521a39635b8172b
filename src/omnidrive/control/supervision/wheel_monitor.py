"""Wheel monitor: detection of dead motors, locked wheels and dead encoders."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, exp
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.control.controller import CommandValue, WheelTorques
from omnidrive.control.supervision.wheel_evidence import (
    MIN_TORQUE_DEAD,
    ZERO_TORQUE,
    Signs,
    WheelDefect,
    WheelEvidence,
)
from omnidrive.estimation import EncoderSettings
from omnidrive.estimation.state import LARGEST
from omnidrive.robot import Robot


class Finding(NamedTuple):
    """A detected defect."""

    wheel: int
    """Index of the wheel, from 0."""
    defect: WheelDefect


SAMPLES = 3
"""Samples with evidence of a defect after which it is reported."""

_SHORTEST = 0.02
"""Shortest time that is evaluated at once, s: shorter samples are joined. In a shorter time the
encoders resolve no speed, and readings of a robot do not arrive exactly with the samples."""
_ROUNDING = 1e-9

_SLOW = 0.9
"""Share of the largest wheel speed up to which a commanded torque is evaluated."""


class _Joined(NamedTuple):
    """Samples that are evaluated together."""

    angles: Array
    """Angles of the wheels at their begin, rad."""
    is_torque: bool = False
    """Whether torques are commanded."""
    target: Array | float = 0.0
    """Mean commanded speeds, rad/s, or torques, N m."""
    torque: Array | float = 0.0
    """Mean torques of the motors, N m."""
    time: float = 0.0
    """Duration, s."""

    def with_sample(self, target: Array, torque: Array, dt: float) -> _Joined:
        """Return the samples with another one."""
        time = self.time + dt
        share = dt / time
        return self._replace(
            target=self.target + share * (target - self.target),
            torque=self.torque + share * (torque - self.torque),
            time=time,
        )


class WheelMonitor:
    """Compares the torque of each motor with that of its velocity servo at the measured speed.

    The mean torque of a velocity servo during a sample is ``gain (commanded - turned / dt)`` of the
    mean speeds while it is below its limit; samples in which the command changes so much that the
    limit is reached are not evaluated. A healthy wheel satisfies that also when it slips, because
    slip occurs between wheel and floor, not between motor and wheel.

    - Dead motor: the wheel turns with the floor, near the commanded speed while the other wheels do
      not slip; its torque is zero although that of the servo model is not.
    - Locked wheel: the wheel does not turn although it is commanded to, and its motor produces more
      torque than friction transmits, or a torque that changes while the wheel stands.
    - Dead encoder: the measured speed is zero although the wheel is commanded to turn, and the
      torque is too small for a standing wheel.

    The robot may differ from its model: the lag of the motors is identified, and differences that
    all wheels show are no evidence (:mod:`~omnidrive.control.supervision.servo_response`).

    While torques are commanded, only dead motors are detected: their torque is zero although the
    commanded one is not.

    A defect is reported after three samples with evidence: after 0.3 s at a sample time of 0.1 s,
    or later if the expected torque is small. A sample that contradicts the defect clears its
    count. Samples of less than 20 ms are joined, so that each evaluation has at least that time.

    Args:
        robot: Wheel matrix, servo gain, lag and torque limit of the robot.
        encoders: Resolution of the wheel encoders.
    """

    def __init__(self, robot: Robot, encoders: EncoderSettings | None = None) -> None:
        self._robot = robot
        self._drive = robot.drive
        self._step = (encoders or EncoderSettings()).step
        self.reset()

    def reset(self) -> None:
        """Start a run: all wheels are at rest and healthy."""
        wheels = len(self._robot.mounts)
        self._evidence = WheelEvidence(self._robot, self._step, (wheels,))
        self._angles = np.zeros(wheels)
        self._joined = _Joined(self._angles)
        self._counts = {defect: np.zeros(wheels, dtype=int) for defect in WheelDefect}
        self._known: set[int] = set()

    @property
    def lag(self) -> float:
        """Motor lag that the robot shows, s: that of the robot file until another one fits better.

        The steps are 0.025 to 0.1 s.
        """
        return float(self._evidence.lag)

    def update(
        self,
        command: CommandValue,
        dt: float,
        angles: Sequence[float],
        torques: Sequence[float],
    ) -> list[Finding]:
        """Return the defects found in the sample that has just ended.

        Args:
            command: Command during the sample.
            dt: Duration of the sample, s.
            angles: Encoder angle of each wheel since the reset, rad; NaN if an encoder
                reports nothing, which counts as no rotation, as does an infinite or huge angle.
            torques: Mean torque of each motor during the sample, N m; no evidence if it is NaN,
                infinite or huge.
        """
        wheels = len(self._robot.mounts)
        if len(angles) != wheels or len(torques) != wheels:
            return []
        is_torque = isinstance(command, WheelTorques)
        if is_torque != self._joined.is_torque:
            self._joined = _Joined(self._angles, is_torque)
        target = np.array(command) if is_torque else self._drive.limited_speeds(command)[0]
        joined = self._joined.with_sample(target, _usable(torques, np.nan), dt)
        self._joined, self._angles = joined, _usable(angles, self._angles)
        if joined.time < _SHORTEST * (1.0 - _ROUNDING):
            return []
        self._joined = _Joined(self._angles, is_torque)
        target, torque = np.asarray(joined.target), np.asarray(joined.torque)
        speeds = (self._angles - joined.angles) / joined.time
        if is_torque:
            return self._count(self._torque_evidence(target, speeds, torque))
        share = torque / self._robot.max_torque
        return self._count(self._evidence.update(target, joined.time, speeds, share))

    def may_report(
        self,
        twists: Float[Array, "runs samples 3"],
        dt: float,
        angles: Float[Array, "runs samples wheels"],
        torques: Float[Array, "runs samples wheels"],
    ) -> Bool[Array, " runs"]:
        """Return whether ``update`` reports a defect in whole runs from rest.

        Args:
            twists: Twist commanded from each sample on; the last one is not used.
            dt: Duration of every sample, s.
            angles: Angles of the encoders at each sample, rad.
            torques: Mean torques of the motors in the sample that ends there, N m.
        """
        usable = ((np.abs(angles) <= LARGEST) & (np.abs(torques) <= LARGEST)).all(axis=(1, 2))
        count = ceil(_SHORTEST / dt * (1.0 - _ROUNDING))
        targets = _means(self._drive.limited_speeds_of(twists[:, :-1]), count)
        torque = _means(torques[:, 1:], count) / self._robot.max_torque
        dt = count * dt
        speeds = np.diff(angles[:, ::count], axis=1)[:, : targets.shape[1]] / dt
        reported: Bool[Array, " runs"] = ~usable
        often = np.flatnonzero(usable & self._has_signs(targets, dt, speeds, torque))
        if len(often):
            shape = (len(often), targets.shape[2])
            evidence = WheelEvidence(self._robot, self._step, shape)
            counts = {defect: np.zeros(shape, dtype=int) for defect in WheelDefect}
            found = np.zeros(shape, dtype=bool)
            for k in range(targets.shape[1]):
                each = evidence.update(targets[often, k], dt, speeds[often, k], torque[often, k])
                for defect, signs in each.items():
                    found |= _counted(counts[defect], *signs)
            reported[often] = found.any(axis=1)
        return reported

    def _has_signs(
        self,
        targets: Float[Array, "runs samples wheels"],
        dt: float,
        speeds: Float[Array, "runs samples wheels"],
        torque: Float[Array, "runs samples wheels"],
    ) -> Bool[Array, " runs"]:
        """Return which runs have enough signs of a defect by the lag of the robot file.

        Without them nothing is reported, and this is much faster than sample by sample.
        """
        commanded, lag = targets.copy(), self._robot.motor_lag
        if lag > 0.0:
            set_point, decay = np.zeros_like(commanded[:, 0]), exp(-dt / lag)
            for k in range(commanded.shape[1]):
                difference = set_point - targets[:, k]
                set_point = targets[:, k] + decay * difference
                commanded[:, k] = targets[:, k] + difference * (lag / dt) * (1.0 - decay)
        before = np.concatenate([np.zeros_like(commanded[:, :1]), commanded[:, :-1]], axis=1)
        signs = self._evidence.signs(commanded, before, speeds, torque, self._step / dt).values()
        often = [(sign.sum(axis=1) >= SAMPLES).any(axis=1) for sign, _ in signs]
        enough: Bool[Array, " runs"] = np.any(often, axis=0)
        return enough

    def _torque_evidence(
        self,
        command: Float[Array, " wheels"],
        speeds: Float[Array, " wheels"],
        torques: Float[Array, " wheels"],
    ) -> Signs:
        """Return the evidence of a sample with commanded torques: that for a dead motor only.

        A motor at the largest wheel speed gives no torque, and is not evaluated.
        """
        robot, none = self._robot, np.zeros(len(speeds), dtype=bool)
        self._evidence.restart(speeds)
        expected, torque = (np.abs(values) / robot.max_torque for values in (command, torques))
        is_slow = np.abs(speeds) < _SLOW * robot.max_wheel_speed
        dead = is_slow & (expected >= MIN_TORQUE_DEAD) & (torque <= ZERO_TORQUE)
        evidence = dict.fromkeys(WheelDefect, (none, none))
        return evidence | {WheelDefect.DEAD: (dead, torque > 2.0 * ZERO_TORQUE)}

    def _count(self, evidence: Signs) -> list[Finding]:
        """Count the evidence for each defect and return the new findings."""
        found = []
        for defect, (sign, against) in evidence.items():
            for wheel in np.flatnonzero(_counted(self._counts[defect], sign, against)).tolist():
                if wheel not in self._known:
                    self._known.add(wheel)
                    found.append(Finding(wheel, defect))
        return found


def _counted(
    counts: Int[Array, "*runs wheels"],
    sign: Bool[Array, "*runs wheels"],
    against: Bool[Array, "*runs wheels"],
) -> Bool[Array, "*runs wheels"]:
    """Count samples with evidence in ``counts``; return where they suffice."""
    counts[against] = 0
    counts[sign] += 1
    return counts >= SAMPLES


def _means(
    values: Float[Array, "runs samples wheels"], count: int
) -> Float[Array, "runs blocks wheels"]:
    """Return the means of ``count`` samples in succession; the rest of a run is left out."""
    if count == 1:
        return values
    runs, samples, wheels = values.shape
    whole = values[:, : samples - samples % count]
    means: Float[Array, "runs blocks wheels"] = whole.reshape(runs, -1, count, wheels).mean(axis=2)
    return means


def _usable(
    numbers: Sequence[float], otherwise: Float[Array, " wheels"] | float
) -> Float[Array, " wheels"]:
    """Return the numbers; ``otherwise`` in place of those that are NaN, infinite or huge."""
    values = np.asarray(numbers, dtype=float)
    return np.where(np.abs(values) <= LARGEST, values, otherwise)
