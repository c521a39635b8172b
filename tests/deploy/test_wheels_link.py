"""The line protocol of motor boards, and its link over UDP and a serial line."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive import FeedforwardController, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import MonotonicClock
from omnidrive.deploy.drive import drive
from omnidrive.deploy.links.wheel_protocol import (
    Hello,
    Report,
    command_line,
    count_difference,
    hello_request,
    parse,
    sequence_difference,
    stamp_difference,
)
from omnidrive.deploy.links.wheels import WheelsLink
from omnidrive.deploy.robot_link import LinkLost, RobotLink
from omnidrive.errors import InvalidInput
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


def test_lines_of_the_documentation():
    assert hello_request() == b"H*283C\n"
    assert hello_line(Hello(1, 4, 4096, 0.5)) == b"H,1,4,4096,500*8883\n"
    assert command_line(7, (1.0, -1.0)) == b"W,7,1.0000,-1.0000*8751\n"


counts = st.integers(-(2**31), 2**31 - 1)
sequences = st.integers(0, 2**16 - 1)


@given(sequences, st.integers(0, 2**32 - 1), sequences, st.lists(counts, min_size=1, max_size=16))
def test_reports_survive_the_line(sequence, stamp, acknowledged, counted):
    report = Report(sequence, stamp, acknowledged, tuple(counted))
    assert parse(report_line(report)) == report


@given(sequences, st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=16))
def test_commands_survive_the_line(sequence, speeds):
    number, read = parse_command(command_line(sequence, tuple(speeds)))
    assert number == sequence
    np.testing.assert_allclose(read, speeds, atol=5.1e-5)
    assert is_hello_request(hello_request())


@given(st.binary(max_size=600))
def test_foreign_bytes_are_no_lines(data):
    assert parse(data) is None
    assert parse_command(data) is None


@given(st.integers(0, 30), st.integers(1, 255))
def test_every_damaged_byte_is_found(at, change):
    line = bytearray(report_line(Report(1, 2_000_000, 3, (4, -5, 600, 7000))))
    line[at % (len(line) - 1)] ^= change
    assert parse(bytes(line)) is None


def test_numbers_wrap():
    assert count_difference(-(2**31) + 4, 2**31 - 1) == 5
    assert stamp_difference(1_000, 2**32 - 1_000) == pytest.approx(0.002)
    assert sequence_difference(1, 65_535) == 2


def opened(board, robot=ROBOT):
    link = WheelsLink(robot, board.address)
    link.open(MonotonicClock())
    return link


def readings_for(link, seconds):
    found, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        readings = link.read()
        if readings is not None:
            found.append(readings)
        time.sleep(0.002)
    return found


@pytest.mark.parametrize("kind", [UdpBoard, SerialBoard])
def test_wheels_turn_as_commanded_and_stop_without_commands(kind):
    if kind is SerialBoard:
        pytest.importorskip("serial")
    with kind(WHEELS, first_stamp=2**32 - 200_000, first=2**31 - 100) as board:
        link = opened(board)
        assert isinstance(link, RobotLink)
        assert link.capabilities.watchdog == pytest.approx(0.3)
        began = time.monotonic()
        twist = BodyTwist(0.2, 0.0, 0.0)
        link.send(twist)
        found = readings_for(link, 0.8)
        link.close()
    speeds = ROBOT.chassis.wheel_speeds(twist)
    stamps = np.array([each.stamp for each in found])
    angles = np.array([each.wheel_angles for each in found])
    assert np.all(np.diff(stamps) > 0.0)
    assert np.all(np.abs(stamps - began) < 1.0)
    moving = np.flatnonzero(np.any(np.diff(angles, axis=0) != 0.0, axis=1))
    assert stamps[moving[-1]] - began == pytest.approx(0.3, abs=0.1)  # its watchdog
    turned = angles[-1] - angles[0]
    wheel = int(np.abs(speeds).argmax())
    assert turned[wheel] / speeds[wheel] == pytest.approx(0.3, abs=0.1)
    np.testing.assert_allclose(turned / turned[wheel], speeds / speeds[wheel], atol=0.05)
    assert link.damaged == 0


def test_damaged_and_lost_lines_are_counted():
    with UdpBoard(WHEELS) as board:
        link = opened(board)
        lines = iter(range(10**9))

        def damage(line):
            number = next(lines)
            return b"" if number % 5 == 3 else line[:-8] + b"00*0000\n" if number % 5 == 4 else line

        board.damage = damage
        found = readings_for(link, 0.5)
        link.close()
    assert found
    assert link.damaged > 3
    assert link.lost > 6


def test_drive_from_encoders_alone():
    dt = 0.02
    with UdpBoard(WHEELS, counts=100_000) as board:
        link = WheelsLink(ROBOT, board.address)
        estimator = PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=False)
        result = drive(
            link,
            Pipeline(FeedforwardController(dt), estimator),
            Hold(Pose(0.1, 0.05, 0.0), 1.5),
            rate=1.0 / dt,
            start=Pose(0.0, 0.0, 0.0),
        )
    assert result.finished, result.ending
    turned = ROBOT.chassis.twist(board.angles)
    assert (turned.vx, turned.vy) == pytest.approx((0.1, 0.05), abs=0.01)


def test_refusals():
    for address in (
        "udp://board", "tcp://1.2.3.4:5", "udp://:5", "udp://[]:5",
        "udp://board:\N{SUPERSCRIPT TWO}", "udp://board:99999999", "/dev/ttyACM0@fast",
    ):  # fmt: skip
        with pytest.raises(InvalidInput, match="the address of a motor board"):
            WheelsLink(ROBOT, address)
    link = WheelsLink(ROBOT, "udp://127.0.0.1:9")
    with pytest.raises(InvalidInput, match="measures no pose"):
        drive(link, Pipeline(FeedforwardController(0.1)), Hold(Pose(0.0, 0.0, 0.0), 1.0), rate=10.0)
    with pytest.raises(InvalidInput, match="reckons from the wheels"):
        drive(
            link, Pipeline(FeedforwardController(0.1)), Hold(Pose(0.0, 0.0, 0.0), 1.0), rate=10.0,
            start=Pose(0.0, 0.0, 0.0),
        )  # fmt: skip
    with UdpBoard(3) as board, pytest.raises(LinkLost, match="the board has 3 wheels"):
        opened(board)


def test_missing_serial_port_is_named_once(tmp_path):
    pytest.importorskip("serial")
    link = WheelsLink(named_robot("small"), f"{tmp_path}/ttyNONE")
    with pytest.raises(LinkLost, match=r"ttyNONE cannot be opened: No such file or directory$"):
        link.open(MonotonicClock())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "the following arguments are required: kind, wheels"),
        (["tcp", "4"], "invalid choice: 'tcp'"),
        (["udp", "four"], "invalid int value: 'four'"),
        (["udp", "4", "99999"], "port must be 0-65535"),
    ],
)
def test_simulated_board_refuses_wrong_words_with_its_usage(words, message):
    command = [sys.executable, str(Path(__file__).parent / "board.py"), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("usage: board.py")
    assert message in done.stderr
    assert "Traceback" not in done.stderr
