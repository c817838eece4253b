"""Compilation and loading of LLVM modules."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from fastslow.kernels.signals import between_passes

#: Optimisation level of LLVM: the next one takes longer without gain.
_LEVEL = 1


@dataclass(frozen=True)
class _Machine:
    """Target of code, and the linker that loads it."""

    triple: str
    target: Any
    linker: Any


@cache
def _machine() -> _Machine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = llvm.get_process_triple()
    linker = llvm.create_lljit_compiler(_target(triple), suppress_errors=True)
    return _Machine(triple, _target(triple), linker)


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
        options = llvm.create_pipeline_tuning_options(speed_level=_LEVEL)
        options.loop_vectorization = options.slp_vectorization = False
        # the loops of series are short: unrolling triples the compilation time without gain
        options.loop_unrolling = False
        builder = llvm.create_pass_builder(machine.target, options)
        # a module has one function, or a few: passes of modules take half of the time without gain
        manager = builder.getFunctionPassManager()
        for function in parsed.functions:
            if not function.is_declaration:
                manager.run(function, builder)
        between_passes()
    return bytes(machine.target.emit_object(parsed))


_numbers = count()

#: Code remains valid as long as its library object.
_loaded: list[Any] = []


def load_object(code: bytes, name: str, symbols: Mapping[str, int]) -> int:
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
    loaded = library.link(_machine().linker, f"generated_{next(_numbers)}")
    _loaded.append(loaded)
    return int(loaded[name])
