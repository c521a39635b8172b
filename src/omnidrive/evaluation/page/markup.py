"""Static HTML parts of the report."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from math import atan2, degrees
from typing import NamedTuple

from omnidrive.evaluation.results import StudyResults
from omnidrive.evaluation.table import Table
from omnidrive.evaluation.verdict import Verdict, headline, limit_notes, verdicts
from omnidrive.robot import Robot


class PageFigure(NamedTuple):
    """A figure of the report."""

    title: str
    caption: str
    svg: bytes
    """Content of an SVG file."""


def tables_markup(tables: Sequence[Table], *, first: int = 0) -> str:
    """Return the HTML of all tables, one section each; ``first`` is the number in the first id."""
    return "\n".join(_table(k, table) for k, table in enumerate(tables, first))


def figures_markup(figures: Sequence[PageFigure]) -> str:
    """Return the section of figures; empty without any."""
    if not figures:
        return ""
    return (
        '<section aria-labelledby="figures-title">\n<h2 id="figures-title">Figures</h2>\n'
        f'<div class="figures">\n{chr(10).join(map(figure_markup, figures))}\n</div>\n</section>'
    )


def figure_markup(figure: PageFigure) -> str:
    """Return a figure with its title and caption."""
    data = b64encode(figure.svg).decode()
    return (
        f'<figure class="card"><h3>{escape(figure.title)}</h3>'
        f'<img alt="{escape(figure.title)}. {escape(figure.caption)}" '
        f'src="data:image/svg+xml;base64,{data}">'
        f"<figcaption>{escape(figure.caption)}</figcaption></figure>"
    )


def _unbroken_options(markup: str) -> str:
    """Return a text in which options of the command line are not broken at their hyphens."""
    return re.sub(r"--[a-z][a-z-]*(?: \d+)?", r'<span class="option">\g<0></span>', markup)


def verdict_markup(results: StudyResults) -> str:
    """Return the best controller of each task as cards; empty if nothing is compared."""
    found = verdicts(results)
    if not found:
        return ""
    cards = "\n".join(map(_card, found))
    lead = " ".join([*headline(found), *limit_notes(results)])
    return (
        '<section class="verdict" aria-labelledby="verdict-title">\n'
        '<h2 id="verdict-title" class="unseen">Verdict</h2>\n'
        f'<p class="lead">{_unbroken_options(escape(lead))}</p>\n'
        f'<ul class="cards">\n{cards}\n</ul>\n</section>'
    )


def _card(verdict: Verdict) -> str:
    """Return the list item of one task: best controller, value, advantage and cost."""
    best = verdict.best
    lines = [
        verdict.value_text(best), verdict.advantage_text, verdict.confidence_text, best.cost_text,
    ]  # fmt: skip
    text = "".join(f"<span>{escape(line)}</span>" for line in lines if line)
    name = escape(best.name)
    return (
        f'<li class="card"><b class="task">{escape(verdict.name)}</b>'
        f'<strong><i class="swatch" data-controller="{name}"></i>{name}</strong>{text}</li>'
    )


def facts_markup(results: StudyResults) -> str:
    """Return robot, plant, map and path as the items of a description list."""
    robot, grid = results.robot, results.obstacles
    rows, cols = grid.occupied.shape
    facts = {
        "Robot": f"{robot.name}: {robot.mass:g} kg, R = {robot.effective_radius:.4g} m, "
        f"r = {robot.wheel.radius:.4g} m, {_wheels(robot)}",
        "Plant": results.plant,
        "Sample time": f"{results.dt:g} s",
        "Map": f"{cols * grid.resolution:.4g} m by {rows * grid.resolution:.4g} m, "
        f"planning grid {results.free_space.resolution:g} m"
        if grid.walled or grid.occupied.any()
        else "open floor",
        "Path": _path(results),
    }
    return "\n".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(fact)}</dd></div>" for name, fact in facts.items()
    )


def _path(results: StudyResults) -> str:
    """Return the length of the path and, if it is planned, that of the grid path."""
    if results.grid_path is None:
        return f"{results.spline.length:.2f} m"
    return (
        f"{results.spline.length:.2f} m smoothed; grid path "
        f"{results.grid_path.length:.2f} m, {len(results.grid_path.poses)} cells"
    )


def _wheels(robot: Robot) -> str:
    """Return number and kind of the wheels, and their directions from the centre."""
    bearings = ", ".join(f"{degrees(atan2(mount.y, mount.x)):.4g}" for mount in robot.mounts)
    kind = "mecanum wheels" if any(mount.is_mecanum for mount in robot.mounts) else "omni wheels"
    return f"{len(robot.mounts)} {kind} at {bearings}°"


def _table(k: int, table: Table) -> str:
    classes = _classes(table)
    head = "".join(
        f'<th scope="col"{name}>{escape(column)}</th>'
        for name, column in zip(classes, table.columns, strict=True)
    )
    best = [{i for row, i in table.best if row == k} for k in range(len(table.rows))]
    body = "\n".join(_row(classes, row, best[k]) for k, row in enumerate(table.rows))
    text = " ".join(
        t for t in ("Bold: best in its column." if table.best else "", table.footnote) if t
    )
    note = f'<p class="note">{escape(text)}</p>' if text else ""
    return (
        f'<section class="card table-card">\n'
        f'<h3 id="table-{k}">{escape(table.title)}</h3>\n'
        f'<div class="scroll" tabindex="0" role="region" aria-labelledby="table-{k}">\n'
        f'<table aria-labelledby="table-{k}"><thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>{note}\n</section>"
    )


def _classes(table: Table) -> list[str]:
    """Return the CSS class of each column: text is left-aligned, sentences are wrapped."""
    classes = [' class="words"'] * table.keys + [""] * (len(table.columns) - table.keys)
    if table.prose:
        classes[-1] = ' class="prose"'
    return classes


def _row(classes: Sequence[str], row: tuple[str, ...], best: set[int]) -> str:
    """Return one row; the cells with the indices ``best`` are marked."""
    cells = [
        f'<td class="best">{escape(cell)}</td>' if i in best else f"<td{name}>{escape(cell)}</td>"
        for i, (name, cell) in enumerate(zip(classes[1:], row[1:], strict=True), 1)
    ]
    return f'<tr><th scope="row">{escape(row[0])}</th>{"".join(cells)}</tr>'
