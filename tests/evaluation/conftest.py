"""Small study on the kinematic plant with the structure of the paper's study."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.control import FeedforwardController, FeedforwardGains
from omnidrive.control.pid import gain_inference
from omnidrive.evaluation.measures.metrics import measure
from omnidrive.evaluation.measures.step_response import step_response
from omnidrive.evaluation.study_logs import ControllerType, RecordedRun, StudyLogs
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Path, SplinePath
from omnidrive.reference import Hold, time_uniformly
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, PaperNoise, simulate
from omnidrive.study.computation.run_recording import step_values, tracking_values
from tests.evaluation.recorded import labelled, record

DT = 0.1
LOCAL = ("file:", "data:", "blob:")
ROBOT = named_robot("paper")
GAINS = {"fuzzy_t1": 1.5, "fuzzy_t2": 1.8, "unicycle-nmpc": 3.0, "holonomic-nmpc": 8.0}


class LaggingController:
    """Feedforward controller with scaled commands, so that the robot lags behind."""

    def __init__(self, gain):
        self.inner = FeedforwardController(DT, FeedforwardGains(gain, gain))
        self.share = gain / (gain + 0.8)

    def reset(self, state):
        self.inner.reset(state)

    def step(self, t, state, reference):
        command = self.inner.step(t, state, reference)
        return command._replace(value=BodyTwist(*(self.share * v for v in command.value)))


def grid():
    occupied = np.zeros((50, 50), dtype=bool)
    occupied[:20, 14:16] = occupied[28:, 14:16] = True
    return OccupancyGrid(occupied, 0.2)


def cells():
    x = [1.0, 1.0, 1.2, 1.6, 2.2, 3.0, 3.8, 4.8, 5.6, 6.4, 7.0, 8.0]
    y = [1.0, 2.0, 3.0, 4.0, 4.6, 4.8, 4.8, 5.2, 5.8, 6.6, 7.2, 7.8]
    xy = np.column_stack([x, y])
    yaw = np.zeros(len(xy))
    yaw[1:] = np.arctan2(*np.diff(xy, axis=0).T[::-1])
    return Path(np.column_stack([xy, yaw]))


def tracked(controller, task, duration, horizon=None):
    gain = GAINS[controller] + (0.1 * horizon if horizon else 0.0)
    noise = PaperNoise(np.random.default_rng(7)) if task == "noise" else None
    path = SplinePath(cells().poses)
    run = simulate(
        KinematicPlant(ROBOT),
        LaggingController(gain),
        time_uniformly(path, duration, ROBOT.chassis),
        start=Pose(1.0, 1.0, 0.0),
        dt=DT,
        sensors=noise,
    )
    run.raise_if_failed()
    clearance = float(grid().clearance(run.pose[:, :2]).min()) - ROBOT.body_radius
    metrics = measure(run, ROBOT.drive)
    variant = f"N = {horizon}" if horizon else ""
    values, timing = tracking_values(metrics, 0, clearance)
    made = record(task, controller, values, timing, duration=duration, variant=variant)
    return RecordedRun(made, run)


def stepped(controller):
    goal = Pose(1.0, 1.0, 1.0)
    run = simulate(
        KinematicPlant(ROBOT),
        LaggingController(GAINS[controller]),
        Hold(goal, 10.0),
        start=Pose(0.0, 0.0, 0.0),
        dt=DT,
    )
    responses = [step_response(run.t, run.pose[:, i], 0.0, goal[i]) for i in range(3)]
    values = step_values(responses, float(run.work[-1]))
    return RecordedRun(record("step", controller, values, duration=10.0), run)


@pytest.fixture(scope="session")
def study():
    runs = [tracked(c, "track", T) for T in (20.0, 30.0) for c in GAINS]
    runs += [tracked(c, "noise", 30.0) for c in GAINS]
    runs += [stepped(c) for c in GAINS]
    runs += [tracked("unicycle-nmpc", "horizon", 20.0, n) for n in (5, 10, 15, 20, 25, 30)]
    path = cells()
    return StudyLogs(
        title="The paper's study",
        robot=ROBOT,
        plant="kinematic",
        dt=DT,
        obstacles=grid(),
        free_space=grid().inflated(0.75),
        grid_path=path,
        spline=SplinePath(path.poses),
        runs=tuple(runs),
        types={
            name: ControllerType(name, "", "", gain_inference(kind, "paper").system)
            for name, kind in (("fuzzy_t1", "t1"), ("fuzzy_t2", "t2"))
        },
    )


def with_gains(result, *, constant=False):
    """Return the run with logged gains, varying or constant."""
    t = result.log.t
    variation = np.where(t < t[-1], 0.0 if constant else np.sin(t), np.nan)
    columns = {
        f"{name}_{axis}": (middle + share * variation, unit)
        for axis, share in (("x", 0.5), ("heading", 0.2))
        for name, middle, unit in (("kp", 5.0, "1/s"), ("ki", 1.0, "1/s^2"), ("kd", 0.3, "1"),
                                   ("error_input", 0.0, "1"), ("change_input", 0.0, "1"))
    }  # fmt: skip
    details = {name: values for name, (values, _) in columns.items()}
    units = {name: unit for name, (_, unit) in columns.items()}
    return result._replace(log=replace(result.log, details=details, detail_units=units))


@pytest.fixture(scope="session")
def tuning(part):
    """Two tracking runs: one with varying gains, one with constant gains."""
    first, other = part.runs
    return replace(
        part,
        runs=(
            with_gains(labelled(first, controller="fuzzy_t1")),
            with_gains(labelled(other, controller="pid"), constant=True),
        ),
    )


@pytest.fixture(scope="session")
def part(study):
    """The same study with two controllers and one task."""
    keep = tuple(
        r
        for r in study.select("track", duration=20.0)
        if r.controller in ("unicycle-nmpc", "holonomic-nmpc")
    )
    return replace(study, runs=keep)


@pytest.fixture(scope="module")
def browser():
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        reason = f"no browser: none of {', '.join(names)} is installed"
        if os.environ.get("OMNIDRIVE_REQUIRE_BROWSER"):
            pytest.fail(reason)
        pytest.skip(reason)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--disable-gpu", "--disable-background-networking",
                     "--disable-component-update", "--no-first-run"]  # fmt: skip
        running = playwright.chromium.launch(executable_path=found, args=arguments)
        yield running
        running.close()


@pytest.fixture
def show(browser, tmp_path):
    """Return a function that opens the text of a page; requests and errors fail the test."""
    problems, contexts = [], []

    def on_request(request):
        if not request.url.startswith(LOCAL):
            problems.append(f"request to {request.url}")

    def on_message(message):
        if message.type in ("error", "warning"):
            problems.append(message.text)

    def opened(text, **options):
        path = tmp_path / "report.html"
        path.write_text(text, encoding="utf-8")
        context = browser.new_context(
            **{"viewport": {"width": 1280, "height": 800}, "reduced_motion": "reduce", **options}
        )
        contexts.append(context)
        context.set_offline(True)
        context.on("request", on_request)
        page = context.new_page()
        page.on("console", on_message)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(path.as_uri(), timeout=180_000.0)  # ms; on a busy machine
        return page

    yield opened
    for context in contexts:
        context.close()
    assert problems == []
