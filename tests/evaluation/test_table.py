"""Cells of tables, marks of the best, and LaTeX and CSV files."""

import csv
from dataclasses import replace
from io import StringIO
from math import isfinite

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.evaluation import Table, write_tables
from omnidrive.evaluation.page.markup import tables_markup
from omnidrive.evaluation.statistics.uncertainty import estimate_mean
from omnidrive.evaluation.study_logs import ControllerType
from omnidrive.evaluation.tables.table import RESOLUTION, cell_text, leading_number, number_text
from omnidrive.evaluation.tables.table_files import csv_text, latex_text
from tests.evaluation.recorded import reported


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (3.934, "3.93"), (49.6, "49.6"), (9.996, "10.0"), (999.6, "1000"),
        (53699.4, "53699"), (0.0982, "0.0982"), (-0.000123, "-0.000123"), (3.21e-6, "3.21e-06"),
        (9.99e-7, "0"), (-1.2e-12, "0"),
        (float("nan"), "–"), (float("inf"), "–"),
    ],
)  # fmt: skip
def test_number_text(value, text):
    assert number_text(value) == text


@given(st.floats(-1e300, 1e300).filter(lambda value: abs(value) >= RESOLUTION))
def test_number_from_the_resolution_on_is_never_printed_as_zero(value):
    assert float(number_text(value)) == pytest.approx(value, rel=6e-3)


@given(st.floats(1e-9, 1e6), st.floats(1e-12, 1e3))
def test_margin_of_a_mean_is_never_printed_as_zero(mean, spread):
    estimate = estimate_mean(np.array([mean - spread, mean + spread]))
    assert estimate.margin == 0.0 or float(estimate.text(1e3)[1]) > 0.0


ERRORS = Table(
    "Errors & more",
    ("time", "controller", "ME, mm", "clearance, mm", "p"),
    (
        ("20 s", "a_1", "2.0 ± 0.3", "−4", "0.02"),
        ("20 s", "b", "1.0 ± 0.1", "7", "< 0.001"),
        ("30 s", "a_1", "1.0 ± 0.2", "7", "–"),
        ("30 s", "b", "1.0 ± 0.3", "–", ""),
    ),
    "A 50 % note.",
    keys=2,
    details=frozenset({"p"}),
)  # fmt: skip


def test_best_cells_are_marked_in_each_group():
    marked = ERRORS.mark_best(("ME, mm",), ("clearance, mm",), group=0)
    assert marked.best == {(1, 2), (1, 3)}  # equal or single values have no best
    assert ERRORS.mark_best(("ME, mm",)).best == {(1, 2), (2, 2), (3, 2)}
    assert marked.select([0, 1, 3]).best == {(1, 2)}
    assert marked.brief().columns == ("time", "controller", "ME, mm", "clearance, mm")
    assert leading_number("none") != leading_number("none")


def test_negligible_results_are_equally_good():
    values = (5.53e-5, 2e-4, 9.9e-4, 1.1e-3, 0.0)
    cells = tuple((cell_text(value), "= 1") for value in values)
    assert [cell for cell, _ in cells] == ["< 0.001", "< 0.001", "< 0.001", "0.00110", "0"]
    table = Table("Steps", ("overshoot, %", "p"), cells).mark_best(("overshoot, %",))
    assert table.best == {(0, 0), (1, 0), (2, 0), (4, 0)}
    p_values = Table("Test", ("ME, mm", "p"), (("< 0.001", "< 0.001"),))
    assert csv_text(p_values).splitlines()[1] == "0,< 0.001"


@pytest.mark.parametrize("published", ["values", ""])
def test_every_column_of_a_quantity_has_a_unit(study, published):
    """Columns whose cells are numbers are counts, or have a unit."""
    counts = {"fallbacks", "collisions", "seeds", "factor", "p"}
    for table in reported(study, published=published).tables:
        for i, name in list(enumerate(table.columns))[table.keys :]:
            numeric = all(isfinite(leading_number(row[i])) or not row[i] for row in table.rows)
            assert not numeric or name in counts or ", " in name, (table.title, name)


def test_csv_has_numbers_in_cells_of_their_own():
    rows = list(csv.reader(StringIO(csv_text(ERRORS))))
    assert rows[0] == ["time", "controller", "ME, mm", "ME, mm (half 95 % interval)",
                       "clearance, mm", "p"]  # fmt: skip
    assert rows[1] == ["20 s", "a_1", "2.0", "0.3", "-4", "0.02"]
    assert rows[3] == ["30 s", "a_1", "1.0", "0.2", "7", ""]


def test_latex_is_escaped_and_marks_the_best():
    text = latex_text(ERRORS.mark_best(("ME, mm",), group=0))
    assert r"\caption{Errors \& more}" in text
    assert r"time & controller & ME (mm) & clearance (mm) & p \\" in text
    assert r"20 s & a\_1 & 2.0 $\pm$ 0.3 & $-$4 & 0.02 \\" in text
    assert r"20 s & b & \textbf{1.0 $\pm$ 0.1} & 7 & $<$ 0.001 \\" in text
    assert r"A 50 \% note." in text
    assert text.count(r"\addlinespace") == 1
    for rule in (r"\toprule", r"\midrule", r"\bottomrule"):
        assert text.count(rule) == 1


def test_every_table_of_a_study_is_written(study, tmp_path):
    tables = reported(study, published="values").tables
    files = list(write_tables(tables, tmp_path / "tables"))
    assert {path.suffix for path in files} == {".tex", ".csv"}
    assert len(set(files)) == 2 * len(tables)
    assert {path.name for path in files} == {p.name for p in (tmp_path / "tables").iterdir()}
    for table in tables:
        rows = (tmp_path / "tables" / f"{table.stem}.csv").read_text(encoding="utf-8").splitlines()
        assert len(rows) == 1 + len(table.rows)
        latex = (tmp_path / "tables" / f"{table.stem}.tex").read_text(encoding="utf-8")
        assert latex.isascii(), table.title
        assert latex.count(r"\textbf") == len(table.best)


def test_study_tables_mark_the_best_controller(study):
    (tracking,) = (t for t in reported(study).tables if "without noise" in t.title)
    column = tracking.columns.index("ME, mm")
    for duration in ("20 s", "30 s"):
        rows = {k: float(r[column]) for k, r in enumerate(tracking.rows) if r[0] == duration}
        (best,) = {k for k, i in tracking.best if i == column} & rows.keys()
        assert rows[best] == min(rows.values())


def test_errors_are_in_mm_and_mrad_under_the_labels_of_the_controllers(study):
    (table,) = (t for t in reported(study).tables if "without noise" in t.title)
    names = ("controller", "ME, mm", "MAE, mrad")
    columns = [table.columns.index(name) for name in names]
    assert [tuple(row[i] for i in columns) for row in table.rows] == [
        (r.controller, *(number_text(1e3 * r.record.metrics[name]) for name in ("me", "mae")))
        for r in study.select("track")
    ]


def test_best_results_are_marked_in_the_table_of_every_task(study):
    tables = {t.title: t for t in reported(study).tables}
    for title, columns in {
        "Tracking error without noise": {"ME, mm", "MAE, mrad"},
        "Tracking error with the paper's noise": {"ME true, mm", "MAE measured, mrad"},
        "Step response": {"rise 10-90 %, s", "settling ±10 %, s"},
        "NMPC by prediction horizon": {"ME, mm", "MAE, mrad"},
    }.items():
        assert columns <= {tables[title].columns[i] for _, i in tables[title].best}


def test_details_are_left_to_the_full_output(study):
    types = {name: ControllerType(name, "", "") for name in study.controllers} | study.types
    tables = reported(replace(study, types=types)).tables
    assert {table.title for table in tables if table.is_detail} == {
        "Controllers", "Fuzzy rules: change of kp/ki/kd",
    }  # fmt: skip
    (tracking,) = (table for table in tables if "without noise" in table.title)
    omitted = set(tracking.columns) - set(tracking.brief().columns)
    assert {"effort, rad/s²", "p99, µs", "min. clearance, mm"} <= omitted


def test_footnote_explains_only_columns_that_the_table_has():
    table = Table(
        "t", ("a", "b, mm", "c"), (("x", "1", "2"),), "All runs.",
        (("b, mm", "B: width."), ("c", "C: count."), ("a", "B: width.")),
    )  # fmt: skip
    assert table.footnote == "All runs. B: width. C: count."
    assert table.select([2]).footnote == "All runs. C: count."
    for text in (latex_text(table.select([2])), tables_markup([table.select([2])])):
        assert "C: count." in text
        assert "width" not in text


def test_tables_of_a_study_explain_nothing_that_they_lack(part):
    verdict, errors = reported(part).tables[:2]
    assert "ME: mean distance" in verdict.footnote
    for absent in ("Settling", "Path ME", "Holm"):
        assert absent not in verdict.footnote + errors.footnote
    assert "first 2 s" in errors.footnote
    kept = [i for i, name in enumerate(errors.columns) if name != "ME after 2 s, mm"]
    assert "first 2 s" not in errors.select(kept).footnote
