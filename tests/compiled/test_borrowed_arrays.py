"""Arrays of kernels: no reference is lost or kept, counted or not."""

import re
import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit
from numba.core.runtime import _nrt_python, rtsys

from omnidrive.compiled import compiled, inlined
from omnidrive.compiled.versions import USES_INTERNALS
from omnidrive.control import holonomic_nmpc
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.reference import Hold
from omnidrive.robot import named_robot

if USES_INTERNALS:
    from omnidrive.compiled.numba_internals import _KernelCompiler

COUNTS = ("NRT_incref", "NRT_decref")


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@compiled
def read_parts(pair):
    swapped = Pair(pair.second, pair.first)
    total = 0.0
    for row in swapped.first:
        total += row[0]
    return total + swapped.second[0, 0] + pair.first[1:, 0][-1]


@compiled
def write_part(pair, k):
    row = pair.first[k]
    row[0] = 7.0


@compiled
def keep_smaller(pair, other):
    chosen = pair.first
    if other[0, 0] < chosen[0, 0]:
        chosen = other
    return chosen[0, 0]


@compiled
def create(pair):
    created = pair.first + pair.second
    return created[0, 0]


@compiled
def copy_part(pair):
    return pair.first[0].copy()[0]


@compiled
def reshape(pair):
    return pair.first.ravel()[0]


@compiled
def select(pair):
    return pair.first[np.array([1, 0])][0, 0]


@compiled
def overwrite(pair):
    pair.first[0] = pair.second[1]


@inlined
def part(pair):
    return pair.first


@compiled
def call_for_part(pair):
    return part(pair)[0, 0]


BORROWING = [read_parts, write_part, keep_smaller]
COUNTING = [create, copy_part, reshape, select, overwrite, part, call_for_part]


def arguments(kernel):
    pair = Pair(np.arange(6.0).reshape(3, 2), 10.0 + np.arange(6.0).reshape(3, 2))
    return {write_part: (pair, 1), keep_smaller: (pair, pair.second)}.get(kernel, (pair,))


@pytest.fixture
def allocations():
    """Return a function that counts the arrays that kernels have not released."""
    _nrt_python.memsys_enable_stats()

    def kept():
        stats = rtsys.get_allocation_stats()
        return stats.mi_alloc - stats.mi_free

    yield kept
    _nrt_python.memsys_disable_stats()


@pytest.mark.skipif(not USES_INTERNALS, reason="Numba counts references")
def test_kernel_that_creates_no_array_counts_no_reference():
    fresh = njit(pipeline_class=_KernelCompiler)(keep_smaller.py_func)  # not read from disk
    fresh(*arguments(keep_smaller))
    (code,) = fresh.inspect_llvm().values()
    bodies = re.findall(r"^define [^\n]*@\"?_ZN(?!7cpython|5cfunc).*?^}", code, re.M | re.S)
    assert len(bodies) == 1  # the function without its wrappers
    assert not any(name in bodies[0] for name in COUNTS)


@pytest.mark.parametrize("kernel", BORROWING + COUNTING, ids=lambda kernel: kernel.__name__)
def test_arrays_are_released_once(kernel, allocations):
    values = arguments(kernel)
    pair = values[0]
    kernel(*values)
    references, arrays = [sys.getrefcount(array) for array in pair], allocations()
    results = [kernel(*values) for _ in range(100)]
    assert len(results) == 100
    del results
    assert [sys.getrefcount(array) for array in pair] == references
    assert allocations() == arrays


def test_controller_keeps_no_reference(allocations):
    controller = holonomic_nmpc(named_robot("paper").chassis, 0.1)
    target = Hold(Pose(1.0, 1.0, 1.0), 1.0)
    controller.reset(State(0.0, Pose(0.0, 0.0, 0.0)))

    def steps(first, last):
        for k in range(first, last):
            controller.step(0.1 * k, State(0.1 * k, Pose(0.01 * k, 0.0, 0.0)), target)
        return allocations(), [sys.getrefcount(array) for array in controller._memory.plan]

    assert steps(0, 5) == steps(5, 50)
