"""Socket of the vendor's client with deadlines and validated replies."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from omnidrive.errors import PlantLost
from omnidrive.files.bounded_file import one_line
from omnidrive.simulation.coppeliasim.cbor import MAX_BYTES, is_well_formed

_WAITING = {"_*wait*_", "_*repeat*_"}


class CheckedSocket:
    """A ZeroMQ REQ socket with a deadline, a size limit and validated replies.

    It replaces the socket of the vendor's client, which waits without a limit, accepts replies of
    any size, and calls functions of the main program on the simulator's request.
    """

    def __init__(
        self, zmq: Any, context: Any, endpoint: str, decode: Callable[[bytes], Any]
    ) -> None:
        """Connect in the background; ZeroMQ does not report failures."""
        self.endpoint = endpoint
        self._decode = decode
        self._seconds, self._deadline = 0.0, 0.0
        self._socket = context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_BYTES)
        self._socket.connect(endpoint)

    def set_deadline(self, seconds: float) -> None:
        """Set the duration (s) that the next call may take."""
        self._seconds, self._deadline = seconds, monotonic() + seconds

    def send(self, raw: bytes) -> None:
        """Send a request."""
        self._socket.send(raw)

    def recv(self) -> bytes:
        """Return the reply to the request.

        Raises:
            PlantLost: It is late or invalid.
        """
        left = self._deadline - monotonic()
        if left <= 0.0 or not self._socket.poll(1000.0 * left):
            raise PlantLost(
                f"CoppeliaSim at {self.endpoint} did not reply within {self._seconds:g} s: is it "
                "busy, does it wait in a dialogue, or does another program use that port?"
            )
        raw: bytes = self._socket.recv()
        self._check(raw)
        return raw

    def _check(self, raw: bytes) -> None:
        """Raise PlantLost unless the reply is valid and harmless."""
        try:
            reply = self._decode(raw) if is_well_formed(raw) else None
        except Exception:  # depends on the decoder of the client
            reply = None
        if not isinstance(reply, dict):
            raise PlantLost(f"the program at {self.endpoint} is not CoppeliaSim's remote API")
        if "func" in reply:
            if reply["func"] not in _WAITING:
                name = one_line(str(reply["func"]), 60)
                raise PlantLost(f"{self.endpoint} requests a call of '{name}', which is refused")
        elif "success" in reply or not ("err" in reply or isinstance(reply.get("ret"), list)):
            message = f": {one_line(str(reply['error']), 200)}" if "error" in reply else ""
            raise PlantLost(
                f"CoppeliaSim at {self.endpoint} uses another version of its remote API{message}; "
                "need version 2, of CoppeliaSim 4.6 or newer"
            )

    def close(self, linger: int = 0) -> None:
        """Close the connection."""
        self._socket.close(linger=linger)
