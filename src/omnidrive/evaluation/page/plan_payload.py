"""JSON data of a planned motion for the scripts of the report."""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from math import ceil, pi
from typing import Any

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from omnidrive.arrays import Array
from omnidrive.evaluation.map_cells import max_pool
from omnidrive.evaluation.page.columns import column
from omnidrive.evaluation.plan_view import PlanView
from omnidrive.maps import CostMap

_LARGEST = 800
"""Cells along a side of the picture of the costs; larger maps are reduced."""
_KEPT_OUT = 255
"""Blue value of keep-out cells; 1 to 254 are directions of lanes, 0 is neither."""
_DIRECTIONS = 254


def plan_data(view: PlanView) -> dict[str, Any]:
    """Return the columns of a motion over its times, and its map layers.

    Arc length in m, times in s, speeds in m/s, curvature in 1/m; a value that is not finite becomes
    null.
    """
    columns = {
        "s": view.distance,
        "t": view.times,
        "x": view.motion[:, 0],
        "y": view.motion[:, 1],
        "yaw": view.motion[:, 2],
        "speed": view.speed,
        "limit": view.top_speed,
        "yawRate": view.motion[:, 5],
        "clearance": view.clearance,
        "curvature": view.curvature,
        **({} if view.cost is None else {"cost": view.cost}),
    }
    return {name: column(values) for name, values in columns.items()}


def layers_data(costs: CostMap | None) -> dict[str, Any] | None:
    """Return costs and zones as a PNG image, top row first; None if there is nothing to draw.

    Red is the cost, as a share of ``topCost``; green is the speed limit, as a share of ``topSpeed``
    in m/s, 0 without a limit; blue is :data:`_KEPT_OUT` or 1 plus the direction of a lane in W, in
    steps of a turn over 254. A pixel that covers several cells has the largest cost and the
    strictest limit of them.
    """
    if costs is None:
        return None
    k = ceil(max(costs.costs.shape) / _LARGEST)
    shown = np.where(costs.grid.occupied, np.float32(0.0), costs.costs)
    top_cost = float(shown.max())
    speeds = np.full(shown.shape, np.inf) if costs.max_speed is None else costs.max_speed
    limited = np.isfinite(speeds)
    top_speed = float(speeds[limited].max()) if limited.any() else 0.0
    channels = [_shares(max_pool(shown, k), top_cost), _limits(-max_pool(-speeds, k), top_speed)]
    channels.append(max_pool(_regions(costs), k))
    if not any(channel.any() for channel in channels):
        return None
    file = BytesIO()
    Image.fromarray(np.stack(channels, axis=-1)[::-1]).save(file, "PNG", optimize=True)
    return {
        "png": b64encode(file.getvalue()).decode(),
        "cell": k * costs.grid.resolution,
        "topCost": round(top_cost, 4),
        "topSpeed": round(top_speed, 4),
        "lowSpeed": round(float(speeds[limited].min()), 4) if limited.any() else 0.0,
        "keptOut": bool(costs.kept_out.any()),
        "lanes": bool((channels[2] % _KEPT_OUT).any()),
    }


def _shares(values: np.ndarray, top: float) -> UInt8[Array, "rows cols"]:
    """Return values from 0 to ``top`` as 0 to 255; positive ones are at least 1."""
    shares = np.zeros(values.shape) if top == 0.0 else np.ceil(255.0 * (values / top))
    return shares.clip(0.0, 255.0).astype(np.uint8)


def _limits(speeds: np.ndarray, top: float) -> UInt8[Array, "rows cols"]:
    """Return speed limits as 1 to 255, and 0 where there is none."""
    return _shares(np.where(np.isfinite(speeds), speeds, 0.0), top)


def _regions(costs: CostMap) -> UInt8[Array, "rows cols"]:
    """Return keep-out cells and directions of lanes as one number per cell."""
    found = np.zeros(costs.costs.shape, np.uint8)
    if costs.directions is not None:
        known = np.isfinite(costs.directions)
        turns = np.floor(costs.directions[known] / (2.0 * pi) * _DIRECTIONS + 0.5)
        found[known] = 1 + (turns % _DIRECTIONS).astype(np.uint8)
    found[costs.kept_out] = _KEPT_OUT
    return found
