"""Simulated power failures: which contents a file may have afterwards.

The calls of ``os.fsync`` and ``os.replace`` are recorded. After a power failure at any time, a disk
has of every file what was there when it was last synchronised, and of every folder the names of
that time; everything after that may be there or not, in any combination.
"""

from __future__ import annotations

import os
import stat
from contextlib import contextmanager
from itertools import product
from typing import NamedTuple

TORN = "torn"
"""Content of a file that was not synchronised since it was last written."""


class Sync(NamedTuple):
    """Synchronisation of a file (its content) or a folder (None), by number of its inode."""

    inode: int
    content: bytes | None


class Rename(NamedTuple):
    """A file gets a name in a folder."""

    inode: int
    folder: int
    name: str


@contextmanager
def recorded_disk(monkeypatch):
    """Yield the list of events, which grows in the block."""
    events = []
    fsync, replace = os.fsync, os.replace

    def recorded_fsync(descriptor):
        """Record and call os.fsync."""
        status = os.fstat(descriptor)
        is_folder = stat.S_ISDIR(status.st_mode)
        content = None if is_folder else os.pread(descriptor, status.st_size, 0)
        fsync(descriptor)
        events.append(Sync(status.st_ino, content))

    def recorded_replace(source, target):
        """Record and call os.replace."""
        inode, folder = os.stat(source).st_ino, os.stat(os.path.dirname(target) or ".").st_ino
        replace(source, target)
        events.append(Rename(inode, folder, os.path.basename(target)))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", recorded_fsync)
        patch.setattr(os, "replace", recorded_replace)
        yield events


def contents_after_failure(events, name, before):
    """Return what a file may contain after a power failure.

    Args:
        events: Recorded events.
        name: Name of the file.
        before: Its content before the events; None: it does not exist.

    Returns:
        The contents after a failure at any time, and after one behind the last event.
    """
    states = [_states(events[:count], name, before) for count in range(len(events) + 1)]
    return set().union(*states), states[-1]


def _states(events, name, before):
    """Return the possible contents of a file after a failure behind the given events."""
    content = {e.inode: e.content for e in events if isinstance(e, Sync) and e.content is not None}
    certain, possible = before, []
    for event in events:
        if isinstance(event, Rename) and event.name == name:
            possible.append(event)
        elif isinstance(event, Sync) and event.content is None:
            for each in [each for each in possible if each.folder == event.inode]:
                certain = content.get(each.inode, TORN)
                possible.remove(each)
    found = set()
    for kept in product((False, True), repeat=len(possible)):
        state = certain
        for rename, is_there in zip(possible, kept, strict=True):
            state = content.get(rename.inode, TORN) if is_there else state
        found.add(state)
    return found
