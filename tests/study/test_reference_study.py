"""Study of the paper with simulated forces: comparison with the numbers in the paper."""

from functools import cache

import pytest

from omnidrive.evaluation import measure, step_response
from omnidrive.evaluation.tables.published import PUBLISHED_ERRORS
from omnidrive.scenario import (
    RunSettings,
    paper_scenario,
    plan_and_check,
    settings_of_runs,
    simulate_run,
)
from omnidrive.simulation import Outcome

RECOMMENDED = {20.0: (0.0044, 0.0031), 30.0: (0.00135, 0.00105)}
RECOMMENDED_PID = {20.0: (0.007, 0.006), 30.0: (0.0025, 0.002)}
TRACKS = [job for job in settings_of_runs(paper_scenario()) if job.task in {"track", "noise"}]
QUICK = [job for job in TRACKS if (job.controller, job.duration) == ("fuzzy_t1", 20.0)]


def name(job):
    return f"{job.task}-{job.controller}-{job.duration:g}"


@pytest.fixture(scope="module")
def paper():
    """The planned study."""
    return plan_and_check(paper_scenario())


@pytest.fixture(scope="module")
def log(paper):
    """The logs of the study, each simulated once."""
    return cache(lambda job: simulate_run(paper, job))


@pytest.mark.parametrize(
    "job",
    [
        pytest.param(job, marks=() if job in QUICK else [pytest.mark.long])
        for job in TRACKS
        if job.controller != "holonomic-nmpc"
    ],
    ids=name,
)
def test_errors_are_not_larger_than_in_the_paper(paper, log, job):
    """With noise: errors of the measured pose, as in the paper, with a tolerance of 15 %."""
    row = PUBLISHED_ERRORS[job.task, job.duration, job.controller]
    run, noise = log(job), job.task == "noise"
    m = measure(run, paper.robot.drive)
    assert run.outcome is Outcome.FINISHED
    assert m.fallbacks == 0
    me, mae = (m.me_measured, m.mae_measured) if noise else (m.me, m.mae)
    tolerance = 1.15 if noise else 1.0
    assert me <= tolerance * row.me
    assert mae <= tolerance * row.mae


@pytest.mark.long
def test_clearance_is_measured_to_the_wall(paper, log):
    """The border of the map is nearer at the start, with equal clearance for all controllers."""
    controllers = {"fuzzy_t1", "unicycle-nmpc", "holonomic-nmpc"}
    jobs = [
        job for job in TRACKS
        if (job.task, job.duration) == ("track", 20.0) and job.controller in controllers
    ]  # fmt: skip
    clearances = {round(paper.clearance(log(job).pose), 3) for job in jobs}
    assert len(clearances) == 3
    assert all(0.1 < c < 0.25 for c in clearances)


@pytest.mark.parametrize("duration", [20.0, pytest.param(30.0, marks=pytest.mark.long)])
def test_holonomic_nmpc_has_a_tenth_of_the_published_error(paper, log, duration):
    (job,) = (
        job for job in TRACKS
        if (job.task, job.controller, job.duration) == ("track", "holonomic-nmpc", duration)
    )  # fmt: skip
    m = measure(log(job), paper.robot.drive)
    me, mae = RECOMMENDED[duration]
    assert m.me <= me
    assert m.mae <= mae
    assert m.me_after_start <= 0.0004
    assert m.me <= PUBLISHED_ERRORS["track", duration, "unicycle-nmpc"].me / 10


LONG = pytest.mark.long


@pytest.mark.parametrize(
    "controller",
    [
        "fuzzy_t1",
        pytest.param("fuzzy_t2", marks=LONG),
        pytest.param("unicycle-nmpc", marks=LONG),
        "holonomic-nmpc",
    ],
)
def test_step_response_reaches_the_target(log, controller):
    run = log(RunSettings("step", controller, 10.0))
    assert run.outcome is Outcome.FINISHED
    assert abs(run.pose[-10:] - run.target[-10:]).max() < 0.02


@pytest.mark.parametrize(
    "controller",
    ["fuzzy_t1", pytest.param("fuzzy_t2", marks=LONG), pytest.param("unicycle-nmpc", marks=LONG)],
)
def test_preset_published_code_has_the_wrong_effective_radius(controller):
    """With R = 0.5 m in the wheel matrix, yaw rates are 0.707 times the commanded ones."""
    published = plan_and_check(paper_scenario("published-code"))
    assert published.robot.assumed_effective_radius == 0.5
    run = simulate_run(published, RunSettings("track", controller, 20.0, 15))
    row = PUBLISHED_ERRORS["track", 20.0, controller]
    assert run.outcome is Outcome.FINISHED
    assert measure(run, published.robot.drive).me <= row.me


@pytest.fixture(scope="module")
def recommended():
    return plan_and_check(paper_scenario("recommended"))


@pytest.mark.parametrize(
    ("controller", "duration"),
    [
        ("fuzzy_t1", 20.0),
        *(pytest.param(c, 20.0, marks=LONG) for c in ("pid", "fuzzy_t2")),
        *(pytest.param(c, 30.0, marks=LONG) for c in ("pid", "fuzzy_t1", "fuzzy_t2")),
    ],
)
def test_recommended_pids_track_closely(recommended, controller, duration):
    run = simulate_run(recommended, RunSettings("track", controller, duration))
    m = measure(run, recommended.robot.drive)
    me, mae = RECOMMENDED_PID[duration]
    assert run.outcome is Outcome.FINISHED
    assert m.me <= me
    assert m.mae <= mae
    assert m.me_after_start <= 0.002


@pytest.mark.parametrize("controller", ["pid", "fuzzy_t1", "fuzzy_t2"])
def test_recommended_pids_have_little_overshoot(recommended, controller):
    """In the paper, the overshoot of type 1 is 10.8 %, 9.4 % and 78.9 %."""
    run = simulate_run(recommended, RunSettings("step", controller, 10.0))
    assert abs(run.pose[-10:] - run.target[-10:]).max() < 1e-3
    start, goal = recommended.start, run.target[-1]
    for i in range(3):
        response = step_response(run.t, run.pose[:, i], start[i], goal[i])
        assert response.overshoot < 1.0
        assert response.settling_time < 1.3
