"""HTML report of a study: one self-contained file with verdict, playback, figures and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import NamedTuple

from omnidrive.evaluation.page.document import document, fill_template, read_parts
from omnidrive.evaluation.page.markup import (
    PageFigure,
    figures_markup,
    items_markup,
    log_facts,
    tables_markup,
    verdict_markup,
)
from omnidrive.evaluation.page.payload import payload
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.statistics.evidence import StudyEvidence
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.study_logs import StudyLogs
from omnidrive.evaluation.study_verdicts import has_evidence
from omnidrive.evaluation.tables.table import Table
from omnidrive.evaluation.verdict import TaskVerdict

_PLAYER_SCRIPTS = (
    "vendor/uPlot.iife.min.js", "study.js", "camera.js", "map_layers.js", "scene.js", "lens.js",
    "charts.js", "page.js",
)  # fmt: skip
_PLAN_SCRIPTS = ("plan_chart.js", "plan.js")

_FIXED = (
    "<p><strong>Brackets</strong> are 95 % confidence intervals of a mean over the repetitions: "
    "Student's t, from 10 repetitions on with Hall's correction of skewness. That of a difference "
    "contains what the sign-flip test does not reject (Student's t beyond 100 repetitions); below "
    "6 repetitions there is none. The error of 5 % holds for controllers with equally distributed "
    "results; differences of mean zero that are skewed exceed it, as with Student's t: with 12 "
    "repetitions 9 % if they are exponential, 16 % if lognormal. "
    "Runs of one repetition at different values of the axes are averaged first, because they share "
    "their random numbers.</p>"
)
_ALWAYS_VALID = (
    "<p><strong>Brackets</strong> are always valid 95 % confidence intervals of a mean over the "
    "repetitions: the study added repetitions until they were narrow enough ({}), and they hold at "
    "every number of repetitions (Gaussian mixture of the t-statistic). They are wider than "
    "intervals of a fixed number. The error of 5 % holds for differences of equally good "
    "controllers that are symmetric; those of mean zero as skewed as a lognormal distribution "
    "exceed it: 16 %, or 9 % if the study has at least 100 repetitions.</p>"
)


class StudyPage(NamedTuple):
    """Content of the report of a study."""

    facts: StudyFacts
    study: StudyEvidence
    verdicts: Sequence[TaskVerdict]
    tables: Sequence[Table]
    """All tables; that of the verdict first."""
    figures: Sequence[PageFigure]
    styles: Mapping[str, ControllerStyle]
    logs: StudyLogs | None = None
    """Logs that the player shows; None: there are none."""

    def text(self) -> str:
        """Return the HTML; its content security policy permits only its own scripts."""
        has_plan = bool(self.logs and self.logs.plan)
        facts, logs, is_tested = self.facts, self.logs, has_evidence(self.study, self.verdicts)
        lead = next((table.lead for table in self.tables if table.title == "Verdict"), "")
        shown = [replace(t.compact, lead="") if t.compact else t for t in self.tables]
        intervals = _ALWAYS_VALID.format(escape(facts.until)) if facts.until else _FIXED
        reading = [fill_template("evidence_reading.html", {"intervals": intervals})] * is_tested
        licence = escape(read_parts(("vendor/uPlot.LICENSE",))[0])
        parts = {
            "kind": "study" if facts.setup else "report",
            "title": escape(facts.name),
            "question": f'    <p class="question">{escape(facts.question)}</p>\n'
            if facts.question else "",
            "facts": items_markup({**(log_facts(logs) if logs else {}), **self._size()}),
            "partial": self._partial(),
            "verdict": verdict_markup(self.verdicts, lead) if lead else "",
            "player": read_parts(("player.html",))[0] if logs else "",
            "plan": read_parts(("plan.html",))[0] if has_plan else "",
            "setup": fill_template("setup.html", {"setup": items_markup(facts.setup)})
            if facts.setup else "",
            "figures": figures_markup(self.figures),
            "tables": tables_markup(shown),
            "reading": "\n".join([*read_parts(("map_view.html",) if logs else ()), *reading]),
            "repeat": self._repeat() if facts.command else "",
            "footer": fill_template("footer.html", {"licence": licence, "data": payload(logs)})
            if logs else "",
        }  # fmt: skip
        styles = read_parts((*(["vendor/uPlot.min.css"] if logs else []), "page.css"))
        player = (*_PLAYER_SCRIPTS, *(_PLAN_SCRIPTS if has_plan else ()))
        scripts = read_parts(player if logs else ("theme_button.js",))
        return document("report.html", parts, [*styles, _swatch_style(self.styles)], scripts)

    def _size(self) -> dict[str, str]:
        """Return the numbers of runs, repetitions, controllers and axes."""
        runs = self.study.runs
        lost = int((~runs.finished).sum())
        return {
            "Runs": f"{len(runs):,}" + (f", {lost:,} ended early" if lost else ""),
            **({"Repetitions": f"{runs.repetitions:,}"} if not self.logs else {}),
            **({"Noise seeds": f"{runs.repeats:,}"} if runs.repeats > 1 else {}),
            "Controllers": str(len(runs.controllers)),
            **({"Axes": ", ".join(runs.axes)} if runs.axes and not self.logs else {}),
            **({"Random": ", ".join(runs.random_factors)} if runs.random_factors else {}),
        }

    def _partial(self) -> str:
        """Return a warning if runs are missing; they may change the verdict."""
        damaged = f"{escape(self.facts.damaged)}. " if self.facts.damaged else ""
        missing = self.facts.planned - len(self.study.runs) - self.study.runs.refused
        if missing <= 0 and not damaged:
            return ""
        part = (
            f"{missing:,} of {self.facts.planned:,} planned runs are not finished: this is a part "
            "of the study. "
            if missing > 0 else ""
        )  # fmt: skip
        return (
            f'<p class="card warning">{damaged}{part}Go on with '
            f"<code>{escape(self.facts.resume)}</code>.</p>"
        )

    def _repeat(self) -> str:
        """Return how the study is repeated."""
        facts = self.facts
        parts = {
            "file": escape(facts.file),
            "command": escape(facts.command),
            "hashes": items_markup({**facts.hashes, **facts.versions}),
            "definition": escape(facts.definition),
        }
        return fill_template("repeat.html", parts)


def _swatch_style(styles: Mapping[str, ControllerStyle]) -> str:
    """Return the style sheet of the colours of the controllers, one rule per theme."""
    rules = []
    for name, style in styles.items():
        quoted = "".join(c if c.isalnum() else f"\\{ord(c):x} " for c in name)
        rule = f'.swatch[data-controller="{quoted}"]'
        rules.append(f"{rule} {{ background: {style.colour.light}; }}")
        rules.append(f':root[data-theme="dark"] {rule} {{ background: {style.colour.dark}; }}')
    return "\n".join(rules)
