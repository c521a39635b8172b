"""The independent peer as a process, and domains of the tests."""

import itertools
import json
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

_numbers = itertools.count(os.getpid() * 17)


def new_domain():
    """A domain that no other test of this process uses."""
    return 1 + next(_numbers) % 231


class PeerProcess:
    def __init__(self, process):
        self.process = process

    def room(self):
        self.process.stdin.write("room\n")
        self.process.stdin.flush()

    def report(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


@contextmanager
def running_peer(domain, distribution="jazzy"):
    path = Path(__file__).with_name("peer.py")
    with subprocess.Popen(
        [sys.executable, path, str(domain), distribution],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout.readline() == "ready\n"
            yield PeerProcess(process)
        finally:
            process.kill()
