"""What the machine code of loops is made for: a class of processors, and not the one at hand.

So that an object which was made elsewhere has the bits of one that is made here.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import llvmlite.binding as llvm

#: The one function of an object that can be seen.
ENTRY = "fastslow_loop"

#: What a processor of the class x86-64-v3 has, after those of 2013.
_V3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2", "ssse3")


@cache
def processor() -> str:
    """LLVM's name of the class that the processor at hand belongs to."""
    if not llvm.get_process_triple().startswith("x86_64"):
        return "generic"
    features = llvm.get_host_cpu_features()
    return "x86-64-v3" if all(features.get(name) for name in _V3) else "x86-64"


def platform_name() -> str:
    """The platform and the class of processors of an object."""
    return f"{llvm.get_process_triple()}-{processor()}"


@cache
def target_machine() -> Any:
    """LLVM's machine for loops: position-independent code that can be put anywhere."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=processor(), features="", opt=3, reloc="pic", codemodel="small"
    )
