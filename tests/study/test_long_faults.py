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
    results = run_study(scenario, processes=2).results
    assert len(results.recoveries) == 12 * len(scenario.controllers)
    for result, found in results.recoveries:
        assert found.recovered or found.stopped, result.name
        if found.stopped:
            assert "the watchdog stops the robot" in result.run.events[-1].what
        if result.fault.kind in {"wheel-dead", "wheel-locked"}:
            assert found.recovered, result.name
            assert any(event.what.startswith("wheel 0 is") for event in result.run.events)
            extra = 0.05 if result.fault.kind == "wheel-locked" else 0.02
            healthy = next(
                r for r in results.faults if r.fault is None and r.controller == result.controller
            )
            after_fault = healthy.run.t >= result.fault.at
            error = (healthy.run.pose - healthy.run.target)[after_fault, :2]
            assert found.max_error <= (error**2).sum(axis=1).max() ** 0.5 + extra, result.name


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("preset", PRESETS)
def test_healthy_robot_causes_no_events(preset, plant):
    planned = plan_and_check(paper_scenario(preset).with_values(plant=plant))
    for job in settings_of_runs(planned.scenario):
        if job.task != "horizon":
            run = simulate_run(planned, job).run
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
    (result,) = run_study(scenario).results.tracks
    assert any(event.what.startswith(f"wheel {wheel} is") for event in result.run.events)
    assert result.metrics.me < 0.01
