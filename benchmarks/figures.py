"""Results of a benchmark: rows of name, value, unit, target and whether the target is met."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

console = Console(width=120)


def ratio(name: str, value: float, target: float) -> dict[str, object]:
    """Return the row of a ratio with a lower bound."""
    return at_least(name, value, "1", target)


def at_least(name: str, value: float, unit: str, target: float) -> dict[str, object]:
    return row(name, value, unit, f">= {target:g}", value >= target)


def at_most(name: str, value: float, unit: str, target: float) -> dict[str, object]:
    return row(name, value, unit, f"<= {target:g}", value <= target)


def row(name, value, unit, target="", holds=True) -> dict[str, object]:
    return {"name": name, "value": float(f"{value:.4g}"), "unit": unit, "target": target,
            "holds": bool(holds)}  # fmt: skip


def publish(benchmark: str, rows: list[dict[str, object]], printed: int | None = None) -> None:
    """Print up to ``printed`` rows, those with a target first; write benchmarks/out/NAME.json."""
    rows = sorted(rows, key=lambda r: not r["target"])
    table = Table("quantity", "value", "unit", "target", "met")
    for r in rows[:printed]:
        holds = str(r["holds"]) if r["target"] else ""
        table.add_row(r["name"], f"{r['value']:g}", r["unit"], r["target"], holds)
    console.print(table)
    out = Path(__file__).parent / "out"
    out.mkdir(exist_ok=True)
    (out / f"{benchmark}.json").write_text(json.dumps(rows, indent=1) + "\n")
