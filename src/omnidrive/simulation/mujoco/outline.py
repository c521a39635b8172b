"""Outline of a robot as prisms in MJCF, and its contacts with obstacles."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.geometry.polygon import Polygon
from omnidrive.simulation.mujoco.mjcf import add, numbers

_MIN_AREA = 1e-8
"""Twice the area in m^2 below which a triangle is left out."""


def add_prisms(  # noqa: PLR0917
    root: ET.Element,
    base: ET.Element,
    name: str,
    polygon: Polygon,
    heights: tuple[float, float],
    attributes: dict[str, str],
) -> None:
    """Add vertical prisms on the triangles of a polygon in B between two heights in B, in m.

    MuJoCo collides with the convex hull of a mesh, so that each triangle is a mesh of its own.
    """
    assets = root.find("asset")
    assert assets is not None
    sides = polygon.triangles[:, 1:] - polygon.triangles[:, :1]
    flat = np.abs(np.linalg.det(sides)) < _MIN_AREA
    for k, triangle in enumerate(polygon.triangles[~flat]):
        vertices = [(x, y, z) for z in heights for x, y in triangle.tolist()]
        add(assets, "mesh", name=f"{name}{k}", vertex=" ".join(numbers(*v) for v in vertices))
        add(base, "geom", name=f"{name}{k}", type="mesh", mesh=f"{name}{k}", **attributes)


def _at(polygon: Polygon, poses: Float[Array, "poses 3"]) -> Float[Array, "poses triangles 3 2"]:
    """Return the triangles of a polygon at poses."""
    turned = np.array([polygon.turned(polygon.triangles, yaw) for yaw in poses[:, 2].tolist()])
    moved: Float[Array, "poses triangles 3 2"] = turned + poses[:, None, None, :2]
    return moved


def box_gaps(
    polygon: Polygon, boxes: Float[Array, "boxes 4"], poses: Float[Array, "poses 3"]
) -> Float[Array, "poses boxes"]:
    """Return bounds on the distances from a polygon to boxes, m; negative where they overlap.

    The bound is the greatest gap along a normal of a side of the box or of a triangle (separating
    axis theorem), so its sign is exact.

    Args:
        polygon: The polygon.
        boxes: (left, right, bottom, top) of each box, m.
        poses: Poses of B in the frame of the boxes; m, m, rad.
    """
    triangles = _at(polygon, poses)
    low, high = triangles.min(axis=2)[:, :, None], triangles.max(axis=2)[:, :, None]
    left, right, bottom, top = boxes.T
    gaps = np.maximum(
        np.maximum(low[..., 0] - right, left - high[..., 0]),
        np.maximum(low[..., 1] - top, bottom - high[..., 1]),
    )
    middle = 0.5 * np.stack([left + right, bottom + top], axis=1)
    half = 0.5 * np.stack([right - left, top - bottom], axis=1)
    sides = np.roll(triangles, -1, axis=2) - triangles
    normals = np.stack([sides[..., 1], -sides[..., 0]], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    reach = normals @ middle.T - (normals * triangles).sum(axis=-1)[..., None]
    along = (reach - np.abs(normals) @ half.T).max(axis=2)
    found: Float[Array, "poses boxes"] = np.maximum(gaps, along).min(axis=1)
    return found


def touches_discs(
    polygon: Polygon,
    centres: Float[Array, "poses 2"],
    radius: float,
    poses: Float[Array, "poses 3"],
) -> Bool[Array, " poses"]:
    """Return whether a polygon at each pose overlaps a disc at the centre of the same row, m."""
    triangles = _at(polygon, poses)
    sides = np.roll(triangles, -1, axis=2) - triangles
    away = centres[:, None, None] - triangles
    share = np.clip((away * sides).sum(axis=-1) / (sides**2).sum(axis=-1), 0.0, 1.0)
    apart = np.linalg.norm(away - share[..., None] * sides, axis=-1).min(axis=2)
    inside = (sides[..., 0] * away[..., 1] - sides[..., 1] * away[..., 0] >= 0.0).all(axis=2)
    touched: Bool[Array, " poses"] = (inside | (apart < radius)).any(axis=1)
    return touched
