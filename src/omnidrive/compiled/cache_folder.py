"""Folder of cached machine code, whose files are complete, undamaged and of a trusted user.

Loading a file executes what it contains. So a file counts only if

* the file and the folder belong to the user or to root, and no other user may write to them;
* the checksum at its start is that of its name and its content.

The checksum detects damage. Against forgery, the owner and the permissions are checked. Without a
usable folder, kernels are compiled in memory; that, and every kind of damage, is logged once.
"""

from __future__ import annotations

import logging
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Any
from uuid import uuid4

from numba import config

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_log = logging.getLogger("omnidrive.compiled.cache")
_config: Any = config  # it has no types
_choosing = Lock()  # of Numba's cache folder, which is a setting of the process

_NUMBA_FILE = ".numba_config.yaml"
_OF_FILE = "" if "NUMBA_CACHE_DIR" in os.environ else _config.CACHE_DIR

_DAY = 86400.0
_MAX_UNUSED_DAYS, _MAX_FILES = 60, 4000
_MAX_BYTES = 100_000_000  # of a file
_CHECKSUM_BYTES = 32
_MODE = 0o755  # of the folder
_LOCK = "lock"  # name of the file of which each name locks one byte
_MAX_WAIT = 120.0  # s; for another process that holds a lock, which may be stopped
_POLLING = 0.02  # s
_BINARY = getattr(os, "O_BINARY", 0)  # Windows
_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | _BINARY
_CREATE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY

SUFFIX = ".kernel"
"""Suffix of complete files."""
failures: list[str] = []
"""Why compiled kernels of this process were not kept; empty: all were."""


class CacheFolder:
    """Files by name in one folder.

    Args:
        path: The folder; it exists and is trusted, see :func:`usable_folder`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._is_tidy = False

    def read(self, name: str) -> bytes | None:
        """Return the content of a file; None: it is absent, unreadable, damaged or not trusted."""
        try:
            stored = _read(self.path / name)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            fact = f"cannot be read ({error.strerror or error})"
        else:
            checksum, content = stored[:_CHECKSUM_BYTES], stored[_CHECKSUM_BYTES:]
            if checksum == _checksum(name, content):
                return content
            fact = "is damaged"
        _log.warning("a compiled kernel in %s %s; it is compiled again", self.path, fact)
        return None

    def write(self, name: str, content: bytes) -> None:
        """Write a file; other processes find the former file or the complete new one."""
        path = self.path / name
        unfinished = self.path / f"{name}.{uuid4().hex[:16]}.tmp"
        try:
            self.path.mkdir(mode=_MODE, parents=True, exist_ok=True)  # removed in the meantime
            with os.fdopen(os.open(unfinished, _CREATE, 0o644), "wb") as file:
                file.write(_checksum(name, content) + content)
            unfinished.replace(path)
        except OSError as error:
            _fail(f"{self.path}: {error.strerror or error}")
        finally:
            self.remove(unfinished.name)
        self._remove_unused()

    def mark_used(self, name: str) -> None:
        """Set the modification time of a file to now, at most once a day."""
        path = self.path / name
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > _DAY:
                os.utime(path)

    def names(self, start: str) -> list[str]:
        """Return the names of the complete files that begin with ``start``."""
        try:
            found = os.listdir(self.path)
        except OSError:
            return []
        return sorted(n for n in found if n.startswith(start) and n.endswith(SUFFIX))

    def remove(self, name: str) -> None:
        """Remove a file if it exists."""
        with suppress(OSError):
            (self.path / name).unlink(missing_ok=True)

    def clear(self) -> int:
        """Remove all compiled kernels, and the folder if it is empty then; return their number."""
        found = self.names("")
        with suppress(OSError):
            for name in [*found, *(each.name for each in self.path.glob("*.tmp")), _LOCK]:
                self.remove(name)
            self.path.rmdir()
        return len(found)

    @contextmanager
    def locked(self, name: str) -> Iterator[None]:
        """Wait until no other process holds the lock of a name, and hold it.

        After two minutes, or without locks on the file system, continue without it.
        """
        at = int.from_bytes(_checksum(name, b"")[:3], "big")
        deadline = time.monotonic() + _MAX_WAIT
        is_held = False
        while self._lock_file is not None and not is_held and time.monotonic() < deadline:
            try:
                fcntl.lockf(self._lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, at)
                is_held = True
            except BlockingIOError:  # another process holds it
                time.sleep(_POLLING)
            except OSError:
                break
        try:
            yield
        finally:
            if is_held:
                with suppress(OSError):
                    fcntl.lockf(self._lock_file, fcntl.LOCK_UN, 1, at)

    @cached_property
    def _lock_file(self) -> int | None:
        """Descriptor of the lock file; None: there is none."""
        if fcntl is None:
            return None
        try:
            return os.open(self.path / _LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        except OSError:
            return None

    def _remove_unused(self) -> None:
        """Remove files unused for 60 days, the oldest beyond 4000, and unfinished ones of a day.

        It does so once per process.
        """
        if self._is_tidy:
            return
        self._is_tidy = True
        ages: list[tuple[float, Path]] = []
        with suppress(OSError):
            for path in self.path.iterdir():
                if path.name != _LOCK:
                    ages.append((time.time() - path.lstat().st_mtime, path))
        for number, (age, path) in enumerate(sorted(ages)):
            days = 1 if path.suffix == ".tmp" else _MAX_UNUSED_DAYS
            if age > days * _DAY or number >= _MAX_FILES:
                self.remove(path.name)


def usable_folder() -> CacheFolder | None:
    """Return the folder of compiled kernels; None: there is none that can be used.

    It is a subfolder of NUMBA_CACHE_DIR if that is set; otherwise it is beside this file if
    that can be written, or in ~/.cache. A folder that others may write is not used. If there is
    none, :data:`failures` holds the reason.

    Numba also reads a file of the working folder, which may be somebody else's: it does not choose
    the folder.
    """
    with _choosing:
        chosen = _config.CACHE_DIR
    if os.environ.get("NUMBA_CACHE_DIR") != chosen and (
        chosen == _OF_FILE or os.path.isfile(_NUMBA_FILE)
    ):
        chosen = ""
    return _first_usable(chosen)


@contextmanager
def numba_folder(path: Path) -> Iterator[None]:
    """Let Numba's own cache of the functions that enable it in the block be in a folder."""
    with _choosing:
        chosen, _config.CACHE_DIR = _config.CACHE_DIR, str(path)
        try:
            yield
        finally:
            _config.CACHE_DIR = chosen


@cache
def _first_usable(chosen: str) -> CacheFolder | None:
    reason = "there is no home folder"
    for path in _candidates(chosen):
        try:
            path.mkdir(mode=_MODE, parents=True, exist_ok=True)
            fault = _distrust(path.stat())
        except OSError as error:
            fault = f"cannot be used: {error.strerror or error}"
        if not fault:
            return CacheFolder(path)
        reason = f"the folder {path} {fault}"
    _fail(reason)
    return None


def _candidates(chosen: str) -> Iterator[Path]:
    if chosen:
        yield Path(chosen) / "omnidrive-kernels"
        return
    package = Path(__file__).parent
    if os.access(package, os.W_OK):
        yield package / "__pycache__" / "kernels"
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    if home.is_absolute():
        yield home / "omnidrive" / "kernels"


def _read(path: Path) -> bytes:
    """Return the bytes of a trusted file.

    Raises:
        OSError: It is no regular file, too large, not trusted, or cannot be read.
    """
    descriptor = os.open(path, _READ)
    try:
        status = os.fstat(descriptor)
        fault = _distrust(status)
        if not stat.S_ISREG(status.st_mode):
            fault = "is no file"
        elif status.st_size > _MAX_BYTES:
            fault = "is too large"
        if fault:
            raise OSError(f"it {fault}")
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read(_MAX_BYTES)
    finally:
        os.close(descriptor)


def _distrust(status: os.stat_result) -> str:
    """Return why a file or folder is not trusted; empty if it is."""
    if not hasattr(os, "geteuid"):  # Windows
        return ""
    if status.st_uid not in {0, os.geteuid()}:
        return "belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "is writable by other users (`chmod go-w` corrects that)"
    return ""


def _checksum(name: str, content: bytes) -> bytes:
    digest = sha256(name.encode() + b"\0")
    digest.update(content)
    return digest.digest()


def _fail(reason: str) -> None:
    message = (
        f"compiled kernels are not kept: {reason}; the environment variable NUMBA_CACHE_DIR "
        "chooses another folder"
    )
    if message not in failures:
        failures.append(message)
    _log.warning(message)


class _Once(logging.Filter):
    """Passes each message once, also if several worker processes log it."""

    def __init__(self) -> None:
        super().__init__()
        self.passed: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the message is new."""
        text = record.getMessage()
        is_new = text not in self.passed
        self.passed.add(text)
        return is_new


_once = _Once()
_log.addFilter(_once)
