"""Files of the cache: only complete, undamaged ones of a trusted user are read."""

import logging
import os
import subprocess
import sys

import numpy as np
import pytest

from omnidrive.compiled import cache_folder
from omnidrive.compiled.cache_folder import CacheFolder, usable_folder
from tests.compiled.damages import (
    IS_ROOT,
    OTHER_USER,
    fill_with_noise,
    flip_bits,
    give_away,
    open_to_others,
    replace_by_folder,
    replace_by_pipe,
    truncate,
)

LOOSE = "is writable by other users (`chmod go-w` corrects that)"
CONTENT = bytes(range(256)) * 8
needs_root = pytest.mark.skipif(not IS_ROOT, reason="needs root, to change owners")


@pytest.fixture
def folder(tmp_path):
    """A folder with one file."""
    folder = CacheFolder(tmp_path)
    folder.write("a.kernel", CONTENT)
    return folder


def test_file_is_read_as_written(folder):
    assert folder.read("a.kernel") == CONTENT
    assert folder.read("b.kernel") is None
    folder.write("a.kernel", b"")
    assert folder.read("a.kernel") == b""
    assert folder.names("a") == ["a.kernel"]
    folder.remove("a.kernel")
    assert folder.names("") == []


def test_removed_folder_is_made_again(folder):
    (folder.path / "a.kernel").unlink()
    folder.path.rmdir()
    assert folder.read("a.kernel") is None
    folder.write("a.kernel", CONTENT)
    assert folder.read("a.kernel") == CONTENT


def test_no_damaged_file_is_read(folder):
    """120 files, each truncated, with flipped bits or with other bytes."""
    path = folder.path / "a.kernel"
    for seed in range(120):
        folder.write("a.kernel", CONTENT)
        damage = (truncate, flip_bits, fill_with_noise)[seed % 3]
        damage(path, np.random.default_rng(seed))
        assert folder.read("a.kernel") is None, seed


def test_file_of_another_name_is_not_read(folder):
    (folder.path / "a.kernel").rename(folder.path / "b.kernel")
    assert folder.read("b.kernel") is None


def replace_by_link(path, rng):
    path.symlink_to(path.rename(path.with_name("elsewhere")))


def enlarge(path, rng):
    with path.open("ab") as file:
        file.truncate(cache_folder._MAX_BYTES + 1)


@pytest.mark.parametrize(
    ("spoil", "fact"),
    [
        (open_to_others, f"it {LOOSE}"),
        (lambda path, rng: path.chmod(0o664), f"it {LOOSE}"),
        pytest.param(give_away, "it belongs to another user", marks=needs_root),
        (replace_by_pipe, "it is no file"),
        (replace_by_folder, "it is no file"),
        (replace_by_link, "symbolic links"),
        (enlarge, "it is too large"),
    ],
)
def test_untrusted_file_is_refused_and_reported_once(folder, caplog, spoil, fact):
    spoil(folder.path / "a.kernel", None)
    assert folder.read("a.kernel") is None
    assert folder.read("a.kernel") is None
    (record,) = caplog.records
    assert fact in record.message
    assert record.message.startswith(f"a compiled kernel in {folder.path} cannot be read (")


def test_messages_of_workers_are_logged_once(folder, caplog):
    logger = logging.getLogger(cache_folder._log.name)
    for _ in range(3):
        logger.handle(logger.makeRecord(logger.name, logging.WARNING, "", 0, "damaged", (), None))
    assert len(caplog.records) == 1


@pytest.fixture
def usable(monkeypatch, tmp_path, new_process):
    """Return a function that chooses the folder for a value of NUMBA_CACHE_DIR."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def choose(chosen):
        monkeypatch.setattr(cache_folder._config, "CACHE_DIR", str(chosen))
        new_process()
        return usable_folder()

    return choose


def loose(path):
    path.mkdir()
    path.chmod(0o777)


def of_another_user(path):
    path.mkdir()
    os.chown(path, OTHER_USER, -1)


@pytest.mark.parametrize(
    ("spoil", "fact"),
    [
        (loose, LOOSE),
        pytest.param(of_another_user, "belongs to another user", marks=needs_root),
        (lambda path: path.write_text(""), "cannot be used: File exists"),
    ],
)
def test_untrusted_folder_is_not_used(usable, tmp_path, caplog, spoil, fact):
    path = tmp_path / "omnidrive-kernels"
    spoil(path)
    assert usable(tmp_path) is None
    (record,) = caplog.records
    assert record.message == (
        f"compiled kernels are not kept: the folder {path} {fact}; the environment variable "
        "NUMBA_CACHE_DIR chooses another folder"
    )
    assert cache_folder.failures == [record.message]


def test_new_folder_is_trusted_for_every_umask(usable, tmp_path):
    before = os.umask(0)
    try:
        assert usable(tmp_path / "new" / "folder") is not None
    finally:
        os.umask(before)
    assert (tmp_path / "new" / "folder" / "omnidrive-kernels").stat().st_mode & 0o777 == 0o755


def test_package_that_cannot_be_written_leaves_the_home_folder(usable, tmp_path, monkeypatch):
    monkeypatch.setattr(cache_folder.os, "access", lambda *_: False)
    assert usable("").path == tmp_path / "home" / ".cache" / "omnidrive" / "kernels"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    assert usable("").path == tmp_path / "caches" / "omnidrive" / "kernels"


def test_absent_home_means_no_folder(usable, monkeypatch, caplog):
    monkeypatch.setattr(cache_folder.os, "access", lambda *_: False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert usable("") is None
    assert "there is no home folder" in caplog.records[0].message


def test_unused_files_are_removed(folder, monkeypatch):
    monkeypatch.setattr(cache_folder, "_MAX_FILES", 4)
    folder.remove("a.kernel")
    names = {"0.kernel": 1, "1.kernel": 2, "2.nbc": 3, "3.kernel": 4, "4.kernel": 61, "5.tmp": 1.5}
    for name, days in names.items():
        path = folder.path / name
        path.write_text("")
        then = cache_folder.time.time() - days * cache_folder._DAY
        os.utime(path, (then, then))
    CacheFolder(folder.path).write("new.kernel", b"")
    assert folder.names("") == ["0.kernel", "1.kernel", "new.kernel"]
    assert len(list(folder.path.iterdir())) == 3


LOCKING = """
import sys
from pathlib import Path
from omnidrive.compiled.cache_folder import CacheFolder
with CacheFolder(Path(sys.argv[1])).locked("a.kernel"):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_lock_is_waited_for_but_not_without_end(folder, monkeypatch):
    """The other process is stopped, as by SIGSTOP, while it holds the lock."""
    monkeypatch.setattr(cache_folder, "_MAX_WAIT", 0.1)
    command = [sys.executable, "-c", LOCKING, str(folder.path)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout.readline() == "held\n"
        began = cache_folder.time.monotonic()
        with folder.locked("a.kernel"):
            assert cache_folder.time.monotonic() - began >= 0.1
        began = cache_folder.time.monotonic()
        with folder.locked("b.kernel"):
            assert cache_folder.time.monotonic() - began < 0.1
        other.communicate("")


def test_cleared_folder_is_removed_with_all_that_omnidrive_wrote(folder):
    folder.write("a.kernel", b"1")
    folder.write("b.kernel", b"2")
    (folder.path / "c.kernel.0.tmp").write_bytes(b"unfinished")
    with folder.locked("a.kernel"):
        pass
    assert folder.clear() == 2
    assert not folder.path.exists()
    assert folder.clear() == 0


def test_other_files_of_a_cleared_folder_are_kept(folder):
    folder.write("a.kernel", b"1")
    (folder.path / "mine.txt").write_text("kept")
    assert folder.clear() == 1
    assert [each.name for each in folder.path.iterdir()] == ["mine.txt"]
