"""Damage to the cache of compiled kernels: the same numbers, no failure, one message."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from omnidrive.compiled import announce_compiling, cache_folder
from tests.compiled.damages import (
    FILE_DAMAGES,
    LIMITS,
    OTHER_DAMAGES,
    flip_bits,
    full_disk,
    open_folder_to_others,
    read_only,
    remove,
    remove_folder,
    replace_by_pipe,
    replace_folder_by_file,
    truncate,
)

PROCESS = """
import numpy as np
from omnidrive.compiled import compiled

@compiled
def total(x):
    return np.sort(x).sum() + 1.0

print(total(np.array([1.0, 2.0, 2.0])), len(total.stats.cache_misses))
"""


@pytest.fixture
def parent():
    """A folder that every user can enter, for the cache."""
    path = Path(tempfile.mkdtemp(prefix="kernels-"))
    path.chmod(0o755)
    yield path
    shutil.rmtree(path)


def results(module):
    with announce_compiling():
        return module.caller(1.0), module.later(1.0)


def survive(build, parent, patch, caplog, seed, kinds):
    """Damage the cache in one way after another; every time check numbers and messages."""
    patch.setattr(cache_folder._config, "CACHE_DIR", str(parent))
    folder, sound = parent / "omnidrive-kernels", parent / "sound"
    assert results(build()) == (10.0, 4.0)
    shutil.copytree(folder, sound)
    for number, kind in enumerate(kinds):
        rng = np.random.default_rng([seed, number])
        where = f"seed {seed}, damage {number}: {kind.__name__}"
        names = sorted(path.name for path in sound.glob("*later*.kernel"))
        path = folder / names[rng.integers(len(names))]
        caplog.clear()
        if kind in LIMITS:
            remove(path, rng)
            module = build()
            with kind(folder, rng):
                assert results(module) == (10.0, 4.0), where
        else:
            kind(path, rng)
            assert results(build()) == (10.0, 4.0), where
        warned = [record for record in caplog.records if record.name.endswith(".cache")]
        if kind in FILE_DAMAGES:
            (record,) = warned
            assert record.message.endswith("it is compiled again"), where
            module = build()
            assert results(module) == (10.0, 4.0), where
            assert not module.later.stats.cache_misses, where
        else:
            assert len(warned) <= 2, (where, [record.message for record in warned])
            assert bool(warned) == (kind not in (remove, remove_folder)), where
        assert not list(parent.rglob("*.tmp")), where
        if folder.is_dir():
            shutil.rmtree(folder)
        else:
            folder.unlink(missing_ok=True)
        shutil.copytree(sound, folder)


ALL = [*FILE_DAMAGES, *OTHER_DAMAGES, *LIMITS]


def test_damaged_cache_changes_no_number(build, parent, monkeypatch, caplog):
    survive(build, parent, monkeypatch, caplog, 17, [flip_bits, full_disk, read_only])


@pytest.mark.long
def test_200_damages_change_no_number(build, parent, monkeypatch, caplog):
    kinds = [ALL[k % len(ALL)] for k in range(200)]
    survive(build, parent, monkeypatch, caplog, 1717, kinds)


def study(cache):
    """Run a small study in two workers; return its numbers and what it prints."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "omnidrive", "compare", "--plant", "planar",
                   "--controllers", "feedforward,pid", "--tasks", "step", "--jobs", "2",
                   "--json", "--out", f"{out}/run"]  # fmt: skip
        done = subprocess.run(
            command, capture_output=True, text=True, check=False,
            env=os.environ | {"NUMBA_CACHE_DIR": str(cache), "COLUMNS": "300"},
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["step_response"]
    times = ("step_time_median_us", "step_time_p99_us")
    numbers = [{k: v for k, v in row.items() if k not in times} for row in rows]
    return numbers, [line for line in done.stderr.splitlines() if "kernel" in line]


@pytest.fixture(scope="module")
def compiled_study(tmp_path_factory):
    """The cache after a study, and its numbers."""
    cache = tmp_path_factory.mktemp("compiled")
    numbers, notes = study(cache)
    assert len(notes) == 1
    assert "compiling kernels" in notes[0]
    assert study(cache) == (numbers, [])
    return cache, numbers


@pytest.mark.long
@pytest.mark.parametrize(
    "kind", [truncate, flip_bits, replace_by_pipe, open_folder_to_others, replace_folder_by_file]
)
def test_study_in_workers_is_the_same_and_says_it_once(compiled_study, tmp_path, kind):
    sound, expected = compiled_study
    folder = tmp_path / "omnidrive-kernels"
    shutil.copytree(sound / "omnidrive-kernels", folder)
    rng = np.random.default_rng(5)
    for path in sorted(folder.glob("*.kernel")):
        if path.exists():
            kind(path, rng)
    numbers, notes = study(tmp_path)
    assert numbers == expected
    assert sum("compiling kernels" in note for note in notes) == 1, notes
    assert len(notes) == 2, notes


@pytest.mark.long
def test_processes_compile_a_kernel_once(tmp_path):
    (tmp_path / "kernels.py").write_text(PROCESS)
    command = [sys.executable, str(tmp_path / "kernels.py")]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    started = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    printed = [process.communicate()[0].split() for process in started]
    assert [value for value, _ in printed] == ["6.0", "6.0"]
    assert sorted(misses for _, misses in printed) == ["0", "1"]


def test_kernels_are_plain_functions_without_compiler(tmp_path):
    (tmp_path / "kernels.py").write_text(PROCESS.replace("len(total.stats.cache_misses)", "'none'"))
    done = subprocess.run(
        [sys.executable, str(tmp_path / "kernels.py")],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["6.0", "none"]
