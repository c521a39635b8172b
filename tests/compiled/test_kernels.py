"""Compiled kernels: kept on disk, and compiled again when code that they reach changes."""

import importlib
import pickle
import sys
from pathlib import Path

import llvmlite.binding as llvm
import numba
import numpy as np
import pytest
from numba.core import serialize, types

import omnidrive
from omnidrive.compiled import CompiledFunction, compiled, entry_point, kernels
from omnidrive.compiled import key as key_module
from omnidrive.compiled.cache_folder import usable_folder
from omnidrive.compiled.kernel_files import KernelFiles, entries
from omnidrive.compiled.key import kernel_key, short_hash
from omnidrive.compiled.versions import USES_INTERNALS
from omnidrive.compiled.views import uncounted
from omnidrive.fuzzy.kernels import infer_rows

internals = pytest.mark.skipif(not USES_INTERNALS, reason="left out of this version of Numba")
PACKAGE = Path(omnidrive.__file__).parent


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


@internals
def test_kernels_and_python_call_the_same_function(build):
    module = build()
    assert module.of_shared(2.0) == module.shared(2.0) == 6.0
    assert module.of_shared.stats.cache_misses
    assert not build(('"""Docstring."""', '"""Another."""')).of_shared.stats.cache_misses
    edited = build(("return 3.0 * x", "return 4.0 * x"))
    assert kernel_key(edited.of_shared) != kernel_key(module.of_shared)
    assert edited.of_shared(2.0) == edited.shared(2.0) == 8.0


def test_global_defined_below_the_kernel_is_part_of_the_key(build):
    before = kernel_key(build().later)
    assert kernel_key(build(("LATER = 3.0", "LATER = 4.0")).later) != before


@internals
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


def test_unknown_kind_of_global_is_refused(build):
    module = build(("LATER = 3.0", "class Own: pass\n\nLATER = Own()"))
    with pytest.raises(TypeError, match=r"cannot refer to .*Own"):
        kernel_key(module.later)


def test_every_kernel_of_the_package_has_a_key():
    for path in PACKAGE.rglob("*.py"):
        if "@compiled" in path.read_text() or "@inlined" in path.read_text():
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            importlib.import_module(".".join(parts))
    functions = {each: each.py_func for each in kernels}
    own = [
        kernel
        for kernel, each in functions.items()
        if each.__module__.startswith("omnidrive.") and "<locals>" not in each.__qualname__
    ]  # not those that are built for a law or a test, perhaps twice with the same code
    assert len(own) > 200
    assert len({kernel_key(kernel) for kernel in own}) == len(own)


@internals
def test_callee_is_compiled_within_its_caller_and_for_python_on_demand(build):
    module = build()
    callee = sys.modules[module.callee.py_func.__module__].callee
    module.caller(1.0)
    cached = [name.split("-")[0] for name in usable_folder().names("")]
    assert cached == ["kernels_of_a_test.caller.caller"]
    assert callee(3.0) == 3.0
    assert len(entries(callee)) == 1
    again = build()
    assert again.callee(3.0) == 3.0
    assert not again.callee.stats.cache_misses
    assert again.caller(1.0) == 10.0


@internals
def test_callee_that_is_on_disk_is_linked_into_a_new_caller(build):
    build().callee(3.0)
    module = build()
    assert module.caller(1.0) == 10.0
    assert module.callee(3.0) == 3.0
    assert not module.callee.stats.cache_misses


@internals
def test_compiled_signature_is_not_looked_up_again(build, monkeypatch):
    module = build()
    entry = entry_point(module.caller, 1.0)
    monkeypatch.delattr(KernelFiles, "_name")
    assert entry_point(module.caller, 1.0) is entry


def test_pickled_kernel_compiles(build):
    data = serialize.dumps(build().callee)
    callee = pickle.loads(data)
    del callee._memo[callee._uuid]
    callee = pickle.loads(data)
    assert isinstance(callee, type(compiled(lambda: 0)))
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


def test_keys_are_those_of_other_processes(monkeypatch):
    """A key that contains an address, such as that of a wrapper in tests, is never found again."""
    texts = []
    monkeypatch.setattr(
        key_module, "short_hash", lambda text: texts.append(text) or short_hash(text)
    )
    key_module._described.cache_clear()
    kernel_key(infer_rows)
    assert len(texts) > 20
    assert not [text for text in texts if " at 0x" in text]
    key_module._described.cache_clear()


@compiled
def total(numbers, scale):
    return scale * numbers.sum()


@compiled
def call_by_address(function, numbers):
    arrays, scale = uncounted(((numbers, numbers[1:]), 2.0))
    return function(arrays[0], scale) + function(arrays[1], 1.0)


def test_kernel_calls_another_one_by_its_address():
    """The arrays that it passes are not counted, and so not released by what it calls."""
    numbers = np.array([1.0, 2.0, 3.0])
    references = sys.getrefcount(numbers)
    function = CompiledFunction(total, numbers, 2.0)
    assert [call_by_address(function, numbers) for _ in range(3)] == [17.0] * 3
    assert sys.getrefcount(numbers) == references
    (name,) = entries(call_by_address)  # one entry for all functions of the same types
    assert call_by_address(CompiledFunction(largest, numbers, 2.0), numbers) == 9.0
    assert entries(call_by_address) == [name]


@internals
def test_callees_are_internal_to_the_code_of_their_caller():
    """LLVM leaves out arguments of internal functions only."""
    total(np.ones(2), 2.0)
    (result,) = total.overloads.values()
    functions = {each.name: each for each in result.library._get_module_for_linking().functions}
    assert functions["NRT_decref"].linkage == llvm.Linkage.internal


@internals
def test_callee_is_compiled_once_for_all_constants():
    for constant in (2, 3):
        multiplied.get_call_template((types.float64, types.literal(constant)), {})
    assert list(multiplied.overloads) == [(types.float64, types.int64)]


@compiled
def multiplied(x, factor):
    return x * factor


@compiled
def largest(numbers, scale):
    return scale * numbers.max()
