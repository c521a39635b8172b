"""The link to a LeKiwi against an independent host, and hostile observations."""

import json
import re
import socket
import subprocess
import sys
import time
from dataclasses import replace
from math import degrees, pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("zmq")

import zmq

from omnidrive import FeedforwardController, Pose, named_robot
from omnidrive.control import Pipeline, WheelSpeeds, WheelTorques
from omnidrive.control.controller import STOP
from omnidrive.deploy.clock import MonotonicClock, SimulatedClock
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.links.lekiwi import (
    _PATIENCE,
    MAX_WHEEL_SPEED,
    WATCHDOG,
    LeKiwiLink,
    action,
    parse_observation,
)
from omnidrive.deploy.robot_link import LinkLost, RobotLink
from omnidrive.errors import InvalidInput
from omnidrive.estimation import EstimatorSettings, PoseEstimator, SensorSettings
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Hold
from tests.deploy.lekiwi_host import ARM, EndlessHost, LeKiwiHost, body_velocity, wheel_steps

ROBOT = named_robot("lekiwi")
STATE = {**ARM, "x.vel": 0.1, "y.vel": -0.05, "theta.vel": 20.0}


def opened(host, robot=ROBOT):
    link = LeKiwiLink(robot, "127.0.0.1", host.command_port, host.observation_port)
    link.open(MonotonicClock())
    return link


def until(condition, seconds=2.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.005)


def test_robot_and_host_agree_on_wheels_and_limits():
    for twist in np.random.default_rng(1).uniform(-0.08, 0.08, (20, 3)):
        x, y, yaw_rate = twist.tolist()
        speeds = ROBOT.chassis.wheel_speeds(BodyTwist(x, y, yaw_rate))
        steps = np.array(wheel_steps(x, y, degrees(yaw_rate)))
        np.testing.assert_allclose(steps * 2.0 * pi / 4096.0, speeds, atol=8e-4)
        read = body_velocity(steps)
        assert read == pytest.approx((x, y, degrees(yaw_rate)), abs=0.03)
    assert max(map(abs, wheel_steps(9.0, 3.0, 10.0))) * 2.0 * pi / 4096.0 == MAX_WHEEL_SPEED
    assert ROBOT.max_wheel_speed == pytest.approx(MAX_WHEEL_SPEED)


@pytest.mark.parametrize("parts", [True, False])
def test_twists_arrive_with_the_arm_at_rest_and_wheels_are_integrated(parts):
    with LeKiwiHost(parts=parts) as host:
        link = opened(host)
        assert isinstance(link, RobotLink)
        assert link.capabilities == (WATCHDOG, False, True, False)
        host.arm["arm_gripper.pos"] = 50.0  # somebody moves it: it goes back
        twist, began = BodyTwist(0.12, -0.05, 0.4), time.monotonic()
        found = []
        while time.monotonic() < began + 0.7:
            link.send(twist)
            found.append(link.read())
            time.sleep(0.01)
        link.send(WheelSpeeds(ROBOT.chassis.wheel_speeds(BodyTwist(0.0, 0.1, 0.0))))
        until(lambda: host.actions[-1][1]["y.vel"] == pytest.approx(0.1))
        link.close()
        _, sent = next(each for each in host.actions if each[1]["x.vel"] > 0.0)
        assert sent["x.vel"] == pytest.approx(0.12)
        assert sent["y.vel"] == pytest.approx(-0.05)
        assert sent["theta.vel"] == pytest.approx(degrees(0.4))
        assert {key: sent[key] for key in ARM} == ARM
        until(lambda: host.actions[-1][1]["y.vel"] == 0.0)  # close stops the robot
        assert not host.failures
    found = [each for each in found if each is not None]
    stamps = np.array([each.stamp for each in found])
    assert np.all(np.diff(stamps) > 0.0)
    assert 15 < len(found) < 25  # 30 Hz
    steady = [each for each in found if each.stamp > began + 0.2]
    turned = np.array(steady[-1].wheel_angles) - steady[0].wheel_angles
    expected = ROBOT.chassis.wheel_speeds(twist) * (steady[-1].stamp - steady[0].stamp)
    np.testing.assert_allclose(turned, expected, atol=2e-3)
    assert link.damaged == 0


def test_calibrated_robot_turns_its_wheels_as_the_host_understands_them():
    wheel = replace(ROBOT.wheel, radius=0.048)
    robot = replace(ROBOT, wheel=wheel)
    with LeKiwiHost() as host:
        link = opened(host, robot)
        link.send(BodyTwist(0.12, 0.0, 0.0))
        until(lambda: host.actions and host.actions[-1][1]["x.vel"] > 0.0)
        link.close()
        assert max(each["x.vel"] for _, each in host.actions) == pytest.approx(0.12 * 0.05 / 0.048)


def test_host_stops_the_robot_when_commands_end():
    with LeKiwiHost() as host:
        link = opened(host)
        link.send(BodyTwist(0.1, 0.0, 0.0))
        until(lambda: host.actions and host.actions[-1][1]["x.vel"] > 0.0)
        moved = host.actions[-1][0]
        until(lambda: host.stops)
        assert host.stops[-1] - moved == pytest.approx(WATCHDOG, abs=0.2)
        link.close()


@pytest.mark.long
def test_drive_from_wheel_speeds_alone():
    dt = 0.04
    estimator = PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=False)
    with LeKiwiHost() as host:
        result = drive(
            LeKiwiLink(ROBOT, "127.0.0.1", host.command_port, host.observation_port),
            Pipeline(FeedforwardController(dt), estimator),
            Hold(Pose(0.06, -0.03, 0.1), 1.2),
            rate=1.0 / dt,
            start=Pose(0.0, 0.0, 0.0),
        )
        assert result.finished, result.ending
        assert host.pose == pytest.approx((0.06, -0.03, 0.1), abs=0.01)
        assert not host.failures


@pytest.mark.long
def test_host_that_vanishes_holds_the_robot_and_one_that_returns_gets_no_old_command():
    dt, controls, seen = 0.05, DriveControls(arm=True), []
    estimator = PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=False)
    first, moving = LeKiwiHost(), []

    class Link(LeKiwiLink):
        def send(self, value):
            if value != STOP and not moving:
                moving.append(time.monotonic())
            since = time.monotonic() - moving[0] if moving else 0.0
            if since > 0.3 and not seen:
                first.__exit__()
                seen.append(LeKiwiHost(ports=(first.command_port, first.observation_port)))
            elif since > 1.3 and len(seen) == 1:
                seen.append(seen[0].__enter__())
            elif since > 1.7:
                controls.stop("enough")
            LeKiwiLink.send(self, value)

    first.__enter__()
    result = drive(
        Link(ROBOT, "127.0.0.1", first.command_port, first.observation_port),
        Pipeline(FeedforwardController(dt), estimator),
        Hold(Pose(2.0, 0.0, 0.0), 20.0),
        rate=1.0 / dt,
        start=Pose(0.0, 0.0, 0.0),
        controls=controls,
    )
    seen[0].__exit__()
    held = next(change for change in result.changes if change.state is DriveState.HOLDING)
    assert held.reason.startswith("no readings for 0.5")
    assert result.ending == "enough"
    assert max(each["x.vel"] for _, each in first.actions) > 0.1
    assert seen[0].actions
    assert {each["x.vel"] for _, each in seen[0].actions} == {0.0}


SPOILT = {
    "silent": lambda _sent: [],
    "NaN": lambda _sent: [json.dumps(STATE | {"x.vel": float("nan")}).encode()],
    "no JSON": lambda _sent: [b"<html>"],
    "without velocities": lambda _sent: [json.dumps(ARM).encode()],
}


@pytest.mark.long
@pytest.mark.parametrize("name", SPOILT)
def test_a_host_without_usable_observations_holds_the_robot(name):
    dt, controls = 0.05, DriveControls(arm=True)
    estimator = PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=False)
    with LeKiwiHost() as host:

        class Link(LeKiwiLink):
            def send(self, value):
                if value != STOP:
                    host.change = SPOILT[name]
                elif host.change is SPOILT[name]:  # the ramp of the hold has ended
                    controls.stop("enough")
                LeKiwiLink.send(self, value)

        result = drive(
            Link(ROBOT, "127.0.0.1", host.command_port, host.observation_port),
            Pipeline(FeedforwardController(dt), estimator),
            Hold(Pose(2.0, 0.0, 0.0), 20.0),
            rate=1.0 / dt,
            start=Pose(0.0, 0.0, 0.0),
            controls=controls,
        )
        assert host.actions[-1][1]["x.vel"] == 0.0
    held = result.changes[-2]
    assert held.state is DriveState.HOLDING
    assert held.reason.startswith("no readings for 0.5")
    assert ("no usable observation" in held.reason) == (name != "silent")


@pytest.mark.parametrize(
    "change",
    [
        {"x.vel": float("nan")}, {"y.vel": float("inf")}, {"theta.vel": "3"}, {"x.vel": True},
        {"x.vel": 10**400}, {"x.vel": 1e300}, {"theta.vel": 1e6}, {"x.vel": 3.0}, {"x.vel": None},
        {"arm_gripper.pos": [1.0]}, {"arm_gripper.pos": float("nan")}, {65 * "k" + ".pos": 1.0},
        {f"joint_{i}.pos": 0.0 for i in range(33)},
    ],
)  # fmt: skip
def test_wrong_observations_are_refused(change):
    assert parse_observation(json.dumps(STATE).encode()) is not None
    assert parse_observation(json.dumps(STATE | change).encode()) is None


@pytest.mark.parametrize("key", ["x.vel", "y.vel", "theta.vel"])
def test_missing_velocity_is_refused(key):
    state = {name: value for name, value in STATE.items() if name != key}
    assert parse_observation(json.dumps(state).encode()) is None


def test_deep_and_long_observations_are_refused():
    for data in (
        100_000 * b"[",
        b"[1, 2]",
        b'{"x.vel": ' + 5000 * b"9" + b"}",
        b"\xff\xfe\x00",
        b"",
    ):
        assert parse_observation(data) is None


@given(st.binary(max_size=200), st.integers(0, 400))
def test_damaged_observations_raise_nothing(change, at):
    data = json.dumps(STATE).encode()
    found = parse_observation(data[:at] + change + data[at + len(change) :])
    if found is not None:
        assert np.isfinite(found.twist).all()
        assert np.isfinite(list(found.arm.values())).all()


@given(st.lists(st.floats(-0.2, 0.2), min_size=3, max_size=3))
def test_commands_survive_the_message(numbers):
    found = parse_observation(action(ARM, BodyTwist(*numbers)))
    assert found is not None
    np.testing.assert_allclose(found.twist, numbers, rtol=0.0, atol=1e-15)
    assert found.arm == ARM


def test_hostile_host_is_survived_and_counted():
    wrong = [[b"{"], [b"[" * 50_000], [b"", b""], 200 * [b"x"], [b'{"x.vel": 0}', b"image"]]
    with LeKiwiHost(rate=100.0) as host:
        link = opened(host)
        begin = link.damaged
        host.change = lambda usual: wrong.pop() if wrong else usual
        until(lambda: link.read() is None and not wrong)
        until(lambda: link.read() is not None)
        assert 1 <= link.damaged - begin <= 5  # only the newest is examined
        link.close()


@pytest.mark.parametrize("further", [20 * [b"x"], 6 * [900_000 * b"x"]])
def test_message_of_too_many_parts_or_bytes_is_refused(further):
    """The connection is replaced, with what it holds."""
    with LeKiwiHost(rate=100.0) as host:
        link = opened(host)
        begin = link.damaged
        host.change = lambda usual: [usual[0], *further]
        until(lambda: link.read() is None and link.damaged > begin, 20.0)
        host.change = lambda usual: usual
        until(lambda: link.read() is not None, 20.0)
        link.close()


def test_message_without_end_ends_the_connection(monkeypatch):
    """ZeroMQ keeps all parts of a message until its last one."""
    # ZeroMQ itself replaces a connection to a host that does not run for longer than this
    monkeypatch.setattr("omnidrive.deploy.links.lekiwi._PING_TIMEOUT", 60_000)
    with EndlessHost() as host:
        clock = SimulatedClock()
        link = LeKiwiLink(ROBOT, "127.0.0.1", 1, host.port)
        link._zmq, link._context, link._clock = zmq, zmq.Context(), clock
        link._connect_observations()
        until(lambda: link.read() is None and host.connections == 1, 20.0)
        time.sleep(0.2)
        assert link.read() is None
        assert host.closed == 0
        clock.time += 1.1 * _PATIENCE
        assert link.read() is None
        until(lambda: host.closed == 1 and host.connections == 2, 20.0)
        link._disconnect()


def test_part_that_is_too_large_ends_the_connection():
    with LeKiwiHost(rate=100.0) as host:
        link = opened(host)
        host.change = lambda _usual: [1_100_000 * b" "]
        time.sleep(0.1)
        link.read()
        host.change = lambda usual: usual
        time.sleep(0.3)
        assert link.read() is None
        link.close()


def test_refusals():
    with pytest.raises(InvalidInput, match="three omni wheels with axles at 60, 180 and -60"):
        LeKiwiLink(named_robot("small"), "1.2.3.4")
    turned = replace(ROBOT, mounts=ROBOT.mounts[::-1])
    with pytest.raises(InvalidInput, match="in this order"):
        LeKiwiLink(turned, "1.2.3.4")
    for name in ("", "a/b", "a b"):
        with pytest.raises(InvalidInput, match="neither the name nor the address"):
            LeKiwiLink(ROBOT, name)
    with pytest.raises(InvalidInput, match="from 1 to 65535, got 70000"):
        LeKiwiLink(ROBOT, "robot", 70_000)
    link = LeKiwiLink(ROBOT, "127.0.0.1")
    with pytest.raises(LinkLost, match="not open"):
        link.send(STOP)
    with pytest.raises(InvalidInput, match="no torques"):
        link.send(WheelTorques([0.0, 0.0, 0.0]))


def test_silent_host_is_reported(monkeypatch):
    monkeypatch.setattr("omnidrive.deploy.links.lekiwi._CONNECT_TIME", 0.2)
    with pytest.raises(LinkLost, match=r"no LeKiwi host sends observations at tcp://127\.0\.0\.1"):
        LeKiwiLink(ROBOT, "127.0.0.1", 9, 9).open(MonotonicClock())
    with LeKiwiHost() as host:
        host.change = lambda _usual: [b"hello"]
        with pytest.raises(LinkLost, match="is no observation of a LeKiwi"):
            opened(host)


HOST = [sys.executable, str(Path(__file__).parent / "lekiwi_host.py")]


def test_simulated_host_prints_the_link_to_it_and_where_its_watchdog_stops_the_robot():
    with subprocess.Popen([*HOST, "0", "0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            words = dict(word.split("=") for word in process.stdout.readline().strip().split(","))
            link = LeKiwiLink(
                ROBOT, words["host"], int(words["command_port"]), int(words["observation_port"])
            )
            link.open(MonotonicClock())
            link.send(BodyTwist(0.1, 0.0, 0.0))
            link.close()
            stopped = process.stdout.readline()
        finally:
            process.kill()
    assert re.fullmatch(
        r"watchdog: no command for 0\.5 s, stopped at x 0\.0\d\d m, y -?0\.000 m, .*\n", stopped
    )


def test_simulated_host_refuses_wrong_words_and_ports_in_use_with_its_usage():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        for words, message in {
            ("one",): "invalid int value: 'one'",
            (port, "0"): f"ports {port} and 0: ",
        }.items():
            command = [*HOST, *words]
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=60.0, check=False
            )
            assert done.returncode == 2
            assert done.stderr.startswith("usage: lekiwi_host.py")
            assert message in done.stderr
            assert "Traceback" not in done.stderr
