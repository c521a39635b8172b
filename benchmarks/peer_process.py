"""Other libraries, in a process and an environment of their own: a line of JSON in, one out."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

PEER_PYTHON = Path(".venv/peers/bin/python")


class PeersMissing(Exception):
    """The environment of the peers is not there, or a peer in it does not start."""


class PeerProcess:
    """Runs ``benchmarks/SCRIPT``, which answers every line that it reads by one line.

    Raises:
        PeersMissing: There is no environment for it.
    """

    def __init__(self, script: str) -> None:
        if not PEER_PYTHON.exists():
            raise PeersMissing("the peers are not installed")
        path = Path(__file__).with_name(script)
        self._process = subprocess.Popen(
            [PEER_PYTHON, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def tell(self, value: object) -> None:
        """Send a value that has no answer."""
        try:
            self._process.stdin.write(json.dumps(value) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError as error:
            raise PeersMissing("the peers stopped") from error

    def ask(self, value: object) -> Any:
        """Send a value and wait for its answer.

        Raises:
            PeersMissing: The process ended without one; what it said stands on stderr.
        """
        self.tell(value)
        answer = self._process.stdout.readline()
        if not answer:
            raise PeersMissing("the peers stopped")
        return json.loads(answer)

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()
