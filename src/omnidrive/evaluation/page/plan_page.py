"""HTML page of a planned motion: one self-contained file with map, chart and results."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import NamedTuple

from omnidrive.evaluation.page.document import document, fill_template, read_parts
from omnidrive.evaluation.page.markup import items_markup, tables_markup
from omnidrive.evaluation.page.payload import plan_payload
from omnidrive.evaluation.plan_view import PlanView
from omnidrive.evaluation.tables.table import Table

_SCRIPTS = (
    "vendor/uPlot.iife.min.js", "study.js", "camera.js", "map_layers.js", "scene.js",
    "plan_chart.js", "plan.js", "theme_button.js",
)  # fmt: skip
_HEADER = ("shape", "length", "clearance", "duration", "mean speed")


class PlanPage(NamedTuple):
    """Content of the page of a planned motion."""

    title: str
    facts: Mapping[str, str]
    """Results of planning with their units, by name."""
    view: PlanView

    def text(self) -> str:
        """Return the HTML; its content security policy permits only its own scripts."""
        results = Table(
            "Path and motion", ("Quantity", "Value"), tuple(self.facts.items()), prose=True
        )
        header = {name: self.facts[name] for name in _HEADER if name in self.facts}
        licence = escape(read_parts(("vendor/uPlot.LICENSE",))[0])
        parts = {
            "kind": "plan",
            "title": escape(self.title),
            "question": "",
            "facts": items_markup({"robot": self.view.robot.name, **header}),
            "plan": read_parts(("plan.html",))[0],
            "tables": tables_markup([results]),
            "footer": fill_template(
                "footer.html", {"licence": licence, "data": plan_payload(self.view)}
            ),
        }
        styles = read_parts(("vendor/uPlot.min.css", "page.css"))
        return document("plan_page.html", parts, styles, read_parts(_SCRIPTS))
