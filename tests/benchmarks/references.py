"""The gear in C, compiled where there is a compiler."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

_DOUBLES = np.ctypeslib.ndpointer(np.float64, flags="C")
_LONGS = np.ctypeslib.ndpointer(np.dtype("l"), flags="C")


@cache
def gear_in_c() -> ctypes.CDLL | None:
    """`gear.c` as a library; None without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    folder = Path(tempfile.mkdtemp())
    target, source = folder / "gear.so", Path(__file__).with_name("gear.c")
    flags = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", target, source, "-lm", "-lpthread"], check=True)
    library = ctypes.CDLL(str(target))
    shutil.rmtree(folder)
    number = ctypes.c_double
    library.run.argtypes = [*[number] * 7, _DOUBLES, ctypes.c_long, _DOUBLES]
    library.run.restype = ctypes.c_long
    library.many.argtypes = [
        number, number, _DOUBLES, _DOUBLES, number, number, number, ctypes.c_long, ctypes.c_long,
        _DOUBLES, _LONGS,
    ]  # fmt: skip
    library.many.restype = None
    return library
