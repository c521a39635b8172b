"""`omnidrive plan`, run in this process: output, figures, waypoint files and errors."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from omnidrive.cli.main import load_verb
from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.errors import CannotWrite, InvalidInput, NoPathFound, OmnidriveError
from omnidrive.maps import OccupancyGrid, load_map, load_queries, save_nav2_map
from omnidrive.reference import MotionLimits, limit_rows, limit_usage, load_waypoints
from omnidrive.robot import named_robot
from omnidrive.scenario import load_scenario, paper_scenario, plan_and_check
from omnidrive.study import check_plan_targets, solve_queries
from tests.shared_data import shared

SCENARIOS = ("maze-32-32-4", "random-32-32-20", "room-64-64-8", "warehouse-10-20-10-2-1")


def plan(capsys, *args):
    """Return the output of the command."""
    load_verb("plan")([*map(str, args)], standalone_mode=False)
    return capsys.readouterr().out


@pytest.fixture
def room(tmp_path):
    """Arguments for a Nav2 map of 8 m x 6 m with a wall between start and goal."""
    occupied = np.zeros((120, 160), bool)
    occupied[:80, 78:82] = True
    save_nav2_map(OccupancyGrid(occupied, 0.05, (-1.0, 2.0)), tmp_path / "room.yaml")
    return [tmp_path / "room.yaml", "--start", "0,3", "--goal", "6,3,1.5", "--robot", "small"]


def test_text_and_json_output_agree(capsys, room):
    lines = plan(capsys, *room).splitlines()
    facts = json.loads(plan(capsys, *room, "--json"))
    assert f"{'length':<20}{facts['length_m']:.3f} m" in lines
    assert 6.0 < facts["length_m"] < facts["length_of_grid_path_m"]
    assert facts["clearance_m"] > 0.0
    assert 0.5 < facts["largest_curvature_per_m"] < 20.0
    assert facts["expansions"] > 0
    assert facts["shortest_duration_s"] <= facts["duration_s"] < facts["shortest_duration_s"] + 0.1
    used = [facts["wheel_speed_used_percent"], facts["wheel_force_used_percent"]]
    assert 90.0 < max(used) <= 101.0


@pytest.mark.parametrize("ending", ["csv", "traj", "path", "yaml"])
def test_waypoint_files(capsys, room, tmp_path, ending):
    file = tmp_path / f"path.{ending}"
    load_verb("plan")([*map(str, room), "--json", "--out", str(file)], standalone_mode=False)
    out, err = capsys.readouterr()
    facts = json.loads(out)
    note = f"{file} has no velocities; .csv and .traj keep the motion"
    assert (note in err) == (ending in {"path", "yaml"})
    waypoints = load_waypoints(file)
    if ending in {"csv", "traj"}:
        assert waypoints.duration == pytest.approx(facts["duration_s"], abs=1e-3)
        first, last = waypoints.at(0.0), waypoints.at(waypoints.duration)
        assert np.abs([*first.twist, *last.twist]).max() < 1e-6
        assert last.pose == pytest.approx((6.0, 3.0, 1.5), abs=1e-6)
    else:
        poses = waypoints.poses if ending == "path" else waypoints.window(0.0, 500, 0.02)
        length = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).sum()
        assert length == pytest.approx(facts["length_m"], rel=0.01)
        assert poses[-1, :2] == pytest.approx((6.0, 3.0), abs=1e-3)


def test_saved_folder_reproduces_the_reference(capsys, room, tmp_path):
    plan(capsys, *room, "--out", tmp_path / "p")
    assert {path.name for path in (tmp_path / "p").iterdir()} == {
        "map.pgm", "map.yaml", "path.html", "path.png", "reference.csv", "scenario.yaml",
    }  # fmt: skip
    again = plan_and_check(load_scenario(tmp_path / "p" / "scenario.yaml"))
    reference = load_waypoints(tmp_path / "p" / "reference.csv")
    ours = again.reference(again.scenario.tasks.path_durations[0])
    assert ours.duration == pytest.approx(reference.duration)
    window = ours.window(0.0, 20, 0.1), reference.window(0.0, 20, 0.1)
    assert window[0] == pytest.approx(window[1], abs=1e-6)


def test_written_motion_keeps_its_limits(capsys, room, tmp_path):
    """Where the acceleration jumps, even samples would exceed them when they are read again."""
    plan(capsys, *room, "--out", tmp_path / "p.csv")
    robot = named_robot("small")
    limits = limit_rows(robot.chassis, MotionLimits.of_robot(robot))
    used = limit_usage(load_waypoints(tmp_path / "p.csv"), limits)
    assert 0.9 < max(used.values()) <= 1.01


def test_written_motion_at_top_speed_is_read_again(capsys, room, tmp_path):
    plan(capsys, *room, "--cost-weight", "0", "--out", tmp_path / "p.csv")
    facts = json.loads(plan(capsys, tmp_path / "p.csv", "--robot", "small", "--json"))
    assert 100.1 < facts["wheel_speed_used_percent"] <= 101.0


def mask(folder, name, pixels, **keys):
    """Write a mask for the map of ``room``."""
    Image.fromarray(pixels.astype(np.uint8)).save(folder / f"{name}.pgm", format="PPM")
    text = "\n".join(f"{key}: {value}" for key, value in keys.items())
    (folder / f"{name}.yaml").write_text(
        f"image: {name}.pgm\nmode: raw\nresolution: 0.05\norigin: [-1, 2, 0]\nnegate: 0\n"
        f"occupied_thresh: 0.65\nfree_thresh: 0.25\n{text}\n"
    )
    return folder / f"{name}.yaml"


def test_path_keeps_to_the_middle_and_out_of_zones(capsys, room, tmp_path):
    near = json.loads(plan(capsys, *room, "--cost-weight", 0, "--json"))
    far = json.loads(plan(capsys, *room, "--cost-weight", 20, "--json"))
    assert far["clearance_m"] > 2.0 * near["clearance_m"]
    assert far["length_m"] < 1.2 * near["length_m"]
    pixels = np.zeros((120, 160))
    pixels[20:40, 60:100] = 100  # in front of the passage, rows from the top
    kept = mask(tmp_path, "keepout", pixels)
    slow = mask(tmp_path, "speed", np.full((120, 160), 50), type=2, base=0.0, multiplier=0.01)
    out = tmp_path / "folder"
    plan(capsys, *room, "--keepout", kept, "--speed-mask", slow, "--out", out)
    rows = load_waypoints(out / "reference.csv").window(0.0, 2000, 0.01)
    x, y = rows[:, 0], rows[:, 1]
    assert not ((x > 2.0) & (x < 4.0) & (y > 6.0) & (y < 7.0)).any()
    assert np.hypot(rows[:, 3], rows[:, 4]).max() == pytest.approx(0.5, rel=0.03)
    assert (out / "path.png").is_file()
    again = json.loads(plan(capsys, out, "--json"))
    assert again["mean_speed_m_per_s"] < 0.5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--keepout", "none.yaml"], "none.yaml"),
        (["--keepout", "small.yaml"], "the mask has 4 x 3 cells, the map 160 x 120"),
        (["--speed-mask", "zero.yaml"], "a speed limit is 0 or negative"),
        (
            ["--keepout", "small.yaml", "--speed-mask", "zero.yaml"],
            "draw the mask on the map; zero",
        ),
        (["--speed-mask", "zero.yaml", "--timing", "uniform"], "need timing.law: limits"),
        (["--keepout", "small.yaml", "--search", "greedy"], "the search greedy has none"),
        (["--cost-weight", "-1"], "costs.weight"),
        (["--cost-radius", "nan"], "costs.radius"),
    ],
)
def test_bad_costs_are_refused(capsys, room, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    mask(tmp_path, "small", np.zeros((3, 4)))
    mask(tmp_path, "zero", np.full((120, 160), 100))
    with pytest.raises(OmnidriveError, match=re.escape(message)):
        plan(capsys, *room, *words)


def test_headings_of_the_command(capsys, room, tmp_path):
    found = {}
    for heading in ("path", "fastest", "goal-first", "goal-last", "strafe-least", "face:3,2"):
        out = tmp_path / heading.partition(":")[0]
        plan(capsys, *room, "--heading", heading, "--out", out)
        found[heading] = load_waypoints(out / "reference.csv")
    assert found["fastest"].duration <= found["path"].duration + 0.1
    assert found["strafe-least"].at(1e9).pose.yaw == pytest.approx(1.5, abs=1e-6)
    late, early = (found[f"goal-{end}"].at(2.0).pose.yaw for end in ("last", "first"))
    assert early == pytest.approx(1.5, abs=0.01)
    assert abs(late - 1.5) > 0.1
    scenario = load_scenario(tmp_path / "face" / "scenario.yaml")
    assert scenario.timing.target == (3.0, 2.0)
    for words in ("face", "face:", "face:1", "face:1,2,3", "face:a,b"):
        with pytest.raises(InvalidInput, match=r"such as face:3.5,2"):
            plan(capsys, *room, "--heading", words)
    with pytest.raises(OmnidriveError, match="heading"):
        plan(capsys, *room, "--heading", "sideways")


def test_figure_shows_the_path(capsys, room, tmp_path):
    plan(capsys, *room, "--png", tmp_path / "p.png")
    with Image.open(tmp_path / "p.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    blue = (pixels == (0, 114, 178)).all(axis=1).sum()
    assert blue > 500


def test_page_has_the_motion_and_the_results(capsys, room, tmp_path):
    facts = json.loads(plan(capsys, *room, "--html", tmp_path / "p.html", "--json"))
    text = (tmp_path / "p.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'type="application/json">(.*?)</script>', text, re.DOTALL)[1])
    motion = data["plan"]
    assert motion["t"][-1] == pytest.approx(facts["duration_s"])
    assert motion["s"][-1] == pytest.approx(facts["length_m"], rel=1e-3)
    assert min(motion["clearance"]) == pytest.approx(facts["clearance_m"], abs=2e-3)
    assert max(motion["cost"]) > 0.0
    assert f"{facts['length_m']:.3f} m" in text
    assert len(text) < 1e6


def test_duration_scales_the_wheel_speed(capsys, room):
    fast = json.loads(plan(capsys, *room, "--json"))
    slow = json.loads(plan(capsys, *room, "--json", "--duration", "20"))
    assert slow["duration_s"] == pytest.approx(20.0)
    share = fast["duration_s"] / 20.0
    expected = fast["wheel_speed_used_percent"] * share
    assert slow["wheel_speed_used_percent"] == pytest.approx(expected, rel=1e-6)


@pytest.fixture
def open_floor(tmp_path):
    """A Nav2 map of 4 m x 4 m without obstacles."""
    save_nav2_map(OccupancyGrid(np.zeros((40, 40), bool), 0.1), tmp_path / "floor.yaml")
    return [tmp_path / "floor.yaml", "--robot", "small", "--json"]


@pytest.mark.parametrize(
    ("options", "duration", "ending"),
    [
        (["--start", "1,2", "--goal", "1.05,2"], 0.3, "csv"),
        (["--start", "1,2,0", "--goal", "1,2,1"], 0.3, "traj"),
        (["--start", "1,2,0", "--goal", "1,2,1", "--speed", "0.5"], 0.3, "csv"),
        (["--start", "1,2", "--goal", "1.05,2", "--speed", "0.1"], 0.5, "traj"),
        (["--start", "1,2", "--goal", "1.05,2", "--timing", "minimum-time"], 0.3, "csv"),
    ],
)
def test_short_motions_last_whole_sample_times(
    capsys, open_floor, tmp_path, options, duration, ending
):
    """0.206 s and 0.267 s, the shortest durations, are rounded up to three sample times."""
    if "minimum-time" in options:
        pytest.importorskip("casadi")
    file = tmp_path / f"short.{ending}"
    facts = json.loads(plan(capsys, *open_floor, *options, "--out", file))
    assert facts["shortest_duration_s"] <= facts["duration_s"] == pytest.approx(duration)
    assert load_waypoints(file).duration == pytest.approx(duration, abs=1e-9)


def test_mean_speed_of_a_short_path_on_the_map_of_the_paper(capsys):
    ends = ["--start", "1,2", "--goal", "1.3,2", "--timing", "limits", "--speed", "0.5"]
    assert json.loads(plan(capsys, *ends, "--json"))["duration_s"] == pytest.approx(0.6)


@pytest.mark.long
def test_minimum_time_is_shorter_than_limits(capsys, room):
    pytest.importorskip("casadi")
    fast = json.loads(plan(capsys, *room, "--json"))
    faster = json.loads(plan(capsys, *room, "--json", "--timing", "minimum-time"))
    assert faster["shortest_duration_s"] < fast["shortest_duration_s"]
    assert faster["clearance_m"] > 0.0
    assert max(v for k, v in faster.items() if k.endswith("used_percent")) <= 101.0
    assert faster["note"].startswith(("converged", "capped"))


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize("method", ["astar", "jump-point"])
def test_all_queries_of_scenario_files_match(name, method):
    grid = load_map(shared(f"maps/movingai/{name}.map"))
    queries = load_queries(shared(f"maps/movingai/{name}.map.scen"), grid)
    solved = solve_queries(grid, queries, method=method)
    assert solved["solved"] == solved["queries"] == len(queries) >= 100
    assert solved["differing"] == []


def test_differing_lengths_are_listed(capsys, tmp_path):
    (tmp_path / "a.map").write_text("type octile\nheight 2\nwidth 4\nmap\n....\n..@.\n")
    row = "0\ta.map\t4\t2\t0\t0\t{}\t{}\t{}\n"
    (tmp_path / "a.scen").write_text(
        "version 1\n" + row.format(3, 0, 3) + row.format(3, 1, 3) + row.format(2, 1, 3)
    )
    args = [tmp_path / "a.map", "--scen", tmp_path / "a.scen"]
    solved = json.loads(plan(capsys, *args, "--json"))
    assert (solved["queries"], solved["solved"]) == (3, 2)
    wrong, blocked = solved["differing"]
    assert (wrong["query"], wrong["length_in_file"], wrong["length"]) == (1, 3.0, 4.0)
    assert (blocked["query"], blocked["length"]) == (2, None)
    assert "occupied" in blocked["why"]
    text = plan(capsys, *args)
    assert "lengths that differ 2" in text
    found = "line 3: (0, 0) to (3, 1): 3.00000000 cells in the file, 4.00000000 found"
    assert f"{tmp_path / 'a.scen'}, {found}" in text


def test_plan_of_the_paper_is_unchanged(capsys):
    assert "shortest duration   16.400 s" in plan(capsys)
    assert plan_and_check(paper_scenario()).plan.search_result.cells.shape == (42, 2)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["no.map", "--start", "1,1", "--goal", "2,2"], "no.map"),
        (["--scen", "a.scen"], "--scen needs the map file"),
        (["a.map", "--scen", "a.scen", "--png", "a.png"], "--scen only searches: omit --png"),
        (["a.map", "--map", "b.map", "--scen", "a.scen"], "argument and --map exclude each other"),
        (["ROOM", "--start", "0,3", "--goal", "6,3", "--unknown", "x"], "map.unknown"),
        (["ROOM", "--start", "1,3"], "a map needs --start X,Y and --goal X,Y"),
        (["ROOM", "--start", "3,3", "--goal", "6,3"], "the nearest valid position is"),
        (["ROOM", "--start", "0,3", "--goal", "60,3"], "outside the map, which spans"),
        (["ROOM", "--start", "0,3", "--goal", "6,3", "--search", "a*"], "path.search"),
        (["ROOM", "--start", "0,3", "--goal", "6,3", "--margin", "9"], "no free cell of the map"),
        (["ROOM", "--start", "0,3", "--goal", "6,3", "--duration", "0.5"], "fastest motion"),
        (["ROOM", "--start", "0,3", "--goal", "0,3"], "stand"),
        (["--resolution", "2"], "map resolution is for map files that do not define it"),
    ],
)
def test_invalid_arguments_are_reported(room, args, message, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    words = [str(room[0]) if word == "ROOM" else word for word in args]
    small = ["--robot", "small"] if "ROOM" in args else []
    with pytest.raises(OmnidriveError) as refused:
        load_verb("plan")([*words, *small], standalone_mode=False)
    assert message in str(refused.value)


def test_unreachable_goal_reports_the_size_of_the_region(tmp_path):
    occupied = np.zeros((60, 60), bool)
    occupied[:, 30] = True
    save_nav2_map(OccupancyGrid(occupied, 0.1), tmp_path / "two.yaml")
    with pytest.raises(
        OmnidriveError,
        match=r"only \d+ of \d+ free cells can be reached .*: a robot of any size needs",
    ):
        load_verb("plan")(
            [str(tmp_path / "two.yaml"), "--start", "1,1", "--goal", "5,5", "--robot", "small"],
            standalone_mode=False,
        )


def test_planning_imports_no_simulator_and_no_plotting(room):
    """Slow imports would delay every call."""
    code = f"import sys; sys.argv = ['omnidrive', 'plan', *{[str(word) for word in room]}]\n"
    code += "from omnidrive.cli import main\ntry: main()\nfinally: "
    code += "print([name for name in ('mujoco', 'matplotlib', 'pyarrow') if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "clearance" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


def test_equal_start_and_goal_are_rejected(tmp_path, room):
    for x in ("0,3", "0.025,3.025"):
        with pytest.raises(OmnidriveError, match="stands still"):
            load_verb("plan")(
                [str(room[0]), "--start", x, "--goal", x, "--robot", "small"],
                standalone_mode=False,
            )


def test_folder_stands_for_its_scenario(capsys, room, tmp_path):
    plan(capsys, *room, "--out", tmp_path / "p")
    by_folder = json.loads(plan(capsys, tmp_path / "p", "--json"))
    by_file = json.loads(plan(capsys, tmp_path / "p" / "scenario.yaml", "--json"))
    assert by_folder["length_m"] == by_file["length_m"]


@pytest.mark.long
def test_minimum_time_on_the_papers_map(capsys):
    pytest.importorskip("casadi")
    options = ["--search", "astar", "--no-cut-corners", "--smooth", "certified"]
    fast = json.loads(plan(capsys, *options, "--timing", "limits", "--json"))
    faster = json.loads(plan(capsys, *options, "--timing", "minimum-time", "--json"))
    assert faster["note"].startswith("converged")
    assert faster["shortest_duration_s"] < fast["shortest_duration_s"] < 16.4


def test_unknown_suffix_is_rejected_and_creates_nothing(room, tmp_path):
    with pytest.raises(OmnidriveError, match=r"suffix of a waypoint file is one of \.csv"):
        load_verb("plan")(
            [*map(str, room), "--out", str(tmp_path / "o.png")], standalone_mode=False
        )
    assert not (tmp_path / "o.png").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--png", "a.txt"], "the suffix of a figure must be .png or .svg"),
        (["--html", "a.png"], "the suffix of a page must be .html"),
        (["--html", "no/a.html"], "cannot write to no/a.html: there is no folder no"),
        (["--png", "no/a.png"], "cannot write to no/a.png: there is no folder no"),
        (["--png", "folder.png"], "cannot write to folder.png: it is a folder"),
        (["--png", "file/a.png"], "cannot write to file/a.png: Not a directory"),
        (["--png", "/proc/a.svg"], "cannot write to /proc/a.svg: "),
        (["--out", "a" * 300 + ".b"], "the suffix of a waypoint file is one of .csv"),
        (["--out", "a.txt"], "the suffix of a waypoint file is one of .csv"),
        (["--out", "no/a.csv"], "cannot write to no/a.csv: there is no folder no"),
        (["--out", "folder.csv"], "cannot write to folder.csv: it is a folder"),
        (["--out", "folder.png"], "folder.png is not empty; choose a new folder with --out"),
        (["--out", "file"], "cannot write to file: Not a directory"),
        (["--out", "file/in/it"], "cannot write to file/in/it: "),
        (["--out", "/proc/no"], "cannot write to /proc/no: "),
        (["--out", "new", "--png", "newer/a.png"], "there is no folder newer"),
    ],
)
def test_unwritable_targets_are_reported_before_planning(tmp_path, monkeypatch, options, message):
    """The map does not exist; it would be reported if it were opened first."""
    monkeypatch.chdir(tmp_path)
    for name in ("folder.png", "folder.csv"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "something").touch()
    (tmp_path / "file").touch()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises((InvalidInput, CannotWrite)) as refused:
        load_verb("plan")(
            ["no.map", "--start", "1,1", "--goal", "2,2", *options], standalone_mode=False
        )
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("verb", ["run", "compare"])
def test_nonempty_folder_is_rejected_before_planning(tmp_path, verb):
    (tmp_path / "file").touch()
    with pytest.raises(CannotWrite, match="is not empty; choose a new folder"):
        load_verb(verb)(
            ["no.map", "--start", "1,1", "--goal", "2,2", "--out", str(tmp_path)],
            standalone_mode=False,
        )


def test_name_with_nul_is_rejected(tmp_path):
    for name in ("new\0", "new\0.csv"):
        with pytest.raises(CannotWrite, match=r"new\\x00.*: embedded null"):
            check_plan_targets(tmp_path / name, None)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_write_permission_is_rejected(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(CannotWrite, match="Permission denied"):
        check_plan_targets(tmp_path / "a.csv", None)


def test_figure_may_be_written_into_the_new_folder(capsys, room, tmp_path):
    plan(capsys, *room, "--out", tmp_path / "a" / "b", "--png", tmp_path / "a" / "p.png")
    assert (tmp_path / "a" / "p.png").stat().st_size > 10_000
    assert (tmp_path / "a" / "b" / "reference.csv").exists()


def test_planning_options_exist_for_every_verb(tmp_path):
    options = {
        "search": "lazy-theta", "cut-corners": None, "smooth": "spline", "timing": "limits",
        "heading": "fixed", "margin": "0.2", "unknown": "free", "resolution": "0.5",
    }  # fmt: skip
    helps = {verb: load_verb(verb) for verb in ("plan", "run", "compare")}
    for verb in helps.values():
        names = {name for each in verb.params for name in each.opts}
        assert {"--" + name for name in options} <= names
    found = ScenarioOptions(
        search="jump-point", cut_corners=False, smooth="spline", timing="limits",
        heading="tangent", margin=0.2, unknown="free", seed=7,
    ).resolve()  # fmt: skip
    assert (found.path.search, found.path.cut_corners, found.path.smooth) == (
        "jump-point", False, "spline",
    )  # fmt: skip
    assert (found.timing.law, found.timing.heading, found.seed) == ("limits", "tangent", 7)
    assert (found.map.margin, found.map.unknown) == (0.2, "free")


def test_run_uses_the_planning_options(room, tmp_path):
    options = ["--search", "lazy-theta", "--heading", "tangent", "--margin", "0.1"]
    load_verb("run")(
        [*map(str, room[:4]), "6,3", *room[5:], *options, "--plant", "kinematic",
         "--figures", "none", "--out", str(tmp_path / "r")],
        standalone_mode=False,
    )  # fmt: skip
    scenario = load_scenario(tmp_path / "r" / "scenario.yaml")
    assert scenario.path.search == "lazy-theta"
    assert (scenario.timing.heading, scenario.map.margin) == ("tangent", 0.1)
    runs = json.loads((tmp_path / "r" / "results.json").read_text())["runs"]
    assert runs[0]["finished"]
    assert runs[0]["min_clearance"] > 0.05


def test_message_about_a_gap_that_is_too_narrow_names_its_parts_and_the_option(tmp_path):
    occupied = np.zeros((100, 100), bool)
    occupied[50] = True
    occupied[50, 35:66] = False  # a gap of 0.62 m
    np.save(tmp_path / "a.npy", occupied)
    plan = [str(tmp_path / "a.npy"), "--resolution", "0.02", "--start", "1,0.5", "--goal",
            "1,1.5", "--robot", "small"]  # fmt: skip
    with pytest.raises(NoPathFound) as refused:
        load_verb("plan")(plan, standalone_mode=False)
    parts = r"0\.33 m \(the body radius of 0\.28 m and the margin of 0\.05 m\) from every obstacle"
    assert re.search(rf"must keep {parts}: lower the margin \(--margin on", str(refused.value))
    load_verb("plan")([*plan, "--margin", "0.0"], standalone_mode=False)


@pytest.mark.parametrize(("resolution", "named"), [(1.0, True), (0.05, False)])
def test_message_names_half_the_cell_diagonal_if_it_decides(tmp_path, resolution, named):
    occupied = np.zeros((30, 30), bool)
    occupied[15, 10] = True
    np.save(tmp_path / "a.npy", occupied)
    with pytest.raises(OmnidriveError) as refused:
        load_verb("plan")(
            [str(tmp_path / "a.npy"), "--resolution", str(resolution), "--robot", "small",
             "--start", f"{9.8 * resolution},{15.5 * resolution}",
             "--goal", f"{25 * resolution},{25 * resolution}"],
            standalone_mode=False,
        )  # fmt: skip
    message = str(refused.value)
    assert "from an obstacle; the robot's centre must keep" in message
    fact = "half a cell diagonal, 0.707 m, which is larger than the margin of 0.05 m), also"
    assert (fact in message) == named
