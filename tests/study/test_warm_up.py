"""Compilation of every kernel in advance."""

import sys

import pytest

from omnidrive.compiled import cache_folder
from omnidrive.errors import CannotWrite, RunFailed
from omnidrive.execution.worker_pool import Lost, WorkerPool
from omnidrive.study import warm_up
from omnidrive.study.progress import NullProgress


class Log(NullProgress):
    def __init__(self):
        self.parts, self.finished = [], []

    def part(self, name, steps):
        self.parts.append((name, steps))

    def done(self, what):
        self.finished.append(what)


@pytest.fixture
def compiled_parts(monkeypatch, tmp_path):
    """Replace the compilation of a part; return the parts, and a list of failures to fill."""
    parts, failures = [], []

    def compile_part(part):
        parts.append(part.name)
        return failures

    monkeypatch.setattr(sys.modules[warm_up.__module__], "_compile_part", compile_part)
    monkeypatch.setattr(cache_folder._config, "CACHE_DIR", str(tmp_path))
    yield parts, failures
    cache_folder._first_usable.cache_clear()


def test_each_part_is_a_step_of_the_progress(compiled_parts):
    log = Log()
    warm_up(log)
    parts, _ = compiled_parts
    assert log.parts == [("warm up", len(parts))]
    assert log.finished == parts
    assert len(set(parts)) == len(parts)


def test_kernels_that_cannot_be_kept_end_it(compiled_parts):
    parts, failures = compiled_parts
    failures.append("compiled kernels are not kept in here: no space left")
    with pytest.raises(
        CannotWrite, match=r"^compiled kernels are not kept in here: no space left$"
    ):
        warm_up()
    assert len(parts) == 1


def test_nothing_is_compiled_without_a_folder_to_keep_it(compiled_parts, tmp_path):
    parts, _ = compiled_parts
    (tmp_path / "omnidrive-kernels").write_text("")
    with pytest.raises(CannotWrite, match=r"not kept: the folder .* cannot be used: File exists"):
        warm_up()
    assert parts == []


def test_part_whose_process_is_killed_is_named(compiled_parts, monkeypatch):
    def outcomes(workers, calls):
        yield 0, []
        yield 1, Lost.KILLED

    monkeypatch.setattr(WorkerPool, "outcomes", outcomes)
    with pytest.raises(RunFailed, match=r"compilation of unicycle-nmpc .paper.: its proc"):
        warm_up(processes=2)
