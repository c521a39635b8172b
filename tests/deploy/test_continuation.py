"""Drives that continue along another motion without a stop."""

from collections import deque
from math import hypot

import numpy as np
import pytest

from omnidrive import (
    Actuation,
    FeedforwardController,
    KinematicPlant,
    PerfectSensors,
    Pose,
    holonomic_nmpc,
    named_robot,
)
from omnidrive.control import Pipeline
from omnidrive.control.reference_governor import ReferenceGovernor
from omnidrive.deploy import DriveControls, SimulatedClock, drive, replay_log
from omnidrive.deploy.drive_progress import DriveProgress
from omnidrive.deploy.drive_state import REFERENCE_ENDS, DriveState
from omnidrive.deploy.links.simulated import SimulatedLink, SimulatedRobot
from omnidrive.deploy.log import DriveLog, read_log
from omnidrive.deploy.ros2.drive_files import reference_file
from omnidrive.deploy.ros2.path_continuation import PathContinuation
from omnidrive.deploy.ros2.path_reference import path_reference
from omnidrive.errors import InvalidReference
from omnidrive.geometry import WorldTwist
from omnidrive.reference import (
    Circle,
    Hold,
    SampledReference,
    ShapeReference,
    SplicedReference,
    delay_within_limits,
    load_waypoints,
)
from omnidrive.reference.timing.limits import SPEED_SHARE
from omnidrive.robot import force_share

DT = 0.05
ROBOT = named_robot("small")
START = Pose(0.0, 0.0, 0.0)


def line(length, angle=0.0, start=START):
    """Poses every 5 cm along a straight path, heading 0."""
    along = np.arange(1, round(length / 0.05) + 1) * 0.05
    return np.column_stack(
        [start.x + along * np.cos(angle), start.y + along * np.sin(angle), 0.0 * along]
    )


@pytest.mark.parametrize("name", ["small", "paper", "kiwi", "mecanum"])
@pytest.mark.parametrize(
    "twist", [(0.5, 0.0, 0.0), (0.3, 0.2, 0.2), (0.0, 0.4, 0.0), (0.0, 0.0, 0.5), (0.1, 0.0, 1.0)]
)
def test_a_path_of_a_moving_robot_begins_with_its_twist(name, twist):
    robot, pose = named_robot(name), Pose(0.4, 0.03, 0.1)
    reference = path_reference(line(3.0), pose, robot, twist=WorldTwist(*twist))
    begin = reference.at(0.0)
    assert begin.pose == pytest.approx(pose, abs=1e-9)
    assert begin.twist == pytest.approx(twist, abs=0.02)
    assert max(reference.limit_usage.values()) < 1.01
    rows = reference.window(0.0, 400, reference.duration / 399)
    assert np.hypot(*np.diff(rows[:, :2], axis=0).T).max() < 0.05
    assert rows[:, 1].max() < 0.15  # no farther beside the path than braking needs
    assert rows[-1, :2] == pytest.approx((3.0, 0.0), abs=1e-6)


def test_a_path_against_the_motion_needs_a_stop():
    with pytest.raises(InvalidReference, match="cannot be followed with the twist"):
        path_reference(line(3.0), START, ROBOT, twist=WorldTwist(-0.8, 0.0, 0.0))


def test_a_splice_is_the_first_motion_and_then_the_other_one():
    circle, hold = ShapeReference(Circle(radius=0.5), 4.0), Hold(Pose(1.0, 2.0, 3.0), 2.0)
    spliced = SplicedReference(circle, hold, 1.5)
    assert spliced.duration == 3.5
    rows = spliced.window(0.5, 31, 0.1)
    assert np.array_equal(rows[:10], circle.window(0.5, 10, 0.1))
    assert np.array_equal(rows[10:], hold.window(0.0, 21, 0.1))
    assert spliced.at(1.5).pose == hold.pose
    again = SplicedReference.of(spliced, circle, 9.0)
    assert again.at(5.0).pose == hold.pose
    assert again.before.before is hold  # the circle is not kept


def test_the_governor_leaves_the_part_before_a_splice_as_it_is():
    fast = ShapeReference(Circle(radius=0.5), 0.8)
    governor = ReferenceGovernor(ROBOT.chassis, Actuation.of(ROBOT).acceleration_faces)
    spliced = SplicedReference(fast, fast, 0.4)
    governed = governor.govern(spliced)
    assert governed.before is fast
    limits = governor._limits(SPEED_SHARE, force_share.GOVERNED)
    expected = delay_within_limits(fast, limits, rest=False)
    assert governed.after.duration == expected.duration > fast.duration
    assert governor.delay(spliced, 0.4 + expected.duration) == pytest.approx(
        expected.max_delay, abs=0.01
    )
    other = ShapeReference(Circle(radius=0.5), 30.0)
    assert governor.govern(other) is other
    assert governor.govern(spliced) is governed  # the latest two are kept
    for _ in range(3):  # motions that do not follow
        governor.retime(SplicedReference(fast, fast, 0.4))
    assert governor.govern(spliced) is governed  # and the one that is tracked


class ReplanningLink(SimulatedLink):
    """A simulated robot for which another path is computed at given times of the drive, s."""

    def __init__(self, pipeline, controls, paths, hold_at=None):
        super().__init__(SimulatedRobot(ROBOT, KinematicPlant(ROBOT), PerfectSensors()), START)
        self.paths, self.controls, self.hold_at = deque(paths), controls, hold_at
        self.continuation = PathContinuation(ROBOT, pipeline, DT, 0.5, (0.4, 0.4))
        self.answers, self.speeds = [], []

    def read(self):
        now = self._clock.now()
        controls, continuation = self.controls, self.continuation
        if self.hold_at is not None and abs(now - self.hold_at) < 1e-6:
            controls.hold("a pause")
        elif self.hold_at is not None and abs(now - self.hold_at - 1.0) < 1e-6:
            controls.arm()
        if continuation._computed is not None or continuation._requested is not None:
            if continuation._computed is not None:
                continuation._computed.exception()  # the simulated time waits for the thread
            answer = continuation.poll(controls)
            self.answers.extend([] if answer is None else [answer])
        if self.paths and now > self.paths[0][0]:
            assert continuation.begin(self.paths.popleft()[1], controls)
        return SimulatedLink.read(self)

    def send(self, value):
        self.speeds.append((self._clock.now(), hypot(value.vx, value.vy)))
        SimulatedLink.send(self, value)


def controllers():
    return {
        "feedforward": lambda: FeedforwardController(DT),
        "nmpc": lambda: holonomic_nmpc(ROBOT.chassis, dt=DT),
    }


def replanned(make, paths, log=None, hold_at=None):
    pipeline, controls = Pipeline(make()), DriveControls(arm=True)
    link = ReplanningLink(pipeline, controls, paths, hold_at)
    reference = path_reference(line(3.0), START, ROBOT, speed=0.5)
    sink = None
    if log is not None:
        sink = DriveLog(log, reference_file(reference, DT))
    result = drive(
        link,
        pipeline,
        reference,
        rate=1.0 / DT,
        start=START,
        controls=controls,
        clock=SimulatedClock(),
        log=sink,
    )
    return result, link


@pytest.mark.parametrize("name", ["feedforward", "nmpc"])
def test_a_robot_does_not_stop_for_new_paths(name):
    """Three new paths, each of which leads elsewhere: it moves all the time, near the last one."""
    paths = [
        (1.0, line(2.5, 0.05, Pose(0.3, 0.0, 0.0))),
        (2.0, line(2.5, 0.10, Pose(0.5, 0.0, 0.0))),
        (3.0, line(1.5, 0.15, Pose(1.0, 0.05, 0.0))),
    ]
    result, link = replanned(controllers()[name], paths)
    assert result.finished, result.changes
    assert link.answers == [True, True, True]
    assert [each.state for each in result.changes].count(DriveState.RUNNING) == 1
    t = result.run.t
    moving = [speed for at, speed in link.speeds if 1.0 < at < t[-1] - 1.0]
    assert min(moving) > 0.3
    assert np.allclose(result.run.pose[-1], [*paths[-1][1][-1, :2], 0.0], atol=0.02)
    errors = np.hypot(*(result.run.pose - result.run.target)[:, :2].T)
    assert errors[10:].max() < 0.03
    steps = np.hypot(*np.diff(result.run.target[:, :2], axis=0).T)
    assert steps.max() < 1.2 * 0.5 * DT + 0.05 * (name == "nmpc")  # the target does not jump


def test_a_path_that_cannot_be_followed_without_a_stop_is_refused():
    result, link = replanned(controllers()["feedforward"], [(1.5, line(0.3))])
    assert link.answers == [False]
    assert result.ending == REFERENCE_ENDS
    assert result.run.pose[-1, 0] == pytest.approx(3.0, abs=0.02)


def test_a_drive_that_is_held_goes_on_where_it_was_held():
    """Also before the time at which the other motion begins, and if the reference is a splice."""
    first, second = (
        ShapeReference(Circle(radius=0.5), 10.0),
        ShapeReference(Circle(radius=0.3), 20.0),
    )
    spliced, pipeline = SplicedReference(first, second, 4.0), Pipeline(FeedforwardController(DT))
    for t in (3.0, 6.0):
        progress = DriveProgress(first, DT)
        progress.begin(0, pipeline)
        progress.continue_along(spliced, pipeline)
        progress.end(round(t / DT))
        progress.begin(500, pipeline)
        assert progress.tracked.at(0.0).pose == pytest.approx(spliced.at(t).pose)
        assert progress.last == round((24.0 - t + 0.5) / DT)
        progress.end(500 + round(2.0 / DT))
        progress.begin(900, pipeline)
        assert progress.tracked.at(0.0).pose == pytest.approx(spliced.at(t + 1.5).pose)
    progress = DriveProgress(spliced, DT)
    progress.begin(0, pipeline)
    assert progress.tracked is spliced


@pytest.mark.parametrize("hold_at", [None, 2.5])
def test_the_log_of_a_replanned_drive_is_replayed(tmp_path, hold_at):
    make = controllers()["feedforward"]
    paths = [(1.0, line(2.5, 0.05, Pose(0.3, 0.0, 0.0))), (1.8, line(1.5, 0.1))]
    result, link = replanned(make, paths, tmp_path / "drive.mcap", hold_at)
    assert result.finished
    assert link.answers == [True, True]
    logged = read_log(tmp_path / "drive.mcap")
    assert [each.file for each in logged.continuations] == [
        "reference-0002.csv",
        "reference-0003.csv",
    ]
    (tmp_path / "reference.csv").write_bytes(logged.files["reference.csv"])
    reference = load_waypoints(tmp_path / "reference.csv")
    assert isinstance(reference, SampledReference)
    replay = replay_log(logged, Pipeline(make()), reference)
    assert len(replay.t) == sum(each.step is not None for each in logged.samples())
    assert np.abs(replay.replayed - replay.logged).max() < 1e-3
    assert len(logged.segments) == (1 if hold_at is None else 2)
