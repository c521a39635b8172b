"""MuJoCo's viewer without a screen: its window is a stand-in, the clock is ours."""

from contextlib import nullcontext
from types import SimpleNamespace

import glfw
import mujoco
import numpy as np
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.errors import CannotDraw
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, MujocoPlant, simulate
from omnidrive.visualization import Observer, Viewer, observe, viewer
from tests.laws.motions import Circle

ROBOT = named_robot("small")


class Window:
    """What MuJoCo gives for a window."""

    def __init__(self, model, data, open_for):
        self.model, self.data, self.positions = model, data, []
        self.cam, self.user_scn = mujoco.MjvCamera(), mujoco.MjvScene(model, 2000)
        self.open_for, self.shown, self.closed = open_for, 0, False

    def is_running(self):
        return self.shown < self.open_for

    def sync(self):
        self.shown += 1
        self.positions.append(self.data.qpos[:2].tolist())

    def lock(self):
        return nullcontext()

    def close(self):
        self.closed = True


@pytest.fixture
def screen(monkeypatch):
    """A screen whose windows can be closed by whoever looks at them, and a clock."""
    clock = SimpleNamespace(now=100.0, slept=0.0)

    def sleep(seconds):
        clock.now += seconds
        clock.slept += seconds

    desk = SimpleNamespace(clock=clock, windows=[], open_for=10**9, kind=Window)

    def open_window(model, data):
        desk.windows.append(desk.kind(model, data, desk.open_for))
        return desk.windows[-1]

    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(viewer, "_find_screen", lambda: None)
    monkeypatch.setattr(viewer, "_open_window", open_window)
    monkeypatch.setattr(viewer, "monotonic", lambda: clock.now)
    monkeypatch.setattr(viewer, "sleep", sleep)
    return desk


def drive(plant, *, observers, reference=None):
    reference = reference or Circle(duration=1.0)
    return simulate(
        observe(plant, ROBOT, reference, observers),
        FeedforwardController(0.1),
        reference,
        start=reference.at(0.0).pose,
        dt=0.1,
    )


@pytest.mark.parametrize("wheels", ["ball", "kinematic"])
def test_a_run_is_shown_at_real_time_and_the_window_closes_after_it(screen, wheels):
    plant = KinematicPlant(ROBOT) if wheels == "kinematic" else MujocoPlant(ROBOT, "ball")
    with Viewer() as watching:
        assert isinstance(watching, Observer)
        drive(plant, observers=[watching])
        (window,) = screen.windows
        assert window.shown == 26
        assert screen.clock.slept == pytest.approx(1.0)
        assert 50 < window.user_scn.ngeom < 500  # path, trail, target
        assert not window.closed
    assert window.closed


def test_what_is_done_in_the_window_does_not_change_the_run(screen):
    """There, a key sets the world back, and the mouse pulls at bodies."""

    class Meddling(Window):
        def sync(self):
            super().sync()
            mujoco.mj_resetData(self.model, self.data)
            self.data.xfrc_applied[:] = 100.0
            self.model.opt.gravity[:] = 0.0

    alone = drive(MujocoPlant(ROBOT, "ball"), observers=[])
    screen.kind = Meddling
    with Viewer() as watching:
        seen = drive(MujocoPlant(ROBOT, "ball"), observers=[watching])
    assert np.array_equal(alone.pose, seen.pose)
    (window,) = screen.windows
    assert window.positions[0] == pytest.approx(seen.pose[0, :2])
    assert window.positions[-1] == pytest.approx(seen.pose[-1, :2])


def test_a_closed_window_lets_the_run_go_on_alone(screen):
    screen.open_for = 10
    with Viewer() as watching:
        run = drive(KinematicPlant(ROBOT), observers=[watching])
    assert run.t[-1] == pytest.approx(1.0)
    assert screen.windows[0].shown == 10
    assert screen.clock.slept == pytest.approx(0.36, abs=0.041)
    assert screen.windows[0].closed


def test_another_run_has_a_window_of_its_own(screen):
    with Viewer() as watching:
        for _ in range(2):
            drive(KinematicPlant(ROBOT), observers=[watching])
    assert len(screen.windows) == 2
    assert all(window.closed for window in screen.windows)


def test_what_is_too_slow_is_not_hurried_afterwards(screen):
    """A second's pause delays what follows, which then runs at real time."""

    class Slow(KinematicPlant):
        steps = 0

        def step(self, twist, dt):
            self.steps += 1
            screen.clock.now += 1.0 if self.steps == 5 else 0.0
            return super().step(twist, dt)

    with Viewer() as watching:
        drive(Slow(ROBOT), observers=[watching])
    assert screen.clock.now == pytest.approx(102.0, abs=0.15)


def test_a_step_of_the_reference_is_shown_without_a_path(screen):
    goal = Circle().at(0.0).pose
    with Viewer() as watching:
        drive(KinematicPlant(ROBOT), observers=[watching], reference=Hold(goal, 0.3))
    assert screen.windows[0].shown == 8


def test_no_screen_is_an_error_that_names_the_way_out(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(CannotDraw, match=r"no display .* --video FILE\.gif"):
        Viewer()


def test_a_screen_that_does_not_answer(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(glfw, "init", lambda: False)
    with pytest.raises(CannotDraw, match="no display for the viewer's window: no reason given"):
        Viewer()


@pytest.mark.parametrize("fails", [True, False])
def test_a_window_that_does_not_open(monkeypatch, fails):
    mujoco_viewer = pytest.importorskip("mujoco.viewer")

    def launch(*given, **named):
        if fails:
            raise RuntimeError("no OpenGL 1.5")
        viewer.sleep(0.5)

    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(mujoco_viewer, "launch_passive", launch)
    monkeypatch.setattr(viewer, "_OPENING", 0.05)
    said = "does not open: no OpenGL 1.5" if fails else "no window after"
    with pytest.raises(CannotDraw, match=said):
        drive(KinematicPlant(ROBOT), observers=[Viewer()])
