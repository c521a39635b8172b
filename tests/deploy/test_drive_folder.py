"""Run folder, report and notebook representation of a drive; one drive for all tests."""

import io
import json
import threading
import time

import numpy as np
import pytest

from omnidrive import FeedforwardController, KinematicPlant, PerfectSensors, study
from omnidrive import scenario as scenarios
from omnidrive.cli.components import one_run
from omnidrive.cli.drives.drive import _keys, _shown_states
from omnidrive.cli.scenario_options import ScenarioOptions
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_folder import save_drive
from omnidrive.deploy.links.simulated import SimulatedLink, SimulatedRobot
from omnidrive.deploy.scenario_files import attached_inputs
from omnidrive.evaluation import plot
from omnidrive.evaluation.figures import catalogue
from tests.command import omnidrive

RATE = 10.0


@pytest.fixture(scope="module")
def planned():
    chosen = ScenarioOptions(reference="circle,radius=0.5", robot="small", plant="kinematic")
    resolved = chosen.resolve().model_copy(update={"sample_time": 1.0 / RATE})
    scenario = one_run(resolved, "feedforward", "track", None)
    return scenarios.plan_and_check(scenario)


def driven(planned, controls=None):
    robot = planned.robot
    reference = planned.reference(study.planned_duration(planned))
    simulated = SimulatedRobot(robot, KinematicPlant(robot), PerfectSensors())
    link = SimulatedLink(simulated, reference.at(0.0).pose)
    pipeline = Pipeline(FeedforwardController(1.0 / RATE))
    return drive(
        link,
        pipeline,
        reference,
        rate=RATE,
        start=link.start,
        controls=controls,
        clock=SimulatedClock(),
    )


@pytest.fixture(scope="module")
def result(planned):
    return driven(planned)


def few_figures(patch):
    """Draw the figure ``effort`` of the study only: all of them take seconds."""
    every = catalogue.log_drawings
    patch.setattr(catalogue, "log_drawings", lambda logs: {"effort": every(logs)["effort"]})


@pytest.fixture(scope="module")
def folder(planned, result, tmp_path_factory):
    made = study.RunFolder(tmp_path_factory.mktemp("drive") / "folder")
    made.save_inputs(planned)
    with pytest.MonkeyPatch.context() as patch:
        few_figures(patch)
        save_drive(result, planned, "simulated", made, ("svg", "png"))
    return made


def test_folder_has_the_files_of_a_simulation(folder, result):
    present = {path.name for path in folder.path.iterdir()}
    assert present >= {"scenario.yaml", "results.json", "report.html", "figures", "series"}
    sizes = {each.name: each.stat().st_size for each in (folder.path / "figures").iterdir()}
    assert set(sizes) == {f"{n}.{s}" for n in ("punctuality", "effort") for s in ("svg", "png")}
    assert min(sizes.values()) > 1000
    series = list((folder.path / "series").iterdir())
    assert [each.name for each in series] == [f"track-feedforward-{result.run.t[-1]:g}s.parquet"]


def test_a_folder_without_figures(planned, result, tmp_path):
    made = study.RunFolder(tmp_path / "folder")
    made.save_inputs(planned)
    page = save_drive(result, planned, "simulated", made, ()).read_text()
    assert not list(made.path.glob("figures/*"))
    assert "<h3>Punctuality of the loop</h3>" not in page
    assert "armed by the user" in page


def test_results_tell_of_the_drive(folder, result):
    data = json.loads((folder.path / "results.json").read_text())
    told = data["drive"]
    assert told["ending"] == "the reference ends"
    assert [each["state"] for each in told["changes"]] == ["armed", "running", "stopped"]
    assert told["timing"]["samples"] == result.timing.summary().samples
    assert data["runs"][0]["me"] < 0.05


def test_report_shows_states_and_punctuality(folder, result):
    page = (folder.path / "report.html").read_text()
    assert "drive over the link simulated" in page
    assert page.count("<h3>Punctuality of the loop</h3>") == 1
    assert "armed by the user" in page
    speeds = json.loads(page.split('type="application/json">')[1].split("</script>")[0])
    middle = speeds["groups"][0]["runs"][0]["speed"][20:-20]
    steps = np.hypot(*np.diff(result.run.pose[20:-20, :2], axis=0).T)
    assert np.mean(middle) == pytest.approx(RATE * np.mean(steps), rel=0.02)


def test_inputs_are_attached_with_their_folder(folder, planned):
    made = attached_inputs(folder)
    assert "scenario/scenario.yaml" in made
    assert b"feedforward" in made["scenario/scenario.yaml"]


def test_notebooks_show_drive_and_run(result, planned):
    html = result._repr_html_()
    assert "missed deadlines" in html
    assert html.count("<svg") == 1
    controls = DriveControls()
    controls.stop("never begun")
    idle = driven(planned, controls)
    assert not idle.ran
    assert "never begun" in idle._repr_html_()
    assert len(plot(result.run).axes) == 3


@pytest.mark.long
@pytest.mark.parametrize(
    ("keys", "way"),
    [
        (True, "press a and Enter to arm the robot again, Enter to stop it"),
        (False, "the drive ends, because without a terminal the robot cannot be armed again"),
    ],
)
def test_a_hold_is_shown_at_once_with_how_it_ends(keys, way, capsys):
    controls, text = DriveControls(), ""
    changes = (("connected", True), ("tracked", ()), ("held", "no readings"), ("held", None))
    input_ends = threading.Event()
    if not keys:
        input_ends.set()
    with _shown_states(controls, "press a", input_ends):
        for name, value in changes:
            setattr(controls, name, value)
            lines, end = text.count("\n"), time.monotonic() + 30.0
            while text.count("\n") == lines and time.monotonic() < end:
                time.sleep(0.01)
                text += capsys.readouterr().out
    drives = "the controller drives the robot"
    assert text.splitlines() == ["press a", drives, f"held: {way}", drives]
    assert controls.stop_reason == (None if keys else "held without a terminal: no readings")


def test_a_hold_ends_a_drive_whose_input_has_ended(monkeypatch):
    """As of ``printf 'a\\n' | omnidrive drive``: nobody can arm the robot again."""
    monkeypatch.setattr("sys.stdin", io.StringIO("a\n"))
    controls = DriveControls()
    with _keys(controls, armed=False):
        end = time.monotonic() + 30.0
        while not controls.arm_requested and time.monotonic() < end:
            time.sleep(0.01)
        assert controls.stop_reason is None
        controls.held = "no readings"
        while controls.stop_reason is None and time.monotonic() < end:
            time.sleep(0.01)
    assert controls.stop_reason == "held without a terminal: no readings"


@pytest.mark.long  # in real time
def test_log_of_a_drive_names_its_components(tmp_path):
    words = ["drive", "--reference", "circle,radius=0.5", "--robot", "small", "--estimator"]
    done = omnidrive(*words, "--duration", "3", "--arm", "--out", "folder", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    shown = omnidrive("log", "show", "folder", "--json", cwd=tmp_path)
    about = json.loads(shown.stdout)["drive"]
    found = (about["link"], about["controller"], about["estimator"])
    assert found == ("simulated", "holonomic-nmpc", "kalman")


@pytest.mark.parametrize(
    "out", [("--out", "runs/folder"), pytest.param((), marks=pytest.mark.long)]
)
def test_a_robot_that_cannot_be_reached_leaves_the_folder_free(tmp_path, out):
    """The command can be repeated with the same folder; a numbered one is removed."""
    words = ["drive", "--reference", "circle,radius=0.5", "--robot", "small", "--estimator"]
    words += ["--controller", "feedforward", "--link", "wheels,address=/dev/missing@115200"]
    done = omnidrive(*words, "--arm", *out, cwd=tmp_path)
    assert done.returncode == 2
    assert "the serial port /dev/missing cannot be opened" in done.stderr
    assert done.stdout == ""  # nothing asks to arm it
    assert [each for each in (tmp_path / "runs").rglob("*") if each.is_file()] == []
    assert len(list((tmp_path / "runs").iterdir())) == bool(out)
