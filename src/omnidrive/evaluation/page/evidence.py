"""HTML report of the evidence of a study: one self-contained file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

from omnidrive.evaluation.evidence import StudyEvidence
from omnidrive.evaluation.page.markup import PageFigure, figure_markup, tables_markup
from omnidrive.evaluation.page.writer import document, read_parts
from omnidrive.evaluation.palette import ControllerStyle
from omnidrive.evaluation.study_answer import TaskAnswer, value_text
from omnidrive.evaluation.study_facts import StudyFacts
from omnidrive.evaluation.table import NO_VALUE, Table

_STYLES = ("page.css", "evidence.css")
_SCRIPTS = ("evidence.js",)
_SHOWN_SENTENCES = 3  # of a card; the others are in a fold

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


class EvidencePage(NamedTuple):
    """Content of the report of a study."""

    facts: StudyFacts
    study: StudyEvidence
    answers: Sequence[TaskAnswer]
    tables: Sequence[Table]
    claims: Sequence[Table]
    """Tables with the claims of the paper; may be empty."""
    figures: Sequence[PageFigure]
    styles: Mapping[str, ControllerStyle]

    def text(self) -> str:
        """Return the HTML; its content security policy permits only its own scripts."""
        facts = self.facts
        parts = {
            "kind": "study",
            "title": escape(facts.name),
            "question": f'    <p class="question">{escape(facts.question)}</p>\n'
            if facts.question else "",
            "facts": items_markup(self._figures_of_the_study()),
            "partial": self._partial(),
            "answer": self._answer(),
            "claims": self._claims(),
            "setup": items_markup(facts.setup),
            "figures": "\n".join(map(figure_markup, self.figures)),
            "tables": tables_markup(self.tables),
            "intervals": _ALWAYS_VALID.format(escape(facts.until)) if facts.until else _FIXED,
            "file": escape(facts.file),
            "command": escape(facts.command),
            "hashes": items_markup({**facts.hashes, **facts.versions}),
            "definition": escape(facts.definition),
        }  # fmt: skip
        return evidence_document("evidence.html", parts, [_swatch_style(self.styles)])

    def _figures_of_the_study(self) -> dict[str, str]:
        """Return the numbers of runs, repetitions, controllers and axes."""
        runs = self.study.runs
        lost = int((~runs.finished).sum())
        return {
            "Runs": f"{len(runs):,}" + (f", {lost:,} ended early" if lost else ""),
            "Repetitions": f"{runs.repetitions:,}",
            **({"Noise seeds": f"{runs.repeats:,}"} if runs.repeats > 1 else {}),
            "Controllers": str(len(runs.controllers)),
            "Axes": ", ".join(runs.axes) or "none",
            **({"Random": ", ".join(runs.random_factors)} if runs.random_factors else {}),
        }

    def _partial(self) -> str:
        """Return a warning if runs are missing; they may change the answer."""
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

    def _answer(self) -> str:
        lead = " ".join(answer.lead for answer in self.answers)
        cards = "\n".join(map(_card, self.answers))
        return f'<p class="lead">{escape(lead)}</p>\n<ul class="cards wide">\n{cards}\n</ul>'

    def _claims(self) -> str:
        if not self.claims:
            return ""
        lead = " ".join(table.lead for table in self.claims if table.lead)
        return (
            '<section aria-labelledby="claims-title"><h2 id="claims-title">Claims of the paper</h2>'
            f'<p class="lead">{escape(lead)}</p><div class="tables">'
            f"{tables_markup(self.claims, first=1000)}</div></section>"
        )


def evidence_document(template: str, parts: Mapping[str, str], styles: Sequence[str] = ()) -> str:
    """Return a page with the styles and the scripts of evidence.

    Args:
        template: See :func:`~omnidrive.evaluation.page.writer.document`.
        parts: See there.
        styles: Texts of further style sheets.
    """
    return document(template, parts, [*read_parts(_STYLES), *styles], read_parts(_SCRIPTS))


def _card(answer: TaskAnswer) -> str:
    """Return the list item of one task: the best controllers and their comparisons."""
    evidence = answer.evidence
    best = "".join(
        f'<strong><i class="swatch" data-controller="{escape(name)}"></i>{escape(name)}</strong>'
        for name in evidence.best
    )
    value = value_text(evidence.leader) if evidence.leader else NO_VALUE
    sentences = [f"<li>{escape(sentence)}</li>" for sentence in answer.sentences]
    shown, rest = sentences[:_SHOWN_SENTENCES], sentences[_SHOWN_SENTENCES:]
    more = (
        f'<details><summary>{len(rest)} more</summary><ul class="sentences">{"".join(rest)}</ul>'
        "</details>"
        if rest
        else ""
    )
    return (
        f'<li class="card"><b class="task">{escape(evidence.task.label)}</b>{best}'
        f"<span>{escape(evidence.measure.label)} {escape(value)}</span>"
        f'<ul class="sentences">{"".join(shown)}</ul>{more}</li>'
    )


def items_markup(facts: Mapping[str, str]) -> str:
    """Return facts as the items of a description list."""
    return "\n".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(fact)}</dd></div>" for name, fact in facts.items()
    )


def _swatch_style(styles: Mapping[str, ControllerStyle]) -> str:
    """Return the style sheet of the colours of the controllers, one rule per theme."""
    rules = []
    for name, style in styles.items():
        quoted = "".join(c if c.isalnum() else f"\\{ord(c):x} " for c in name)
        rule = f'.swatch[data-controller="{quoted}"]'
        rules.append(f"{rule} {{ background: {style.colour.light}; }}")
        rules.append(f':root[data-theme="dark"] {rule} {{ background: {style.colour.dark}; }}')
    return "\n".join(rules)
