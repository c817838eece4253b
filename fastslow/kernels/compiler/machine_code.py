"""Compilation and loading of LLVM modules."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any, Self

import llvmlite
import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from fastslow.kernels.compiler.signals import between_passes

#: Optimisation level of LLVM: the next one takes longer without gain.
_LEVEL = 1


@dataclass(frozen=True)
class _Machine:
    """Target of code."""

    triple: str
    target: Any


@cache
def _machine() -> _Machine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = llvm.get_process_triple()
    return _Machine(triple, _target(triple))


def _target(triple: str) -> Any:
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=_LEVEL,
        reloc="static" if triple.startswith("x86") else "default",
        codemodel="jitdefault",
        jit=True,
    )


@cache
def _passes() -> tuple[Any, Any]:
    """Builder and manager of the passes, made once: llvmlite does not release a manager."""
    options = llvm.create_pipeline_tuning_options(speed_level=_LEVEL)
    options.loop_vectorization = options.slp_vectorization = False
    # the loops of series are short: unrolling triples the compilation time without gain
    options.loop_unrolling = False
    builder = llvm.create_pass_builder(_machine().target, options)
    # a module has one function, or a few: passes of modules take half of the time without gain
    return builder, builder.getFunctionPassManager()


@cache
def platform_key() -> str:
    """Platform and versions that machine code depends on besides its sources."""
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    version = ".".join(map(str, llvm.llvm_version_info))
    # functions of lanes contain constants computed by NumPy
    versions = (llvmlite.__version__, version, np.__version__)
    return "|".join((*versions, llvm.get_process_triple(), cpu, features))


def object_code(build: Callable[[ir.Module], None], *, passes: bool = True) -> bytes:
    """Machine code of a module for the current processor.

    Parameters
    ----------
    build : callable
        Fills the empty module.
    passes : bool
        Whether to run the optimisation passes.
    """
    machine = _machine()
    module = ir.Module("generated")
    module.triple, module.data_layout = machine.triple, str(machine.target.target_data)
    build(module)
    between_passes()
    parsed = llvm.parse_assembly(str(module))
    parsed.verify()
    between_passes()
    if passes:
        builder, manager = _passes()
        for function in parsed.functions:
            if not function.is_declaration:
                manager.run(function, builder)
        between_passes()
    return bytes(machine.target.emit_object(parsed))


class _Library:
    """Loaded code, which is released with this object.

    A linker keeps some memory for each library that it ever had, so that it is released with
    the last of a limited number of libraries.
    """

    def __init__(self, builder: Any) -> None:
        with _lock:
            number = next(_numbers)
            if number % LIBRARIES == 0:
                target = _target(_machine().triple)
                _linkers[:] = [llvm.create_lljit_compiler(target, suppress_errors=True)]
            self.linker = _linkers[0]
            self.tracker = builder.link(self.linker, f"generated_{number}")

    def __del__(self, at_exit: Callable[[], bool] = sys.is_finalizing) -> None:
        if not hasattr(self, "tracker"):
            return
        if at_exit():
            # the process ends, with the modules that the release needs
            self.tracker.detach()
            self.linker.detach()
        else:
            # before the linker
            self.tracker.close()


class Address(int):
    """Address of a function, whose code remains loaded as long as this number is referenced.

    Whatever calls the function keeps this object, and no plain number made from it.
    """

    library: _Library

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        return self


#: Number of libraries of one linker.
LIBRARIES = 128

_numbers = count()
_linkers: list[Any] = []
_lock = threading.Lock()


def load_object(code: bytes, name: str, symbols: Mapping[str, int]) -> Address:
    """Load machine code and return the address of one of its functions.

    Parameters
    ----------
    code : bytes
    name : str
        The function.
    symbols : mapping
        Addresses of other functions that it calls, except those of the C library.

    Raises
    ------
    RuntimeError
        If the code calls an unknown function.
    """
    library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
    for symbol, address in symbols.items():
        library.import_symbol(symbol, address)
    library.export_symbol(name)
    loaded = _Library(library)
    address = Address(loaded.tracker[name])
    address.library = loaded
    return address
