"""A LeKiwi host in a thread: the loop, messages and arithmetic of LeRobot's, in plain pyzmq.

Its wheels turn exactly as commanded, in whole encoder steps per second.
"""

import argparse
import json
import socket
import struct
import threading
import time
from contextlib import suppress
from math import cos, pi, radians, sin

import zmq

STEPS = 4096.0 / 360.0  # per degree
WHEELS = [radians(a - 90.0) for a in (240.0, 0.0, 120.0)]  # left, back, right
WHEEL_RADIUS, BASE_RADIUS, MAX_RAW = 0.05, 0.125, 3000
ARM = {
    "arm_shoulder_pan.pos": -3.25, "arm_shoulder_lift.pos": -98.5, "arm_elbow_flex.pos": 97.0,
    "arm_wrist_flex.pos": 71.125, "arm_wrist_roll.pos": 0.5, "arm_gripper.pos": 12.0,
}  # fmt: skip
JPEG = b"\xff\xd8" + 60_000 * b"\x5a" + b"\xff\xd9"


def wheel_steps(x, y, theta):
    """Return steps per second of the wheels for m/s, m/s, deg/s, scaled down together."""
    speeds = [(x * cos(a) + y * sin(a) + BASE_RADIUS * radians(theta)) / WHEEL_RADIUS
              for a in WHEELS]  # fmt: skip
    steps = [speed * 180.0 / pi * STEPS for speed in speeds]
    largest = max(map(abs, steps))
    share = MAX_RAW / largest if largest > MAX_RAW else 1.0
    return [round(share * each) for each in steps]


def body_velocity(steps):
    """Return m/s, m/s, deg/s for steps per second of the wheels (three at 120 degrees)."""
    rim = [each / STEPS * pi / 180.0 * WHEEL_RADIUS for each in steps]
    x = 2.0 / 3.0 * sum(v * cos(a) for v, a in zip(rim, WHEELS, strict=True))
    y = 2.0 / 3.0 * sum(v * sin(a) for v, a in zip(rim, WHEELS, strict=True))
    return x, y, sum(rim) / 3.0 / BASE_RADIUS * 180.0 / pi


class LeKiwiHost:
    """Context manager: a host on two free ports.

    Attributes:
        parts: Whether images are parts of their own, as since 2026, or base64 in the JSON object.
        change: Function that returns the parts to send instead of those of an observation.
        actions: Commands that were executed, with their time.
        stops: Times at which the watchdog stopped the base.
        pose: x, y, heading; m, m, rad.
    """

    def __init__(self, *, parts=True, rate=30.0, watchdog=0.5, ports=(0, 0)):
        self.parts, self.rate, self.watchdog, self.ports = parts, rate, watchdog, ports
        self.change = lambda sent: sent
        self.actions, self.stops, self.failures = [], [], []
        self.pose = (0.0, 0.0, 0.0)
        self.arm = dict(ARM)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self.context = zmq.Context()
        self.commands = self.context.socket(zmq.PULL)
        self.commands.setsockopt(zmq.CONFLATE, 1)
        self.observations = self.context.socket(zmq.PUSH)
        self.observations.setsockopt(*((zmq.SNDHWM, 2) if self.parts else (zmq.CONFLATE, 1)))
        for each in (self.commands, self.observations):
            each.setsockopt(zmq.LINGER, 0)
        self.command_port, self.observation_port = (
            each.bind_to_random_port("tcp://127.0.0.1")
            if port == 0
            else (each.bind(f"tcp://127.0.0.1:{port}"), port)[1]
            for each, port in zip((self.commands, self.observations), self.ports, strict=True)
        )
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self.commands.close()
        self.observations.close()
        self.context.term()

    def _run(self):
        heard = last = time.monotonic()
        stopped, steps = False, [0, 0, 0]
        while not self._ended.wait(1.0 / self.rate):
            now = time.monotonic()
            self._move(body_velocity(steps), now - last)
            last = now
            try:
                data = dict(json.loads(self.commands.recv_string(zmq.NOBLOCK)))
                steps = self._execute(data)
                heard, stopped = now, False
            except zmq.Again:
                pass
            except Exception as error:  # LeRobot's host logs any and goes on
                self.failures.append(error)
            if now - heard > self.watchdog and not stopped:
                stopped, steps = True, [0, 0, 0]
                self.stops.append(now)
            self._send(body_velocity(steps))

    def _execute(self, data):
        arm = {key: value for key, value in data.items() if key.endswith(".pos")}
        base = {key: value for key, value in data.items() if key.endswith(".vel")}
        steps = wheel_steps(base["x.vel"], base["y.vel"], base["theta.vel"])
        next(iter(arm))  # sync_write of no motors raises StopIteration
        self.arm.update(arm)
        self.actions.append((time.monotonic(), data))
        return steps

    def _move(self, velocity, dt):
        x, y, yaw = self.pose
        vx, vy, turn = velocity[0], velocity[1], radians(velocity[2])
        middle = yaw + 0.5 * turn * dt
        self.pose = (
            x + dt * (vx * cos(middle) - vy * sin(middle)),
            y + dt * (vx * sin(middle) + vy * cos(middle)),
            yaw + turn * dt,
        )

    def _send(self, velocity):
        state = {**self.arm, **dict(zip(("x.vel", "y.vel", "theta.vel"), velocity, strict=True))}
        if self.parts:
            sent = [json.dumps({"_cams": ["front", "wrist"], **state}).encode(), JPEG, JPEG]
        else:
            sent = [json.dumps({**state, "front": 80_000 * "A", "wrist": ""}).encode()]
        sent = self.change(sent)
        if sent:
            with suppress(zmq.Again):
                self.observations.send_multipart(sent, zmq.NOBLOCK)


class EndlessHost:
    """Context manager: a host whose message has one part of 10 kB after the other, without end.

    Attributes:
        port: Its port of observations.
        connections: Number of connections that were made to it.
        closed: Number of them that the other side closed.
    """

    def __init__(self):
        self.connections = self.closed = 0
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._socket.settimeout(0.1)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def _run(self):
        while not self._ended.is_set():
            with suppress(TimeoutError):
                connection = self._socket.accept()[0]
                self.connections += 1
                with connection:
                    self._serve(connection)

    def _serve(self, connection):
        """Send the greeting and the handshake of ZMTP 3.1 (ZeroMQ RFC 37), and then parts."""
        kind = b"\x0bSocket-Type" + struct.pack(">I", 4) + b"PUSH"
        ready = b"\x05READY" + kind
        part = b"\x03" + struct.pack(">Q", 10_000) + bytes(10_000)
        greeting = b"\xff" + bytes(8) + b"\x7f\x03\x01" + b"NULL".ljust(20, b"\0") + bytes(32)
        connection.settimeout(5.0)
        try:
            connection.sendall(greeting + b"\x04" + bytes([len(ready)]) + ready)
            while not self._ended.wait(0.002):
                connection.sendall(part)
        except OSError:
            self.closed += 1


def main(command_port, observation_port):
    """Run a host until the process is killed; print its ports, and what its watchdog does."""
    with LeKiwiHost(ports=(command_port, observation_port)) as host:
        ports = f"command_port={host.command_port},observation_port={host.observation_port}"
        print(f"host=127.0.0.1,{ports}", flush=True)
        driven, stops = False, 0
        while True:
            time.sleep(0.1)
            driven = driven or bool(host.actions)
            host.actions.clear()  # of the tests
            if driven and len(host.stops) > stops:
                pose = "x {:.3f} m, y {:.3f} m, heading {:.3f} rad".format(*host.pose)
                print(
                    f"watchdog: no command for {host.watchdog:g} s, stopped at {pose}", flush=True
                )
                driven = False
            stops = len(host.stops)


if __name__ == "__main__":
    words = argparse.ArgumentParser(
        description="A simulated LeKiwi with its host; it prints the parameters of the link."
    )
    words.add_argument("command_port", type=int, nargs="?", default=5555, help="[default: 5555]")
    words.add_argument(
        "observation_port", type=int, nargs="?", default=5556, help="[default: 5556]"
    )
    chosen = words.parse_args()
    try:
        main(chosen.command_port, chosen.observation_port)
    except (zmq.ZMQError, OverflowError, ValueError) as error:
        words.error(f"ports {chosen.command_port} and {chosen.observation_port}: {error}")
    except KeyboardInterrupt:
        print()
