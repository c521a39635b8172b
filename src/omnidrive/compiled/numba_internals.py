"""Internals of Numba, used only with the versions that they are tested with.

No other file imports them, and none is needed for a result (:mod:`omnidrive.compiled.versions`):

* Numba optimises and emits the machine code of every callee by itself, and again as a part of each
  of its callers, at every level. Here a callee is only translated to LLVM's intermediate language;
  it is linked into the kernel that Python calls, and the whole is optimised and emitted once. The
  callees are internal to the whole, so that LLVM leaves out arguments that they do not use, such as
  most fields of an array. A kernel with ``fastmath`` is still optimised by itself first, so that
  the order of its sums does not depend on its callers; all other floating-point operations are
  strict, so that their results do not depend on the order of optimisation.
* A kernel on disk is loaded whatever line it is on; a compiled function is a quick argument.
* Numba counts the references of every array that a function takes out of its arguments, in two
  atomic operations per array and call. :class:`_BorrowedArrays` leaves that out of functions that
  create no array, :func:`uncounted` for arguments of the others.
"""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from itertools import chain
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import extending, types
from numba.experimental.function_type import FunctionModel

from omnidrive.compiled.compilation import reported
from omnidrive.compiled.compiled_function import CompiledFunction
from omnidrive.compiled.kernel_files import KernelFiles, qualified_name

Types = tuple[Any, ...]

_log = logging.getLogger("omnidrive.compiled.cache")
_numba: Any = numba  # its types are incomplete
_core: Any = numba.core
_extending: Any = extending
_types: Any = types
_llvm_ir: Any = ir
_UNRESOLVED = _core.codegen.RuntimeLinker.PREFIX  # of a recursive call
_ENVIRONMENT = "_ZN08NumbaEnv"
NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_PARTS = {"build_tuple", "cast", "exhaust_iter", "iternext", "pair_first", "pair_second", "phi"}
_INDICES = (_types.Integer, _types.SliceType, _types.EllipsisType, _types.NoneType)


class _KernelCache(KernelFiles):
    """Files of a kernel, with the interface of the ``_cache`` of a Numba dispatcher."""

    content: bytes | None = None
    """What :meth:`~.KernelFiles.locked` read for the next :meth:`load_overload`."""

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled kernel for a signature; None: there is no valid file."""
        target_context.refresh()
        arguments = _core.sigutils.normalize_signature(signature)[0]
        content, self.content = self.content or self.read(arguments), None
        if content is None:
            return None
        try:
            result = _core.compiler.CompileResult._rebuild(target_context, *pickle.loads(content))
        except Exception as error:  # of any class: Numba restores its own objects
            _log.warning(
                "a compiled kernel in %s cannot be loaded (%s); it is compiled again",
                self.cache_path,
                type(error).__name__,
            )
            return None
        self.mark_used(arguments)
        return result

    def save_overload(self, signature: Any, result: Any) -> None:
        """Write a compiled kernel with machine code, unless it has addresses of this process."""
        if result.library.is_complete and not result.library.has_dynamic_globals:
            arguments = _core.sigutils.normalize_signature(signature)[0]
            self.write(arguments, _core.serialize.dumps(result._reduce()))


class Kernel(_core.registry.CPUDispatcher):  # type: ignore[misc]
    """A compiled function, with its machine code on disk."""

    def __init__(
        self, py_func: Any, locals: Any = None, targetoptions: Any = None, **more: Any
    ) -> None:
        options = {"nopython": True, "boundscheck": None} | (targetoptions or {})
        super().__init__(py_func, locals, options, pipeline_class=_KernelCompiler, **more)
        self._cache = _KernelCache(self)
        self._without_code: set[Types] = set()

    def compile(self, sig: Any) -> Any:
        """Return the entry point for a signature; of a callee only while its caller compiles."""
        with _core.compiler_lock.global_compiler_lock:
            arguments = tuple(_core.sigutils.normalize_signature(sig)[0])
            if _requests and not self._is_separate:
                return self._compile_callee(sig)
            existing = self.overloads.get(arguments)
            if existing is not None and arguments not in self._without_code:
                return existing.entry_point
            if existing is not None:
                self._without_code.discard(arguments)
                del self.overloads[arguments]
            with ExitStack() as stack:
                self._cache.content = stack.enter_context(self._cache.locked(arguments))
                if self._cache.content is None:
                    stack.enter_context(reported(qualified_name(self)))
                stack.enter_context(_late_code(self, arguments))
                return super().compile(sig)

    def get_call_template(self, args: Types, kws: Mapping[str, Any]) -> Any:
        """Return the template of a call; Numba compiles a callee again for each constant."""
        named = {name: _types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(_types.unliteral, args)), named)

    def add_overload(self, result: Any) -> None:
        """Register a result; for calls from Python only if it has machine code."""
        if getattr(result.library, "is_complete", True):
            super().add_overload(result)
        else:
            arguments = tuple(result.signature.args)
            self.overloads[arguments] = result
            self._without_code.add(arguments)

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


class LateLibrary(_core.codegen.JITCodeLibrary):  # type: ignore[misc]
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
                found = _core.environment.lookup_environment(variable.name)
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
        return int(super().get_pointer_to_function(name))


def _module_of(library: Any) -> Any:
    """Module of a callee for linking."""
    module = library.module_without_callees() if isinstance(library, LateLibrary) else None
    return library._get_module_for_linking() if module is None else module


def _hide_callees(module: Any) -> None:
    """Make the functions that come from other modules internal, unless one is found by its name."""
    for function in () if _is_recursive(module) else module.functions:
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
    if outermost:
        _core.runtime.nrt.rtsys.initialize(context)
        generator._library_class = LateLibrary
        context.get_executable = _executable(context.get_executable)
    try:
        yield
    finally:
        _requests.pop()
        if outermost:
            del generator._library_class
            del context.get_executable


def _executable(get_executable: Any) -> Any:
    """Return a replacement for the method that makes a Python function of compiled code.

    Callees get a function without code, as Numba's own do: it is the name by which it is found.
    """

    def executable(library: Any, description: Any, globals_: Any) -> Any:
        """Return the Python function of a library; without code unless it is requested."""
        kernel, arguments = _requests[-1]
        function = kernel.py_func
        requested = (function.__module__, function.__qualname__, arguments)
        if (description.modname, description.qualname, tuple(description.argtypes)) == requested:
            library.is_separate = kernel._is_separate
        elif not library.is_complete:
            name, module = description.qualname.split(".")[-1], description.lookup_module()
            return _numba._dynfunc.make_function(module, name, "", 0, globals_, (library,))
        return get_executable(library, description, globals_)

    return executable


class _CompiledFunctionType(_types.FunctionType):  # type: ignore[misc]
    """Type of a compiled function; Numba's looks up the address in Python at every call."""


def _typeof(function: CompiledFunction, _: Any) -> _CompiledFunctionType:
    return _CompiledFunctionType(function.signature())


def _unboxed(kind: Any, function: Any, c: Any) -> Any:
    """Emit the conversion of the argument: its address is an attribute."""
    value = _core.cgutils.create_struct_proxy(kind)(c.context, c.builder)
    address = c.pyapi.object_getattr_string(function, "address")
    value.c_addr = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    pointer = c.context.get_value_type(_types.voidptr)
    value.py_addr = c.builder.ptrtoint(function, pointer)
    value.jit_addr = _llvm_ir.Constant(pointer, None)
    return _extending.NativeValue(value._getvalue())


_extending.register_model(_CompiledFunctionType)(FunctionModel)
_extending.typeof_impl.register(CompiledFunction)(_typeof)
_extending.unbox(_CompiledFunctionType)(_unboxed)


@extending.intrinsic
def uncounted(_: Any, value: Any) -> tuple[Any, Callable[..., Any]]:
    """Return a value, of whose arrays no reference is counted."""

    def build(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        """Emit a copy of the value whose arrays refer to no reference count and no parent."""
        return _without_counts(context, builder, value, arguments[0])

    return value(value), build


def _without_counts(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, _types.Array):
        made = context.make_array(kind)(context, builder, value=value)
        made.meminfo = _core.cgutils.get_null_value(made.meminfo.type)
        made.parent = _core.cgutils.get_null_value(made.parent.type)
        return made._getvalue()
    if isinstance(kind, _types.BaseTuple):
        parts = [
            _without_counts(context, builder, part, builder.extract_value(value, i))
            for i, part in enumerate(kind.types)
        ]
        return context.make_tuple(builder, kind, parts)
    return value


class _BorrowedArrays(_core.compiler_machinery.AnalysisPass):  # type: ignore[misc]
    """Switches the reference counts off if they are not needed."""

    _name = "borrowed_arrays"

    def __init__(self) -> None:  # abstract in the base class
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Decide for the function that is compiled."""
        if not _creates_arrays(state):
            state.targetctx.enable_nrt = False
        return False


_core.compiler_machinery.register_pass(mutates_CFG=False, analysis_only=True)(_BorrowedArrays)


class _KernelCompiler(_core.compiler.CompilerBase):  # type: ignore[misc]
    """Numba's compiler with :class:`_BorrowedArrays`."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes from byte code to machine code."""
        passes: Any = _core.compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_BorrowedArrays, _core.typed_passes.AnnotateTypes)
        passes.finalize()
        return [passes]


def _creates_arrays(state: Any) -> bool:
    """Return whether a function returns an array, or assigns one that it may have created."""
    models, types_of = state.targetctx.data_model_manager, state.typemap

    def counted(kind: Any) -> bool:
        """Return whether values of a type hold references."""
        return bool(models[kind].contains_nrt_meminfo())

    if counted(state.return_type):
        return True
    for statement in chain.from_iterable(block.body for block in state.func_ir.blocks.values()):
        if isinstance(statement, _core.ir.Assign):
            if counted(types_of[statement.target.name]) and not _is_part(statement.value, types_of):
                return True
        elif isinstance(statement, _core.ir.SetItem | _core.ir.StaticSetItem):
            if counted(types_of[statement.value.name]):
                return True  # an array, which is copied if the two overlap
        elif not isinstance(statement, _core.ir.Del | _core.ir.Terminator | _core.ir.Expr):
            return True
    return False


def _is_part(value: Any, types_of: Any) -> bool:
    """Return whether a value is an argument, a constant array, a part or a view of a variable."""
    if not isinstance(value, _core.ir.Expr):
        return isinstance(value, _core.ir.Arg | _core.ir.FreeVar | _core.ir.Global | _core.ir.Var)
    if value.op == "call":
        return isinstance(types_of[value.func.name], _types.NamedTupleClass)
    if value.op not in {"getattr", "getitem", "getiter", "static_getitem"}:
        return value.op in _PARTS
    whole = types_of[value.value.name]
    if not isinstance(whole, _types.Array):
        return isinstance(whole, _types.BaseTuple)
    if value.op in {"getattr", "getiter"}:
        return bool(value.op == "getiter")
    index = value.index_var if value.op == "static_getitem" else value.index
    return index is not None and _is_basic(types_of[index.name])


def _is_basic(index: Any) -> bool:
    """Return whether indexing an array with this type gives a view or a number."""
    each = getattr(index, "types", (index,)) if isinstance(index, _types.BaseTuple) else (index,)
    return all(isinstance(one, _INDICES) for one in each)
