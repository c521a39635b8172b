"""Compiler pass that leaves out the reference counts of functions that create no array.

Numba counts the references of every array that a function takes out of its arguments: two atomic
operations per array and call, also for each array of a named tuple. A function that returns no
array, and whose arrays are all arguments, parts or views of them, needs no count: its caller holds
a reference to each of them until it returns. Without the counts, the first step of the controller
``holonomic-nmpc`` compiles in a tenth less time.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import AnnotateTypes

_Pass: Any = AnalysisPass  # Numba's types are incomplete
_Compiler: Any = CompilerBase
_builder: Any = DefaultPassBuilder

_PARTS = {"build_tuple", "cast", "exhaust_iter", "iternext", "pair_first", "pair_second", "phi"}
_INDICES = (types.Integer, types.SliceType, types.EllipsisType, types.NoneType)


class _BorrowedArrays(_Pass):  # type: ignore[misc]
    """Switches the reference counts off if they are not needed."""

    _name = "borrowed_arrays"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Decide for the function that is compiled."""
        if not _creates_arrays(state):
            state.targetctx.enable_nrt = False
        return False


_register: Any = register_pass
_register(mutates_CFG=False, analysis_only=True)(_BorrowedArrays)


class KernelCompiler(_Compiler):  # type: ignore[misc]
    """Numba's compiler with the pass of this module."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes from byte code to machine code."""
        passes: Any = _builder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_BorrowedArrays, AnnotateTypes)
        passes.finalize()
        return [passes]


def _creates_arrays(state: Any) -> bool:
    """Return whether a function returns an array, or assigns one that it may have created."""
    models, types_of = state.targetctx.data_model_manager, state.typemap

    def counted(kind: Any) -> bool:
        """Return whether values of a type hold references."""
        found: bool = models[kind].contains_nrt_meminfo()
        return found

    if counted(state.return_type):
        return True
    for statement in _statements(state.func_ir):
        if isinstance(statement, ir.Assign):
            if counted(types_of[statement.target.name]) and not _is_part(statement.value, types_of):
                return True
        elif isinstance(statement, ir.SetItem | ir.StaticSetItem):
            if counted(types_of[statement.value.name]):
                return True  # an array, which is copied if the two overlap
        elif not isinstance(statement, ir.Del | ir.Terminator | ir.Expr):
            return True
    return False


def _statements(function: Any) -> Iterable[Any]:
    """Yield the statements of a function in Numba's intermediate representation."""
    for block in function.blocks.values():
        yield from block.body


def _is_part(value: Any, types_of: Any) -> bool:
    """Return whether a value is an argument, a constant array, a part or a view of a variable."""
    if not isinstance(value, ir.Expr):
        return isinstance(value, ir.Arg | ir.FreeVar | ir.Global | ir.Var)
    if value.op == "call":
        return isinstance(types_of[value.func.name], types.NamedTupleClass)
    if value.op not in {"getattr", "getitem", "getiter", "static_getitem"}:
        return value.op in _PARTS
    whole = types_of[value.value.name]
    if not isinstance(whole, types.Array):
        return isinstance(whole, types.BaseTuple)
    if value.op in {"getattr", "getiter"}:
        return bool(value.op == "getiter")
    index = value.index_var if value.op == "static_getitem" else value.index
    return index is not None and _is_basic(types_of[index.name])


def _is_basic(index: Any) -> bool:
    """Return whether indexing an array with this type gives a view or a number."""
    each = getattr(index, "types", (index,)) if isinstance(index, types.BaseTuple) else (index,)
    return all(isinstance(one, _INDICES) for one in each)
