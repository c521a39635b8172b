"""Faults of a motor board: on simulated time, and of its network and serial line."""

import errno
import random
import threading
from math import inf, pi

import numpy as np
import pytest

from omnidrive import FeedforwardController, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import MonotonicClock, SimulatedClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_loop import MAX_AGE
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.links import wheel_protocol, wheels
from omnidrive.deploy.links.wheel_counts import STUCK_TIME, WITHHELD
from omnidrive.deploy.links.wheel_protocol import (
    Hello,
    Report,
)
from omnidrive.deploy.links.wheels import WheelsLink
from omnidrive.estimation import EstimatorSettings, PoseEstimator, SensorSettings
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Hold
from tests.deploy.board import (
    SerialBoard,
    UdpBoard,
    hello_line,
    is_hello_request,
    parse_command,
    report_line,
)

ROBOT = named_robot("small")
WHEELS = len(ROBOT.mounts)
DT, COUNTS, WATCHDOG = 0.04, 100_000, 0.3
BEGIN, END, ARMED, DURATION = 0.32, 1.2, 2.0, 2.52  # s, multiples of DT
GOAL = Pose(0.4, 0.2, 0.0)


class Board:
    """A port to a board on simulated time, whose reports a test changes."""

    def __init__(self, clock, spoil):
        self.clock, self.spoil = clock, spoil
        self.angles, self.speeds = np.zeros(WHEELS), np.zeros(WHEELS)
        self.hello = Hello(1, WHEELS, COUNTS, WATCHDOG)
        self.heard = self.last = clock.now()
        self.number, self.waiting, self.deaf, self.moved = 0, [], False, []

    def send(self, data):
        if self.deaf:
            return
        if is_hello_request(data):
            self.waiting.append(hello_line(self.hello))
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


LONGEST = 6.0  # s


def driven(monkeypatch, spoil, goal=GOAL, duration=DURATION):
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
        Hold(goal, duration),
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


def states(result):
    return [change.state for change in result.changes]


RESTART = 0.8  # s


def restarted(t, report):
    """A report of a board that restarted: number, stamp and counts begin at zero."""
    number, stamp = round((t - RESTART) / DT), round(1e6 * (t - RESTART))
    return report._replace(sequence=number, stamp=stamp)


@pytest.mark.parametrize("first", [0, 40_000])
def test_a_board_that_restarts_holds_the_robot(monkeypatch, first):
    """It greets as before, so that the armed robot goes on from the last estimate.

    Behind 40,000, zero is ahead by the arithmetic of numbers that wrap.
    """
    at_restart = []

    def spoil(board, t, report):
        if t < RESTART:
            return report_line(report._replace(sequence=first + report.sequence))
        if not at_restart:
            at_restart.append(report.counts)
        counts = (np.array(report.counts) - at_restart[0]).tolist()
        return report_line(restarted(t, report)._replace(counts=tuple(counts)))

    result, board = driven(monkeypatch, spoil)
    t, reason = rest(result)
    assert "begin anew" in reason or "the motor board reports that wheel" in reason
    assert t <= RESTART + MAX_AGE + 3.0 * DT
    assert result.finished, result.changes
    assert states(result).count(DriveState.RUNNING) == 2
    # what the wheels turned between the restart and the hold is not known
    assert ROBOT.chassis.twist(board.angles)[:2] == pytest.approx(GOAL[:2], abs=0.4)


@pytest.mark.parametrize(
    ("change", "again"),
    [
        ({"counts": COUNTS // 2}, False),
        ({"wheels": 3}, True),
        ({"version": 2}, False),
        ({"watchdog": 5.0}, True),
    ],
)
def test_another_greeting_in_mid_drive_holds_the_robot(monkeypatch, change, again):
    """An armed robot goes on only when the board greets as at first."""
    first = Hello(1, WHEELS, COUNTS, WATCHDOG)
    greeting = first._replace(**change)
    restored = END if again else inf

    def spoil(board, t, report):
        board.hello = greeting if BEGIN <= t < restored else first
        if board.hello == greeting:
            report = report._replace(counts=report.counts[: greeting.wheels])
        sudden = hello_line(greeting) if BEGIN <= t < BEGIN + DT else b""
        return sudden + report_line(report)

    result, board = driven(monkeypatch, spoil)
    t, reason = rest(result)
    assert reason.startswith("no readings for 0.5")
    assert "more than 0.5 s: the motor board " in reason
    assert f"{greeting.wheels} wheels" in reason or f"{greeting.counts} counts" in reason
    assert t <= BEGIN + MAX_AGE + 3.0 * DT
    assert result.finished == again, result.changes
    if not again:
        assert max(board.moved) < t + 0.6
        assert states(result).count(DriveState.RUNNING) == 1


def false_counts(kind):
    rng = np.random.default_rng(1)
    widths = {"random": 2**31, "near": COUNTS, "fast": 0}
    counts = np.zeros(WHEELS, dtype=int)

    def spoil(_board, t, report):
        nonlocal counts
        if not BEGIN <= t < BEGIN + 1.0:
            return report_line(report)
        if kind == "fast":
            counts = counts + COUNTS
        else:
            counts = rng.integers(-widths[kind], widths[kind], WHEELS)
        return report_line(report._replace(counts=tuple(counts.tolist())))

    return spoil


@pytest.mark.parametrize("kind", ["random", "near", "fast"])
def test_false_counts_hold_the_robot_until_they_follow_one_another(monkeypatch, kind):
    result, board = driven(monkeypatch, false_counts(kind))
    t, reason = rest(result)
    assert "s: the motor board reports that wheel " in reason
    assert reason.endswith(" s, more than 1.5 times its largest speed")
    assert result.finished, result.changes
    if kind == "near":  # some of them may be where the wheels can have turned to
        assert BEGIN + MAX_AGE - DT < t < BEGIN + 1.0 + MAX_AGE
        return
    assert t == pytest.approx(BEGIN + MAX_AGE, abs=6.0 * DT)
    assert ROBOT.chassis.twist(board.angles)[:2] == pytest.approx(GOAL[:2], abs=0.01)


@pytest.mark.parametrize("wheel", [0, WHEELS - 1])
def test_a_count_that_is_stuck_holds_the_robot(monkeypatch, wheel):
    def spoil(_board, t, report):
        counts = list(report.counts)
        counts[wheel] = 5
        return report_line(report._replace(counts=tuple(counts)))

    result, _ = driven(monkeypatch, spoil, goal=Pose(1.5, 0.5, 0.0), duration=6.0)
    t, reason = rest(result)
    assert f": the count of wheel {wheel} has not changed for 1" in reason
    assert t <= STUCK_TIME + MAX_AGE + 0.2


def check_random_lines(monkeypatch, seeds):
    for seed in seeds:
        rng = random.Random(seed)
        result, board = driven(monkeypatch, noise(rng))
        assert states(result)[-1] is DriveState.STOPPED
        assert np.isfinite(board.angles).all(), seed
        assert np.abs(board.angles).max() < 2.0 * ROBOT.max_wheel_speed * LONGEST


def test_random_lines_never_end_a_drive_by_an_error(monkeypatch):
    """Lines with right checksums and any fields, floods, pieces of lines and noise."""
    check_random_lines(monkeypatch, range(3))


@pytest.mark.long
def test_many_random_lines_never_end_a_drive_by_an_error(monkeypatch):
    check_random_lines(monkeypatch, range(100))


def noise(rng):
    """Return a fault: from BEGIN on, until END in half of all cases, anything arrives."""
    until = rng.choice((END, inf))
    fields = ("", "-", "0", "1", "-1", "4", "65535", "65536", "4294967295", "-2147483648", "nan",
              "inf", "1e9", "9" * 12, "9" * 400, " 7", "x", "0x10")  # fmt: skip

    def lines(report):
        kind = rng.choice("HEEW")
        names = [str(each) for each in (*report[:3], *report.counts)]
        for _ in range(rng.choice((0, 1, 3))):
            names[rng.randrange(len(names))] = rng.choice(fields)
        if kind == "H":
            names = [rng.choice(fields) for _ in range(rng.choice((0, 3, 4, 5)))]
        return wheel_protocol._line(",".join([kind, *names]))

    def spoil(_board, t, report):
        if not BEGIN <= t < until or rng.random() < 0.3:
            return report_line(report)
        data = b"".join(lines(report) for _ in range(rng.choice((1, 1, 5, 200))))
        return rng.choice(
            (data, data[rng.randrange(len(data)) :], b"\n" * 60_000, rng.randbytes(3000), b"")
        )

    return spoil


def test_readings_are_withheld_until_the_drive_is_held():
    assert WITHHELD > MAX_AGE


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
