"""Motors that are commanded and read as joints of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from omnidrive.geometry import wrap
from omnidrive.simulation.coppeliasim.remote_api import RemoteApi


class JointState(NamedTuple):
    """State of one joint, with the sign of its mount."""

    angle: float
    """Angle as the simulator reports it, rad; for some joints within one turn."""
    speed: float
    """Speed, rad/s."""
    torque: float
    """Torque of the motor, N m."""


class JointInterface:
    """Motors in velocity mode, one joint of the scene each.

    Attributes:
        angles: Angle of each joint since :meth:`reset`, rad.
        work: Work since :meth:`reset`, J: the sum of |torque at the end of a step * its rotation|.
    """

    def __init__(self, api: RemoteApi, paths: Sequence[str], signs: Sequence[int]) -> None:
        """Look up the joints.

        Raises:
            InvalidScene: A joint does not exist.
            PlantLost: The simulator does not reply.
        """
        self._api, self._signs = api, tuple(signs)
        self._handles = [api.handle(path, joint=True) for path in paths]
        self._last: list[JointState] = []
        self.angles: tuple[float, ...] = ()
        self.work = 0.0

    def reset(self) -> None:
        """Start angles and work at 0."""
        self._last = self._read()
        self.angles, self.work = (0.0,) * len(self._handles), 0.0

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speed of each joint after the last step, rad/s."""
        return tuple(joint.speed for joint in self._last)

    def command(self, speeds: Sequence[float]) -> None:
        """Command the wheel speeds, rad/s."""
        for handle, sign, speed in zip(self._handles, self._signs, speeds, strict=True):
            self._api.call("setJointTargetVelocity", handle, sign * float(speed))

    def update(self, dt: float) -> None:
        """Read the joints after a step of ``dt`` (s).

        Angles are reported within one turn, and a wheel can turn by more than half a turn in one
        step. The mean of the speeds before and after the step determines the number of turns.
        """
        now, angles = self._read(), []
        for angle, a, b in zip(self.angles, self._last, now, strict=True):
            expected = 0.5 * dt * (a.speed + b.speed)
            rotation = expected + wrap(b.angle - a.angle - expected)
            self.work += abs(b.torque * rotation)
            angles.append(angle + rotation)
        self.angles, self._last = tuple(angles), now

    def _read(self) -> list[JointState]:
        return [
            JointState(
                *(
                    sign * self._api.numbers(1, name, handle)[0]
                    for name in ("getJointPosition", "getJointVelocity", "getJointForce")
                )
            )
            for handle, sign in zip(self._handles, self._signs, strict=True)
        ]
