"""Static HTML parts of the report."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from math import atan2, degrees
from typing import NamedTuple

from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.evaluation.tables.table import NO_VALUE, Table
from omnidrive.evaluation.verdict import TaskVerdict
from omnidrive.robot import Robot

_SHOWN_SENTENCES = 3  # of a card; the others are in a fold


class PageFigure(NamedTuple):
    """A figure of the report."""

    title: str
    caption: str
    svg: bytes
    """Content of an SVG file."""


def tables_markup(tables: Sequence[Table]) -> str:
    """Return the HTML of all tables, one section each."""
    return "\n".join(_table(k, table) for k, table in enumerate(tables))


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


def verdict_markup(verdicts: Sequence[TaskVerdict], lead: str) -> str:
    """Return the best controller of each task as cards, below the sentences of the verdict."""
    cards = "\n".join(map(_card, verdicts))
    return (
        '<section class="verdict" aria-labelledby="verdict-title">\n'
        '<h2 id="verdict-title">Verdict</h2>\n'
        f'<p class="lead">{_unbroken_options(escape(lead))}</p>\n'
        f'<ul class="cards">\n{cards}\n</ul>\n</section>'
    )


def _card(verdict: TaskVerdict) -> str:
    """Return the list item of one task: best controllers, value, comparisons and cost."""
    best = "".join(
        f'<strong><i class="swatch" data-controller="{escape(name)}"></i>{escape(name)}</strong>'
        for name in verdict.best
    )
    lines = [NO_VALUE]
    if verdict.leader is not None:
        lines = [
            verdict.value_text(verdict.leader),
            verdict.advantage,
            "" if verdict.sentences else verdict.confidence,
            str(verdict.costs.get(verdict.leader.controller, "")),
        ]
    text = "".join(f"<span>{escape(line)}</span>" for line in lines if line)
    name = f'<b class="task">{escape(verdict.name)}</b>'
    return f'<li class="card">{name}{best}{text}{_sentences(verdict)}</li>'


def _sentences(verdict: TaskVerdict) -> str:
    """Return the tested comparisons as a list; many are in a fold."""
    every = [f"<li>{escape(sentence)}</li>" for sentence in verdict.sentences]
    shown, rest = every[:_SHOWN_SENTENCES], every[_SHOWN_SENTENCES:]
    more = (
        f'<details><summary>{len(rest)} more</summary><ul class="sentences">{"".join(rest)}</ul>'
        "</details>"
        if rest
        else ""
    )
    return f'<ul class="sentences">{"".join(shown)}</ul>{more}' if shown else ""


def items_markup(facts: Mapping[str, str]) -> str:
    """Return facts as the items of a description list."""
    return "\n".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(fact)}</dd></div>" for name, fact in facts.items()
    )


def log_facts(logs: StudyLogs) -> dict[str, str]:
    """Return robot, plant, map and path of logs."""
    robot, grid = logs.robot, logs.obstacles
    rows, cols = grid.occupied.shape
    return {
        "Robot": f"{robot.name}: {robot.mass:g} kg, R = {robot.effective_radius:.4g} m, "
        f"r = {robot.wheel.radius:.4g} m, {_wheels(robot)}",
        "Plant": logs.plant,
        "Sample time": f"{logs.dt:g} s",
        "Map": f"{cols * grid.resolution:.4g} m by {rows * grid.resolution:.4g} m, "
        f"planning grid {logs.free_space.resolution:g} m"
        if grid.walled or grid.occupied.any()
        else "open floor",
        "Path": _path(logs),
    }


def _path(logs: StudyLogs) -> str:
    """Return the length of the path and, if it is planned, that of the grid path."""
    if logs.grid_path is None:
        return f"{logs.spline.length:.2f} m"
    return (
        f"{logs.spline.length:.2f} m smoothed; grid path "
        f"{logs.grid_path.length:.2f} m, {len(logs.grid_path.poses)} cells"
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
    lead = f'<p class="lead">{escape(table.lead)}</p>\n' if table.lead else ""
    return (
        f'<section class="card table-card">\n'
        f'<h3 id="table-{k}">{escape(table.title)}</h3>\n{lead}'
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
