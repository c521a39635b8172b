"""Numba with and without its internals: the same results, each with its own files on disk."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import omnidrive
from omnidrive.compiled import announce_compiling, compilation
from omnidrive.compiled.versions import USES_INTERNALS

PACKAGE = Path(omnidrive.__file__).parent
KERNELS = """
import numpy as np
from omnidrive.compiled import CompiledFunction, compilable, compiled, compiled_sums, entry_point
from omnidrive.compiled.views import uncounted, unsafe_matrix, unsafe_slice
from omnidrive.planning.search.bit_ops import leading_zeros, trailing_zeros, uint64

SCALE = 3.0

@compilable
def scaled(x):
    return SCALE * x

@compiled_sums
def total(numbers, scale):
    return scale * numbers.sum()

@compiled
def caller(function, numbers, bits):
    part, matrix = unsafe_slice(numbers, 1, 3), unsafe_matrix(numbers, 2, 2, 2)
    zeros = trailing_zeros(uint64(bits)) + 100 * leading_zeros(uint64(bits))
    return (function(uncounted(numbers), 2.0), part[0], part.size, matrix[1, 0],
            scaled(part[1]) / 0.0, scaled(part[1]), zeros)

numbers = np.arange(6.0)
arguments = CompiledFunction(total, numbers, 2.0), numbers, 8
print(entry_point(caller, *arguments)(*arguments), caller.stats.cache_misses.total())
"""
EXPECTED = "(30.0, 1.0, 2, 4.0, inf, 6.0, 6003) "


def run(folder, internals, kernels=KERNELS):
    (folder / "kernels.py").write_text(kernels)
    variables = {"OMNIDRIVE_NUMBA_INTERNALS": internals, "NUMBA_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, "-W", "error", str(folder / "kernels.py")], env=os.environ | variables,
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def files(folder):
    return {path.name for path in (folder / "cache" / "omnidrive-kernels").glob("*.kernel")}


def test_results_are_the_same_and_files_are_separate(tmp_path):
    assert run(tmp_path, "1") == EXPECTED + "1"
    first = files(tmp_path)
    assert run(tmp_path, "0") == EXPECTED + ("1" if USES_INTERNALS else "0")
    assert first < files(tmp_path) or not USES_INTERNALS
    assert run(tmp_path, "1") == EXPECTED + "0"


@pytest.mark.long
def test_public_kernel_is_compiled_again_when_its_callee_changes(tmp_path):
    run(tmp_path, "0")
    edited = KERNELS.replace("SCALE = 3.0", "SCALE = 4.0")
    assert run(tmp_path, "0", edited) == EXPECTED.replace("6.0, 6003", "8.0, 6003") + "1"


@pytest.mark.long
def test_damaged_file_of_a_public_kernel_is_replaced(tmp_path):
    run(tmp_path, "0")
    for name in files(tmp_path):
        path = tmp_path / "cache" / "omnidrive-kernels" / name
        path.write_bytes(path.read_bytes()[:-9])
    assert run(tmp_path, "0") == EXPECTED + "1"
    assert run(tmp_path, "0") == EXPECTED + "0"


def test_public_interfaces_are_announced_once(monkeypatch, caplog):
    monkeypatch.setattr(compilation, "VERSION_NOTE", "public interfaces")
    with announce_compiling("compiling"):
        compilation.notify(compilation.Compilation("a"))
        compilation.notify(compilation.Compilation("b"))
    assert sorted(record.message for record in caplog.records) == ["compiling", "public interfaces"]


def test_one_file_imports_internals_of_numba():
    inside = ("numba.core", "numba.cpython", "numba.np", "numba._", "numba.experimental")
    users = set()
    for path in PACKAGE.rglob("*.py"):
        text, found = path.read_text(encoding="utf-8"), set()
        for node in ast.walk(ast.parse(text)) if "numba" in text else ():
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found |= {f"{node.module}.{alias.name}" for alias in node.names}
        if any(name.startswith(inside) for name in found):
            users.add(path.name)
    assert users == {"numba_internals.py"}
