"""Machine code of a kernel as an argument of other kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import typeof, types

_MachineCode: Any = types.CompileResultWAP  # untyped


class CompiledFunction(_MachineCode):  # type: ignore[misc]
    """The machine code of a kernel for the types of the examples, as an argument of other kernels.

    It is called by its address: the kernels that call it are compiled without it, and execute the
    same machine code as Python does. An error within it, such as too little memory, is printed and
    does not reach the caller.
    """

    def __init__(self, kernel: Callable[..., Any], *examples: Any) -> None:
        machine: Any = kernel
        arguments = tuple(map(typeof, examples))
        machine.compile(arguments)
        super().__init__(machine.overloads[arguments])
