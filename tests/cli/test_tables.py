"""Tables in a terminal: no cell is truncated at any width."""

from dataclasses import replace

import pytest

from omnidrive.cli.tables import print_tables
from omnidrive.evaluation import Table

WIDE = Table(
    "Errors",
    ("time", "controller", *(f"measured value {i}, rad" for i in range(9))),
    tuple((f"{t} s", "feedforward", *(f"{i}.2345" for i in range(9))) for t in (20, 20, 30)),
    "A note below the table that explains the columns, with a certain length.",
    keys=2,
)


@pytest.mark.parametrize("width", [50, 60, 80, 100, 150, 400])
def test_no_cell_is_truncated(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    print_tables([WIDE])
    drawn = capsys.readouterr().out
    assert "…" not in drawn
    assert max(map(len, drawn.splitlines())) <= width
    for i in range(9):
        assert drawn.count(f"{i}.2345") == 3
    parts = drawn.count("Errors")
    assert drawn.count("feedforward") == 3 * parts
    assert (parts == 1) == (width >= 150)


FAULTS = Table(
    "Faults",
    ("fault", "controller", "ME, m", "first detection"),
    (
        ("1 wheel-locked at 5 s, wheel 0", "feedforward", "0.0054", "one two three " * 6),
        ("2 push at 5 s", "feedforward", "0.0055", ""),
    ),
    keys=2,
    prose=True,
)


@pytest.mark.parametrize("width", [80, 100, 160])
def test_sentences_are_wrapped(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    print_tables([FAULTS])
    drawn = capsys.readouterr().out
    assert "…" not in drawn
    assert max(map(len, drawn.splitlines())) <= width
    assert drawn.count("three") == 6
    assert drawn.count("2 push at 5 s") == 1


@pytest.mark.parametrize(("width", "compact"), [(60, True), (200, False)])
def test_compact_form_is_printed_in_narrow_terminals(width, compact, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    table = replace(
        WIDE, compact=replace(FAULTS, title="Narrow"), lead="The first is best.",
        best=frozenset({(0, 2)}),
    )  # fmt: skip
    print_tables([table])
    drawn = capsys.readouterr().out
    assert drawn.startswith("The first is best.")
    assert ("Narrow" in drawn) == compact
    assert ("*0.2345" in drawn) != compact
    assert ("* best in its column." in drawn) != compact


def test_details_are_printed_on_request(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "200")
    tables = [replace(WIDE, details=frozenset({WIDE.columns[3]})), replace(FAULTS, is_detail=True)]
    print_tables(tables, full=False)
    drawn = capsys.readouterr().out
    assert "Faults" not in drawn
    assert "1.2345" not in drawn
    assert "2.2345" in drawn
    print_tables(tables, full=True)
    drawn = capsys.readouterr().out
    assert "Faults" in drawn
    assert "1.2345" in drawn
