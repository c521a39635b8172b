"""Round trips between two processes on loopback over ROS 2: delay, losses, memory.

A robot in another process answers each Twist on /cmd_vel with an Odometry on /odom, both encoded
and decoded. The delay is that of one message at a time, at real-time priority where the system
allows it; the rate is that of eight on their way.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from figures import at_most, row

from omnidrive.ros2 import Node, Publisher, Subscription

TWIST, ODOMETRY = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"
DELAYS, MESSAGES, WINDOW = 10_000, 1_000_000, 8
PEERS = ("localhost",)


class Channel(NamedTuple):
    """Commands to the robot and its answers."""

    node: Node
    commands: Publisher
    odometry: Subscription

    def send(self, number: int) -> None:
        """Send a command with a number."""
        twist = self.commands.message()
        twist.linear.x = float(number)
        self.commands.publish(twist)

    def answers(self) -> list[int]:
        """Return the numbers of the answers that arrived, of all of them after one arrived."""
        assert self.node.wait(10.0), "no answer within 10 s"
        return [int(each.message.twist.twist.linear.x) for each in self.odometry.take()]


def answer(domain: int) -> None:
    """Answer every command, for ever."""
    with Node("robot", domain=domain, peers=PEERS, distribution="jazzy") as node:
        commands = node.subscription("/cmd_vel", TWIST)
        odometry = node.publisher("/odom", ODOMETRY)
        state = odometry.message()
        state.header.frame_id, state.child_frame_id = "odom", "base_link"
        while True:
            node.wait(1.0)
            for received in commands.take():
                state.twist.twist = received.message
                odometry.publish(state)


@contextmanager
def channel(domain: int) -> Iterator[tuple[Channel, int]]:
    """Start the robot; yield the channel to it and its process number."""
    command = [sys.executable, str(Path(__file__)), str(domain)]
    with subprocess.Popen(command) as process:
        try:
            with Node("tracker", domain=domain, peers=PEERS, distribution="jazzy") as node:
                commands = node.publisher("/cmd_vel", TWIST)
                odometry = node.subscription("/odom", ODOMETRY)
                assert node.wait_for(lambda: commands.matched and odometry.matched, 20.0)
                yield Channel(node, commands, odometry), process.pid
        finally:
            process.kill()


def delays(to: Channel, count: int) -> np.ndarray:
    """Return the delays of ``count`` round trips, ms."""
    found = []
    for number in range(count):
        start = time.perf_counter()
        to.send(number)
        while number not in to.answers():
            pass
        found.append(time.perf_counter() - start)
    return 1e3 * np.array(found)


def memory(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Traffic(NamedTuple):
    """Result of many messages."""

    lost: int
    rate: float  # round trips per second
    growth: float  # of the larger process after the first tenth, MB


def traffic(to: Channel, peer: int, count: int) -> Traffic:
    """Send numbered messages, eight on their way at a time; each answer must be the next one."""
    sent = due = lost = 0
    before: list[float] = []
    start = time.perf_counter()
    while due < count:
        while sent < min(due + WINDOW, count):
            to.send(sent)
            sent += 1
        for number in to.answers():
            lost += number - due
            due = number + 1
        if not before and due > count // 10:
            before = [memory(each) for each in (os.getpid(), peer)]
    rate = count / (time.perf_counter() - start)
    after = [memory(each) for each in (os.getpid(), peer)]
    return Traffic(lost, rate, max(b - a for a, b in zip(before, after, strict=True)))


def prioritise() -> str:
    """Give this process and those that it starts real-time priority; return how it is scheduled."""
    with suppress(AttributeError, PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
        return "SCHED_FIFO"
    return "normal priority"


def rows(count: int = MESSAGES) -> list[dict[str, object]]:
    """Return the rows of the table."""
    domain = 1 + os.getpid() % 200
    with channel(domain) as (to, peer):
        many = traffic(to, peer, count)
    priority = prioritise()
    with channel(domain + 1) as (to, _):
        delays(to, 200)
        found = delays(to, DELAYS)
    if priority == "SCHED_FIFO":
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    name = f"ROS 2, round trip Twist and Odometry, {priority}"
    return [
        at_most(f"{name}, p50", float(np.percentile(found, 50)), "ms", 0.5),
        at_most(f"{name}, p99", float(np.percentile(found, 99)), "ms", 2.0),
        at_most(f"ROS 2, lost of {count} messages both ways", many.lost, "1", 0.0),
        at_most("ROS 2, growth of memory meanwhile", many.growth, "MB", 5.0),
        row("ROS 2, round trips per second, 8 on their way", many.rate, "1/s"),
    ]


if __name__ == "__main__":
    answer(int(sys.argv[1]))
