"""Long tests of whole studies on plants with forces."""

import json
from math import dist

import pytest

from omnidrive.evaluation import measure
from omnidrive.evaluation.tables.published import PUBLISHED_ERRORS
from omnidrive.geometry import move
from omnidrive.planning import Waypoint
from omnidrive.scenario import (
    RunSettings,
    make_controller,
    map_scenario,
    paper_scenario,
    plan_and_check,
    retime,
    settings_of_runs,
    simulate_run,
)
from omnidrive.simulation import MujocoPlant, Outcome, simulate
from omnidrive.study import run_study
from tests.shared_data import shared

pytestmark = pytest.mark.long

SEEDS = range(2, 12)
MAPS = {
    "depot": ((2.0, 2.0), (27.0, 13.0, 1.57), "small"),
    "tb3_sandbox": ((-1.5, -1.5), (1.6, 1.5), "small"),
    "smoothers_world": ((5.6, 4.7, 0.0), (11.5, 14.0, 1.57), "paper"),
    "demo_map": ((-6.0, -1.0), (9.0, 0.6), "paper"),
}


@pytest.mark.parametrize("controller", ["fuzzy_t1", "fuzzy_t2", "unicycle-nmpc"])
@pytest.mark.parametrize("seed", SEEDS)
def test_errors_with_noise_match_the_paper_for_other_seeds(controller, seed):
    planned = plan_and_check(paper_scenario().model_copy(update={"seed": seed}))
    run = simulate_run(planned, RunSettings("noise", controller, 30.0, 15))
    m = measure(run, planned.robot.drive)
    row = PUBLISHED_ERRORS["noise", 30.0, controller]
    assert m.me_measured <= 1.15 * row.me
    assert m.mae_measured <= 1.15 * row.mae


@pytest.mark.parametrize("plant", ["mujoco-balls", "mujoco-rollers"])
@pytest.mark.parametrize("preset", ["paper", "published-code"])
def test_every_run_finishes_on_plants_with_forces(plant, preset):
    planned = plan_and_check(paper_scenario(preset).with_values(plant=plant))
    for job in settings_of_runs(planned.scenario):
        assert simulate_run(planned, job).outcome is Outcome.FINISHED, job


@pytest.mark.parametrize("name", MAPS)
def test_study_on_nav2_maps(name, tmp_path):
    start, goal, robot = MAPS[name]
    source = str(shared(f"maps/nav2/{name}.yaml"))
    scenario = map_scenario(source, Waypoint(*start), Waypoint(*goal), robot=robot, name=name)
    run_study(retime(scenario), tmp_path / name, processes=2)
    runs = json.loads((tmp_path / name / "results.json").read_text())["runs"]
    assert all(run["finished"] for run in runs)
    best = [r for r in runs if r["controller"] == "holonomic-nmpc" and r["task"] == "track"]
    assert all(r["min_clearance"] > 0.0 and r["me_after_start"] < 0.005 for r in best)


def test_results_with_forces_are_bitwise_equal_for_any_number_of_processes(tmp_path):
    scenario = paper_scenario()
    for processes in (1, 2):
        run_study(scenario, tmp_path / str(processes), processes=processes)
    one, two = (json.loads((tmp_path / n / "results.json").read_text()) for n in "12")
    for a, b in zip(one["runs"], two["runs"], strict=True):
        assert a.pop("step_time_us")
        assert b.pop("step_time_us")
        assert a == b
    assert one["step_response"] == two["step_response"]


class PlantWithOdometry(MujocoPlant):
    """Plant that also integrates the measured wheel speeds every 10 ms."""

    def reset(self, pose):
        self.drift, self.odometry = [0.0], pose
        return super().reset(pose)

    def step(self, twist, dt):
        for _ in range(10):
            state = super().step(twist, dt / 10)
            rolled = self.robot.chassis.twist(self._data.actuator_velocity)
            self.odometry = move(self.odometry, rolled, dt / 10)
        self.drift.append(dist(state.pose[:2], self.odometry[:2]))
        return state


def test_odometry_drifts_less_without_wheel_slip():
    """Reproduce the table of decision 0007; ``-s`` prints it."""
    paper = plan_and_check(paper_scenario())
    reference, robot = paper.reference(20.0), paper.robot
    drift = {}
    for may_spin, traction in ((True, 0.85), (True, 1.0), (False, 0.85), (False, 0.6)):
        values = {"type": "holonomic-nmpc", "traction": traction, "may_spin": may_spin}
        scenario = paper.scenario.with_values(controllers={"holonomic-nmpc": values})
        controller = make_controller(scenario, robot, "holonomic-nmpc")
        plant = PlantWithOdometry(robot)
        run = simulate(plant, controller, reference, start=reference.at(0.0).pose, dt=0.1)
        metrics = measure(run, robot.drive)
        drift[may_spin, traction] = plant.drift[10]
        print(f"{may_spin} {traction} {metrics.me:.4f} {metrics.mae:.4f} {plant.drift[10]:.2f}")
    assert drift[False, 0.85] < 0.3 * drift[True, 0.85]
    assert drift[False, 0.6] < 0.3 * drift[True, 0.85]
