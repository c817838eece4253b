"""Target of the machine code of loops: a class of processors instead of the current one.

Objects built elsewhere are therefore identical to those built here.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import llvmlite.binding as llvm

#: The exported function of an object.
ENTRY = "fastslow_loop"

#: Features of a processor of the class x86-64-v3 (from 2013 on).
_V3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2", "ssse3")


@cache
def processor() -> str:
    """LLVM's name of the class of the current processor."""
    if not llvm.get_process_triple().startswith("x86_64"):
        return "generic"
    features = llvm.get_host_cpu_features()
    return "x86-64-v3" if all(features.get(name) for name in _V3) else "x86-64"


def platform_name() -> str:
    """Platform and class of processors of an object."""
    return f"{llvm.get_process_triple()}-{processor()}"


@cache
def target_machine() -> Any:
    """LLVM's target machine for loops, with position-independent code."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=processor(), features="", opt=3, reloc="pic", codemodel="small"
    )
