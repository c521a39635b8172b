"""Python in a process of its own, which finds a further distribution."""

import os
import subprocess
import sys


def environment_with(folder):
    """Return environment variables with which Python finds the distributions in a folder."""
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "200"}


def run_python(environment, cwd, *arguments):
    """Run Python with some arguments, and return its exit status and output."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=environment, cwd=cwd, capture_output=True, text=True, check=False,
    )  # fmt: skip
