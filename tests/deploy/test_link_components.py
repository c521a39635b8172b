"""Links by name, as on the command line."""

import sys

import numpy as np
import pytest

from omnidrive import Pose
from omnidrive.cli.components import chosen_component
from omnidrive.cli.drives.drive import _drive
from omnidrive.components import component_names, find_component
from omnidrive.deploy.clock import SimulatedClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.links.components import LinkContext
from omnidrive.deploy.links.simulated import SimulatedLink
from omnidrive.deploy.robot_link import RobotLink
from omnidrive.deploy.scenario_robot import scenario_pipeline, without_pose_fixes
from omnidrive.errors import InvalidInput
from omnidrive.scenario import Scenario, load_scenario, plan_and_check
from omnidrive.study import RunFolder

TEXTS = {
    "simulated": "simulated,latency=0.02,jitter=0.005,noise=true",
    "wheels": "wheels,address=udp://127.0.0.1:9",
    "lekiwi": "lekiwi,host=127.0.0.1,command_port=9",
}


@pytest.fixture(scope="module")
def planned():
    return plan_and_check(
        Scenario.model_validate(
            {
                "name": "circle",
                "robot": {"name": "lekiwi"},
                "plant": "kinematic",
                "reference": {"type": "circle", "radius": 0.2},
                "controllers": ["feedforward"],
                "tasks": {"track": {"durations": [20.0]}},
            }
        )
    )


def test_every_link_is_tried():
    assert set(component_names("links")) == {*TEXTS, "replay"}  # test_log_replay.py


@pytest.mark.parametrize("name", TEXTS)
def test_links_by_name(name, planned):
    chosen = chosen_component("links", TEXTS[name])
    made = chosen.make(LinkContext(planned, Pose(0.0, 0.0, 0.0)))
    assert isinstance(made, RobotLink)
    assert made.robot == planned.robot
    summary = find_component("links", name).summary
    assert summary.endswith(".")


def test_delays_reach_the_simulated_robot(planned):
    context = LinkContext(planned, Pose(0.0, 0.0, 0.0))
    made = chosen_component("links", TEXTS["simulated"]).make(context)
    assert (made.latency, made.jitter, made.make.noise) == (0.02, 0.005, True)
    assert made.period == context.sample_time == planned.scenario.sample_time


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lekiwi", "the link lekiwi: 'host' is missing"),
        ("lekiwi,host=a,command_port=0", "the link lekiwi: command_port is 0, need 1 to 65535"),
        ("simulated,latency=-1", "the link simulated: latency is -1 s, need 0 to 10 s"),
        ("wheel", "there is no link 'wheel'; did you mean 'wheels'"),
        ("a=lekiwi,host=b", "a link has no label: write lekiwi"),
    ],
)
def test_wrong_links_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        chosen_component("links", text)


def test_the_watchdog_expects_no_fixes_of_a_link_that_measures_no_pose(planned):
    usual = scenario_pipeline(planned, "feedforward").supervisor.watchdog.limits
    changed = scenario_pipeline(without_pose_fixes(planned), "feedforward").supervisor.watchdog
    assert usual.age == 1.5
    assert changed.limits == usual._replace(age=1e6)


class Driven(Exception):
    """Raised instead of a drive, with its link, pipeline and reference."""


def driven(link, pipeline, reference, **_):
    raise Driven(link, pipeline, reference)


def test_the_estimator_of_a_drive_has_the_noise_of_its_link(monkeypatch, tmp_path):
    """The pose fixes err by 8 cm, slowly; a filter without a bias errs by 3 mm."""
    sensors = {"sensors": {"estimator": "kalman"}, "tasks": {"track": {"durations": [20.0]}}}
    motion = {"robot": {"name": "small"}, "reference": {"type": "circle", "radius": 1.0}}
    scenario = Scenario.model_validate(
        {"name": "noisy", "plant": "planar", "controllers": ["feedforward"], **motion, **sensors}
    )
    monkeypatch.setattr(sys.modules[drive.__module__], "drive", driven)
    chosen, folder = chosen_component("links", "simulated,noise=true"), RunFolder(tmp_path / "a")
    with pytest.raises(Driven) as caught:
        _drive(plan_and_check(scenario), DriveControls(), chosen, folder, cpu=None)
    process, pipeline, reference = caught.value.args
    link = SimulatedLink(process.make(), process.start)
    found = drive(link, pipeline, reference, rate=1.0 / process.period, clock=SimulatedClock())
    assert found.finished
    true = np.array([state.pose[:2] for state in link.states])[: len(found.run.t)]
    assert 1e3 * np.hypot(*(true - found.run.pose[: len(true), :2]).T).mean() < 2.0
    assert load_scenario(tmp_path / "a" / "scenario.yaml").sensors.fixes.law == "paper"
