"""Server of peer_process.py, in the environment of the peers; uses the standard library only."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any

READY = "ready?"


def serve(answer: Callable[[Any], Any]) -> None:
    """Reply to every request (one JSON line on stdin) with one JSON line on stdout.

    ``answer`` computes the reply to a request; "ready?" is replied to with "yes".
    """
    answers = os.fdopen(os.dup(1), "w")  # redirect the output of libraries to stderr
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        reply = "yes" if request == READY else answer(request)
        print(json.dumps(reply), file=answers, flush=True)
