"""The socket under the vendor's client: answers come in time and are bounded, or not at all."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from omnidrive.errors import PlantLost
from omnidrive.files.bounded_file import one_line
from omnidrive.simulation.coppeliasim.replies import MAX_BYTES, is_plain

_WAITING = {"_*wait*_", "_*repeat*_"}


class BoundedSocket:
    """A ZeroMQ REQ socket with a deadline.

    The vendor's client waits for ever, takes replies of any size, and calls what functions of the
    main program the simulator names. It sends and receives here instead.
    """

    def __init__(
        self, zmq: Any, context: Any, endpoint: str, decode: Callable[[bytes], Any]
    ) -> None:
        """Connect; ZeroMQ does so in the background, and never says that it failed."""
        self.endpoint = endpoint
        self._decode = decode
        self._seconds, self._deadline = 0.0, 0.0
        self._socket = context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_BYTES)
        self._socket.connect(endpoint)

    def allow(self, seconds: float) -> None:
        """Let the next call take so long, in s."""
        self._seconds, self._deadline = seconds, monotonic() + seconds

    def send(self, raw: bytes) -> None:
        """Send a request."""
        self._socket.send(raw)

    def recv(self) -> bytes:
        """The reply to it.

        Raises:
            PlantLost: It did not come in time, or is none.
        """
        left = self._deadline - monotonic()
        if left <= 0.0 or not self._socket.poll(1000.0 * left):
            raise PlantLost(
                f"CoppeliaSim at {self.endpoint} did not answer within {self._seconds:g} s: is it "
                "busy, waiting in a dialogue, or another program on that port?"
            )
        raw: bytes = self._socket.recv()
        self._check(raw)
        return raw

    def _check(self, raw: bytes) -> None:
        """Refuse what the client should not see."""
        try:
            reply = self._decode(raw) if is_plain(raw) else None
        except Exception:  # of whatever decoder the client has
            reply = None
        if not isinstance(reply, dict):
            raise PlantLost(f"what answers at {self.endpoint} is not CoppeliaSim's remote API")
        if "func" in reply:
            if reply["func"] not in _WAITING:
                name = one_line(str(reply["func"]), 60)
                raise PlantLost(f"{self.endpoint} asks to call '{name}' here, which is refused")
        elif "success" in reply or not ("err" in reply or isinstance(reply.get("ret"), list)):
            said = f": {one_line(str(reply['error']), 200)}" if "error" in reply else ""
            raise PlantLost(
                f"CoppeliaSim at {self.endpoint} speaks another version of its remote API{said}; "
                "need version 2, of CoppeliaSim 4.6 or newer"
            )

    def close(self, linger: int = 0) -> None:
        """Give up the connection."""
        self._socket.close(linger=linger)
