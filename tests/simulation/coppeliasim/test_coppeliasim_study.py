"""CoppeliaSim in scenarios and on the command line."""

import json
import signal
import subprocess
import sys
from time import monotonic, sleep

import pytest
import yaml

from omnidrive.errors import InvalidScenario, PlantLost
from omnidrive.robot import named_robot
from omnidrive.scenario import Tasks, load_scenario, paper_scenario, save_scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.tasks import DurationsTask, StepTask
from omnidrive.simulation import Outcome
from omnidrive.study import run_study
from tests.command import omnidrive
from tests.simulation.coppeliasim.fake_scene import STOPPED
from tests.simulation.coppeliasim.fake_server import cbor, fake_server, free_port

PAPER = named_robot("paper")


def scenario_at(port, **section):
    """Return a scenario with the paper's path and a step, for a controller without kernels."""
    return paper_scenario().with_values(
        plant={"type": "coppeliasim", "port": port, "timeout": 5.0, **section},
        controllers=("feedforward",),
        tasks=Tasks(
            track=DurationsTask(durations=(17.0,)),
            step=StepTask(displacement=(0.5, 0.5, 0.2), duration=2.0),
        ),
    )


def test_section_is_restored_from_a_file(tmp_path):
    scenario = scenario_at(23001, body="/omni/centre", signs=(1, -1, 1, 1))
    save_scenario(scenario, tmp_path / "scenario.yaml")
    assert load_scenario(tmp_path / "scenario.yaml") == scenario


@pytest.mark.parametrize(
    ("line", "fact"),
    [
        ("port: 0", "plant.port"),
        ("timeout: forever", "plant.timeout must be a plain number"),
        ("body: motor1", "plant.body"),
        ("body_yaw: 90", "plant.body_yaw"),
        ("host: 'a b'", "plant.host"),
        ("jonits: []", "did you mean 'joints'"),
        ("interface: ros", "plant.interface"),
    ],
)
def test_invalid_parameter_is_refused(tmp_path, line, fact):
    data = scenario_data(paper_scenario())
    data["plant"] = {"type": "coppeliasim", **yaml.safe_load(line)}
    file = tmp_path / "scenario.yaml"
    file.write_text(yaml.safe_dump(data))
    with pytest.raises(InvalidScenario, match=fact):
        load_scenario(file)


@pytest.mark.parametrize("interface", ["joints", "signals"])
def test_study_runs_in_one_process(monkeypatch, interface):
    """Also with more processes permitted, because one simulator contains one robot."""
    monkeypatch.setattr(sys.modules["omnidrive.execution.engine"], "WorkerPool", None)
    with fake_server(PAPER, signals=interface == "signals") as server:
        study = run_study(scenario_at(server.port, interface=interface), processes=4)
        assert server.scene.state == STOPPED
    study.raise_if_failed()
    direct = run_study(scenario_at(1).with_values(plant="mujoco-balls"))
    for remote, local in zip(study.logs.runs, direct.logs.runs, strict=True):
        assert remote.log.pose == pytest.approx(local.log.pose, abs=1e-4)


def test_lost_simulator_keeps_the_log_of_the_run(tmp_path):
    with fake_server(PAPER) as server:
        scenario = scenario_at(server.port)
        count = 0

        def mangle(request, reply):
            nonlocal count
            count += request["func"] == "sim.step"
            return b"" if count > 100 else cbor.dumps(reply)

        server.mangle = mangle
        with pytest.raises(PlantLost):  # the next run cannot start
            run_study(scenario, tmp_path / "run")
    (record,) = json.loads((tmp_path / "run" / "results.json").read_text())["runs"]
    assert not record["finished"]
    assert record["outcome"].startswith(Outcome.PLANT_LOST.value + ": ")
    assert "is not CoppeliaSim's remote API" in record["outcome"]
    assert (tmp_path / "run" / record["series"]).exists()


def test_command_reports_a_missing_simulator(tmp_path):
    save_scenario(scenario_at(free_port()), tmp_path / "scenario.yaml")
    done = omnidrive("run", "scenario.yaml", "--controller", "feedforward", cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert "no program listens at localhost:" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.long
def test_interrupted_command_stops_the_robot(tmp_path):
    with fake_server(PAPER) as server:
        save_scenario(scenario_at(server.port), tmp_path / "scenario.yaml")
        command = [sys.executable, "-m", "omnidrive", "run", "scenario.yaml", "--controller",
                   "feedforward"]  # fmt: skip
        with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
            deadline = monotonic() + 120.0
            while len(server.called("step")) < 20 and monotonic() < deadline:
                sleep(0.01)
            process.send_signal(signal.SIGINT)
            assert process.wait(60.0) == 130
        assert server.scene.finished == 1
        assert server.scene.state == STOPPED
        assert not server.scene.targets.any()
        assert not any(server.called("setJointTargetVelocity")[-1][1:])


@pytest.mark.long
def test_run_from_the_command_line(tmp_path):
    with fake_server(PAPER) as server:
        save_scenario(scenario_at(server.port), tmp_path / "scenario.yaml")
        done = omnidrive(
            "run", "scenario.yaml", "--controller", "feedforward", "--task", "step",
            "--plant", "coppeliasim", "--out", "here", cwd=tmp_path,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "here" / "report.html").exists()
        assert server.scene.finished == 1
