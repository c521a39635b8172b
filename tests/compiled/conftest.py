"""A new process of the cache, and a package of kernels, imported after edits of its text."""

import importlib
import sys

import pytest

from omnidrive.compiled import cache_folder, kernels

CALLER = '''
"""Module docstring."""
from typing import NamedTuple

import numpy as np

from {package}.callee import FACTOR, Mode, callee, plain, shared
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
def of_shared(x):
    return shared(x)


@compiled
def later(x):
    return x + LATER


LATER = 3.0
'''
CALLEE = '''
from enum import IntEnum

from omnidrive.compiled import compilable, compiled, inlined

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


@compilable
def shared(x):
    """Docstring."""
    return 3.0 * x
'''


@pytest.fixture(autouse=True)
def new_process():
    """Return a function after which the cache is as in a new process; called around each test."""

    def forget():
        """Forget the chosen folder, the failures and the logged messages."""
        cache_folder._first_usable.cache_clear()
        cache_folder._once.passed.clear()
        cache_folder.failures.clear()

    forget()
    yield forget
    forget()


@pytest.fixture
def build(tmp_path, monkeypatch, new_process):
    """Return a function that imports the package after some replacements, as a new process does."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(cache_folder._config, "CACHE_DIR", str(tmp_path / "cache"))
    package = "kernels_of_a_test"
    folder = tmp_path / package
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    before = kernels[:]

    def forget_modules():
        """Let the next import execute the modules of the package."""
        for name in [name for name in sys.modules if name.startswith(package)]:
            del sys.modules[name]

    def make(*replacements):
        """Write the replaced texts, import the package and return its module ``caller``."""
        texts = {"caller": CALLER.format(package=package), "callee": CALLEE}
        for old, new in replacements:
            assert any(old in text for text in texts.values())
            texts = {name: text.replace(old, new) for name, text in texts.items()}
        for name, text in texts.items():
            (folder / f"{name}.py").write_text(text)
        forget_modules()
        importlib.invalidate_caches()
        new_process()
        return importlib.import_module(f"{package}.caller")

    yield make
    forget_modules()
    kernels[:] = before
