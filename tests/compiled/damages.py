"""Damages to a compiled kernel or to the folder of the cache; ``rng`` chooses how."""

import os
import resource
import shutil
from contextlib import contextmanager

import pytest

from omnidrive.compiled import cache_folder

OTHER_USER = 65534
IS_ROOT = os.geteuid() == 0


def truncate(path, rng):
    path.write_bytes(path.read_bytes()[: rng.integers(path.stat().st_size)])


def flip_bits(path, rng):
    content = bytearray(path.read_bytes())
    for at in rng.integers(len(content), size=rng.integers(1, 9)):
        content[at] ^= 1 << rng.integers(8)
    path.write_bytes(content)


def fill_with_noise(path, rng):
    path.write_bytes(rng.bytes(int(rng.integers(20_000))))


def replace_by_pipe(path, rng):
    path.unlink()
    os.mkfifo(path)


def replace_by_folder(path, rng):
    path.unlink()
    path.mkdir()


def replace_by_other_kernel(path, rng):
    others = [each for each in path.parent.glob("*.kernel") if each != path]
    shutil.copy(others[rng.integers(len(others))], path)


def open_to_others(path, rng):
    path.chmod(0o666)


def give_away(path, rng):
    os.chown(path, OTHER_USER, -1)


def remove(path, rng):
    path.unlink()


def remove_folder(path, rng):
    shutil.rmtree(path.parent)


def replace_folder_by_file(path, rng):
    shutil.rmtree(path.parent)
    path.parent.write_text("")


def open_folder_to_others(path, rng):
    path.parent.chmod(0o777)


def give_folder_away(path, rng):
    os.chown(path.parent, OTHER_USER, -1)


FILE_DAMAGES = [truncate, flip_bits, fill_with_noise, replace_by_pipe, replace_by_other_kernel,
                open_to_others, *([give_away] if IS_ROOT else [])]  # fmt: skip
"""Damages that are reported, and mended by replacing the file."""
OTHER_DAMAGES = [remove, remove_folder, replace_by_folder, replace_folder_by_file,
                 open_folder_to_others, *([give_folder_away] if IS_ROOT else [])]  # fmt: skip


@contextmanager
def full_disk(folder, rng):
    """Limit new files to a random size, smaller than every entry."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(rng.integers(4096)), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextmanager
def as_other_user():
    """Take the permissions of root; other users have nothing to take."""
    if IS_ROOT:
        os.seteuid(OTHER_USER)
    try:
        yield
    finally:
        if IS_ROOT:
            os.seteuid(0)


@contextmanager
def read_only(folder, rng):
    """Take the permission to write to the folder."""
    folder.chmod(0o555)
    try:
        with as_other_user():
            yield
    finally:
        folder.chmod(0o755)


@contextmanager
def unreachable(folder, rng):
    """Take the permission to enter the folder above."""
    folder.parent.chmod(0o000)
    try:
        with as_other_user():
            yield
    finally:
        folder.parent.chmod(0o755)


@contextmanager
def no_home(folder, rng):
    """Let the user have no home folder, and the package be read-only."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cache_folder._config, "CACHE_DIR", "")
        patch.setattr(cache_folder.os, "access", lambda *_: False)
        patch.setattr(os.path, "expanduser", lambda path: path)
        patch.delenv("XDG_CACHE_HOME", raising=False)
        yield


LIMITS = [full_disk, read_only, unreachable, no_home]
