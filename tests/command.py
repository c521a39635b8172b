"""The command line in a separate process."""

import os
import subprocess
import sys


def omnidrive(*args, cwd, **env):
    """Run `omnidrive` with arguments and further environment variables; return its output."""
    return subprocess.run(
        [sys.executable, "-m", "omnidrive", *map(str, args)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "COLUMNS": "200", **env},
    )
