"""Special functions of generated code.

Most are those of SciPy, called by address. The others are defined here, in the subset of
Python of generated code, and translated with it.
"""

from __future__ import annotations

import ast
import ctypes
import math
from functools import cache
from pathlib import Path
from typing import Any

from scipy.special import cython_special, gamma, psi

from fastslow.kernels.compiler.native import External, Names, Written
from fastslow.quotients import QUOTIENTS, tables

#: Translated from the imported version, even if the file changes later.
_TREE = ast.parse(
    Path(__file__).read_bytes() + (Path(__file__).parents[1] / "quotients.py").read_bytes()
)

#: Functions of SciPy by their number of arguments; each returns a number.
_VALUES = {
    **dict.fromkeys(("gamma", "loggamma", "psi", "zetac"), 1),
    **dict.fromkeys(("expi", "erfi", "erfinv", "erfcinv", "ellipk", "ellipe"), 1),
    **dict.fromkeys(("jv", "yv", "iv", "kv", "expn", "ellipkinc", "ellipeinc"), 2),
    **dict.fromkeys(("beta", "gammainc", "gammaincc"), 2),
}

#: Functions of one argument that fill several numbers; the last argument says which is meant:
#: Ai, Ai', Bi, Bi'; Si, Ci; Shi, Chi; Fresnel's S, C.
_SEVERAL = {"airy": 4, "sici": 2, "shichi": 2, "fresnel": 2}

#: Cython's functions that may be overridden take a number that says whether to look for that.
_DIRECT = 0


def _external(name: str) -> External:
    if name in _SEVERAL:
        return External(f"scipy_{name}", 1, _SEVERAL[name])
    return External(f"scipy_{name}", _VALUES[name], last=_DIRECT)


@cache
def addresses() -> dict[str, int]:
    """Addresses of SciPy's functions by their symbols.

    Raises
    ------
    ImportError
        If this version of SciPy has one of them in another form.
    """
    return {_external(name).symbol: _address(name) for name in (*_VALUES, *_SEVERAL)}


def _address(name: str) -> int:
    if name in _SEVERAL:
        kinds = ["double"] + ["double *"] * _SEVERAL[name]
        wanted = f"void ({', '.join(kinds)})"
    else:
        wanted = f"double ({'double, ' * _VALUES[name]}int __pyx_skip_dispatch)"
    capsules = cython_special.__pyx_capi__
    # the number of a fused type differs between functions and between versions
    for known in (name, *(f"__pyx_fuse_{k}{name}" for k in range(3))):
        if known in capsules and _signature(capsules[known]) == wanted:
            return _pointer(capsules[known])
    raise ImportError(f"scipy.special.cython_special has no {name} with the signature {wanted}")


def _signature(capsule: Any) -> str:
    name_of = ctypes.pythonapi.PyCapsule_GetName
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    return name_of(capsule).decode()


def _pointer(capsule: Any) -> int:
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype = ctypes.c_void_p
    pointer_of.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(pointer_of(capsule, _signature(capsule).encode()))


@cache
def names() -> Names:
    """Special functions available to generated source, for its translation."""
    written = {f.__name__ for f in (polygamma, lambertw)} | {*QUOTIENTS}
    functions = {n.name: n for n in _TREE.body if isinstance(n, ast.FunctionDef)}
    return {
        **{name: _external(name) for name in (*_VALUES, *_SEVERAL)},
        **{name: Written(functions[name], fused=True) for name in written},
        "_BERNOULLI": _BERNOULLI,
        **tables(),
    }


#: Bernoulli numbers B_2j over (2j)!, of Euler and Maclaurin's sum.
_BERNOULLI = (
    1.0 / 12.0,
    -1.0 / 720.0,
    1.0 / 30240.0,
    -1.0 / 1209600.0,
    1.0 / 47900160.0,
    -691.0 / 1307674368000.0,
    1.0 / 74724249600.0,
)


def polygamma(n: float, x: float) -> float:
    """The n-th derivative of digamma, by its sum with Euler and Maclaurin's remainder."""
    if n == 0.0:
        return psi(x)
    half = 0.5 * n
    odd = half != math.floor(half)
    if x <= 0.0 and x == math.floor(x):
        return math.inf if odd else math.nan
    s = n + 1.0
    total = 0.0
    while x < 10.0 + n:
        total += math.pow(x, -s)
        x += 1.0
    power = math.pow(x, -s)
    total += x * power / n + 0.5 * power
    factor = s * power / x
    for j in range(len(_BERNOULLI)):
        total += _BERNOULLI[j] * factor
        factor *= (s + 2.0 * j + 1.0) * (s + 2.0 * j + 2.0) / (x * x)
    sign = 1.0 if odd else -1.0
    return sign * gamma(n + 1.0) * total


def lambertw(x: float, branch: float) -> float:
    """The real branches 0 and -1 of W exp(W) = x, by Halley's method (Corless et al. 1996)."""
    if math.isnan(x) or x < -1.0 / math.e or (branch < 0.0 and x >= 0.0):
        below = 1.0 + math.e * x
        # the branch point is not representable in floating point
        return -1.0 if abs(below) < 1e-15 else math.nan
    if x == 0.0 or math.isinf(x):
        return x
    # about the branch point in powers of p, far from it by logarithms
    p = math.sqrt(max(2.0 * (1.0 + math.e * x), 0.0))
    if branch < 0.0:
        p = -p
        if x > -0.2:
            far = math.log(-x)
            w = far - math.log(-far)
        else:
            w = -1.0 + p * (1.0 - p * (1.0 / 3.0 - p * 11.0 / 72.0))
    elif x < 0.0:
        w = -1.0 + p * (1.0 - p * (1.0 / 3.0 - p * 11.0 / 72.0))
    else:
        w = math.log1p(x)
        w = w * (1.0 - math.log1p(w) / (2.0 + w))
    for _ in range(20):
        power = math.exp(w)
        f = w * power - x
        if f == 0.0 or w == -1.0:
            break
        step = f / (power * (w + 1.0) - (w + 2.0) * f / (2.0 * w + 2.0))
        w -= step
        if abs(step) <= 1e-16 * (1.0 + abs(w)):
            break
    return w
