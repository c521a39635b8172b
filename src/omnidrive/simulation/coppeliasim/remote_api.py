"""Connection to CoppeliaSim through the vendor's client; needs the extra ``coppeliasim``."""

from __future__ import annotations

import sys
from importlib import import_module
from math import isfinite, nan
from types import ModuleType
from typing import Any

from omnidrive.errors import InvalidScene, MissingExtra, PlantLost, one_line
from omnidrive.simulation.coppeliasim.checked_socket import CheckedSocket

_MAX_INTEGER = 2**53  # larger integers are neither handles nor measurements


class RemoteApi:
    """Calls of functions of CoppeliaSim's ``sim`` namespace, each with a deadline.

    Attributes:
        usable: Whether the connection is open and no reply is outstanding.
    """

    def __init__(self, host: str, port: int, timeout: float) -> None:
        """Connect.

        Args:
            host: Name or address of the machine.
            port: Port of its ZeroMQ remote API server.
            timeout: Longest wait for one reply, s.

        Raises:
            MissingExtra: The vendor's client is not installed.
            PlantLost: There is no reply, or no valid one.
        """
        self._host, self._port, self._timeout = host, port, timeout
        self._client: Any = None
        self._sim: Any = None
        self._module = _import_client()
        self.usable = False
        self.open()

    def open(self) -> None:
        """Connect or reconnect, as a new client without outstanding requests.

        After an interrupted request the simulator still waits for the old client, and would take
        its next request for the missing message.

        Raises:
            PlantLost: There is no reply, or no valid one.
        """
        self.close()
        connection = CheckedSocket(self._host, self._port, self._timeout, self._module.cbor.loads)
        self._client = _make_client(self._module)
        self._client.socket.close(linger=0)
        self._client.socket = connection
        try:
            self._sim = self._call("require", self._client.require, "sim")
        except BaseException:
            self.close()
            raise

    def call(self, name: str, *args: Any) -> Any:
        """Return the value of ``sim.name(*args)``.

        Raises:
            PlantLost: The reply is late or an error, or the function does not exist.
        """
        return self._call(f"sim.{name}", self._member(name), *args)

    def has_member(self, name: str) -> bool:
        """Return whether ``sim`` has this function or constant."""
        return hasattr(self._sim, name)

    def numbers(self, count: int, name: str, *args: Any) -> tuple[float, ...]:
        """Return the ``count`` numbers of ``sim.name(*args)``; a single one needs no list.

        Raises:
            PlantLost: As for :meth:`call`, or the value is something else.
        """
        return self.as_numbers(count, self.call(name, *args), f"sim.{name}")

    def as_numbers(self, count: int, value: Any, source: str) -> tuple[float, ...]:
        """Convert ``value`` to ``count`` numbers; values that are not finite become NaN.

        Raises:
            PlantLost: ``value`` is something else.
        """
        values = value if isinstance(value, list | tuple) else [value]
        if len(values) != count or not all(_is_number(v) for v in values):
            raise PlantLost(
                f"CoppeliaSim at {self.address} returns {one_line(str(value), 60)} for {source}, "
                f"need {'a number' if count == 1 else f'{count} numbers'}"
            )
        return tuple(float(v) if isfinite(v) else nan for v in values)

    def handle(self, path: str, *, joint: bool = False) -> int:
        """Return the handle of the scene's object with this path.

        Raises:
            InvalidScene: There is none, or ``joint`` is set and it is not a joint.
            PlantLost: As for :meth:`call`.
        """
        (found,) = self.numbers(1, "getObject", path, {"noError": True})
        if not 0 <= found < _MAX_INTEGER:
            raise InvalidScene(
                f"the scene in CoppeliaSim has no object '{path}': open the robot's scene, or name "
                "its objects in the parameters of the scenario's plant"
            )
        handle = int(found)
        if joint and self.call("getObjectType", handle) != self._member("sceneobject_joint"):
            raise InvalidScene(f"'{path}' in CoppeliaSim's scene is not a joint")
        return handle

    def _member(self, name: str) -> Any:
        if not self.has_member(name):
            raise PlantLost(f"CoppeliaSim at {self.address} has no sim.{name}: is it too old?")
        return getattr(self._sim, name)

    @property
    def address(self) -> str:
        """Host and port."""
        return f"{self._host}:{self._port}"

    def close(self) -> None:
        """Close the connection without a message to the simulator."""
        client, self._client, self._sim, self.usable = self._client, None, None, False
        if client is not None:
            client.socket.close(linger=0)
            client.context.term()

    def _call(self, request: str, function: Any, *args: Any) -> Any:
        self.usable = False
        self._client.socket.set_deadline(self._timeout)
        try:
            value = function(*args)
        except PlantLost:
            raise
        except Exception as error:  # the client raises no class of its own
            raise PlantLost(
                f"CoppeliaSim at {self.address} refuses {request}: {one_line(str(error), 200)}"
            ) from None
        self.usable = True
        return value


def _is_number(value: Any) -> bool:
    return type(value) is float or (type(value) is int and abs(value) <= _MAX_INTEGER)


def _import_client() -> ModuleType:
    """Import the vendor's client.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return import_module("coppeliasim_zmqremoteapi_client")
    except ImportError as error:
        raise MissingExtra(
            "plant 'coppeliasim' needs CoppeliaSim's client, which is not installed: "
            "pip install coppeliasim-zmqremoteapi-client, or choose plant 'mujoco-rollers'"
        ) from error


def _make_client(module: ModuleType) -> Any:
    """Create a client and remove its global function `require`, which would keep it alive.

    Its own socket is replaced, and must not reach the simulator: it has no limits.
    """
    main = vars(sys.modules["__main__"])
    before = {k: main[k] for k in ("require",) if k in main}
    try:
        return module.RemoteAPIClient("127.0.0.1", 9, verbose=0)  # port 9 discards what it receives
    finally:
        main.pop("require", None)
        main.update(before)
