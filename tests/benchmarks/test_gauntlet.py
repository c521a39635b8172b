"""The harness of benchmarks/gauntlet.py: cases, figures, rows, and the table that is resumed."""

import sys
from collections import Counter
from itertools import combinations, product
from math import inf, nan, pi
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from omnidrive.estimation.drive_estimate import DRIVE_UNITS
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import ROBOTS

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import gauntlet
import gauntlet_cells
import gauntlet_rows
import gauntlet_table
from gauntlet_cases import CASES, LINK_CASES, PAIRS, Case, CasePlant
from gauntlet_cells import RECOMMENDED, UNADAPTED, Cell, Figures, cost_of
from gauntlet_grid import LINK_PLANTS, PARTS, RIVALS, Grid, groups_of_part
from gauntlet_oscillation import at_bounds, reversals, straight
from gauntlet_references import (
    LINK_SHAPES,
    SHAPES,
    counted,
    exact_arrival,
    limits_of,
    path_distance,
    physical_limits,
    reference_of,
)
from gauntlet_sample import Drawn

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
    plant = CasePlant(ROBOTS["small"], (CASES | LINK_CASES)[case], "ball")
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


def test_a_command_half_a_sample_late_acts_for_half_a_sample():
    """In steady motion, the displacement in a sample is that of half the former command."""
    moved = {}
    for case in ("nominal", "late-0.5"):
        plant = CasePlant(ROBOTS["small"], (CASES | LINK_CASES)[case], "planar")
        states = [plant.reset(Pose(0.0, 0.0, 0.0))]
        states += [plant.step(BodyTwist(0.2, 0.0, 0.0), 0.1) for _ in range(20)]
        x = [state.pose.x for state in states]
        assert x[20] - x[19] == pytest.approx(0.02, rel=0.02)
        moved[case] = x[20]
    assert moved["nominal"] - moved["late-0.5"] == pytest.approx(0.5 * 0.02, rel=0.02)


def test_a_pair_has_the_differences_of_both_cases():
    robot = ROBOTS["small"]
    pair = LINK_CASES["late-0.5"].both(LINK_CASES["late-2"]).both(LINK_CASES["gains-uneven"])
    assert pair.late == 2.5
    assert pair.gains == LINK_CASES["gains-uneven"].gains
    pair = LINK_CASES["mass-1.6"].both(LINK_CASES["lag-60ms"]).both(LINK_CASES["slip"])
    assert pair.robot(robot).mass == pytest.approx(1.6 * robot.mass)
    assert pair.robot(robot).motor_lag == pytest.approx(robot.motor_lag + 0.06)
    assert (pair.slip, pair.wheel, pair.wind) == (0.1, 1.0, 0.0)
    assert LINK_CASES["wheel-0.96"].both(Case(wheel=0.5)).wheel == pytest.approx(0.48)
    assert len(PAIRS) == 30
    kinds = [[name.split("-")[0] for name in pair.split("+")] for pair in PAIRS]
    assert all(a != b for a, b in kinds)


def test_wind_blows_in_every_other_two_seconds():
    plant = CasePlant(ROBOTS["small"], LINK_CASES["wind"], "planar")
    plant.plant = recorder = Recorder()
    plant.reset(Pose(0.0, 0.0, 0.0))
    slopes = []
    for _ in range(60):
        plant.step(BodyTwist(0.0, 0.0, 0.0), 0.1)
        slopes.append(recorder.slope[0])
    assert slopes == [0.0] * 20 + [0.05] * 20 + [0.0] * 20


@pytest.mark.parametrize(("case", "changed"), [("wheel-0.96", 0.96), ("slip", 1.1)])
def test_the_first_wheel_turns_at_another_speed(case, changed):
    robot = ROBOTS["small"]
    own = robot.drive.wheel_speeds(BodyTwist(0.95, 2.0, 3.0)).tolist()
    plant = CasePlant(robot, LINK_CASES[case], "planar")
    plant.plant = recorder = Recorder()
    plant.reset(Pose(0.0, 0.0, 0.0))
    for _ in range(6):
        plant.step(BodyTwist(0.95, 2.0, 3.0), 0.1)
    assert recorder.commands[0] == pytest.approx([changed * own[0], *own[1:]])
    # the encoder slips for half a second
    assert len(recorder.commands[5]) == (3 if case == "slip" else len(own))
    assert isinstance(recorder.commands[5], BodyTwist) == (case == "slip")


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


def test_derivatives_of_the_shapes_are_those_of_their_points():
    s, h = np.linspace(0.01, 0.99, 50), 1e-5
    for name, (shape, _) in LINK_SHAPES.items():
        before, at, after = (shape.evaluate(s + d) for d in (-h, 0.0, h))
        for k in (0, 1):
            slope = (after[k] - before[k]) / (2.0 * h)
            np.testing.assert_allclose(at[k + 1], slope, atol=2e-3, err_msg=f"{name} {k}")


def test_the_lane_change_is_straight_at_both_ends():
    reference = reference_of("lane-change", "small")
    t = np.arange(0.0, reference.duration, 0.05)
    which = straight(reference, t)
    share = reference.window(0.0, len(t), 0.05)[:, 0] / 6.0
    assert which[(share < 0.29) | (share > 0.71)].all()
    turning = (share > 0.35) & (share < 0.45)
    assert turning.any()
    assert not which[turning].any()


def test_reversals_are_large_changes_of_the_command_back_and_forth():
    k = np.arange(100)
    which = np.ones(100, bool)
    for amplitude, share in ((0.02, 1.0), (0.004, 0.0)):
        command = np.outer(amplitude * (-1.0) ** k, [0.0, 1.0, 0.0])
        assert reversals(SimpleNamespace(command=command), which) == share
    steady = SimpleNamespace(command=np.outer(0.05 * k, np.ones(3)))
    assert reversals(steady, which) == 0.0
    assert reversals(SimpleNamespace(command=command), k < 5) == 0.0


def test_estimates_at_a_bound_are_counted_in_the_last_complete_row():
    names = DRIVE_UNITS
    details = {name: np.array([0.0, 0.1, nan]) for name in names}
    gains = [details[f"drive_gain_{axis}"] for axis in ("x", "y", "yaw")]
    for each in gains:
        each[1] = 1.0
    run = SimpleNamespace(t=np.arange(3) * 0.05, details=details)
    assert at_bounds(run) == 0
    details["drive_lag"][1], gains[2][1] = 0.3, 0.7
    assert at_bounds(run) == 2
    details["drive_delay"][1] = 0.2
    assert at_bounds(run) == 3
    assert at_bounds(SimpleNamespace(t=run.t, details={})) == 0


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


def test_rows_of_the_link_allow_a_small_difference():
    rows = rows_of({
        ("nominal", RECOMMENDED, 0): Figures(0.1, 0.1, reversals=0.0, at_bounds=0.0),
        ("wind", RECOMMENDED, 0): Figures(0.15, 1.06, reversals=0.2, at_bounds=0.0),
        ("wind", UNADAPTED, 0): Figures(0.1, 1.0),
        ("wind", "pid", 0): Figures(0.11, 1.0),
        ("slip", RECOMMENDED, 0): Figures(2.08, 0.9, reversals=0.0, at_bounds=1.0),
        ("slip", UNADAPTED, 0): Figures(3.0, 0.9),
        ("slip", "pid", 0): Figures(2.0, 0.8),
    }, "link")  # fmt: skip
    value = {name: (row["value"], len(row["failing"])) for name, row in rows.items()}
    assert value["link: ME over its limit by the best other"] == (0.9905, 0)  # 2.08 of 2.1
    assert value["link: MAE over its limit by the best other"] == (1.059, 2)  # 0.9 of 0.85
    assert value["link: ME over its limit by the nominal run"] == (2.08, 1)  # of 1 mm
    assert value["link: MAE over its limit by the nominal run"] == (1.06, 1)
    assert value["link: ME over its limit by adapt: false"] == (1.0, 0)  # 0.15 of 0.15
    assert value["link: MAE over its limit by adapt: false"] == (1.01, 1)  # 1.06 of 1.05
    assert value["link: share of reversals of the command"] == (0.2, 1)
    assert value["link: estimates at a bound in the end"] == (1.0, 1)


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


def test_rows_of_steps_of_the_link():
    rows = rows_of({
        ("wind", RECOMMENDED, 0): step(5.0, 1.12),
        ("wind", UNADAPTED, 0): step(1.0, 0.1),
        ("wind", "pid", 0): step(4.0, 1.0),
        ("wind", "fast", 0): step(6.0, 0.5),
    }, "link-steps")  # fmt: skip
    assert rows["link-steps: overshoot"]["holds"]
    settling = rows["link-steps: settling over that of the fastest other"]
    assert (settling["value"], settling["holds"]) == (1.12, False)


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
    assert [cell.controller for cell in calls] == [RECOMMENDED, *RIVALS]
    out_text = capsys.readouterr().out
    assert "1 of 1" in out_text
    assert "step: overshoot: 3 small, 0.1 s, ball, nominal, step-x: 3" in out_text
    gauntlet.main([*selected, "--out", str(out), "--against", str(out)])
    assert len(calls) == 1 + len(RIVALS)
    assert "0 figures moved" in capsys.readouterr().out
    gauntlet.main([*selected, "--out", str(tmp_path / "own.csv"), "--others", str(out)])
    assert [cell.controller for cell in calls[1 + len(RIVALS) :]] == [RECOMMENDED]
    assert '"name": "step: settling' in (tmp_path / "gauntlet.json").read_text()


def test_every_row_has_cells_in_the_whole_grid_and_plants_where_it_must():
    cells = Grid().cells()
    assert {cell.part for cell in cells} == set(PARTS)
    for part in ("step", "faults", "impossible"):
        assert {cell.plant for cell in cells if cell.part == part} == {"ball", "rollers"}
    tracked = {cell.case for cell in cells if cell.part == "tracking"}
    assert tracked == set(CASES)
    for part in ("link", "link-steps"):
        own = [cell for cell in cells if cell.part == part]
        assert {cell.plant for cell in own} == set(LINK_PLANTS)
        assert {cell.case for cell in own} - {"nominal"} == {*LINK_CASES, *PAIRS}
    assert {cell.seed for cell in cells if cell.part == "noise"} == set(range(20))
    assert len(cells) == len(set(cells))


@pytest.mark.parametrize("part", ["link", "link-steps", "tracking", "step-cases"])
def test_the_sample_is_balanced(part):
    """Cases, robots, sample times, plants and references meet each other in proportion."""
    drawn = groups_of_part(part)
    assert len(drawn) == len(set(drawn)) > 150
    fields = [Counter(column) for column in zip(*drawn, strict=True)]
    for i, j in combinations(range(5), 2):
        pairs = Counter((group[i], group[j]) for group in drawn)
        off = 1.5 if Drawn._fields.index("case") in (i, j) else 4.0
        for a, b in product(fields[i], fields[j]):
            assert abs(pairs[a, b] - fields[i][a] * fields[j][b] / len(drawn)) <= off


def test_the_sample_is_the_same_in_every_selection():
    every = Grid(parts=("link", "link-steps")).cells()
    some = Grid(parts=("link", "link-steps"), robots=("kiwi",), dts=(0.1,), cases=("wind", "slip"))
    cells = some.cells()
    assert set(cells) <= set(every)
    assert {cell.part for cell in cells} == {"link", "link-steps"}
    assert groups_of_part("link") == groups_of_part.__wrapped__("link")
    nominal = {c._replace(case="") for c in cells if c.case == "nominal"}
    own = {c._replace(case="") for c in cells if c.part == "link" and c.controller == RECOMMENDED}
    assert own <= nominal


def test_the_gauntlet_takes_forty_minutes_on_two_cores_and_the_quick_part_two():
    for grid, minutes in ((Grid(), 40.0), (gauntlet.QUICK, 2.0)):
        assert sum(map(cost_of, grid.cells())) <= 2.0 * 60.0 * minutes
