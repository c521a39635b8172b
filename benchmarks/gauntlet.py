"""Gauntlet: the recommended controller against the others where the model is wrong.

The controllers know the nominal robot; the plant is that of the case (gauntlet_cases.py). All
robots can meet the references in every case (gauntlet_references.py), except one and those of the
part link, which the nominal robots can meet. Cells are a balanced sample (gauntlet_grid.py). Every
requirement is a row with its worst cell (gauntlet_rows.py). Finished cells are appended to
benchmarks/out/gauntlet.csv at once; a run with the same code resumes there.

    python benchmarks/gauntlet.py --quick                      # one robot and sample time
    python benchmarks/gauntlet.py --only step --robots small   # one row
    python benchmarks/gauntlet.py --against FILE               # also lists what moved by over 5 %
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from time import monotonic

from figures import console
from gauntlet_cases import ALL_CASES, CASES, LINK_CASES
from gauntlet_cells import CONTROLLERS, RECOMMENDED, UNADAPTED, Cell, Figures, cost_of, run_cell
from gauntlet_grid import DTS, PARTS, Grid
from gauntlet_rows import NEGLIGIBLE, entries
from gauntlet_table import TableFile, changes, read_table, version
from rich.progress import Progress, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from omnidrive.cli.options import available_cores
from omnidrive.execution.worker_pool import Call, Lost, WorkerPool
from omnidrive.robot import ROBOTS

OUT = Path(__file__).parent / "out"
STUDY = Path(__file__).parent / "gauntlet_study.csv"
"""Figures of the paper's study before the changes that the gauntlet judges."""
GRID = Grid()
QUICK = Grid(
    parts=tuple(part for part in PARTS if part not in ("noise", "study")),
    robots=("small",), dts=(0.05,), plants=("planar", "ball"), cases=(*CASES, *LINK_CASES),
)  # fmt: skip
SAID_EVERY = 30.0  # s, where the output is no terminal
MAX_CHANGES = 60


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )

    def several(option: str, valid: Sequence[object], kind: type = str) -> None:
        parser.add_argument(
            option, nargs="+", type=kind, choices=valid, metavar="NAME",
            help=f"of {', '.join(map(str, valid))}",
        )  # fmt: skip

    several("--only", PARTS)
    several("--robots", tuple(ROBOTS))
    several("--dts", DTS, float)
    several("--plants", GRID.plants)
    several("--cases", tuple(ALL_CASES))
    several("--references", GRID.references)
    several("--controllers", (*CONTROLLERS, UNADAPTED))
    parser.add_argument(
        "--quick", action="store_true", help="one robot and sample time, less than two minutes"
    )
    parser.add_argument("--processes", type=int, default=available_cores())
    parser.add_argument("--out", type=Path, default=OUT / "gauntlet.csv", help="table of all cells")
    parser.add_argument("--against", type=Path, help="earlier table: list what moved by over 5 %%")
    parser.add_argument("--others", type=Path, help="table with the other controllers, not run")
    parser.add_argument("--worst", type=int, default=0, help="failing cells to print per row")
    parser.add_argument("--list", action="store_true", help="count the cells and run none")
    return parser.parse_args(arguments)


def grid_of(options: argparse.Namespace) -> Grid:
    """Return the cells that the options select."""
    values = {key: value and tuple(value) for key, value in vars(options).items()
              if key in Grid.__dataclass_fields__}  # fmt: skip
    if options.others and not options.controllers:
        values["controllers"] = (RECOMMENDED, UNADAPTED)
    base = QUICK if options.quick else GRID
    return base.with_values(**values, parts=options.only and tuple(options.only))


def finished(cells: Sequence[Cell], processes: int) -> Iterator[tuple[Cell, Figures]]:
    """Yield each cell when it is finished; a cell whose process is lost is left out."""
    if processes == 1:
        yield from ((cell, run_cell(cell)) for cell in cells)
        return
    calls = [Call(cell.name, partial(run_cell, cell)) for cell in cells]
    with WorkerPool(processes, nothing) as pool:
        for index, figures in pool.outcomes(calls):
            if isinstance(figures, Lost):
                console.print(f"lost: {cells[index].name}: {figures.value}")
            else:
                yield cells[index], figures


def nothing() -> None:
    """Prepare nothing in a worker process."""


def run(cells: Sequence[Cell], file: TableFile, processes: int) -> None:
    """Run the cells that are not in the file, with progress and remaining time."""
    waiting = [cell for cell in cells if cell not in file.cells]
    if len(waiting) < len(cells):
        console.print(f"{len(cells) - len(waiting)} cells of this code are in {file.path}")
    total, done = sum(map(cost_of, waiting)), 0.0
    began = said = monotonic()
    columns = (*Progress.get_default_columns()[:3], TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(f"{len(waiting)} cells", total=total)
        for count, (cell, figures) in enumerate(finished(waiting, processes), 1):
            file.add(cell, figures)
            done += cost_of(cell)
            progress.update(task, completed=done, description=f"{count} of {len(waiting)} cells")
            if not console.is_terminal and monotonic() - said > SAID_EVERY:
                said = monotonic()
                left = (said - began) * (total / done - 1.0)
                console.print(f"{count} of {len(waiting)} cells, {left / 60:.1f} min left")


def report(rows: Sequence[dict[str, object]], most: int) -> None:
    """Print the rows, up to ``most`` failing cells of each, and write out/gauntlet.json."""
    table = Table("row", "value", "unit", "target", "holds", "failing", "worst cell")
    for r in rows:
        failing = f"{len(r['failing'])} of {r['cells']}"
        if r["clearly"] < len(r["failing"]):
            failing += f", {r['clearly']} by over {NEGLIGIBLE:g}"
        table.add_row(r["name"], f"{r['value']:g}", r["unit"], r["target"], str(r["holds"]),
                      failing, r["worst"])  # fmt: skip
    console.print(table)
    for r in rows:
        for text in r["failing"][:most]:
            console.print(f"{r['name']}: {text}", soft_wrap=True)
    OUT.mkdir(exist_ok=True)
    (OUT / "gauntlet.json").write_text(json.dumps(list(rows), indent=1) + "\n")


def main(arguments: Sequence[str] | None = None) -> None:
    options = parsed(arguments)
    cells = grid_of(options).cells()
    if options.list:
        minutes = sum(map(cost_of, cells)) / 60.0
        console.print(f"{len(cells)} cells, about {minutes:.0f} min of one core")
        return
    for path in (options.against, options.others):
        if path and not path.exists():
            sys.exit(f"there is no {path}")
    earlier = read_table(options.against) if options.against else {}
    others = read_table(options.others) if options.others else {}
    file = TableFile(options.out, version())
    if file.previous:
        console.print(f"the code has changed: the former table is now {file.previous}")
    run(cells, file, options.processes)
    selected = {cell: file.cells[cell] for cell in cells if cell in file.cells}
    compared = {
        cell._replace(controller=name) for cell in selected for name in (*CONTROLLERS, UNADAPTED)
    }
    selected = {c: f for c, f in others.items() if c in compared} | selected
    report(entries(selected, read_table(STUDY)), options.worst)
    if options.against:
        moved = changes(selected, earlier)
        console.print(f"{len(moved)} figures moved by more than 5 %, factor and cell:")
        shown = moved if len(moved) <= MAX_CHANGES else [
            *moved[: MAX_CHANGES // 2], *moved[-MAX_CHANGES // 2 :]
        ]  # fmt: skip
        for factor, text in shown:
            console.print(f"{factor:8.3f}  {text}", soft_wrap=True)


if __name__ == "__main__":
    main()
