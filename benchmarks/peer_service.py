"""The peers' side of peer_process.py; runs in their environment and needs nothing installed."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any

READY = "ready?"


def serve(answer: Callable[[Any], Any]) -> None:
    """Answer every request, a line of JSON on stdin, by one on stdout, until there are no more.

    ``answer`` makes the answer from the request; "ready?" is answered here, by "yes".
    """
    answers = os.fdopen(os.dup(1), "w")  # whatever a library prints is no answer
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        reply = "yes" if request == READY else answer(request)
        print(json.dumps(reply), file=answers, flush=True)
