"""Viewer with a fake window and a fake clock."""

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
from omnidrive.testing.laws import Circle
from omnidrive.visualization import Observer, Viewer, observe, viewer

ROBOT = named_robot("small")


class Window:
    """Fake of MuJoCo's viewer handle."""

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
def display(monkeypatch):
    """A fake display whose windows close after a number of frames, and a fake clock."""
    clock = SimpleNamespace(now=100.0, slept=0.0)

    def sleep(seconds):
        clock.now += seconds
        clock.slept += seconds

    fake = SimpleNamespace(clock=clock, windows=[], open_for=10**9, kind=Window)

    def open_window(model, data):
        fake.windows.append(fake.kind(model, data, fake.open_for))
        return fake.windows[-1]

    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(viewer, "_check_display", lambda: None)
    monkeypatch.setattr(viewer, "_open_window", open_window)
    monkeypatch.setattr(viewer, "monotonic", lambda: clock.now)
    monkeypatch.setattr(viewer, "sleep", sleep)
    return fake


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
def test_run_is_shown_in_real_time_and_the_window_closes(display, wheels):
    plant = KinematicPlant(ROBOT) if wheels == "kinematic" else MujocoPlant(ROBOT, "ball")
    with Viewer() as viewer_observer:
        assert isinstance(viewer_observer, Observer)
        drive(plant, observers=[viewer_observer])
        (window,) = display.windows
        assert window.shown == 26
        assert display.clock.slept == pytest.approx(1.0)
        assert 50 < window.user_scn.ngeom < 500  # path, trail, target
        assert not window.closed
    assert window.closed


def test_actions_in_the_window_do_not_change_the_run(display):
    """In the viewer, a key resets the state and the mouse applies forces."""

    class InteractiveWindow(Window):
        def sync(self):
            super().sync()
            mujoco.mj_resetData(self.model, self.data)
            self.data.xfrc_applied[:] = 100.0
            self.model.opt.gravity[:] = 0.0

    alone = drive(MujocoPlant(ROBOT, "ball"), observers=[])
    display.kind = InteractiveWindow
    with Viewer() as viewer_observer:
        seen = drive(MujocoPlant(ROBOT, "ball"), observers=[viewer_observer])
    assert np.array_equal(alone.pose, seen.pose)
    (window,) = display.windows
    assert window.positions[0] == pytest.approx(seen.pose[0, :2])
    assert window.positions[-1] == pytest.approx(seen.pose[-1, :2])


def test_run_continues_after_the_window_is_closed(display):
    display.open_for = 10
    with Viewer() as viewer_observer:
        run = drive(KinematicPlant(ROBOT), observers=[viewer_observer])
    assert run.t[-1] == pytest.approx(1.0)
    assert display.windows[0].shown == 10
    assert display.clock.slept == pytest.approx(0.36, abs=0.041)
    assert display.windows[0].closed


def test_every_run_opens_a_window(display):
    with Viewer() as viewer_observer:
        for _ in range(2):
            drive(KinematicPlant(ROBOT), observers=[viewer_observer])
    assert len(display.windows) == 2
    assert all(window.closed for window in display.windows)


def test_delay_is_not_caught_up(display):
    """After a pause of one second the run continues in real time."""

    class Slow(KinematicPlant):
        steps = 0

        def step(self, twist, dt):
            self.steps += 1
            display.clock.now += 1.0 if self.steps == 5 else 0.0
            return super().step(twist, dt)

    with Viewer() as viewer_observer:
        drive(Slow(ROBOT), observers=[viewer_observer])
    assert display.clock.now == pytest.approx(102.0, abs=0.15)


def test_constant_reference_is_shown(display):
    goal = Circle().at(0.0).pose
    with Viewer() as viewer_observer:
        drive(KinematicPlant(ROBOT), observers=[viewer_observer], reference=Hold(goal, 0.3))
    assert display.windows[0].shown == 8


def test_missing_display_is_an_error_with_advice(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(CannotDraw, match=r"no display .* --video FILE\.gif"):
        Viewer()


def test_display_that_cannot_be_opened(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(glfw, "init", lambda: False)
    with pytest.raises(CannotDraw, match="no display for the viewer's window: no reason given"):
        Viewer()


@pytest.mark.parametrize("fails", [True, False])
def test_window_that_does_not_open(monkeypatch, fails):
    mujoco_viewer = pytest.importorskip("mujoco.viewer")

    def launch(*args, **kwargs):
        if fails:
            raise RuntimeError("no OpenGL 1.5")
        viewer.sleep(0.5)

    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(mujoco_viewer, "launch_passive", launch)
    monkeypatch.setattr(viewer, "_OPEN_TIMEOUT", 0.05)
    message = "does not open: no OpenGL 1.5" if fails else "no window after"
    with pytest.raises(CannotDraw, match=message):
        drive(KinematicPlant(ROBOT), observers=[Viewer()])
