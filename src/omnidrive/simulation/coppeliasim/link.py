"""A connection to CoppeliaSim through the vendor's client. Needs the extra ``coppeliasim``."""

from __future__ import annotations

import socket
import sys
from importlib import import_module
from math import isfinite, nan
from types import ModuleType
from typing import Any

from omnidrive.errors import InvalidScene, MissingExtra, PlantLost
from omnidrive.files.bounded_file import one_line
from omnidrive.simulation.coppeliasim.bounded_socket import BoundedSocket

_MOST = 2**53  # whole numbers beyond are neither handles nor measurements


class Link:
    """Calls functions of CoppeliaSim's ``sim`` namespace, each within a deadline.

    Attributes:
        usable: Whether it is open, and the simulator owes no answer.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        """Connect.

        Args:
            host: Name or address of the machine.
            port: Of its ZeroMQ remote API server.
            timeout: Longest wait for one answer, in s.

        Raises:
            MissingExtra: The vendor's client is not installed.
            PlantLost: Nobody answers, or not as CoppeliaSim does.
        """
        self._host, self._port, self._timeout = host, port, timeout
        self._client: Any = None
        self._sim: Any = None
        self._module = _vendors_client()
        self.usable = False
        self.open()

    def open(self) -> None:
        """Connect, again where need be: as a new client, to whom nothing is owed.

        A request that was cut short leaves the simulator's side waiting for us; it would take the
        next one for the missing answer.

        Raises:
            PlantLost: As on making one.
        """
        self.close()
        self._refuse_unless_listening()
        zmq = self._module.zmq
        try:
            self._client = _quiet_client(self._module, self._host, self._port)
            self._client.socket.close(linger=0)
            self._client.socket = BoundedSocket(
                zmq,
                self._client.context,
                f"tcp://{self._host}:{self._port}",
                self._module.cbor.loads,
            )
            self._sim = self._bounded("require", self._client.require, "sim")
        except zmq.ZMQError as error:
            self.close()
            raise PlantLost(f"cannot connect to {self.where}: {error}") from None
        except BaseException:
            self.close()
            raise

    def call(self, name: str, *args: Any) -> Any:
        """What ``sim.name(*args)`` returns.

        Raises:
            PlantLost: It does not answer in time, or refuses, or does not know the function.
        """
        return self._bounded(f"sim.{name}", self._member(name), *args)

    def knows(self, name: str) -> bool:
        """Whether there is such a function or constant."""
        return hasattr(self._sim, name)

    def numbers(self, count: int, name: str, *args: Any) -> tuple[float, ...]:
        """``count`` numbers that ``sim.name(*args)`` returns, as a list or, if one, plainly.

        Raises:
            PlantLost: As for :meth:`call`, or it returns something else.
        """
        return self.as_numbers(count, self.call(name, *args), f"sim.{name}")

    def as_numbers(self, count: int, value: Any, source: str) -> tuple[float, ...]:
        """``value`` as so many numbers; what is not finite as NaN.

        Raises:
            PlantLost: It is something else.
        """
        values = value if isinstance(value, list | tuple) else [value]
        if len(values) != count or not all(_is_number(v) for v in values):
            raise PlantLost(
                f"CoppeliaSim at {self.where} answers {source} with {one_line(str(value), 60)}, "
                f"need {'a number' if count == 1 else f'{count} numbers'}"
            )
        return tuple(float(v) if isfinite(v) else nan for v in values)

    def handle(self, path: str, *, joint: bool = False) -> int:
        """The scene's object of that path.

        Raises:
            InvalidScene: There is none, or it is no joint where one is wanted.
            PlantLost: As for :meth:`call`.
        """
        (found,) = self.numbers(1, "getObject", path, {"noError": True})
        if not 0 <= found < _MOST:
            raise InvalidScene(
                f"the scene in CoppeliaSim has no object '{path}': open the robot's scene, or name "
                "its objects in the scenario's section coppeliasim"
            )
        handle = int(found)
        if joint and self.call("getObjectType", handle) != self._member("sceneobject_joint"):
            raise InvalidScene(f"'{path}' in CoppeliaSim's scene is not a joint")
        return handle

    def _member(self, name: str) -> Any:
        if not self.knows(name):
            raise PlantLost(f"CoppeliaSim at {self.where} has no sim.{name}: is it too old?")
        return getattr(self._sim, name)

    @property
    def where(self) -> str:
        """The simulator's address."""
        return f"{self._host}:{self._port}"

    def close(self) -> None:
        """Give up the connection; nothing is said to the simulator."""
        client, self._client, self._sim, self.usable = self._client, None, None, False
        if client is not None:
            client.socket.close(linger=0)
            client.context.term()

    def _bounded(self, what: str, function: Any, *args: Any) -> Any:
        self.usable = False
        self._client.socket.allow(self._timeout)
        try:
            answer = function(*args)
        except PlantLost:
            raise
        except Exception as error:  # the client has no class of its own
            raise PlantLost(
                f"CoppeliaSim at {self.where} refuses {what}: {one_line(str(error), 200)}"
            ) from None
        self.usable = True
        return answer

    def _refuse_unless_listening(self) -> None:
        """Ask the system, as ZeroMQ never says that nobody is there."""
        try:
            socket.create_connection((self._host, self._port), self._timeout).close()
        except OSError as error:
            raise PlantLost(
                f"nobody listens at {self.where} ({error.strerror or error}): start CoppeliaSim, "
                "whose add-on 'ZMQ remote API server' listens on port 23000, or name another host "
                "and port in the scenario's section coppeliasim"
            ) from None


def _is_number(value: Any) -> bool:
    return type(value) is float or (type(value) is int and abs(value) <= _MOST)


def _vendors_client() -> ModuleType:
    """The vendor's client.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return import_module("coppeliasim_zmqremoteapi_client")
    except ImportError as error:
        raise MissingExtra(
            "plant 'coppeliasim' needs CoppeliaSim's client, which is not installed: "
            "pip install 'omnidrive[coppeliasim]', or choose plant 'rollers'"
        ) from error


def _quiet_client(module: ModuleType, host: str, port: int) -> Any:
    """A client that leaves no function `require` in the main program, which would keep it alive."""
    main = vars(sys.modules["__main__"])
    before = {k: main[k] for k in ("require",) if k in main}
    try:
        return module.RemoteAPIClient(host, port, verbose=0)
    finally:
        main.pop("require", None)
        main.update(before)
