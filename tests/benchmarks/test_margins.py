"""The harness of benchmarks/margins.py: late commands, least margins, tables of the page."""

import sys
from math import nan
from pathlib import Path

import numpy as np
import pytest

from omnidrive.components import component_names
from omnidrive.evaluation import LoopMargins
from omnidrive.geometry import BodyTwist

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import margins
import margins_page

ROOT = Path(__file__).parents[2]
DT = 0.1
BEGIN = round(margins.AT / DT)


class Recorder:
    """A plant that keeps durations and commands."""

    def __init__(self):
        self.steps, self.disturbances = [], []

    def step(self, command, dt):
        self.steps.append((dt, *command))

    def apply(self, disturbances):
        self.disturbances.append((len(self.steps), disturbances.offset))


def executed(delay, axes):
    """Return what a plant executes from 4 s on, of commands that count from 0, and its offsets."""
    plant = Recorder()
    late = margins.LatePlant(plant, delay, axes, margins.PoseOffset(x=1e-3))
    for k in range(BEGIN + 3):
        late.step(BodyTwist(k - BEGIN, 10.0 + k - BEGIN, 0.0), DT)
    assert plant.disturbances == [(BEGIN, margins.PoseOffset(x=1e-3))]
    assert plant.steps[:BEGIN] == [(DT, k - BEGIN, 10.0 + k - BEGIN, 0.0) for k in range(BEGIN)]
    return np.array(plant.steps[BEGIN:])


def test_whole_samples_late():
    steps = executed(2 * DT, ["x"])
    np.testing.assert_allclose(
        steps, [[DT, -2.0, 10.0, 0.0], [DT, -1.0, 11.0, 0.0], [DT, 0.0, 12.0, 0.0]]
    )


def test_fractions_of_a_sample_late():
    """The older command is executed for the fraction, then the newer one."""
    steps = executed(1.25 * DT, margins.AXES)
    np.testing.assert_allclose(
        steps[:4],
        [
            [0.25 * DT, -2.0, 8.0, 0.0], [0.75 * DT, -1.0, 9.0, 0.0],
            [0.25 * DT, -1.0, 9.0, 0.0], [0.75 * DT, 0.0, 10.0, 0.0],
        ],
    )  # fmt: skip


def test_the_line_is_the_integral_of_its_speed():
    rows = margins.Line(10.0).window(0.0, 9001, 1e-3)
    np.testing.assert_allclose(np.gradient(rows[:, 0], 1e-3)[1:-1], rows[1:-1, 3], atol=1e-3)
    assert rows[-1, 3] == margins.SPEED


def result(delay, phase, *, stable=True, confirmed=True, reason=""):
    found = LoopMargins(stable, 3.0, 0.0, 9.0, phase, delay, delay / DT, 4.0, 1.5)
    return margins.Result(found, confirmed, reason)


def test_the_least_margins_are_shown():
    cells = [margins.Cell("lqr", "small", DT, axis, "moving") for axis in margins.MEASURED]
    results = dict(zip(cells, [result(0.3, 50.0), result(0.25, 60.0)], strict=True))
    assert margins.least(results, "lqr", DT) == cells[1]
    text = "\n".join(margins_page.tables_of(results, {cells[1]: False}))
    assert "| `lqr` | 250 (2.5) | 2 of 3 |" in text
    assert "| `lqr` | 3.0 / 50° / 1.5 |" in text


@pytest.mark.parametrize(
    "other",
    [result(nan, nan, stable=False), result(0.2, 50.0, reason="not linear"),
     margins.Result(None, confirmed=False, reason="has not decayed")],
)  # fmt: skip
def test_a_cell_without_margins_leaves_none(other):
    cells = [margins.Cell("lqr", "small", DT, axis, "moving") for axis in margins.MEASURED]
    results = dict(zip(cells, [result(0.3, 50.0), other], strict=True))
    assert margins.least(results, "lqr", DT) is None
    assert "| `lqr` | none |" in "\n".join(margins_page.tables_of(results, {}))


def test_a_page_without_marks_is_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("text")
    with pytest.raises(SystemExit, match="needs the lines"):
        margins_page.write_page(page, {}, {})
    assert page.read_text() == "text"


def test_the_page_has_every_controller():
    names = {each.partition(",")[0] for each in margins.CONTROLLERS}
    assert names == set(component_names("controllers"))
    page = (ROOT / "docs/margins.md").read_text(encoding="utf-8")
    tables = page.partition(margins_page.BEGIN)[2].partition(margins_page.END)[0]
    for label in margins.CONTROLLERS:
        assert tables.count(f"| `{label}` |") == 2
