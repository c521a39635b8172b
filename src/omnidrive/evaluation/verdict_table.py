"""Table of the verdicts of all tasks."""

from __future__ import annotations

from collections.abc import Sequence

from omnidrive.evaluation.table import NO_VALUE, Table, number_text
from omnidrive.evaluation.verdict import Verdict, headline

_MEASURES = {
    "me": "ME: mean distance to the reference; with noise, of the true pose.",
    "path_me": "Path ME: mean distance to the path of a reference that is too fast.",
    "settling_time": "Settling: of the slowest axis.",
}
_DEFINITIONS = (
    ("factor", "Factor: result of the next over that of the best."),
    (
        "confidence",
        "Confidence: 95 % interval of the factor over the seeds, and p-value of equal means "
        "(Holm-corrected).",
    ),
)


def verdict_table(found: Sequence[Verdict], notes: Sequence[str] = ()) -> Table:
    """Return a table with the best controller of each task, its advantage and its cost.

    Args:
        found: The verdicts.
        notes: Sentences after those that name the best controllers.
    """
    measures = {verdict.measure for verdict in found}
    note = " ".join(text for measure, text in _MEASURES.items() if measure in measures)
    unranked = [f"{', '.join(v.unranked)} ({v.name})" for v in found if v.unranked]
    if unranked:
        note += (
            f" Not ranked, because a run stopped early or did not settle: {'; '.join(unranked)}."
        )
    is_repeated = any(v.advantage is not None and v.advantage.seeds > 1 for v in found)
    sentences = tuple((v.name, v.best.name, _text(v)) for v in found)
    compact = Table(
        "Verdict", ("task", "best", "result"), sentences, note,
        tuple(("result", text) for _, text in _DEFINITIONS[1:] if is_repeated), keys=2, prose=True,
    )  # fmt: skip
    return Table(
        "Verdict",
        ("task", "best", "result", "next", "result of next", "factor", "confidence",
         "work, J", "work of next, J", "step time, µs", "step time of next, µs"),
        tuple(_row(verdict) for verdict in found),
        note,
        definitions=_DEFINITIONS if is_repeated else _DEFINITIONS[:1],
        keys=2,
        compact=compact,
        lead=" ".join([*headline(found), *notes]),
    )  # fmt: skip


def _text(verdict: Verdict) -> str:
    """Return result, advantage, confidence and cost as one sentence."""
    best, following = verdict.best, verdict.following
    parts = [verdict.value_text(best), verdict.advantage_text, verdict.confidence_text]
    cost = best.cost_text
    if cost and following is not None and following.cost_text:
        cost += f" (next: {following.cost_text})"
    return "; ".join(part for part in (*parts, cost) if part)


def _row(verdict: Verdict) -> tuple[str, ...]:
    best, following = verdict.best, verdict.following
    return (
        verdict.name,
        best.name,
        verdict.value_text(best),
        following.name if following else NO_VALUE,
        verdict.value_text(following) if following else NO_VALUE,
        verdict.factor_text,
        verdict.confidence_text,
        number_text(best.work),
        number_text(following.work) if following else NO_VALUE,
        number_text(best.step_time),
        number_text(following.step_time) if following else NO_VALUE,
    )
