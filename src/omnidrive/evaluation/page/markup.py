"""Static HTML parts of the report."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import atan2, degrees

from omnidrive.evaluation.results import StudyResults
from omnidrive.evaluation.table import Table
from omnidrive.robot import Robot


def tables_markup(tables: Sequence[Table]) -> str:
    """Return the HTML of all tables, one section each."""
    return "\n".join(_table(k, table) for k, table in enumerate(tables))


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
        f"planning grid {results.free_space.resolution:g} m",
        "Path": f"{results.grid_path.length:.2f} m, {len(results.grid_path.poses)} cells",
    }
    return "\n".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(fact)}</dd></div>" for name, fact in facts.items()
    )


def _wheels(robot: Robot) -> str:
    """Return number and kind of the wheels, and their directions from the centre."""
    bearings = ", ".join(f"{degrees(atan2(mount.y, mount.x)):.4g}" for mount in robot.mounts)
    kind = "mecanum wheels" if any(mount.roller_angle for mount in robot.mounts) else "omni wheels"
    return f"{len(robot.mounts)} {kind} at {bearings}°"


def _table(k: int, table: Table) -> str:
    classes = _classes(table)
    head = "".join(
        f'<th scope="col"{name}>{escape(column)}</th>'
        for name, column in zip(classes, table.columns, strict=True)
    )
    body = "\n".join(_row(classes, row) for row in table.rows)
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
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


def _row(classes: Sequence[str], row: tuple[str, ...]) -> str:
    cells = [
        f"<td{name}>{escape(cell)}</td>"
        for name, cell in zip(classes[1:], row[1:], strict=True)
    ]  # fmt: skip
    return f'<tr><th scope="row">{escape(row[0])}</th>{"".join(cells)}</tr>'
