"""HTML and SVG by which notebooks show objects: a table of facts beside a small drawing."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from math import ceil

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

BLUE, ORANGE, GREY = "#0072b2", "#e69f00", "#8a8a8a"
"""Colours with contrast on white and on black."""

_MAX_POINTS = 300  # of a line
_MARGIN = 4.0  # px


class Drawing:
    """A drawing as SVG, in the coordinates of the data with y upwards.

    Args:
        box: Left, right, bottom and top of the drawn area, in the unit of the data.
        width: Width of the image, px.
        height: Height of the image, px. None: both axes have the same scale.
    """

    def __init__(
        self, box: tuple[float, float, float, float], *, width: float, height: float | None = None
    ) -> None:
        left, right, bottom, top = box
        across, up = max(right - left, 1e-9), max(top - bottom, 1e-9)
        if height is None:
            longest = max(across, up)
            width, height = width * across / longest, width * up / longest
        self._size = (width + 2.0 * _MARGIN, height + 2.0 * _MARGIN)
        self._scale = np.array([width / across, -height / up])
        self._origin = np.array([_MARGIN - left * width / across, _MARGIN + top * height / up])
        self._parts: list[str] = []

    def line(
        self,
        points: Float[Array, "points 2"],
        colour: str = "currentColor",
        *,
        width: float = 1.5,
        dashed: bool = False,
    ) -> None:
        """Draw a polyline of at most 300 points; points that are not finite are omitted."""
        points = points[np.isfinite(points).all(axis=1)]
        step = max(1, ceil(len(points) / _MAX_POINTS))
        thinned = np.vstack([points[:-1:step], points[-1:]])
        dash = ' stroke-dasharray="4 3"' if dashed else ""
        self._parts.append(
            f'<polyline points="{self._pixels(thinned)}" fill="none" stroke="{colour}" '
            f'stroke-width="{width:g}"{dash}/>'
        )

    def polygon(self, points: Float[Array, "points 2"], fill: str, *, opacity: float = 1.0) -> None:
        """Fill a polygon."""
        self._parts.append(
            f'<polygon points="{self._pixels(points)}" fill="{fill}" fill-opacity="{opacity:g}"/>'
        )

    def circle(
        self, centre: tuple[float, float], radius: float, colour: str = "currentColor"
    ) -> None:
        """Draw the outline of a circle; radius in the unit of the data."""
        x, y = self._origin + self._scale * centre
        self._parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius * self._scale[0]:.1f}" fill="none" '
            f'stroke="{colour}"/>'
        )

    def svg(self) -> str:
        """Return the SVG element."""
        width, height = self._size
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.1f} {height:.1f}">{"".join(self._parts)}</svg>'
        )

    def _pixels(self, points: Float[Array, "points 2"]) -> str:
        pixels = self._origin + self._scale * points
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels.tolist())


def box_around(
    points: Float[Array, "points 2"], margin: float = 0.0
) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of finite points, with a margin in their unit."""
    points = points[np.isfinite(points).all(axis=1)]
    (left, bottom), (right, top) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return left - margin, right + margin, bottom - margin, top + margin


def facts_html(title: str, facts: Mapping[str, str], *drawings: str) -> str:
    """Return a title, drawings and a table of facts as HTML.

    Args:
        title: Title; escaped.
        facts: Text of each fact by its name; both are escaped.
        drawings: SVG elements, see :meth:`Drawing.svg`, or results of :func:`captioned`.
    """
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(text)}</td></tr>'
        for name, text in facts.items()
    )
    return (
        f'<div><strong>{escape(title)}</strong><div style="display:flex;flex-wrap:wrap;gap:1em;'
        f'align-items:center">{"".join(drawings)}<table>{rows}</table></div></div>'
    )


def captioned(drawing: str, caption: str) -> str:
    """Return a drawing above its caption, which is escaped, as HTML."""
    return f'<figure style="margin:0">{drawing}<figcaption>{escape(caption)}</figcaption></figure>'


def table_html(title: str, columns: tuple[str, ...], rows: tuple[tuple[str, ...], ...]) -> str:
    """Return a table with a title as HTML; every text is escaped."""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
    )
    return (
        f"<table><caption>{escape(title)}</caption><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table>"
    )
