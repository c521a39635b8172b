"""Faults of a motor board: on simulated time, and of its network and serial line."""

import errno
import threading
from math import pi

import numpy as np
import pytest

from omnidrive import FeedforwardController, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import MonotonicClock, SimulatedClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_loop import MAX_AGE
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.links import wheels
from omnidrive.deploy.links.wheel_protocol import (
    Hello,
    Report,
    hello_line,
    is_hello_request,
    parse_command,
    report_line,
)
from omnidrive.deploy.links.wheels import WheelsLink
from omnidrive.estimation import EstimatorSettings, PoseEstimator, SensorSettings
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Hold
from tests.deploy.board import SerialBoard, UdpBoard

ROBOT = named_robot("small")
WHEELS = len(ROBOT.mounts)
DT, COUNTS, WATCHDOG = 0.02, 100_000, 0.3
BEGIN, END, ARMED, DURATION = 0.3, 1.2, 2.0, 2.5  # s
GOAL = Pose(0.4, 0.2, 0.0)


class Board:
    """A port to a board on simulated time, whose reports a test changes."""

    def __init__(self, clock, spoil):
        self.clock, self.spoil = clock, spoil
        self.angles, self.speeds = np.zeros(WHEELS), np.zeros(WHEELS)
        self.heard = self.last = clock.now()
        self.number, self.waiting, self.deaf, self.moved = 0, [], False, []

    def send(self, data):
        if self.deaf:
            return
        if is_hello_request(data):
            self.waiting.append(hello_line(Hello(1, WHEELS, COUNTS, WATCHDOG)))
        command = parse_command(data)
        if command is not None:
            self.speeds, self.heard = np.array(command[1]), self.clock.now()

    def receive(self):
        now = self.clock.now()
        moving = min(now, self.heard + WATCHDOG) - self.last
        self.angles = self.angles + self.speeds * max(moving, 0.0)
        self.last = now
        if moving > 0.0 and self.speeds.any():
            self.moved.append(now)
        counted = np.round(self.angles / (2.0 * pi) * COUNTS).astype(int).tolist()
        report = Report(self.number, round(1e6 * now), 0, tuple(counted))
        self.number += 1
        found = b"".join([*self.waiting, self.spoil(self, now, report)])
        self.waiting = []
        return found

    def close(self):
        pass


LONGEST = 30.0  # s


def driven(monkeypatch, spoil):
    """The result of a drive, and the board; it is armed again at the time ARMED."""
    clock, controls = SimulatedClock(), DriveControls(arm=True)
    armed = []

    def spoil_and_arm(board, now, report):
        if now - origin >= ARMED and not armed:
            armed.append(True)
            controls.arm()
        if now - origin >= LONGEST:  # an armed robot waits for readings as long as it takes
            controls.stop("the test ends")
        return spoil(board, now - origin, report)

    board = Board(clock, spoil_and_arm)
    origin = 0.01  # of the greeting
    monkeypatch.setattr(wheels, "_opener", lambda _: lambda: board)
    estimator = PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=False)
    result = drive(
        WheelsLink(ROBOT, "udp://board:1"),
        Pipeline(FeedforwardController(DT), estimator),
        Hold(GOAL, DURATION),
        rate=1.0 / DT,
        start=Pose(0.0, 0.0, 0.0),
        controls=controls,
        clock=clock,
    )
    return result, board


def unplugged(board, t, report):
    board.deaf = BEGIN <= t < END
    return b"" if board.deaf else report_line(report)


def changed(change):
    """Return a fault: reports between BEGIN and END are changed."""
    return lambda _, t, report: report_line(change(report) if BEGIN <= t < END else report)


def damaged(_board, t, report):
    line = report_line(report)
    return line[:3] + b"x" + line[4:] if BEGIN <= t < END else line


def rest(result):
    """The time of the hold and its reason."""
    held = next(each for each in result.changes if each.state is DriveState.HOLDING)
    return held.t, held.reason


@pytest.mark.parametrize(
    "spoil", [unplugged, damaged, changed(lambda report: report._replace(sequence=3))]
)
def test_a_board_without_new_reports_is_held_until_it_is_armed_again(monkeypatch, spoil):
    result, board = driven(monkeypatch, spoil)
    t, reason = rest(result)
    assert reason.startswith("no readings for 0.5")
    assert t == pytest.approx(BEGIN + MAX_AGE, abs=3.0 * DT)
    if spoil is unplugged:  # its watchdog was faster
        assert max(x for x in board.moved if x < ARMED) <= BEGIN + 0.01 + WATCHDOG + 2.0 * DT
    assert not [x for x in board.moved if t + 0.6 < x < ARMED]
    assert result.finished
    assert ROBOT.chassis.twist(board.angles)[:2] == pytest.approx(GOAL[:2], abs=0.01)


BEGINS_ANEW = "the link is lost: the reports of the motor board begin anew"


@pytest.mark.parametrize(
    "change",
    [
        lambda report: Report(report.sequence % 20, report.stamp, 0, (0,) * WHEELS),
        lambda report: report._replace(stamp=report.stamp // 2),
    ],
)
def test_a_board_that_restarts_ends_the_drive(monkeypatch, change):
    """Its counts begin at zero, so that the position is lost."""
    spoil = changed(change)
    result, board = driven(monkeypatch, lambda b, t, r: spoil(b, min(t, 1.0), r))
    ended = [each for each in result.changes if each.state is DriveState.STOPPED][-1]
    assert ended.reason.startswith(BEGINS_ANEW) or rest(result)[1].startswith("no readings")
    assert not result.finished
    assert max(board.moved) < BEGIN + MAX_AGE + 0.6


def test_counts_that_jump_once_change_nothing(monkeypatch):
    """One report is wrong by ten turns of a wheel."""
    once = []

    def spoil(_board, t, report):
        if t >= BEGIN and not once:
            once.append(True)
            report = report._replace(counts=(report.counts[0] + 10 * COUNTS, *report.counts[1:]))
        return report_line(report)

    result, board = driven(monkeypatch, spoil)
    assert result.finished, result.changes
    assert ROBOT.chassis.twist(board.angles)[:2] == pytest.approx(GOAL[:2], abs=0.01)


def test_a_serial_line_that_takes_no_bytes_does_not_block():
    """The buffer of the line fills up; pyserial would wait."""
    pytest.importorskip("serial")
    board = SerialBoard(WHEELS)
    board.open()
    port = wheels._opener(board.address)()
    thread = threading.Thread(target=lambda: [port.send(bytes(100)) for _ in range(3000)])
    thread.daemon = True
    thread.start()
    thread.join(20.0)
    assert not thread.is_alive()
    port.close()
    board.close()


@pytest.mark.parametrize("number", [errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ECONNREFUSED])
def test_a_network_that_is_down_loses_datagrams(number):
    """An unplugged cable is no lost link: the drive is held, and goes on when it is armed."""

    class Down:
        def send(self, _data):
            raise OSError(number, "down")

    with UdpBoard(WHEELS) as board:
        link = WheelsLink(ROBOT, board.address)
        link.open(MonotonicClock())
        socket, link._port._socket = link._port._socket, Down()
        link.send(BodyTwist(0.1, 0.0, 0.0))
        link._port._socket = socket
        link.close()
