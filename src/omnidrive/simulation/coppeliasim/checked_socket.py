"""Socket of the vendor's client with deadlines and validated replies."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

from omnidrive.errors import PlantLost, one_line
from omnidrive.simulation.coppeliasim.cbor import MAX_BYTES, is_harmless
from omnidrive.simulation.coppeliasim.request_socket import InvalidReply, RequestSocket

_WAITING = {"_*wait*_", "_*repeat*_"}


class CheckedSocket:
    """A connection to CoppeliaSim with a deadline, size limits and validated replies.

    It replaces the socket of the vendor's client, which waits without a limit, accepts replies of
    any size, and calls functions of the main program on the simulator's request.
    """

    def __init__(
        self, host: str, port: int, timeout: float, decode: Callable[[bytes], Any]
    ) -> None:
        """Connect.

        Args:
            host: Name or address of the machine.
            port: Port of its ZeroMQ remote API server.
            timeout: Longest wait for the connection, s.
            decode: Decoder of CBOR.

        Raises:
            PlantLost: No program listens there.
        """
        self.address = f"{host}:{port}"
        self._decode = decode
        self._seconds = timeout
        try:
            self._socket = RequestSocket(host, port, timeout, MAX_BYTES)
        except OSError as error:
            raise PlantLost(
                f"no program listens at {self.address} ({error.strerror or error}): start "
                "CoppeliaSim, whose add-on 'ZMQ remote API server' listens on port 23000, or name "
                "another host and port in the parameters of the scenario's plant"
            ) from None

    def set_deadline(self, seconds: float) -> None:
        """Set the duration (s) that the next call may take."""
        self._seconds, self._socket.deadline = seconds, monotonic() + seconds

    def send(self, raw: bytes) -> None:
        """Send a request.

        Raises:
            PlantLost: The deadline has passed, or the connection is lost.
        """
        with self._reported():
            self._socket.send(raw)

    def recv(self) -> bytes:
        """Return the reply to the request.

        Raises:
            PlantLost: It is late or invalid, or the connection is lost.
        """
        with self._reported():
            raw = self._socket.receive()
        self._check(raw)
        return raw

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Raise errors of the connection as PlantLost."""
        try:
            yield
        except TimeoutError:
            raise PlantLost(
                f"CoppeliaSim at {self.address} did not reply within {self._seconds:g} s: is it "
                "busy, does it wait in a dialogue, or does another program use that port?"
            ) from None
        except InvalidReply as error:
            raise PlantLost(
                f"the program at {self.address} is not CoppeliaSim's remote API: {error}"
            ) from None
        except OSError as error:
            raise PlantLost(
                f"the connection to {self.address} is lost: {error.strerror or error}"
            ) from None

    def _check(self, raw: bytes) -> None:
        """Raise PlantLost unless the reply is valid and harmless."""
        try:
            reply = self._decode(raw) if is_harmless(raw) else None
        except Exception:  # depends on the decoder of the client
            reply = None
        if not isinstance(reply, dict):
            raise PlantLost(f"the program at {self.address} is not CoppeliaSim's remote API")
        if "func" in reply:
            name = str(reply["func"])
            if name not in _WAITING:
                raise PlantLost(
                    f"{self.address} requests a call of '{one_line(name, 60)}', which is refused"
                )
        elif "success" in reply or not ("err" in reply or isinstance(reply.get("ret"), list)):
            message = f": {one_line(str(reply['error']), 200)}" if "error" in reply else ""
            raise PlantLost(
                f"CoppeliaSim at {self.address} uses another version of its remote API{message}; "
                "need version 2, of CoppeliaSim 4.6 or newer"
            )

    def close(self, linger: int = 0) -> None:
        """Close the connection; ``linger`` is an argument of the vendor's client, without use."""
        self._socket.close()
