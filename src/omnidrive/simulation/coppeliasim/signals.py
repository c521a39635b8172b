"""The signals of the scene that the paper's author published.

His Matlab functions show their meaning: ``omni_reqVelocities0`` holds the speeds of motors 1 to 4
in rad/s, ``omni_pose0`` x, y (m) and yaw (rad) in W, both as 32-bit floats one after the other;
``omni_bodyDiameter0`` and ``omni_wheelDiameter0`` are lengths in m.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from math import isclose, isfinite, nan
from typing import Any

from omnidrive.errors import InvalidScene, PlantLost
from omnidrive.geometry import Pose
from omnidrive.robot import Robot
from omnidrive.simulation.coppeliasim.link import Link

# Motors 1 to 4 of his matrix, (2 / wheelDiameter) [-s s -d; s s -d; s -s -d; -s -s -d] with
# s = 0.7071, are wheels at 225, 135, 45 and 315 degrees that turn the other way round.
_MOUNTS = (2, 1, 0, 3)
_SIGN = -1.0


class Signals:
    """Motors and pose by signals."""

    def __init__(self, link: Link) -> None:
        self._link = link
        # CoppeliaSim since 4.7 sends string signals as text, which packed numbers are not
        self._kind = "Buffer" if link.knows("getBufferSignal") else "String"

    def command(self, speeds: Sequence[float]) -> None:
        """Turn at ``speeds`` (rad/s), in the order of the robot's mounts."""
        packed = struct.pack("<4f", *(_SIGN * float(speeds[i]) for i in _MOUNTS))
        self._link.call(f"set{self._kind}Signal", "omni_reqVelocities0", packed)

    def pose(self) -> Pose:
        """Pose of B in W, as the scene's script last told; its yaw within one turn.

        Raises:
            PlantLost: It told none.
        """
        raw = self._told(f"get{self._kind}Signal", "omni_pose0")
        if isinstance(raw, str):
            raw = raw.encode("utf-8", "surrogateescape")
        if not isinstance(raw, bytes) or len(raw) < 12:
            raise PlantLost("signal 'omni_pose0' does not hold three packed floats")
        return Pose(*(v if isfinite(v) else nan for v in struct.unpack_from("<3f", raw)))

    def check(self, robot: Robot) -> None:
        """Refuse a robot of other dimensions than the scene's.

        The body's diameter is the side of the square of its wheels.

        Raises:
            InvalidScene: They differ by more than 1 %.
            PlantLost: The simulator does not tell.
        """
        for signal, ours in (
            ("omni_bodyDiameter0", robot.mean_wheel_distance * 2.0**0.5),
            ("omni_wheelDiameter0", 2.0 * robot.wheel.radius),
        ):
            (theirs,) = self._link.as_numbers(1, self._told("getFloatSignal", signal), signal)
            if not isclose(theirs, ours, rel_tol=0.01):
                raise InvalidScene(
                    f"the scene's signal '{signal}' is {theirs:g} m, of robot '{robot.name}' it "
                    f"would be {ours:g} m: choose the robot that the scene holds"
                )

    def _told(self, function: str, signal: str) -> Any:
        value = self._link.call(function, signal)
        if value is None:
            raise InvalidScene(
                f"the scene in CoppeliaSim does not set the signal '{signal}': open the paper's "
                "scene with its script enabled, or use interface 'joints'"
            )
        return value
