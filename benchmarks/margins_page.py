"""Tables and picture of docs/margins.md, made from the results of benchmarks/margins.py."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from omnidrive.evaluation import LoopMargins
from omnidrive.evaluation.figures.style import DARK, MUTED, figure_style, new_figure
from omnidrive.evaluation.palette import styles_of

if TYPE_CHECKING:
    from margins import Cell, Results

BEGIN, END = "<!-- tables: made by benchmarks/margins.py -->", "<!-- end of the tables -->"
IMAGE = "margins.svg"


class Worst:
    """Least margins over the cells of a controller and a sample time."""

    def __init__(self, margins: list[LoopMargins]) -> None:
        self.delay = min((m.delay_margin for m in margins), default=0.0)
        self.samples = min((m.delay_margin_samples for m in margins), default=0.0)
        self.phase = min((m.phase_margin for m in margins), default=0.0)
        self.gain = min((m.gain_margin for m in margins), default=1.0)
        self.peak = max((m.peak for m in margins), default=inf)


def worst_of(results: Results) -> dict[str, dict[float, Worst | None]]:
    """Return the least margins by controller and sample time; None: a cell has none."""
    table: dict[str, dict[float, Worst | None]] = {}
    for cell in results:
        table.setdefault(cell.controller, {}).setdefault(cell.dt, None)
    for controller, row in table.items():
        for dt in row:
            own = [r for c, r in results.items() if (c.controller, c.dt) == (controller, dt)]
            if all(r.margins and r.margins.stable and not r.reason for r in own):
                row[dt] = Worst([r.margins for r in own if r.margins])
    return table


def write_page(page: Path, results: Results, joint: dict[Cell, bool]) -> None:
    """Rewrite the text between the marks of the page, and the picture beside it."""
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, found, after = rest.partition(END)
    if not found:
        raise SystemExit(f"{page} needs the lines {BEGIN} and {END}")
    tables = "\n".join(tables_of(results, joint))
    page.write_text(f"{before}{BEGIN}\n{tables}\n{END}{after}", encoding="utf-8")
    draw(worst_of(results), page.parent / "images" / IMAGE)


def tables_of(results: Results, joint: dict[Cell, bool]) -> Iterator[str]:
    """Yield the lines of both tables."""
    table = worst_of(results)
    times = sorted({cell.dt for cell in results})
    heads = [f"{dt:g} s" for dt in times]
    yield from _head(["Delay margin, ms (samples)", *heads, "confirmed"])
    for controller, row in table.items():
        held = [r.confirmed for c, r in results.items() if c.controller == controller]
        held += [holds for c, holds in joint.items() if c.controller == controller]
        cells = [_delay(row[dt]) for dt in times]
        yield _line([f"`{controller}`", *cells, f"{sum(held)} of {len(held)}"])
    yield ""
    yield from _head(["Gain margin / phase margin / Ms", *heads])
    for controller, row in table.items():
        yield _line([f"`{controller}`", *(_others(row[dt]) for dt in times)])


def _delay(worst: Worst | None) -> str:
    return f"{1e3 * worst.delay:.0f} ({worst.samples:.2g})" if worst else "none"


def _others(worst: Worst | None) -> str:
    return f"{worst.gain:.1f} / {worst.phase:.0f}° / {worst.peak:.1f}" if worst else "none"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _head(cells: list[str]) -> Iterator[str]:
    yield _line(cells)
    yield "|" + "---|" * len(cells)


def draw(table: dict[str, dict[float, Worst | None]], path: Path) -> None:
    """Draw the delay margin of every controller over the sample time."""
    styles = styles_of({name: name.partition(",")[0] for name in table})
    with figure_style(), mpl.rc_context({"svg.hashsalt": "margins", "svg.fonttype": "none"}):
        figure = new_figure(7.16, 4.0)
        axes = figure.subplots()
        for name, row in table.items():
            known = {1e3 * dt: 1e3 * w.delay for dt, w in row.items() if w and isfinite(w.delay)}
            style = styles[name]
            axes.plot(
                list(known), list(known.values()), label=name, color=style.colour.light,
                marker=style.marker, ms=4, ls=(0, style.dash) if style.dash else "-",
            )  # fmt: skip
        times = np.array([0.0, 1e3 * max(dt for row in table.values() for dt in row)])
        for samples in (1, 2):
            axes.plot(times, samples * times, color=MUTED, lw=0.8)
            axes.annotate(f"{samples} late", (times[1], samples * times[1]), color=DARK,
                          xytext=(3, 0), textcoords="offset points", va="center")  # fmt: skip
        axes.set(xlabel="sample time in ms", ylabel="delay margin in ms", ylim=(0.0, None))
        figure.legend(loc="outside right upper")
        path.parent.mkdir(exist_ok=True)
        figure.savefig(path, metadata={"Date": None})
