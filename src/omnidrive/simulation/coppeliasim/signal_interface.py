"""Motors and pose by the signals of the scene that the paper's author published.

The author's Matlab functions show their meaning: ``omni_reqVelocities0`` holds the speeds of
motors 1 to 4 in rad/s, ``omni_pose0`` x, y (m) and yaw (rad) in W, both as packed 32-bit floats;
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
from omnidrive.simulation.coppeliasim.remote_api import RemoteApi

# Motors 1 to 4 of the author's matrix, (2 / wheelDiameter) [-s s -d; s s -d; s -s -d; -s -s -d]
# with s = 0.7071, are wheels at 225, 135, 45 and 315 degrees with the opposite sign.
_MOUNTS = (2, 1, 0, 3)
_SIGN = -1.0


class SignalInterface:
    """Motors that are commanded, and a pose that is read, by signals."""

    def __init__(self, api: RemoteApi) -> None:
        self._api = api
        # since CoppeliaSim 4.7 string signals are text, which cannot hold packed numbers
        self._kind = "Buffer" if api.has_member("getBufferSignal") else "String"

    def command(self, speeds: Sequence[float]) -> None:
        """Command the wheel speeds (rad/s), in the order of the robot's mounts."""
        packed = struct.pack("<4f", *(_SIGN * float(speeds[i]) for i in _MOUNTS))
        self._api.call(f"set{self._kind}Signal", "omni_reqVelocities0", packed)

    def pose(self) -> Pose:
        """Return the last pose of B in W from the scene's script; the yaw is within one turn.

        Raises:
            InvalidScene: The signal is not set.
            PlantLost: The signal does not hold a pose.
        """
        raw = self._read(f"get{self._kind}Signal", "omni_pose0")
        if isinstance(raw, str):
            raw = raw.encode("utf-8", "surrogateescape")
        if not isinstance(raw, bytes) or len(raw) < 12:
            raise PlantLost("signal 'omni_pose0' does not hold three packed floats")
        return Pose(*(v if isfinite(v) else nan for v in struct.unpack_from("<3f", raw)))

    def check_dimensions(self, robot: Robot) -> None:
        """Check that the dimensions of ``robot`` are those of the scene.

        The diameter of the body is the side of the square that its wheels form.

        Raises:
            InvalidScene: A dimension differs by more than 1 %, or a signal is not set.
            PlantLost: A signal does not hold a number.
        """
        for signal, expected in (
            ("omni_bodyDiameter0", robot.mean_wheel_distance * 2.0**0.5),
            ("omni_wheelDiameter0", 2.0 * robot.wheel.radius),
        ):
            (actual,) = self._api.as_numbers(1, self._read("getFloatSignal", signal), signal)
            if not isclose(actual, expected, rel_tol=0.01):
                raise InvalidScene(
                    f"the scene's signal '{signal}' is {actual:g} m, but robot '{robot.name}' "
                    f"needs {expected:g} m: choose the robot of the scene"
                )

    def _read(self, function: str, signal: str) -> Any:
        value = self._api.call(function, signal)
        if value is None:
            raise InvalidScene(
                f"the scene in CoppeliaSim does not set the signal '{signal}': open the paper's "
                "scene with its script enabled, or use interface 'joints'"
            )
        return value
