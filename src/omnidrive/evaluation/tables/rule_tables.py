"""Tables of the rules with which fuzzy controllers tune their gains."""

from __future__ import annotations

from collections.abc import Mapping

from omnidrive.control.pid import gain_tuning_system
from omnidrive.control.pid.rules import LABELS, paper_rules
from omnidrive.evaluation.tables.table import Table
from omnidrive.fuzzy import FuzzySystem

_TITLE = "change of kp/ki/kd"


def rule_tables(systems: Mapping[str, FuzzySystem]) -> list[Table]:
    """Return one table for each rule base in use, with the paper's rule where it differs.

    Args:
        systems: Gain-tuning system of each fuzzy controller, by label. The title names the
            controllers of a rule base if there are several.
    """
    users: dict[tuple[str, ...], list[str]] = {}
    for label, system in systems.items():
        users.setdefault(_cells(system), []).append(label)
    several = len(users) > 1
    return [
        _table(f"Fuzzy rules of {', '.join(labels)}" if several else "Fuzzy rules", cells)
        for cells, labels in users.items()
    ]


def _cells(system: FuzzySystem) -> tuple[str, ...]:
    """Return the consequents of all rules, in the order of the rules."""
    return tuple("/".join(each.set for each in rule.consequents) for rule in system.rules)


def _table(title: str, cells: tuple[str, ...]) -> Table:
    paper = _cells(gain_tuning_system(paper_rules()))
    shown = [
        ours if ours == theirs else f"{ours} (paper {theirs})"
        for ours, theirs in zip(cells, paper, strict=True)
    ]
    count = len(LABELS)
    return Table(
        f"{title}: {_TITLE}",
        ("error \\ change of error", *LABELS),
        tuple((error, *shown[i * count : (i + 1) * count]) for i, error in enumerate(LABELS)),
        "N: negative, P: positive; B: big, M: medium, S: small; ZO: zero.",
        is_detail=True,
    )
