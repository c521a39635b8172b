"""A motor board in a thread, over UDP or a serial line: the reference loop of the protocol."""

import argparse
import os
import select
import socket
import threading
import time
from math import isfinite, pi

from omnidrive.deploy.links.wheel_protocol import MAX_WHEELS, Hello, Report, _fields, _line


def hello_line(hello):
    """Return the answer of a board to the request for its greeting."""
    watchdog = round(1e3 * hello.watchdog)
    return _line(f"H,{hello.version},{hello.wheels},{hello.counts},{watchdog}")


def report_line(report):
    """Return the line of a report."""
    counts = ",".join(str(count) for count in report.counts)
    return _line(f"E,{report.sequence},{report.stamp},{report.acknowledged},{counts}")


def parse_command(line):
    """Return number and wheel speeds, rad/s, of a command; None: damaged, or of another kind."""
    fields = _fields(line)
    if fields is None or fields[0] != "W" or not 3 <= len(fields) <= 2 + MAX_WHEELS:
        return None
    try:
        sequence, speeds = int(fields[1]), tuple(map(float, fields[2:]))
    except ValueError:
        return None
    return (sequence, speeds) if all(map(isfinite, speeds)) else None


def is_hello_request(line):
    """Return whether a line asks for the greeting."""
    return _fields(line) == ["H"]


class Board:
    """Wheels that turn exactly as commanded; it stops them without commands."""

    def __init__(self, wheels, *, counts=4096, watchdog=0.3, period=0.01, first_stamp=0, first=0):
        self.hello = Hello(1, wheels, counts, watchdog)
        self.period, self.first_stamp, self.first = period, first_stamp, first
        self.angles, self.speeds, self.acknowledged = [0.0] * wheels, (0.0,) * wheels, 0
        self.damage = lambda line: line
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self.open()
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self.close()

    def _run(self):
        heard = last = time.monotonic()
        begin, number, rest = last, 0, b""
        while not self._ended.is_set():
            rest += self.receive(self.period)
            *lines, rest = rest.split(b"\n")
            now = time.monotonic()
            self.angles = [
                a + w * (now - last) for a, w in zip(self.angles, self.speeds, strict=True)
            ]
            last = now
            for line in lines:
                if is_hello_request(line):
                    self.send(hello_line(self.hello))
                command = parse_command(line)
                if command is not None:
                    self.acknowledged, self.speeds = command
                    heard = now
            if now - heard > self.hello.watchdog:
                self.speeds = (0.0,) * self.hello.wheels
            if now >= begin + number * self.period:
                counted = [
                    round(a / (2.0 * pi) * self.hello.counts) + self.first for a in self.angles
                ]
                counted = [(c + 2**31) % 2**32 - 2**31 for c in counted]
                stamp = (self.first_stamp + round(1e6 * (now - begin))) % 2**32
                report = Report(number % 2**16, stamp, self.acknowledged, tuple(counted))
                self.send(self.damage(report_line(report)))
                number += 1


class UdpBoard(Board):
    port = 0  # any

    def open(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", self.port))
        self.address = f"udp://127.0.0.1:{self.socket.getsockname()[1]}"
        self.peer = None

    def receive(self, wait):
        if not select.select([self.socket], [], [], wait)[0]:
            return b""
        data, self.peer = self.socket.recvfrom(4096)
        return data

    def send(self, data):
        if self.peer:
            self.socket.sendto(data, self.peer)

    def close(self):
        self.socket.close()


class SerialBoard(Board):
    def open(self):
        import tty

        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        tty.setraw(self.master)
        self.address = f"{os.ttyname(self.slave)}@115200"

    def receive(self, wait):
        return os.read(self.master, 4096) if select.select([self.master], [], [], wait)[0] else b""

    def send(self, data):
        if select.select([], [self.master], [], 0.0)[1]:
            os.write(self.master, data)

    def close(self):
        os.close(self.master)
        os.close(self.slave)


def main(kind, wheels, port):
    """Run a board until the process is killed; print its address."""
    board = {"udp": UdpBoard, "pty": SerialBoard}[kind](wheels, counts=100_000)
    board.port = port
    board.open()
    print(board.address, flush=True)
    board._run()


if __name__ == "__main__":
    words = argparse.ArgumentParser(description="A simulated motor board; it prints its address.")
    words.add_argument("kind", choices=["udp", "pty"], help="UDP, or a serial line (a pty)")
    words.add_argument("wheels", type=int, help="number of wheels")
    words.add_argument("port", type=int, nargs="?", default=0, help="of UDP [default: a free one]")
    chosen = words.parse_args()
    try:
        main(chosen.kind, chosen.wheels, chosen.port)
    except (OSError, OverflowError, ValueError) as error:
        words.error(f"{error}")
    except KeyboardInterrupt:
        print()
