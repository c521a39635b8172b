"""Dispatcher of a kernel that runs LLVM once for a kernel and all kernels that it calls.

Numba optimises and emits the machine code of every callee by itself, and again as a part of each of
its callers, at every level. Here a callee is only translated to LLVM's intermediate language; it is
linked into the kernel that Python calls, and the whole is optimised and emitted once. This halves
the time of compilation. The callees are internal to the whole, so that LLVM leaves out arguments
that they do not use, such as most fields of an array. A kernel with ``fastmath`` is still optimised
by itself first, so that the order of its sums does not depend on its callers; all other
floating-point operations are strict, so that their results do not depend on the order of
optimisation.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import llvmlite.binding as llvm
import numba._dynfunc
from numba.core import codegen, compiler, environment, registry, sigutils, targetconfig, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.runtime import nrt

from omnidrive.compiled.borrowed_arrays import KernelCompiler
from omnidrive.compiled.cache import KernelCache
from omnidrive.compiled.compilation import reported

Types = tuple[Any, ...]

_lock: Any = global_compiler_lock  # Numba's types are incomplete
_Dispatcher: Any = registry.CPUDispatcher
_Library: Any = codegen.JITCodeLibrary
_environment_of: Any = environment.lookup_environment
_make_function: Any = numba._dynfunc.make_function
_normalized: Any = sigutils.normalize_signature
_runtime: Any = nrt.rtsys
_Flags: Any = compiler.Flags
_DEFAULTS = {name: option.default for name, option in _Flags.options.items()}
_FLAGS_HASH = hash(_Flags())
_unliteral: Any = types.unliteral

_UNRESOLVED = codegen.RuntimeLinker.PREFIX  # of a recursive call
_ENVIRONMENT = "_ZN08NumbaEnv"
NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class Kernel(_Dispatcher):  # type: ignore[misc]
    """A compiled function, with its machine code on disk."""

    def __init__(
        self, py_func: Any, locals: Any = None, targetoptions: Any = None, **more: Any
    ) -> None:
        options = {"nopython": True, "boundscheck": None} | (targetoptions or {})
        super().__init__(py_func, locals, options, pipeline_class=KernelCompiler, **more)
        self._cache = KernelCache(self)
        self._without_code: set[Types] = set()

    def compile(self, sig: Any) -> Any:
        """Return the entry point for a signature; of a callee only while its caller compiles."""
        with _lock:
            arguments = tuple(_normalized(sig)[0])
            if _requests and not self._is_separate:
                return self._compile_callee(sig)
            existing = self.overloads.get(arguments)
            if existing is not None and arguments not in self._without_code:
                return existing.entry_point
            if existing is not None:
                self._without_code.discard(arguments)
                del self.overloads[arguments]
            with ExitStack() as stack:
                if not stack.enter_context(self._cache.locked(sig)):
                    stack.enter_context(reported(self._name))
                stack.enter_context(_late_code(self, arguments))
                return super().compile(sig)

    def get_call_template(self, args: Types, kws: Mapping[str, Any]) -> Any:
        """Return the template of a call; the value of a constant argument is no part of its type.

        Numba compiles a callee again for each constant.
        """
        named = {name: _unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(_unliteral, args)), named)

    def add_overload(self, result: Any) -> None:
        """Register a result; for calls from Python only if it has machine code."""
        if getattr(result.library, "is_complete", True):
            super().add_overload(result)
        else:
            arguments = tuple(result.signature.args)
            self.overloads[arguments] = result
            self._without_code.add(arguments)

    @property
    def _name(self) -> str:
        module = self.py_func.__module__.removeprefix("omnidrive.")
        return f"{module}.{self.py_func.__qualname__}"

    @property
    def _is_separate(self) -> bool:
        return bool(self.targetoptions.get("fastmath"))

    def _compile_callee(self, sig: Any) -> Any:
        options = self._compiler.targetoptions
        self._compiler.targetoptions = options | NO_WRAPPERS
        try:
            return super().compile(sig)
        finally:
            self._compiler.targetoptions = options


class LateLibrary(_Library):  # type: ignore[misc]
    """Code of one function, in LLVM's intermediate language until its machine code is needed."""

    is_complete = False
    is_separate = False
    _before_linking: Any = None

    def finalize(self) -> None:
        """End the construction; the code is linked, optimised and emitted by :meth:`complete`."""
        self._raise_if_finalized()
        self._finalized = True

    def complete(self) -> None:
        """Link all callees into the module, optimise it and emit machine code."""
        if self.is_complete:
            return
        self._finalized = False
        if not self.is_separate:
            self._before_linking = self._final_module.clone()
        for library in self._callees():
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(_module_of(library), preserve=True)
        _hide_callees(self._final_module)
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()
        for variable in self._final_module.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                found = _environment_of(variable.name)
                if found is not None:
                    self._codegen.set_env(variable.name, found)

    def module_without_callees(self) -> Any:
        """Module for linking into a caller with those of the callees; None if there is none."""
        if self._before_linking is not None:
            return _linkable(self._before_linking)
        if self.is_complete or self.is_separate or _is_recursive(self._final_module):
            return None
        return _linkable(self._final_module)

    def _callees(self) -> list[Any]:
        """Libraries to link: those of all callees, and of theirs unless they contain them."""
        found: dict[Any, None] = {}
        waiting = list(self._linking_libraries)
        while waiting:
            library = waiting.pop(0)
            if library not in found and library is not self:
                found[library] = None
                if isinstance(library, LateLibrary) and library.module_without_callees():
                    waiting += library._linking_libraries
        return list(found)

    def _finalize_final_module(self) -> None:
        super()._finalize_final_module()
        self.is_complete = True

    def _get_module_for_linking(self) -> Any:
        self.complete()
        return super()._get_module_for_linking()

    def get_pointer_to_function(self, name: str) -> int:
        """Address of the machine code; 0 if the library does not define the function."""
        self.complete()
        address: int = super().get_pointer_to_function(name)
        return address


def _module_of(library: Any) -> Any:
    """Module of a callee for linking."""
    module = library.module_without_callees() if isinstance(library, LateLibrary) else None
    return library._get_module_for_linking() if module is None else module


def _hide_callees(module: Any) -> None:
    """Make the functions that come from other modules internal, unless one is found by its name."""
    if _is_recursive(module):
        return
    for function in module.functions:
        if function.linkage == llvm.Linkage.linkonce_odr and not function.is_declaration:
            function.linkage = llvm.Linkage.internal


def _is_recursive(module: Any) -> bool:
    """Return whether functions of a module are found by their names when its code is loaded."""
    return any(variable.name.startswith(_UNRESOLVED) for variable in module.global_variables)


def _linkable(module: Any) -> Any:
    """Copy of a module whose functions may be inlined, and defined several times."""
    copy = module.clone()
    for function in copy.functions:
        if not function.is_declaration and function.linkage == llvm.Linkage.external:
            function.linkage = "linkonce_odr"
    return copy


_requests: list[tuple[Kernel, Types]] = []  # the kernel being compiled is the last


@contextmanager
def _late_code(kernel: Kernel, arguments: Types) -> Iterator[None]:
    """Emit machine code for this kernel only; the compiler lock must be held."""
    _requests.append((kernel, arguments))
    context = kernel.targetctx
    generator = context.codegen()
    outermost = len(_requests) == 1
    collecting = gc.isenabled()
    if outermost:
        gc.disable()  # collections take a sixth of the compile time and find little
        _runtime.initialize(context)
        generator._library_class = LateLibrary
        _Flags.__eq__, _Flags.__hash__ = _equal_flags, _hash_flags
        context.get_executable = _executable(context.get_executable)
    try:
        yield
    finally:
        _requests.pop()
        if outermost:
            del generator._library_class
            del _Flags.__eq__, _Flags.__hash__
            del context.get_executable
            if collecting:
                gc.enable()


def _equal_flags(flags: Any, other: Any) -> Any:
    """Return what ``==`` returns for two sets of compiler options.

    Numba looks up every option by its property, in each search for a compiled function.
    """
    if type(flags) is not type(other):
        compare: Any = targetconfig.TargetConfig.__eq__  # untyped
        return compare(flags, other)
    ours, theirs = flags._values, other._values
    return ours == theirs or {**_DEFAULTS, **ours} == {**_DEFAULTS, **theirs}


def _hash_flags(_: Any) -> int:
    """Return the hash of compiler options: Numba's is one of their names only, too."""
    return _FLAGS_HASH


def _executable(get_executable: Any) -> Any:
    """Return a replacement for the method that makes a Python function of compiled code.

    Callees get a function without code, as Numba's own library functions do: it only serves as the
    name under which callers find them.
    """

    def executable(library: Any, description: Any, globals_: Any) -> Any:
        """Return the Python function of a library; without code unless it is requested."""
        kernel, arguments = _requests[-1]
        function = kernel.py_func
        requested = (function.__module__, function.__qualname__, arguments)
        if (description.modname, description.qualname, tuple(description.argtypes)) == requested:
            library.is_separate = kernel._is_separate
        elif not library.is_complete:
            name = description.qualname.split(".")[-1]
            module = description.lookup_module()
            return _make_function(module, name, "", 0, globals_, (library,))
        return get_executable(library, description, globals_)

    return executable
