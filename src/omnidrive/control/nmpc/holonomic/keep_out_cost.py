"""Signed distance to the polygons of keep-out zones, and the cost of coming too close to them."""

from __future__ import annotations

from math import inf, sqrt

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.problem import KeepOutArrays


@compiled
def signed_distance(
    zones: KeepOutArrays, j: int, k: int, x: float, y: float
) -> tuple[float, float, float, float]:
    """Return the signed distance from (x, y) to the polygon of zone j at state k, and derivatives.

    Args:
        zones: The keep-out zones.
        j: Index of the zone.
        k: Index of the state x_k.
        x: Position in W, in m.
        y: Position in W, in m.

    Returns:
        The distance in m, negative inside the polygon; its gradient (x, y) in W, a unit vector
        outward; and its second derivative perpendicular to the gradient in 1/m, nonzero only
        outside where a corner is nearest. All four are zero on a polygon of one or two corners.
    """
    first, count = zones.first[j], zones.first[j + 1] - zones.first[j]
    px, py = x - zones.centres[j, k, 0], y - zones.centres[j, k, 1]
    nearest, dx, dy, at_corner = inf, 0.0, 0.0, True
    outermost, out_x, out_y = -inf, 0.0, 0.0
    for i in range(count):
        ax, ay = zones.corners[first + i, 0], zones.corners[first + i, 1]
        after = first + (i + 1) % count
        ex, ey = zones.corners[after, 0] - ax, zones.corners[after, 1] - ay
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
    distance = sqrt(nearest)
    if distance < 1e-12:
        return 0.0, 0.0, 0.0, 0.0
    return distance, dx / distance, dy / distance, 1.0 / distance if at_corner else 0.0


@compiled
def keep_out_cost(zones: KeepOutArrays, states: Float[Array, "points 3"]) -> float:
    """Return the cost of all zones, see :class:`KeepOutArrays`; 0 if all distances are kept.

    Args:
        zones: The keep-out zones.
        states: x_k in W; m, m, rad.
    """
    total = 0.0
    for j in range(len(zones.radii)):
        for k in range(len(states)):
            distance, _, _, _ = signed_distance(zones, j, k, states[k, 0], states[k, 1])
            total += zones.weights[j] * max(zones.radii[j] - distance, 0.0) ** 2
    return total


@compiled
def add_keep_out_derivatives(
    zones: KeepOutArrays,
    states: Float[Array, "points 3"],
    gradient: Float[Array, "points 3"],
    hessian: Float[Array, "points 2 3"],
) -> None:
    """Add the derivatives of :func:`keep_out_cost` by the states.

    Args:
        zones: The keep-out zones.
        states: x_k in W; m, m, rad.
        gradient: Incremented by the derivatives by (x, y, yaw); those by yaw are zero.
        hessian: Incremented by the second derivatives by (x, x), (x, y) and (y, y). They are in two
            parts: ``hessian[k, 0]`` is along the gradient of the distance, positive semidefinite;
            ``hessian[k, 1]`` is perpendicular to it, negative semidefinite.
    """
    for j in range(len(zones.radii)):
        for k in range(len(states)):
            distance, nx, ny, curvature = signed_distance(zones, j, k, states[k, 0], states[k, 1])
            violation = zones.radii[j] - distance
            if violation > 0.0:
                force = 2.0 * zones.weights[j] * violation
                gradient[k, 0] -= force * nx
                gradient[k, 1] -= force * ny
                along, across = 2.0 * zones.weights[j], -force * curvature
                hessian[k, 0, 0] += along * nx * nx
                hessian[k, 0, 1] += along * nx * ny
                hessian[k, 0, 2] += along * ny * ny
                hessian[k, 1, 0] += across * ny * ny
                hessian[k, 1, 1] -= across * nx * ny
                hessian[k, 1, 2] += across * nx * nx
