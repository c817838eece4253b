"""Compilation of a loop, with all functions it calls, into one object by Numba."""

from __future__ import annotations

import linecache
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from types import ModuleType
from typing import Any

import llvmlite.binding as llvm
from numba import njit, types
from numba.core import event
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target

from fastslow.kernels.compiler.decorators import OPTIONS
from fastslow.kernels.compiler.loop_target import ENTRY, processor, target_machine
from fastslow.kernels.compiler.signals import between_passes

#: Numba's event before and after each pass of its compiler.
_PASS = "numba:run_pass"


class _Passes(event.Listener):
    """Handles signals between Numba's passes."""

    def on_start(self, _: Any) -> None:
        between_passes()

    def on_end(self, _: Any) -> None:
        pass


def watched_passes() -> AbstractContextManager[None]:
    """Context in which compilations by Numba can be interrupted between passes."""
    return event.install_listener(_PASS, _Passes())


class _LinkedLibrary(JITCodeLibrary):
    """A function that is only linked into others: neither optimised nor loaded."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_specific(self) -> None:
        pass

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0


class _Codegen(JITCPUCodegen):
    """Numba's code generator for the target processor of loops."""

    _library_class = _LinkedLibrary

    def _customize_tm_options(self, options: dict[str, Any]) -> None:
        super()._customize_tm_options(options)
        options["cpu"], options["features"] = processor(), ""

    def _add_module(self, module: Any) -> None:
        pass

    def set_env(self, env_name: str, env: Any) -> None:
        pass


_codegen: _Codegen | None = None

#: All functions whose compilation was started. Numba removes one in a finaliser, which loses an
#: interrupt during garbage collection; so interrupted ones are kept as well.
_begun: list[Any] = []


@contextmanager
def _in_place() -> Iterator[None]:
    """Replace the code generator of Numba's CPU context by `_Codegen` meanwhile."""
    global _codegen
    with global_compiler_lock:
        context = cpu_target.target_context
        if _codegen is None:
            _codegen = _Codegen("fastslow")
        usual, context._internal_codegen = context._internal_codegen, _codegen
        try:
            yield
        finally:
            context._internal_codegen = usual


def compiled_object(source: str, function: str) -> bytes:
    """Machine code of a function of slots (see `fastslow.kernels.compiler.slots`).

    Parameters
    ----------
    source : str
        Source of a module.
    function : str
        Name of the function in it.
    """
    name = f"<{function}>"
    module = ModuleType(f"fastslow_{function}")
    linecache.cache[name] = (len(source), None, source.splitlines(keepends=True), name)
    exec(compile(source, name, "exec"), module.__dict__)
    with _in_place(), watched_passes():
        entry: Any = njit(**OPTIONS)(getattr(module, function))
        _begun.append(entry)
        entry.compile((types.CPointer(types.int64),))
        (made,) = entry.overloads.values()
        whole = made.library._final_module.clone()
    return _object(whole, made.fndesc.llvm_func_name)


def _object(module: Any, entry: str) -> bytes:
    """Optimised object code of a module with its entry as the only exported symbol."""
    machine = target_machine()
    for function in module.functions:
        if function.name == entry:
            function.name = ENTRY
            function.linkage = "external"
        elif not function.is_declaration:
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    module.verify()
    between_passes()
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    # loops over states and orders are short: unrolled they take a third longer to compile, and
    # run as fast
    options.slp_vectorization = options.loop_unrolling = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    between_passes()
    return bytes(machine.emit_object(module))
