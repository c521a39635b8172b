"""Machine code of a kernel as an argument of other kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.experimental.function_type import FunctionModel
from numba.extending import NativeValue, register_model, typeof_impl, unbox

_FunctionType: Any = types.FunctionType
_cgutils: Any = cgutils
_ir: Any = ir
_NativeValue: Any = NativeValue
_typeof_impl: Any = typeof_impl
_unbox: Any = unbox


class CompiledFunction:
    """The machine code of a kernel for the types of the examples, as an argument of other kernels.

    It is called by its address: the kernels that call it are compiled without it, and execute the
    same machine code as Python does. An error within it, such as too little memory, is printed and
    does not reach the caller.
    """

    def __init__(self, kernel: Callable[..., Any], *examples: Any) -> None:
        machine: Any = kernel
        arguments = tuple(map(typeof, examples))
        machine.compile(arguments)
        self._result = machine.overloads[arguments]
        name = self._result.fndesc.llvm_cfunc_wrapper_name
        self.address: int = self._result.library.get_pointer_to_function(name)
        """Of the function with the calling convention of C."""

    @property
    def signature(self) -> Any:
        """Types of result and arguments."""
        return self._result.signature


class _CompiledFunctionType(_FunctionType):  # type: ignore[misc]
    """Type of a compiled function in kernels.

    As a function type of Numba, which however looks up the address in Python at every call of the
    kernel that receives the function, for 25 us.
    """


def _typeof(function: CompiledFunction, _: Any) -> _CompiledFunctionType:
    return _CompiledFunctionType(function.signature)


def _unboxed(kind: Any, function: Any, c: Any) -> Any:
    """Emit the conversion of the argument: its address is an attribute."""
    value = _cgutils.create_struct_proxy(kind)(c.context, c.builder)
    address = c.pyapi.object_getattr_string(function, "address")
    value.c_addr = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    pointer = c.context.get_value_type(types.voidptr)
    value.py_addr = c.builder.ptrtoint(function, pointer)
    value.jit_addr = _ir.Constant(pointer, None)
    return _NativeValue(value._getvalue())


register_model(_CompiledFunctionType)(FunctionModel)
_typeof_impl.register(CompiledFunction)(_typeof)
_unbox(_CompiledFunctionType)(_unboxed)
