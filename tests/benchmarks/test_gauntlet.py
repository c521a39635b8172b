"""The harness of benchmarks/gauntlet.py: cases, figures, rows, and the table that is resumed."""

import sys
from math import inf, nan, pi
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import ROBOTS

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import gauntlet
import gauntlet_cells
import gauntlet_rows
import gauntlet_table
from gauntlet_cases import CASES, CasePlant
from gauntlet_cells import RECOMMENDED, Cell, Figures, Grid
from gauntlet_references import (
    SHAPES,
    counted,
    exact_arrival,
    limits_of,
    path_distance,
    physical_limits,
    reference_of,
)

from omnidrive.reference import delay_within_limits, limit_rows, limit_usage
from omnidrive.simulation import Outcome

CELL = Cell("step-cases", "small", 0.1, "ball", "lag", "step-x", 0, "pid")


class Recorder:
    """A plant that keeps its commands."""

    def __init__(self):
        self.commands = []

    def reset(self, pose):
        return None

    def apply(self, disturbances):
        self.slope = disturbances.slope

    def step(self, command, dt):
        self.commands.append(command)


def driven(case):
    plant = CasePlant(ROBOTS["small"], CASES[case], "ball")
    plant.plant = recorder = Recorder()
    plant.reset(Pose(0.0, 0.0, 0.0))
    for k in range(3):
        plant.step(BodyTwist(1.0 + k, 2.0, 3.0), 0.1)
    return recorder


def test_commands_are_scaled_by_the_gains():
    assert driven("gains-low").commands[0] == pytest.approx((0.95, 1.9, 2.7))
    assert driven("nominal").commands[0] == (1.0, 2.0, 3.0)


def test_commands_are_one_sample_late():
    assert [command.vx for command in driven("late").commands] == [0.0, 1.0, 2.0]


def test_the_slope_of_a_case_acts_from_the_start():
    assert driven("slope").slope == pytest.approx((0.0, np.tan(0.1)))


@pytest.mark.parametrize("direction", [BodyTwist(1.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 1.0)])
def test_drag_opposes_the_motion(direction):
    """The motors of a robot at constant speed exert it in addition."""
    robot = ROBOTS["small"]
    drag = 0.981 * robot.mass * np.array([1.0, 1.0, robot.mean_wheel_distance**2])
    effort = {}
    for case in ("nominal", "drag"):
        plant = CasePlant(ROBOTS["small"], CASES[case], "ball")
        plant.reset(Pose(0.0, 0.0, 0.0))
        for _ in range(20):
            state = plant.step(direction, 0.05)
        effort[case] = robot.chassis.jacobian.T @ state.wheel_torques
    axis = int(np.argmax(direction))
    added = effort["drag"][axis] - effort["nominal"][axis]
    assert added == pytest.approx(drag[axis] * max(state.twist), rel=0.05)


def test_a_robot_can_meet_its_references_in_every_case():
    reference = reference_of("eight-spin", "kiwi")
    usages = [
        max(limit_usage(reference, limits_of(case.robot(ROBOTS["kiwi"]), 1.0)).values())
        for case in CASES.values()
    ]
    assert max(usages) == pytest.approx(0.7, abs=1e-3)


def test_the_exact_retiming_is_late_only_where_the_wheels_limit_it():
    """Computed along the path here, and along the time of the reference in the package."""
    feasible = exact_arrival("paper")
    assert feasible < 8.0  # within 50 mm of the end, before the end
    robot = ROBOTS["mecanum"]
    limits = limit_rows(robot.chassis, physical_limits("mecanum"))
    motion = delay_within_limits(reference_of("eight-8s", "mecanum"), limits)
    t = np.arange(0.0, motion.duration, 1e-3)
    positions = motion.window(0.0, len(t), 1e-3)[:, :2]
    away = np.hypot(*(positions - positions[-1]).T) > 0.05
    assert exact_arrival("mecanum") == pytest.approx(t[np.flatnonzero(away)[-1]], abs=5e-3)


def test_distance_to_a_path_keeps_its_branch_where_the_path_crosses_itself():
    shape = SHAPES["eight"]
    s = np.linspace(0.0, 1.0, 401)
    poses = shape.evaluate(s).poses
    normal = np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
    poses[:, :2] += 0.01 * normal
    poses[:, 2] += 0.02 + 2.0 * pi
    found = path_distance(shape, poses)
    np.testing.assert_allclose(found.position, 0.01, atol=2e-4)
    np.testing.assert_allclose(found.heading, 0.02, atol=6e-3)
    np.testing.assert_allclose(found.share, s, atol=2e-3)


def test_arrival_on_the_path_is_compared_with_the_exact_retiming():
    cell = CELL._replace(part="impossible", robot="paper", reference="eight-8s")
    t, late = np.arange(0.0, 9.01, 0.05), 0.4
    reference = reference_of(cell.reference, cell.robot)
    poses = np.array([reference.at(max(each - late, 0.0)).pose for each in t.tolist()])
    run = SimpleNamespace(t=t, pose=poses, outcome=Outcome.FINISHED, work=np.zeros(1))
    exact = exact_arrival("paper")
    figures = gauntlet_cells.impossible_figures(cell, run)
    assert figures.arrival == pytest.approx((exact + late) / exact, abs=1e-3)
    assert figures.me_mm < 0.5
    run.t, run.pose = t[:150], poses[:150]
    assert gauntlet_cells.impossible_figures(cell, run).arrival == inf


def test_the_end_of_a_reference_that_stops_at_once_does_not_count():
    t = np.arange(0.0, 10.1, 1.0)
    assert t[counted("square", t)].tolist() == [3.0, 4.0, 5.0, 6.0, 7.0, 8.0]
    assert t[counted("eight", t)].tolist() == [*range(3, 11)]


def test_settling_is_the_last_entry_into_the_band():
    t = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    settling = gauntlet_cells.settling_time
    assert settling(t, np.array([0.0, 0.98, 1.04, 1.0, 1.0]), 0.0, 1.0) == pytest.approx(2.5)
    assert settling(t, np.array([0.0, 0.5, 1.0, 1.0, 1.0]), 0.0, 1.0) == pytest.approx(1.96)
    assert settling(t, np.array([5.0, 3.0, 3.0, 3.0, 3.0]), 5.0, 3.0) == pytest.approx(0.98)
    assert settling(t, np.array([0.0, 1.0, 1.0, 1.0, 0.97]), 0.0, 1.0) == inf


def test_one_cell():
    figures = gauntlet_cells.run_cell(CELL)
    assert figures.overshoot_percent > 0.0
    assert 0.5 < figures.settling_s < 4.0
    assert figures.work_J > 1.0
    assert np.isnan(figures.me_mm)
    again = gauntlet_cells.run_cell(CELL)  # the plant is that of before
    assert again.settling_s == figures.settling_s


def test_a_cell_that_raises_fails_alone(monkeypatch, capsys):
    monkeypatch.setattr(gauntlet_cells, "figures_of", lambda cell: 1 / 0)
    assert gauntlet_cells.run_cell(CELL) == Figures(*[inf] * len(Figures._fields))
    assert "lag step-x 0 pid: ZeroDivisionError" in capsys.readouterr().err


def rows_of(figures, part="tracking", study=None):
    """Return the rows of cells {(case, controller): figures} by their names."""
    table = {
        Cell(part, "small", 0.05, "ball", case, "eight", seed, controller): value
        for (case, controller, seed), value in figures.items()
    }
    return {row["name"]: row for row in gauntlet_rows.entries(table, study or {})}


def test_rows_of_tracking():
    rows = rows_of({
        ("nominal", RECOMMENDED, 0): Figures(1.0, 1.0),
        ("nominal", "pid", 0): Figures(2.0, 1.0),
        ("lag", RECOMMENDED, 0): Figures(1.9, 2.5),
        ("lag", "pid", 0): Figures(9.0, 3.0),
        ("lag", "fuzzy_t1", 0): Figures(2.0, 9.0),
    })  # fmt: skip
    over = rows["tracking: ME over nominal"]
    assert (over["value"], over["holds"], over["failing"], over["cells"]) == (1.9, True, [], 1)
    over = rows["tracking: MAE over nominal"]
    assert (over["value"], over["holds"]) == (2.5, False)
    over = rows["tracking: ME over the best other"]
    assert (over["value"], over["holds"], over["cells"]) == (0.95, False, 2)
    assert over["worst"] == "small, 0.05 s, ball, lag, eight: 1.9, fuzzy_t1 2"
    assert over["failing"] == [f"0.95 {over['worst']}"]
    assert rows["tracking: MAE over the best other"]["value"] == 1.0
    assert "step: overshoot" not in rows


def test_cells_that_fail_by_less_than_a_tenth_of_a_millimetre_are_counted():
    rows = rows_of({
        ("nominal", RECOMMENDED, 0): Figures(0.01),
        ("lag", RECOMMENDED, 0): Figures(0.11),
        ("late", RECOMMENDED, 0): Figures(0.13),
    })  # fmt: skip
    row = rows["tracking: ME over nominal"]
    assert (len(row["failing"]), row["clearly"]) == (2, 1)


def step(overshoot, settling=1.0):
    return Figures(overshoot_percent=overshoot, settling_s=settling)


def test_rows_of_steps():
    rows = rows_of({
        ("nominal", RECOMMENDED, 0): step(0.9, 1.3),
        ("nominal", "pid", 0): step(1.0, 1.2),
        ("nominal", "fast", 0): step(1.1, 0.5),
        ("nominal", "stuck", 0): step(0.0, inf),
    }, "step")  # fmt: skip
    assert rows["step: overshoot"]["holds"]
    settling = rows["step: settling over that of the fastest other"]
    assert settling["value"] == pytest.approx(1.3 / 1.2, abs=1e-3)
    assert not settling["holds"]
    name = "step in other cases: overshoot over its limit"
    for others, limit in (((20.0, 30.0), 10.0), ((1.0, 30.0), 5.0)):
        cells = {("lag", f"other{k}", 0): step(value) for k, value in enumerate(others)}
        cells |= {("lag", RECOMMENDED, 0): step(8.0), ("lag", "stuck", 0): step(0.0, inf)}
        row = rows_of(cells, "step-cases")[name]
        assert row["value"] == pytest.approx(8.0 / limit)
        assert row["holds"] == (limit == 10.0)


def test_a_failed_run_of_the_recommended_controller_never_holds():
    cells = {("nominal", RECOMMENDED, 0): gauntlet_cells.FAILED, ("nominal", "pid", 0): step(0.5)}
    rows = rows_of(cells, "step")
    assert rows
    assert not any(row["holds"] for row in rows.values())


def test_rows_of_noise_compare_means_over_the_seeds():
    rows = rows_of({
        ("recommended", name, seed): Figures(me_mm=value, mae_mrad=1.0, work_J=value)
        for name, values in ((RECOMMENDED, (1.0, 3.0)), ("pid", (2.5, 2.5)), ("few", (0.1,)))
        for seed, value in enumerate(values)
    }, "noise")  # fmt: skip
    row = rows["task noise: ME over the best other"]
    assert (row["value"], row["holds"], row["cells"]) == (0.8, True, 1)
    assert "2 seeds: 2, pid 2.5" in row["worst"]


def test_rows_of_the_study_compare_every_controller_with_before():
    cells = {("paper", name, 0): Figures(me_mm=10.0) for name in (RECOMMENDED, "pid")}
    before = {
        Cell("study", "small", 0.05, "ball", "paper", "eight", 0, name): Figures(me_mm=value)
        for name, value in ((RECOMMENDED, 10.1), ("pid", 9.7))
    }
    row = rows_of(cells, "study", before)["paper's study: any figure over that of before"]
    assert row["value"] == pytest.approx(1.031, abs=1e-3)
    assert "pid me_mm 10, before 9.7" in row["worst"]


def test_a_table_is_resumed_and_that_of_other_code_is_kept(tmp_path):
    path = tmp_path / "table.csv"
    file = gauntlet_table.TableFile(path, "a")
    file.add(CELL, Figures(me_mm=0.123456789, arrival=inf))
    with path.open("a") as interrupted:
        interrupted.write("a,step-cases,small,0.1,ba")
    resumed = gauntlet_table.TableFile(path, "a")
    (figures,) = resumed.cells.values()
    assert list(resumed.cells) == [CELL]
    assert (figures.me_mm, figures.arrival) == (0.123457, inf)
    assert np.isnan(figures.mae_mrad)
    resumed.add(CELL._replace(seed=1), Figures())
    assert len(gauntlet_table.read_table(path)) == 2
    other = gauntlet_table.TableFile(path, "b")
    assert other.cells == {}
    assert other.previous == tmp_path / "table.previous.csv"
    assert len(gauntlet_table.read_table(other.previous)) == 2


def test_changes_of_more_than_five_per_cent_are_listed():
    other = CELL._replace(seed=1)
    before = {CELL: Figures(10.0, 1.0, nan), other: Figures(0.001, 1.0)}
    now = {CELL: Figures(10.6, 1.04, nan), other: Figures(0.002, inf)}
    texts = [text for _, text in gauntlet_table.changes(now, before)]
    assert texts == [
        f"{other.name}: mae_mrad 1 -> inf",
        f"{CELL.name}: me_mm 10 -> 10.6",
    ]


def test_main_resumes_and_compares(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(gauntlet, "OUT", tmp_path)
    calls = []

    def run_cell(cell):
        calls.append(cell)
        return step(3.0 if cell.controller == RECOMMENDED else 0.5)

    monkeypatch.setattr(gauntlet, "run_cell", run_cell)
    out = tmp_path / "table.csv"
    selected = ["--only", "step", "--robots", "small", "--dts", "0.1", "--plants", "ball",
                "--references", "step-x", "--processes", "1", "--worst", "3"]  # fmt: skip
    gauntlet.main([*selected, "--out", str(out)])
    assert [cell.controller for cell in calls] == list(gauntlet_cells.CONTROLLERS)
    out_text = capsys.readouterr().out
    assert "1 of 1" in out_text
    assert "step: overshoot: 3 small, 0.1 s, ball, nominal, step-x: 3" in out_text
    gauntlet.main([*selected, "--out", str(out), "--against", str(out)])
    assert len(calls) == len(gauntlet_cells.CONTROLLERS)
    assert "0 figures moved" in capsys.readouterr().out
    gauntlet.main([*selected, "--out", str(tmp_path / "own.csv"), "--others", str(out)])
    assert [cell.controller for cell in calls[len(gauntlet_cells.CONTROLLERS) :]] == [RECOMMENDED]
    assert '"name": "step: settling' in (tmp_path / "gauntlet.json").read_text()


def test_every_row_has_cells_in_the_whole_grid_and_plants_where_it_must():
    cells = Grid().cells()
    assert {cell.part for cell in cells} == set(gauntlet_cells.PARTS)
    for part in ("step", "faults", "impossible"):
        assert {cell.plant for cell in cells if cell.part == part} == {"ball", "rollers"}
    tracked = {cell.case for cell in cells if cell.part == "tracking"}
    assert tracked == set(CASES)
    assert {cell.seed for cell in cells if cell.part == "noise"} == set(range(20))
    assert len(cells) == len(set(cells))
