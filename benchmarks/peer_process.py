"""Other libraries, in a process and an environment of their own: a line of JSON in, one out."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from figures import console
from peer_service import READY

PEER_PYTHON = Path(".venv/peers/bin/python")


class PeersMissing(Exception):
    """The environment of the peers is not there, or a peer in it does not start."""


class PeerProcess:
    """Runs ``benchmarks/BENCHMARK_peers.py``, which serves requests (see peer_service.py).

    Raises:
        PeersMissing: There is no environment for it, or it does not start; what it said stands on
            stderr, and the message says how to install it.
    """

    def __init__(self, benchmark: str) -> None:
        self._install = f"make bench-{benchmark} installs them"
        if not PEER_PYTHON.exists():
            raise PeersMissing(f"the peers are not installed; {self._install}")
        path = Path(__file__).with_name(f"{benchmark}_peers.py")
        self._process = subprocess.Popen(
            [PEER_PYTHON, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.ask(READY)

    @classmethod
    def if_there(cls, benchmark: str) -> PeerProcess | None:
        """The peers, or a line that says why not."""
        try:
            return cls(benchmark)
        except PeersMissing as error:
            console.print(f"Without peers: {error}.")
            return None

    def ask(self, request: object) -> Any:
        """Send a request and wait for its answer.

        Raises:
            PeersMissing: The process ended without one; what it said stands on stderr.
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
