"""Worker processes of a test."""

import psutil


def workers(parent=None):
    """Return the worker processes of a process that run; None: of this one."""
    return [
        each
        for each in psutil.Process(parent).children(recursive=True)
        if "popen_loky" in " ".join(each.cmdline())
    ]
