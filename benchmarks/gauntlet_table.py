"""The table of all cells: a csv file to which every finished cell is appended at once."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterator, Mapping
from math import inf, isfinite, isnan
from pathlib import Path

from gauntlet_cells import Cell, Figures

import omnidrive

MOVED = 0.05  # relative change of a figure that is reported
FLOORS = {
    "me_mm": 0.02, "mae_mrad": 0.02, "max_mm": 0.05, "overshoot_percent": 0.05,
    "settling_s": 0.002, "arrival": 0.001, "work_J": 0.5,
    "reversals": 0.05, "at_bounds": 0.5,
}  # fmt: skip
"""Changes up to these are not reported."""

Table = Mapping[Cell, Figures]


def version() -> str:
    """Return a hash of the sources of the package and of the gauntlet."""
    package, here = Path(omnidrive.__file__).parent, Path(__file__).parent
    files = [*package.rglob("*.py"), *package.rglob("*.yaml"), *here.glob("gauntlet_c*.py")]
    files += [here / f"gauntlet_{name}.py" for name in ("oscillation", "references")]
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


class TableFile:
    """Finished cells of one version of the code, in a file that a later run resumes.

    A file of another version is renamed: NAME.csv to NAME.previous.csv.
    """

    def __init__(self, path: Path, code: str) -> None:
        self.path, self.code = path, code
        self.cells: dict[Cell, Figures] = {}
        self.previous: Path | None = None
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            found, own = read_versions(path), read_table(path)
            if found <= {code}:
                self.cells = own
                _end_line(path)
            else:
                self.previous = path.with_suffix(".previous.csv")
                path.replace(self.previous)
        if not path.exists():
            with path.open("w", newline="") as file:
                csv.writer(file, lineterminator="\n").writerow(
                    ["version", *Cell._fields, *Figures._fields]
                )

    def add(self, cell: Cell, figures: Figures) -> None:
        """Append a finished cell; an interrupted write costs this cell only."""
        self.cells[cell] = figures
        with self.path.open("a", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(
                [self.code, *cell, *(f"{value:.6g}" for value in figures)]
            )


def _end_line(path: Path) -> None:
    """Remove the incomplete last line of an interrupted write."""
    text = path.read_bytes()
    if not text.endswith(b"\n"):
        path.write_bytes(text[: text.rfind(b"\n") + 1])


def _rows(path: Path) -> Iterator[dict[str, str]]:
    """Yield the complete rows of a file."""
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            if None not in row.values() and None not in row:
                yield row


def read_versions(path: Path) -> set[str]:
    return {row["version"] for row in _rows(path)}


def read_table(path: Path) -> dict[Cell, Figures]:
    """Return the cells of a file; of a cell that is there twice, the last.

    Figures that an earlier version of the gauntlet did not have are NaN.
    """
    kinds = {"dt": float, "seed": int}
    return {
        Cell(*(kinds.get(name, str)(row[name]) for name in Cell._fields)): Figures(
            *(float(row.get(name, "nan")) for name in Figures._fields)
        )
        for row in _rows(path)
    }


def changes(table: Table, earlier: Table) -> list[tuple[float, str]]:
    """Return the figures that differ by more than 5 %, with factor and text; the worst first."""
    found = []
    for cell in table.keys() & earlier.keys():
        for name, new, old in zip(Figures._fields, table[cell], earlier[cell], strict=True):
            if _moved(name, new, old):
                factor = new / old if old and isfinite(old) else inf if new > old else 0.0
                found.append((factor, f"{cell.name}: {name} {old:.4g} -> {new:.4g}"))
    return sorted(found, key=lambda each: (-each[0], each[1]))


def _moved(name: str, new: float, old: float) -> bool:
    if (isnan(new) and isnan(old)) or new == old:
        return False
    if not (isfinite(new) and isfinite(old)):
        return True
    return abs(new - old) > max(MOVED * abs(old), FLOORS[name])
