"""Compiled kernels: kept on disk, and compiled again when code that they reach changes."""

import importlib
import logging
import os
import pickle
import subprocess
import sys
from functools import partial
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import serialize

import omnidrive
from omnidrive.compiled import announce_compiling, entry_point, kernels, notify_compiling
from omnidrive.compiled import cache as kernel_cache
from omnidrive.compiled.dispatcher import Kernel, compile_listeners
from omnidrive.compiled.key import kernel_key

PACKAGE = Path(omnidrive.__file__).parent
CALLER = '''
"""Module docstring."""
from typing import NamedTuple

import numpy as np

from {package}.callee import FACTOR, Mode, callee, plain
from {package} import callee as callees
from omnidrive.compiled import compiled

TABLE = np.array([1.0, 2.0])


class Pair(NamedTuple):
    first: float
    second: float


@compiled
def caller(x):
    """Docstring."""
    pair = Pair(x, FACTOR)
    if x < -1e9:
        return caller(x + 1.0)
    return callee(pair.second) + TABLE[1] * pair.first + callees.SHIFT + (Mode.ON == 1)


@compiled
def of_pair(pair):
    return pair.first


@compiled
def later(x):
    return x + LATER


LATER = 3.0
'''
PROCESS = """
import numpy as np
from omnidrive.compiled import compiled

@compiled
def total(x):
    return np.sort(x).sum() + np.median(x) - 1.0

print(total(np.array([1.0, 2.0, 2.0])), len(total.stats.cache_misses))
"""
CALLEE = '''
from enum import IntEnum

from omnidrive.compiled import compiled, inlined

FACTOR = 2.0
SHIFT = 5.0
UNUSED = 0.0


class Mode(IntEnum):
    ON = 1


def plain():
    pass


@inlined
def callee(x, scale=1.0):
    """Docstring."""
    return x * scale
'''


@pytest.fixture
def build(tmp_path, monkeypatch):
    """Import a package of two modules, after some replacements in their texts."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(kernel_cache._config, "CACHE_DIR", str(tmp_path / "cache"))
    package = "kernels_of_a_test"
    folder = tmp_path / package
    folder.mkdir()
    (folder / "__init__.py").write_text("")

    before = kernels[:]

    def make(*replacements):
        texts = {"caller": CALLER.format(package=package), "callee": CALLEE}
        for old, new in replacements:
            assert any(old in text for text in texts.values())
            texts = {name: text.replace(old, new) for name, text in texts.items()}
        for name, text in texts.items():
            (folder / f"{name}.py").write_text(text)
        for name in [name for name in sys.modules if name.startswith(package)]:
            del sys.modules[name]
        importlib.invalidate_caches()
        return importlib.import_module(f"{package}.caller")

    yield make
    for name in [name for name in sys.modules if name.startswith(package)]:
        del sys.modules[name]
    kernels[:] = before


def key(module):
    return kernel_key(module.caller)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"""Docstring."""', '"""Another docstring."""'),
        ("@compiled\ndef caller", "# a comment\n\n@compiled\ndef caller"),
        ("UNUSED = 0.0", "UNUSED = 1.0\n\ndef other(): return 2"),
        ("def of_pair(pair):\n    return pair.first", "def of_pair(pair):\n    return pair.second"),
        ("def plain():\n    pass", "def plain():\n    return 1"),
        ("LATER = 3.0", "LATER = 4.0"),
    ],
)
def test_edit_of_what_a_kernel_does_not_reach_keeps_its_key(build, old, new):
    assert key(build()) == key(build((old, new)))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("return x * scale", "return x * scale + 1.0"),
        ("return x * scale", "return x * scale + 0.0"),
        ("scale=1.0", "scale=2.0"),
        ("@inlined\n", "@compiled\n"),
        ("FACTOR = 2.0", "FACTOR = 3.0"),
        ("FACTOR = 2.0", "FACTOR = 2"),
        ("SHIFT = 5.0", "SHIFT = -5.0"),
        ("ON = 1\n", "ON = 2\n"),
        ("[1.0, 2.0]", "[1.0, 3.0]"),
        ("[1.0, 2.0]", "[1, 2]"),
        ("    second: float", "    second: float\n    third: float = 0.0"),
        ("x < -1e9", "x < -2e9"),
        ("caller(x + 1.0)", "caller(1.0 + x)"),
    ],
)
def test_edit_of_what_a_kernel_reaches_changes_its_key(build, old, new):
    assert key(build()) != key(build((old, new)))


def test_global_defined_below_the_kernel_is_part_of_the_key(build):
    before = kernel_key(build().later)
    assert kernel_key(build(("LATER = 3.0", "LATER = 4.0")).later) != before


def test_entry_is_loaded_after_a_harmless_edit_and_compiled_after_another(build):
    module = build()
    assert module.caller(1.0) == 2.0 + 2.0 + 5.0 + 1.0
    assert module.caller.stats.cache_misses
    moved = build(('"""Docstring."""', '"""Another\n\n    docstring."""'))
    assert moved.caller(1.0) == 10.0
    assert not moved.caller.stats.cache_misses
    edited = build(("return x * scale", "return -x * scale"))
    assert edited.caller(1.0) == 6.0
    assert edited.caller.stats.cache_misses


def test_fields_of_a_named_tuple_argument_are_part_of_the_entry(build):
    module = build()
    assert module.of_pair(module.Pair(1.0, 2.0)) == 1.0
    swapped = build(("    first: float\n    second: float", "    second: float\n    first: float"))
    assert swapped.of_pair(swapped.Pair(1.0, 2.0)) == 2.0


@pytest.mark.parametrize(
    "damage", [lambda content: content[:-1], lambda _: b"", lambda _: b"x" * 99]
)
def test_damaged_entry_is_replaced_and_reported_once(build, caplog, monkeypatch, damage):
    monkeypatch.setattr(kernel_cache, "_warned", set())
    build().caller(1.0)
    paths = sorted(kernel_cache.cache_folder().glob("*.nbc"))
    sound = {path: path.read_bytes() for path in paths}
    for path in paths:
        path.write_bytes(damage(sound[path]))
    with caplog.at_level(logging.WARNING, logger="omnidrive"):
        assert build().caller(1.0) == 10.0
    assert [record.message.split(" is ")[1][:7] for record in caplog.records] == ["damaged"]
    assert sorted(kernel_cache.cache_folder().glob("*.nbc")) == paths
    again = build()
    assert again.caller(1.0) == 10.0
    assert not again.caller.stats.cache_misses


def test_folder_that_cannot_be_written_is_reported_once(build, caplog, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(kernel_cache._config, "CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(kernel_cache, "_warned", set())
    assert build().caller(1.0) == 10.0
    assert len(caplog.records) == 1
    assert "cannot be" in caplog.records[0].message


def test_unused_entries_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "_MAX_ENTRIES", 2)
    for number, days in enumerate((1, 2, 3, 61)):
        path = tmp_path / f"{number}.nbc"
        path.write_text("")
        then = kernel_cache.time.time() - days * kernel_cache._DAY
        kernel_cache.os.utime(path, (then, then))
    kernel_cache._remove_unused(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0.nbc", "1.nbc"]


def test_compiling_is_announced_once_and_only_if_it_happens(build, caplog):
    def announced():
        caplog.clear()
        module = build()
        with announce_compiling():
            module.caller(1.0)
            module.later(1.0)
        return [record.message.split(",")[0] for record in caplog.records]

    assert announced() == ["compiling the kernels of this command"]
    assert announced() == []
    assert compile_listeners == []


def test_only_the_outer_context_announces_and_once_for_all_processes(build):
    announced = []
    with announce_compiling(partial(announced.append, "outer")):
        with announce_compiling(partial(announced.append, "inner")):
            build().caller(1.0)
        notify_compiling()
    assert announced == ["outer"]
    with announce_compiling(partial(announced.append, "second")):
        notify_compiling()
    assert announced == ["outer", "second"]


def test_unknown_kind_of_global_is_refused(build):
    module = build(("LATER = 3.0", "class Own: pass\n\nLATER = Own()"))
    with pytest.raises(TypeError, match=r"cannot refer to .*Own"):
        kernel_key(module.later)


def test_every_kernel_of_the_package_has_a_key():
    for path in PACKAGE.rglob("*.py"):
        if "@compiled" in path.read_text() or "@inlined" in path.read_text():
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            importlib.import_module(".".join(parts))
    assert len(kernels) > 200
    assert len({kernel_key(kernel) for kernel in kernels}) == len(kernels)


def test_callee_is_compiled_within_its_caller_and_for_python_on_demand(build):
    module = build()
    callee = sys.modules[module.callee.py_func.__module__].callee
    module.caller(1.0)
    cached = sorted(path.name.split("-")[0] for path in kernel_cache.cache_folder().glob("*.nbc"))
    assert cached == ["kernels_of_a_test.caller.caller"]
    assert callee(3.0) == 3.0
    assert len(list(kernel_cache.entries(callee))) == 1
    again = build()
    assert again.callee(3.0) == 3.0
    assert not again.callee.stats.cache_misses
    assert again.caller(1.0) == 10.0


def test_callee_that_is_on_disk_is_linked_into_a_new_caller(build):
    build().callee(3.0)
    module = build()
    assert module.caller(1.0) == 10.0
    assert module.callee(3.0) == 3.0
    assert not module.callee.stats.cache_misses


def test_compiled_signature_is_not_looked_up_again(build, monkeypatch):
    module = build()
    entry = entry_point(module.caller, 1.0)
    monkeypatch.delattr(kernel_cache.KernelCache, "_path")
    assert entry_point(module.caller, 1.0) is entry


def test_pickled_kernel_compiles(build):
    data = serialize.dumps(build().callee)
    callee = pickle.loads(data)
    del callee._memo[callee._uuid]
    callee = pickle.loads(data)
    assert isinstance(callee, Kernel)
    assert callee(3.0) == 3.0


def test_error_of_a_callee_arrives_with_its_message(build):
    error = "if x > 1.5:\n        raise ValueError('too large')\n    return x"
    for _ in range(2):  # compiled, and from disk
        with pytest.raises(ValueError, match=r"^too large$"):
            build(("return x * scale", error)).caller(1.0)


def test_recursive_callee_is_linked(build):
    recursive = "    if x > 10.0:\n        return callee(x - 1.0)\n    return x * scale"
    edits = (("    return x * scale", recursive), ("FACTOR = 2.0", "FACTOR = 20.0"))
    for _ in range(2):
        assert build(*edits).caller(1.0) == 10.0 + 2.0 + 5.0 + 1.0


def test_other_numba_functions_can_call_a_kernel_and_its_callees(build):
    module = build()
    module.caller(1.0)
    caller, callee = module.caller, module.callee

    @numba.njit
    def foreign(x):
        return caller(x) + callee(x) + np.zeros(3).sum()

    assert foreign(1.0) == 11.0


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
