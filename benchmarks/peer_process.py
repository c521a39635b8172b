"""Client of a process with other libraries in a separate environment; one JSON line per message."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from figures import console
from peer_service import READY

PEER_PYTHON = Path(".venv/peers/bin/python")


class PeersMissing(Exception):
    """The environment of the peer libraries does not exist, or a library in it cannot be loaded."""


class PeerProcess:
    """A process that runs ``benchmarks/BENCHMARK_peers.py`` (see peer_service.py).

    Raises:
        PeersMissing: The environment does not exist, or the process does not start. Its errors are
            on stderr; the message describes the installation.
    """

    def __init__(self, benchmark: str) -> None:
        self._install = f"make bench-{benchmark} installs them"
        if not PEER_PYTHON.exists():
            raise PeersMissing(f"the peers are not installed; {self._install}")
        path = Path(__file__).with_name(f"{benchmark}_peers.py")
        self._process = subprocess.Popen(
            [PEER_PYTHON, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.request(READY)

    @classmethod
    def if_available(cls, benchmark: str) -> PeerProcess | None:
        """Return the process, or print the reason and return None."""
        try:
            return cls(benchmark)
        except PeersMissing as error:
            console.print(f"Without peers: {error}.")
            return None

    def request(self, request: object) -> Any:
        """Send a request and wait for the reply.

        Raises:
            PeersMissing: The process ended without a reply; its errors are on stderr.
        """
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            raise PeersMissing(f"the peers stopped; {self._install}")
        return json.loads(answer)

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()
