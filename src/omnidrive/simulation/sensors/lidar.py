"""A planar laser scanner."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import Annotated, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.parameter import TIME_TOLERANCE, Bounds, check_bounds


@dataclass(frozen=True, slots=True)
class LidarSettings:
    """Settings of a planar laser scanner; the defaults are typical of warehouse robots."""

    rays: Annotated[int, Bounds(1, 100_000, "rays")] = 360
    """Number of rays per scan, at equal angles; a single ray points along the x axis of B."""
    field_of_view: Annotated[float, Bounds(0.001, 2.0 * pi, "rad")] = 2.0 * pi
    """Angle from the first ray to the last, symmetrical about the x axis of B. In a full turn the
    first ray is at -pi and the last one step before pi."""
    max_range: Annotated[float, Bounds(0.01, 1000.0, "m")] = 10.0
    """Largest distance of a hit."""
    rate: Annotated[float, Bounds(0.01, 1000.0, "Hz")] = 10.0
    """Frequency of scans; the first is at t = 0."""
    sigma: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.01
    """Standard deviation of the Gaussian noise of each range, independent of all others."""
    height: Annotated[float, Bounds(-10.0, 10.0, "m")] = 0.15
    """Height of the rays above the origin of B, along its z axis."""

    @property
    def bearings(self) -> Float[Array, " rays"]:
        """Bearing of each ray from the x axis of B, rad; increasing, counter-clockwise."""
        full_turn = self.field_of_view > 2.0 * pi - 1e-9
        half = 0.5 * self.field_of_view
        angles: Float[Array, " rays"] = np.linspace(-half, half, self.rays, endpoint=not full_turn)
        return angles if self.rays > 1 else np.zeros(1)


class Scan(NamedTuple):
    """One scan."""

    t: float
    """Time, s."""
    bearings: Float[Array, " rays"]
    """Bearing of each ray from the x axis of B, rad."""
    ranges: Float[Array, " rays"]
    """Range of each ray with noise, m, not negative; infinite without a hit within
    ``max_range``."""


@dataclass(slots=True)
class Lidar:
    """Laser scanner in a MuJoCo model.

    The rays lie in a plane parallel to the x and y axes of B, the frame of the body with the
    scanner. They pass through that body and hit all others, also its wheels, which are bodies of
    their own.

    Attributes:
        settings: Rays, range and noise.
        model: Any MuJoCo model.
        data: State of the model. Its body poses are used: ``mj_forward`` computes them for the
            present time, ``mj_step`` leaves those at the start of the step.
        rng: Generator of the noise.
        body: Name of the body with the scanner.

    Raises:
        InvalidInput: A setting is out of range, or the model has no such body.
    """

    settings: LidarSettings
    model: mujoco.MjModel
    data: mujoco.MjData
    rng: np.random.Generator
    body: str = "base"
    _count: int = field(default=0, init=False, repr=False)
    _body: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_bounds(self.settings)
        self._body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, self.body)
        if self._body < 0:
            raise InvalidInput(f"the model has no body '{self.body}' for the lidar")

    def reset(self) -> None:
        """Set the time of the next scan to 0."""
        self._count = 0

    def read(self, t: float) -> Scan | None:
        """Return a scan if one is due at the time ``t`` (s), otherwise None."""
        if t + TIME_TOLERANCE < self._count / self.settings.rate:
            return None
        self._count = int((t + TIME_TOLERANCE) * self.settings.rate) + 1
        return self.scan(t)

    def scan(self, t: float) -> Scan:
        """Return a scan of ``data`` with the time stamp ``t`` (s), whether it is due or not."""
        settings, bearings = self.settings, self.settings.bearings
        rotation = self.data.xmat[self._body].reshape(3, 3)
        level = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)])
        rays = np.ascontiguousarray((rotation @ level).T)
        origin = self.data.xpos[self._body] + rotation @ [0.0, 0.0, settings.height]
        distances = np.empty(settings.rays)
        mujoco.mj_multiRay(
            self.model, self.data, origin, rays.ravel(), None, True, self._body,
            np.empty(settings.rays, dtype=np.int32), distances, None, settings.rays,
            settings.max_range,
        )  # fmt: skip
        noisy = distances + settings.sigma * self.rng.standard_normal(settings.rays)
        hit = (distances >= 0.0) & (distances <= settings.max_range)
        return Scan(t, bearings, np.where(hit, np.maximum(noisy, 0.0), np.inf))
