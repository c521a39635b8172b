"""Wheels as joints of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from omnidrive.geometry import wrap
from omnidrive.simulation.coppeliasim.link import Link


class Turning(NamedTuple):
    """How one joint turns, with the sign of its mount."""

    angle: float
    """In rad, as the simulator counts it: some of them within one turn."""
    speed: float
    """In rad/s."""
    torque: float
    """Of the motor, in N m."""


class Joints:
    """Motors in velocity mode, each a joint of the scene.

    Attributes:
        angles: How far each has turned since :meth:`reset`, in rad.
        work: Since :meth:`reset`, in J: the torque at the end of a step times the way in it.
    """

    def __init__(self, link: Link, paths: Sequence[str], signs: Sequence[int]) -> None:
        """Find the joints.

        Raises:
            InvalidScene: One is not there.
            PlantLost: The simulator does not answer.
        """
        self._link, self._signs = link, tuple(signs)
        self._handles = [link.handle(path, joint=True) for path in paths]
        self._last: list[Turning] = []
        self.angles: tuple[float, ...] = ()
        self.work = 0.0

    def reset(self) -> None:
        """Count from here."""
        self._last = self._read()
        self.angles, self.work = (0.0,) * len(self._handles), 0.0

    def command(self, speeds: Sequence[float]) -> None:
        """Turn at ``speeds`` (rad/s)."""
        for handle, sign, speed in zip(self._handles, self._signs, speeds, strict=True):
            self._link.call("setJointTargetVelocity", handle, sign * float(speed))

    def follow(self, dt: float) -> None:
        """Read what happened in a step of ``dt`` (s).

        Angles come within one turn, and a wheel may turn further than half of one in a step: the
        mean of the speeds before and after says by how many.
        """
        now, turned = self._read(), []
        for angle, a, b in zip(self.angles, self._last, now, strict=True):
            expected = 0.5 * dt * (a.speed + b.speed)
            way = expected + wrap(b.angle - a.angle - expected)
            self.work += abs(b.torque * way)
            turned.append(angle + way)
        self.angles, self._last = tuple(turned), now

    def _read(self) -> list[Turning]:
        return [
            Turning(
                *(
                    sign * self._link.numbers(1, name, handle)[0]
                    for name in ("getJointPosition", "getJointVelocity", "getJointForce")
                )
            )
            for handle, sign in zip(self._handles, self._signs, strict=True)
        ]
