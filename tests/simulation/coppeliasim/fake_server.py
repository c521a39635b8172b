"""Fake of CoppeliaSim's ZeroMQ remote API server, protocol version 2.

It follows the add-on that the vendor publishes ("ZMQ remote API server.lua" of the repository
CoppeliaRobotics/zmqRemoteApi): a REP socket with one CBOR map in each direction. Every client has a
counter of `setStepping` and blocks the simulation until it requests the next step. A client inside
`sim.step` receives `_*wait*_` and replies `_*executed*_` until the step counter increases; until
then every message of it is taken for that reply.
"""

import socket
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event, Thread

import zmq
from coppeliasim_zmqremoteapi_client import cbor

from tests.simulation.coppeliasim.fake_scene import RUNNING, STOPPED, STOPPING, FakeScene, Refused

WAIT = {"func": "_*wait*_", "args": []}


@dataclass
class Client:
    level: int = 0
    requested_step: int = 0
    stepping_since: int | None = None
    ran: bool = False


class FakeServer:
    """Server in a thread until `end`; `mangle` can replace any reply or, with None, drop it."""

    def __init__(self, scene):
        self.scene, self.clients, self.current = scene, {}, 0
        self.requests, self.greetings = [], []
        self.mangle = lambda request, reply: cbor.dumps(reply)
        self.before = lambda request: None
        self._end = Event()
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.REP)
        self._socket.setsockopt(zmq.LINGER, 0)
        self.port = self._socket.bind_to_random_port("tcp://127.0.0.1")
        self._thread = Thread(target=self._serve, daemon=True)
        self._thread.start()

    def end(self):
        self._end.set()
        self._thread.join(10.0)
        assert not self._thread.is_alive()

    def called(self, name):
        return [r["args"] for r in self.requests if r["func"] == f"sim.{name}"]

    def _serve(self):
        try:
            while not self._end.is_set():
                if self._is_free():
                    self._advance()
                if self._socket.poll(0 if self._is_free() else 20):
                    self._serve_request(cbor.loads(self._socket.recv()))
        finally:
            self._socket.close(linger=0)
            self._context.term()

    def _is_free(self):
        blocked = any(
            c.level > 0 and c.requested_step <= self.current for c in self.clients.values()
        )
        return self.scene.state in {RUNNING, STOPPING} and not blocked

    def _advance(self):
        self.scene.advance()
        self.current = self.current + 1 if self.scene.state != STOPPED else 0

    def _serve_request(self, request):
        self.requests.append(request)
        self.before(request)
        if "uuid" not in request:
            reply = {
                "success": False,
                "error": "The client ZeroMQ remote API version does not match",
            }
        else:
            if request["uuid"] not in self.clients:
                self.greetings.append(request)
            client = self.clients.setdefault(request["uuid"], Client(requested_step=self.current))
            reply = self._reply(client, request)
        raw = self.mangle(request, reply)
        if raw is None:  # without a reply, a REP socket cannot receive again
            self._end.wait(30.0)
        else:
            self._socket.send(raw)

    def _reply(self, client, request):
        if client.stepping_since is not None:  # any message: the client is inside sim.step
            if client.ran and client.stepping_since == self.current:
                return WAIT
            client.stepping_since = None
            return {"ret": []}
        name, args = request["func"], request["args"]
        assert request["argsL"] == len(args)
        if name == "sim.step":
            client.stepping_since, client.ran = self.current, self.scene.state == RUNNING
            if client.ran and client.level > 0:
                client.requested_step = self.current + 1
            return WAIT
        try:
            value = self._call(client, name, args)
        except Refused as error:
            return {"err": str(error)}
        if value is None:
            return {"ret": []}
        return {"ret": list(value) if isinstance(value, tuple) else [value]}

    def _call(self, client, name, args):
        if name == "zmqRemoteApi.require":
            return None
        if name == "zmqRemoteApi.info":
            return self._info()
        if name == "sim.setStepping":
            before = client.level
            if not args[0]:
                client.level = max(0, before - 1)
            else:
                client.requested_step = self.current if before == 0 else client.requested_step
                client.level += 1
            return before
        space, _, function = name.partition(".")
        if space != "sim" or function.startswith("_") or not hasattr(FakeScene, function):
            raise Refused(f"No such function: {name}")
        if function == "stopSimulation":
            for other in self.clients.values():
                other.level, other.requested_step = 0, self.current + 10
        return getattr(self.scene, function)(*args)

    def _info(self):
        names = [
            n for n in vars(FakeScene) if not n.startswith("_") and n not in {"torques", "advance"}
        ]
        values = {n: getattr(FakeScene, n) for n in names}
        entries = {n: {"func": {}} if callable(v) else {"const": v} for n, v in values.items()}
        return entries | {"step": {"func": {}}, "setStepping": {"func": {}}}


def free_port():
    """Return a port at which no program listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def fake_server(robot, **options):
    server = FakeServer(FakeScene(robot, **options))
    try:
        yield server
    finally:
        server.end()
