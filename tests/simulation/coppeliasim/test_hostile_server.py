"""Hostile servers: every call ends within its deadline, and memory stays bounded."""

import json
import subprocess
import sys
from contextlib import ExitStack, contextmanager, suppress
from random import Random
from socket import create_server
from threading import Event, Thread

import pytest

from tests.simulation.coppeliasim.fake_server import WAIT, cbor

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
READY = b"\x05READY\x0bSocket-Type\0\0\0\x03REP"
MEBIBYTE = 2**20


class Peer:
    """The server's end of one connection."""

    def __init__(self, connection, ended):
        self.connection, self.ended = connection, ended
        self.send = connection.sendall

    def read(self, count):
        data = b""
        while len(data) < count:
            chunk = self.connection.recv(count - len(data))
            if not chunk:
                raise ConnectionError
            data += chunk
        return data

    def read_frame(self):
        flags, size = self.read(2)
        if flags & 2:
            size = int.from_bytes(bytes([size]) + self.read(7), "big")
        self.read(size)

    def greet(self):
        """Exchange greetings and types as a server of CoppeliaSim does."""
        self.send(GREETING)
        self.read(len(GREETING))
        self.send(frame(4, READY))
        self.read_frame()

    def serve(self, *bodies):
        """Reply to requests with these bodies in turn, and to all later ones with the last."""
        self.greet()
        for k in range(10**9):
            self.read_frame()
            self.read_frame()
            self.send(b"\x01\x00" + frame(0, bodies[min(k, len(bodies) - 1)]))

    def flood(self, data):
        """Reply to the first request with an endless repetition of ``data``."""
        self.greet()
        self.read_frame()
        self.read_frame()
        while not self.ended.is_set():
            self.send(data)

    def drip(self, data):
        """Send one byte every 50 ms."""
        for byte in data:
            self.send(bytes([byte]))
            if self.ended.wait(0.05):
                return


def frame(flags, body):
    if len(body) < 256:
        return bytes([flags, len(body)]) + body
    return bytes([flags | 2]) + len(body).to_bytes(8, "big") + body


def reply(raw):
    """Return the map of a reply whose value is one CBOR item."""
    return b"\xa1\x63ret\x81" + raw


def array(item):
    """Return a CBOR array of a million items of a byte."""
    return b"\x9a" + (MEBIBYTE - 100).to_bytes(4, "big") + item * (MEBIBYTE - 100)


def text(size):
    return b"\x5a" + size.to_bytes(4, "big") + bytes(size)


def slow_reply(peer):
    peer.greet()
    peer.read_frame()
    peer.read_frame()
    peer.drip(b"\x01\x00" + frame(0, cbor.dumps({"ret": ["a" * 4000]})))


def close_in_the_middle(peer):
    peer.greet()
    peer.read_frame()
    peer.send(b"\x01\x00\x02" + (1000).to_bytes(8, "big") + b"\xa1\x63ret")


def refuse(peer):
    peer.send(GREETING)
    peer.send(frame(4, b"\x05ERROR\x02no"))
    peer.ended.wait(10.0)


def reserved_flags(peer):
    peer.greet()
    peer.read_frame()
    peer.send(frame(8, b""))


def long_command(peer):
    peer.send(GREETING)
    peer.send(frame(4, READY + bytes(MEBIBYTE)))
    peer.ended.wait(10.0)


def garbage(peer):
    rng = Random(5)
    while not peer.ended.is_set():
        peer.send(b"\xff" + rng.randbytes(65_536))


FUNCTIONS = cbor.dumps({"ret": [{f"f{k}" + "x" * 60: {"func": {}} for k in range(12_000)}]})
KINDS = {
    "parts": lambda peer: peer.flood(frame(1, bytes(MEBIBYTE))),
    "empty parts": lambda peer: peer.flood(b"\x01\x00" * 10_000),
    "endless part": lambda peer: peer.flood(b"\x01\x00" + frame(2, b"") + b"\x7f" * 100_000),
    "long": lambda peer: peer.serve(bytes(5 * MEBIBYTE)),
    "lists": lambda peer: peer.serve(reply(array(b"\x80"))),
    "maps": lambda peer: peer.serve(reply(array(b"\xa0"))),
    "nested": lambda peer: peer.serve(reply(b"\x81" * (MEBIBYTE - 100) + b"\0")),
    "pieces": lambda peer: peer.serve(reply(b"\x5f" + b"\x40" * (MEBIBYTE - 100) + b"\xff")),
    "large integer": lambda peer: peer.serve(reply(b"\xc2" + text(MEBIBYTE - 100))),
    "fraction": lambda peer: peer.serve(
        reply(b"\xd8\x1e\x82" + 2 * (b"\xc2" + text(MEBIBYTE // 2 - 100)))
    ),
    "wide text": lambda peer: peer.serve(
        cbor.dumps({"err": "\N{ROBOT FACE}" + "a" * (MEBIBYTE - 100)})
    ),
    "functions": lambda peer: peer.serve(cbor.dumps({"ret": []}), FUNCTIONS),
    "waits": lambda peer: peer.serve(cbor.dumps(WAIT)),
    "silent": lambda peer: peer.ended.wait(10.0),
    "slow greeting": lambda peer: peer.drip(GREETING),
    "slow reply": slow_reply,
    "commands": lambda peer: peer.flood(frame(4, b"\x04PING\0\0") * 1000),
    "reserved flags": reserved_flags,
    "long command": long_command,
    "refuses": refuse,
    "web server": lambda peer: peer.send(b"HTTP/1.1 400 Bad Request\r\n\r\n"),
    "version 2": lambda peer: peer.drip(GREETING[:10] + b"\x01" + GREETING[11:]),
    "encrypted": lambda peer: peer.send(GREETING.replace(b"NULL\0", b"CURVE")),
    "closes": lambda peer: None,
    "closes in the middle": close_in_the_middle,
    "garbage": garbage,
}
QUICK = ("parts", "empty parts", "lists", "waits", "slow reply", "reserved flags")


@contextmanager
def hostile_server(behave):
    """Yield the port of a server that treats every connection in this way."""
    ended, threads = Event(), []

    def handle(connection):
        with connection, suppress(OSError):
            behave(Peer(connection, ended))

    def accept():
        with suppress(OSError):
            while True:
                connection, _ = listener.accept()
                connection.settimeout(10.0)
                threads.append(Thread(target=handle, args=(connection,)))
                threads[-1].start()

    with create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(120.0)
        accepting = Thread(target=accept)
        accepting.start()
        try:
            yield listener.getsockname()[1]
        finally:
            ended.set()
            listener.shutdown(2)
            for thread in (accepting, *threads):
                thread.join()


CLIENT = """
import json, re, sys, time
from pathlib import Path
from omnidrive.errors import PlantLost
from omnidrive.robot import named_robot
from omnidrive.simulation import CoppeliaSimPlant, CoppeliaSimScene

robot, found = named_robot("small"), {}
ports, timeout = json.loads(sys.argv[1]), float(sys.argv[2])

def connect(port):
    began = time.monotonic()
    try:
        CoppeliaSimPlant(robot, CoppeliaSimScene(port=port, timeout=timeout))
    except PlantLost as error:
        return time.monotonic() - began, str(error)

def largest_memory():  # MB; ru_maxrss would include that of the process that started this one
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmHWM:\\s*(\\d+) kB", status)[1]) / 1024.0

connect(1)  # imports the client
start = largest_memory()
for kind, port in ports.items():
    result = connect(port)
    found[kind] = (*result, largest_memory() - start)
print(json.dumps(found))
"""


def check(kinds, timeout):
    """Connect to one hostile server of every kind, all in one process without other work."""
    with ExitStack() as stack:
        ports = {kind: stack.enter_context(hostile_server(KINDS[kind])) for kind in kinds}
        done = subprocess.run(
            [sys.executable, "-c", CLIENT, json.dumps(ports), str(timeout)],
            capture_output=True, text=True, check=True, timeout=300,
        )  # fmt: skip
    found = json.loads(done.stdout)
    assert list(found) == list(kinds)
    for kind, (seconds, message, memory) in found.items():
        assert seconds < timeout + 1.0, kind
        assert memory < 50.0, kind  # MB, so far
        assert "\n" not in message, kind
        assert len(message) < 400, kind
    return found


def test_hostile_servers_of_a_few_kinds():
    found = check(QUICK, timeout=0.3)
    assert "its reply is not a single part" in found["empty parts"][1]
    assert "is not CoppeliaSim's remote API" in found["lists"][1]
    assert "did not reply within 0.3 s" in found["slow reply"][1]
    assert "a frame with the reserved flags 0x08" in found["reserved flags"][1]


@pytest.mark.long
def test_hostile_servers_of_every_kind():
    found = check(KINDS, timeout=2.0)
    for kind, (seconds, message, memory) in found.items():
        print(f"{kind:22} {seconds:5.2f} s {memory:6.1f} MB  {message[:100]}")
