"""The command line: verbs, help texts, and errors without tracebacks."""

import json
import os
import subprocess
import sys

import pytest
import yaml

from omnidrive.cli.components import with_controllers
from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.control import FeedforwardController, Status
from omnidrive.errors import InvalidInput, InvalidScenario
from omnidrive.robot import load_robot
from omnidrive.scenario import load_scenario, paper_scenario, save_scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.study import run_study
from tests.command import omnidrive
from tests.shared_data import shared

ONE_PROCESS = ["--plant", "kinematic", "--jobs", "1"]  # starting workers takes longer than the runs
QUICK = [*ONE_PROCESS, "--controllers", "feedforward", "--tasks", "track"]


def test_compare_prints_tables_and_folder(tmp_path):
    done = omnidrive("compare", *QUICK, "--out", "here", cwd=tmp_path, NO_COLOR="1")
    assert done.returncode == 0, done.stderr
    assert "Tracking error without noise" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("results: here")
    assert "simulate" in done.stdout.splitlines()[-2]
    assert (tmp_path / "here" / "report.html").exists()
    assert (tmp_path / "here" / "figures" / "xy_comparison.svg").exists()


def test_compare_json_prints_only_json(tmp_path):
    done = omnidrive("compare", *QUICK, "--json", "--seed", "5", cwd=tmp_path)
    data = json.loads(done.stdout)
    assert data["scenario"]["seed"] == 5
    assert {r["duration"] for r in data["runs"]} == {20.0, 30.0}


def test_compare_with_the_recommended_preset(tmp_path):
    done = omnidrive(
        "compare", "--preset", "recommended", *ONE_PROCESS, "--tasks", "track,step",
        "--controllers", "pid,fuzzy_t2", "--out", "here", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = json.loads((tmp_path / "here" / "results.json").read_text())
    assert {r["controller"] for r in data["runs"]} == {"pid", "fuzzy_t2"}
    assert all(r["me"] < 0.005 for r in data["runs"])
    assert (
        "PID tuned by an interval type-2 fuzzy system"
        in (tmp_path / "here" / "report.html").read_text()
    )


def test_default_controllers_depend_on_preset(tmp_path):
    all_seven = (
        "pid",
        "fuzzy_t1",
        "fuzzy_t2",
        "fuzzy_t3",
        "unicycle-nmpc",
        "feedforward",
        "holonomic-nmpc",
    )
    assert tuple(ScenarioOptions("paper").resolve().controllers) == (
        "fuzzy_t1",
        "fuzzy_t2",
        "unicycle-nmpc",
        "holonomic-nmpc",
    )
    recommended = ScenarioOptions("paper", preset="recommended").resolve()
    assert tuple(recommended.controllers) == all_seven
    save_scenario(paper_scenario(), tmp_path / "s.yaml")
    scenario = ScenarioOptions(str(tmp_path / "s.yaml"), preset="recommended").resolve()
    assert scenario.preset == "recommended"
    names = ("fuzzy_t1", "fuzzy_t2", "unicycle-nmpc", "holonomic-nmpc")
    assert tuple(scenario.controllers) == names


def test_compare_with_several_seeds(tmp_path):
    done = omnidrive(
        "compare", *ONE_PROCESS, "--tasks", "noise", "--noise-seeds", "3",
        "--controllers", "fuzzy_t1,fuzzy_t2", "--out", "here", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    tie = "Noise 30 s: no difference in ME is shown between fuzzy_t1, 86.3 mm [80.9, 91.7], and fuz"
    assert done.stdout.startswith(tie), done.stdout
    assert "(p = 0.250" in done.stdout
    needed = (
        "With 3 repetitions no difference between runs that vary can be shown at 5 %: one pair of"
    )
    assert needed in " ".join(done.stdout.split())
    assert "Paired differences" not in done.stdout
    assert "Fuzzy rules" not in done.stdout
    data = json.loads((tmp_path / "here" / "results.json").read_text())
    assert data["scenario"]["tasks"]["noise"]["repeats"] == 3
    assert len(data["runs"]) == 6
    assert "Paired differences" in (tmp_path / "here" / "report.html").read_text()


@pytest.mark.long
def test_compare_full_prints_every_table(tmp_path):
    done = omnidrive(
        "compare", "--plant", "kinematic", "--tasks", "track", "--full",
        "--controllers", "fuzzy_t1,holonomic-nmpc", "--out", "here", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Best in track 20 s and track 30 s: holonomic-nmpc.")
    for shown in ("Verdict", "Fuzzy rules", "Controllers", "effort"):
        assert shown in done.stdout
    assert "not found" not in done.stderr  # fonts
    assert "0.0000" not in done.stdout


def test_compare_on_user_map(tmp_path):
    depot = shared("maps/nav2/depot.yaml")
    done = omnidrive(
        "compare", "--map", depot, "--start", "2,2", "--goal", "27,13,1.57", "--robot", "small",
        "--speed", "0.6", *QUICK, "--out", "depot", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = json.loads((tmp_path / "depot" / "results.json").read_text())
    assert all(r["finished"] and r["min_clearance"] > 0 for r in data["runs"])
    again = run_study(load_scenario(tmp_path / "depot" / "scenario.yaml"))
    assert [r.metrics["me"] for r in again.records] == [r["me"] for r in data["runs"]]


def test_plan_and_run(tmp_path):
    planned = omnidrive("plan", "--out", "p", cwd=tmp_path)
    assert planned.returncode == 0, planned.stderr
    assert "shortest duration   16.400 s" in planned.stdout
    rows = (tmp_path / "p" / "reference.csv").read_text().splitlines()
    assert rows[0].startswith("# Between rows")
    assert rows[1].startswith("t_s,x_m,y_m,yaw_rad")
    assert len(rows) == 203
    ran = omnidrive("run", "--controller", "unicycle-nmpc", "--horizon", "8",
                    "--plant", "kinematic", "--figures", "none", cwd=tmp_path)  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[-1].startswith("results: runs/paper-unicycle-nmpc-track-")


def test_run_saves_the_robot_with_the_drive_that_it_identified(tmp_path):
    common = ("run", "--plant", "kinematic", "--save-robot", "learned.yaml")
    ran = omnidrive(*common, "--controller", "holonomic-nmpc", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[-1].startswith("robot: learned.yaml")
    text = (tmp_path / "learned.yaml").read_text()
    assert text.startswith("# Drive identified by holonomic-nmpc in the run runs/paper-")
    learned = load_robot(tmp_path / "learned.yaml")
    assert learned.drive_gain == pytest.approx((1.0, 1.0, 1.0), abs=0.02)
    assert learned.drive_gain[0] != 1.0
    again = omnidrive(*common, "--controller", "pid", cwd=tmp_path)
    assert again.returncode == 2
    assert "learned.yaml already exists; choose another, or add --force" in again.stderr
    none = omnidrive(*common, "--controller", "pid", "--force", cwd=tmp_path)
    assert none.returncode == 2
    assert "pid identifies no drive" in none.stderr
    assert (tmp_path / "learned.yaml").read_text() == text


@pytest.mark.parametrize("verb", ["", "compare", "plan", "run"])
def test_help_fits_80_columns(tmp_path, verb):
    done = omnidrive(*([verb] if verb else []), "--help", cwd=tmp_path, COLUMNS="80")
    assert done.returncode == 0
    assert "Usage: omnidrive" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    for needed in ["compare", "plan", "run"] if not verb else ["--map", "--start", "--robot"]:
        assert needed in done.stdout


MAP = ["--map", "no.yaml", "--start", "1,1", "--goal", "2,2"]


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["compare", *MAP], "cannot read the map no.yaml: No such file"),
        (["compare", "--map", "no.yaml"], "a map needs --start X,Y and --goal X,Y"),
        (["run", "x.parquet"], "need a scenario (.yaml or its folder), a waypoint file (.csv,"),
        (["compare", "--controller", "no.py:A"], "relative to the working folder"),
        (["compare", "none.yaml"], "cannot read the scenario none.yaml"),
        (["compare", "--goal", "80,6"], "outside the map, which spans"),
        (["compare", "--goal", "2,3"], "inside an obstacle"),
        (["compare", "--start", "1"], "--start must be X,Y or X,Y,HEADING in m, m, rad"),
        (["compare", "--start", "1,1,90"], "the heading is 90 rad"),
        (["compare", "--start", "nan,1"], "--start must be X,Y or X,Y,HEADING"),
        (["compare", "--start", "1_0,1"], "--start must be X,Y or X,Y,HEADING"),
        (["compare", "--duration", "5"], "shortest duration is 16.4 s"),
        (["compare", "--duration", "nan"], "duration must be positive"),
        (["compare", "--speed", "1e-9"], "e+09 s, need 0.1 to 36000 s: choose another duration"),
        (["compare", "--duration", "-5"], "duration must be positive, got -5 s"),
        (["compare", "--speed", "50"], "mean speed of 50 m/s is too high for this path of"),
        (["compare", "--duration", "25", "--speed", "0.4"], "give only one of them"),
        (
            ["compare", "--plant", "rolers"],
            "no plant 'rolers'; did you mean 'mujoco-rollers'?",
        ),
        (["compare", "--controllers", "unicycle-nmcp"], "did you mean 'unicycle-nmpc'?"),
        (
            ["compare", "--tasks", "horizon", "--controllers", "fuzzy_t1"],
            "needs a controller with the parameter horizon",
        ),
        (["compare", "--seed", "-1"], "seed is -1, need 0 to"),
        (["compare", "--seed", "9" * 20], "seed is 1e+20"),
        (["compare", "--duration", "30000"], "need 0.1 to 36000 s"),
        (["compare", "--speed", "0.0001"], "need 0.1 to 36000 s"),
        (["compare", "--jobs", "0"], "jobs"),
        (["compare", "--noise-seeds", "0"], "noise.repeats is 0 seeds, need 1 to 200 seeds"),
        (
            ["compare", "--tasks", "step", "--noise-seeds", "9"],
            "needs the task `noise`",
        ),
        (["compare", "--no-such-option"], "No such option"),
        (["run", "--controller", "pdi"], "did you mean 'pid'?"),
        (
            ["run", "--controller", "pid", "--horizon", "9"],
            "to controllers with the parameter horizon, not to pid",
        ),
        (["compare", *QUICK, "--out", "/proc/no/such"], "cannot write to /proc/no/such"),
        (["fly"], "No such command"),
        (["tune", "a.fis"], "with --controller fuzzy_t1,fuzzy.file=a.fis the gains around"),
        (
            ["run", "a.fis"],
            "a fuzzy system, not a scenario; show it with omnidrive fuzzy show a.fis",
        ),
    ],
)
def test_invalid_input_has_one_message_and_status_2(tmp_path, args, message):
    done = omnidrive(*args, cwd=tmp_path)
    assert done.returncode == 2, done.stdout + done.stderr
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_two_controllers_with_like_labels_are_refused():
    message = "two controllers are labelled 'PID'; name one of them, such as other=feedforward"
    with pytest.raises(InvalidInput, match=message):
        with_controllers(paper_scenario(), ["pid", "PID=feedforward"])


def test_code_in_a_scenario_file_needs_permission(tmp_path):
    (tmp_path / "law.py").write_text("def law():\n    pass\n")
    data = scenario_data(paper_scenario()) | {"controllers": {"own": f"{tmp_path}/law.py:law"}}
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(InvalidScenario, match=r"is code that is not installed; .* --allow-code"):
        ScenarioOptions(str(tmp_path / "s.yaml")).resolve()
    assert list(ScenarioOptions(str(tmp_path / "s.yaml"), allow_code=True).resolve().controllers)


def test_internal_error_has_status_1_and_no_traceback(command, monkeypatch):
    monkeypatch.setattr("omnidrive.study.run_study", lambda *_, **__: 1 / 0)
    status, _, errors = command("compare")
    assert status == 1
    assert "internal error of omnidrive" in errors
    assert "Traceback" not in errors


ASSUMED_ARMS = [
    (["--preset", "published-code"], 0.5),
    (["--preset", "published-code", "--robot", "paper"], 0.5),
    (["paper.yaml", "--preset", "published-code"], 0.5),
    (["published.yaml"], 0.5),
    (["published.yaml", "--preset", "paper"], None),
    (["published.yaml", "--robot", "small"], 0.25 / 2**0.5),
    (["paper.yaml"], None),
    ([], None),
]


@pytest.mark.parametrize(("args", "arm"), ASSUMED_ARMS)
def test_assumed_radius_of_published_code_depends_on_preset(tmp_path, args, arm):
    """R = 0.5 instead of 0.7071 m belongs to `published-code`, however it is selected."""
    for preset in ("paper", "published-code"):
        save_scenario(paper_scenario(preset), tmp_path / f"{preset.split('-')[0]}.yaml")
    files = [str(tmp_path / a) if a.endswith(".yaml") else a for a in args]
    scenario = files.pop(0) if files and files[0].endswith(".yaml") else "paper"
    named = dict(zip((f.removeprefix("--") for f in files[::2]), files[1::2], strict=True))
    assert ScenarioOptions(scenario, **named).resolve().robot.assumed_effective_radius == arm


def test_failed_run_has_no_error_metrics_and_status_1(command, monkeypatch, tmp_path):
    real = FeedforwardController.step

    def step(self, t, state, reference):
        found = real(self, t, state, reference)
        return found if t < 3 else found._replace(status=Status.FAILED)

    monkeypatch.setattr(FeedforwardController, "step", step)
    status, out, errors = command("compare", *QUICK, "--figures", "none", "--out", "failed")
    assert status == 1
    assert "stopped early: track-feedforward-20s (at 3 s: " in " ".join(errors.split())
    assert "feedforward (stopped at 3 s)" in out
    assert "0.00" not in out.split("ME:")[0]
    runs = json.loads((tmp_path / "failed" / "results.json").read_text())["runs"]
    assert [run["finished"] for run in runs] == [False, False]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_output_to_full_disk_is_reported(tmp_path):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "omnidrive", "list", "plants"],
            cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert "no space left for the output" in done.stderr
    assert "Traceback" not in done.stderr
