"""Distance to a keep-out, and what it costs to be too near."""

from __future__ import annotations

from math import inf, sqrt

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import inlined
from omnidrive.control.nmpc.holonomic.problem import KeepOuts


@inlined
def distance(
    places: KeepOuts, j: int, k: int, x: float, y: float
) -> tuple[float, float, float, float]:
    """Signed distance in m from (x, y) in W to keep-out j at stage k, negative inside a polygon.

    Returns:
        The distance; its gradient, a unit vector outward; and its curvature across the gradient in
        1/m, which is not zero where a corner is nearest. On a single corner all are zero.
    """
    first, count = places.first[j], places.first[j + 1] - places.first[j]
    px, py = x - places.centres[j, k, 0], y - places.centres[j, k, 1]
    nearest, dx, dy, at_corner = inf, 0.0, 0.0, True
    outermost, out_x, out_y = -inf, 0.0, 0.0
    for i in range(count):
        ax, ay = places.corners[first + i, 0], places.corners[first + i, 1]
        after = first + (i + 1) % count
        ex, ey = places.corners[after, 0] - ax, places.corners[after, 1] - ay
        rx, ry = px - ax, py - ay
        square = ex * ex + ey * ey
        along = 0.0
        if square > 0.0:
            along = min(max((rx * ex + ry * ey) / square, 0.0), 1.0)
            out = (ey * rx - ex * ry) / sqrt(square)
            if out > outermost:
                outermost, out_x, out_y = out, ey / sqrt(square), -ex / sqrt(square)
        rx, ry = rx - along * ex, ry - along * ey
        if rx * rx + ry * ry < nearest:
            nearest, dx, dy = rx * rx + ry * ry, rx, ry
            at_corner = not 0.0 < along < 1.0
    if count > 2 and outermost <= 0.0:
        return outermost, out_x, out_y, 0.0
    far = sqrt(nearest)
    if far < 1e-12:
        return 0.0, 0.0, 0.0, 0.0
    return far, dx / far, dy / far, 1.0 / far if at_corner else 0.0


@inlined
def keep_out_cost(places: KeepOuts, states: Float[Array, "points 3"]) -> float:
    """What all keep-outs cost along the states; 0 exactly where all distances are kept."""
    total = 0.0
    for j in range(len(places.radii)):
        for k in range(len(states)):
            far, _, _, _ = distance(places, j, k, states[k, 0], states[k, 1])
            total += places.weights[j] * max(places.radii[j] - far, 0.0) ** 2
    return total


@inlined
def add_keep_outs(
    places: KeepOuts,
    states: Float[Array, "points 3"],
    slopes: Float[Array, "points 3"],
    bends: Float[Array, "points 2 3"],
) -> None:
    """Add the derivatives of :func:`keep_out_cost` by the states.

    Args:
        places: The keep-outs.
        states: x_k.
        slopes: To add to: derivatives by (x, y, yaw).
        bends: To add to: second derivatives by (x, x), (x, y) and (y, y), in two parts: along the
            gradient of the distance, where they are positive, and across it, where they are not.
    """
    for j in range(len(places.radii)):
        for k in range(len(states)):
            far, nx, ny, curvature = distance(places, j, k, states[k, 0], states[k, 1])
            lack = places.radii[j] - far
            if lack > 0.0:
                push = 2.0 * places.weights[j] * lack
                slopes[k, 0] -= push * nx
                slopes[k, 1] -= push * ny
                along, across = 2.0 * places.weights[j], -push * curvature
                bends[k, 0, 0] += along * nx * nx
                bends[k, 0, 1] += along * nx * ny
                bends[k, 0, 2] += along * ny * ny
                bends[k, 1, 0] += across * ny * ny
                bends[k, 1, 1] -= across * nx * ny
                bends[k, 1, 2] += across * nx * nx
