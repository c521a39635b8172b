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
from omnidrive.parameter import Bounds

_TIME_SLACK = 1e-9
"""In s: samples count their time otherwise than scans do."""


@dataclass(frozen=True, slots=True)
class LidarSettings:
    """A scanner of the size that warehouse robots carry."""

    rays: Annotated[int, Bounds(1, 100_000, "rays")] = 360
    """Per scan."""
    field_of_view: Annotated[float, Bounds(0.001, 2.0 * pi, "rad")] = 2.0 * pi
    """Between its first and last ray, in the middle of which is the robot's x axis; of a whole
    turn, the last ray comes one step before the first."""
    max_range: Annotated[float, Bounds(0.01, 1000.0, "m")] = 10.0
    rate: Annotated[float, Bounds(0.01, 1000.0, "Hz")] = 10.0
    """Of scans; the first at t = 0."""
    sigma: Annotated[float, Bounds(0.0, 10.0, "m")] = 0.01
    """Standard deviation of a range."""
    height: Annotated[float, Bounds(-10.0, 10.0, "m")] = 0.15
    """Of the rays above the origin of the body that carries it."""

    @property
    def bearings(self) -> Float[Array, " rays"]:
        """Of the rays in B, in rad."""
        whole = self.field_of_view > 2.0 * pi - 1e-9
        half = 0.5 * self.field_of_view
        angles: Float[Array, " rays"] = np.linspace(-half, half, self.rays, endpoint=not whole)
        return angles if self.rays > 1 else np.zeros(1)


class Scan(NamedTuple):
    """One turn of the scanner."""

    t: float
    """In s."""
    bearings: Float[Array, " rays"]
    """In B, in rad."""
    ranges: Float[Array, " rays"]
    """In m; infinite where nothing is within reach."""


@dataclass(slots=True)
class Lidar:
    """Scans a MuJoCo world by one call for all rays, when a scan is due and never else.

    The body that carries it is not seen; its wheels and others are.

    Attributes:
        settings: Rays, reach and noise.
        model: Any MuJoCo model.
        data: Its state, whose positions are known, as after ``mj_forward`` or a step.
        rng: What the noise of the ranges is drawn from.
        body: Name of the body that carries it.
    """

    settings: LidarSettings
    model: mujoco.MjModel
    data: mujoco.MjData
    rng: np.random.Generator
    body: str = "base"
    _count: int = field(default=0, init=False, repr=False)
    _body: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._body = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, self.body)
        if self._body < 0:
            raise InvalidInput(f"the model has no body '{self.body}' that could carry a lidar")

    def reset(self) -> None:
        """The next scan is due at t = 0."""
        self._count = 0

    def read(self, t: float) -> Scan | None:
        """The scan at ``t`` (s) if one is due since the last; else None."""
        if t + _TIME_SLACK < self._count / self.settings.rate:
            return None
        self._count = int((t + _TIME_SLACK) * self.settings.rate) + 1
        return self.scan(t)

    def scan(self, t: float) -> Scan:
        """A scan at ``t`` (s), whether one is due or not."""
        settings, bearings = self.settings, self.settings.bearings
        turn = self.data.xmat[self._body].reshape(3, 3)
        level = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)])
        rays = np.ascontiguousarray((turn @ level).T)
        origin = self.data.xpos[self._body] + turn @ [0.0, 0.0, settings.height]
        distances = np.empty(settings.rays)
        mujoco.mj_multiRay(
            self.model, self.data, origin, rays.ravel(), None, True, self._body,
            np.empty(settings.rays, dtype=np.int32), distances, None, settings.rays,
            settings.max_range,
        )  # fmt: skip
        noisy = distances + settings.sigma * self.rng.standard_normal(settings.rays)
        seen = (distances >= 0.0) & (distances <= settings.max_range)
        return Scan(t, bearings, np.where(seen, np.maximum(noisy, 0.0), np.inf))
