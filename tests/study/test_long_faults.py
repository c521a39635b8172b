"""Every controller with every fault on physical plants, and no findings without faults."""

import pytest

from omnidrive.scenario import paper_scenario, plan_and_check, settings_of_runs, simulate_run
from omnidrive.scenario.tasks import DurationsTask, FaultsTask, Tasks
from omnidrive.simulation import Outcome, parse_fault
from omnidrive.study import run_study

pytestmark = pytest.mark.long

PRESETS = ("paper", "published-code", "recommended")
PLANTS = ("mujoco-balls", "mujoco-rollers")


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("preset", PRESETS)
def test_every_run_recovers_or_is_stopped(preset, plant):
    """A robot that does not recover is stopped by the watchdog, with an event."""
    scenario = paper_scenario(preset).model_copy(
        update={"plant": plant, "tasks": Tasks(faults=FaultsTask(duration=20.0))}
    )
    logs = run_study(scenario, processes=2).logs
    runs = logs.select("faults")
    faulty = [each for each in runs if each.record.variant in logs.faults]
    healthy = {each.controller: each.log for each in runs if each.record.variant not in logs.faults}
    assert len(faulty) == 12 * len(scenario.controllers)
    for record, log in faulty:
        fault, recovered = logs.faults[record.variant], record.metrics["recovered"] == 1.0
        is_stopped = record.outcome == "stopped"
        assert recovered or is_stopped, record.name
        if is_stopped:
            assert "the watchdog stops the robot" in log.events[-1].what
        if fault.kind in {"wheel-dead", "wheel-locked"}:
            assert recovered, record.name
            assert any(event.what.startswith("wheel 0 is") for event in log.events)
            extra = 0.05 if fault.kind == "wheel-locked" else 0.02
            usual = healthy[record.controller]
            error = (usual.pose - usual.target)[usual.t >= fault.at, :2]
            largest = (error**2).sum(axis=1).max() ** 0.5
            assert record.metrics["worst_error"] <= largest + extra, record.name


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("preset", PRESETS)
def test_healthy_robot_causes_no_events(preset, plant):
    planned = plan_and_check(paper_scenario(preset).with_values(plant=plant))
    for job in settings_of_runs(planned.scenario):
        if job.task != "horizon":
            run = simulate_run(planned, job)
            assert run.events == (), job
            assert run.outcome is Outcome.FINISHED, job


@pytest.mark.parametrize("wheel", range(4))
@pytest.mark.parametrize("kind", ["wheel-dead", "wheel-locked"])
@pytest.mark.parametrize("plant", PLANTS)
def test_failure_of_every_wheel_is_compensated(plant, kind, wheel):
    scenario = paper_scenario("recommended").with_values(
        plant=plant,
        controllers=("holonomic-nmpc",),
        tasks=Tasks(track=DurationsTask(durations=(20.0,))),
        faults=(parse_fault(f"{kind}:wheel={wheel},at=4"),),
    )
    ((record, log),) = run_study(scenario).logs.runs
    assert any(event.what.startswith(f"wheel {wheel} is") for event in log.events)
    assert record.metrics["me"] < 0.01
