"""Values of special functions for generated code.

Most are SciPy's own, called by their addresses: generated code that was read
from the disk finds them under the names that are given to them when this
module is imported.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import types
from scipy.special import cython_special

from fastslow.compiled.parts import part


def _external(name: str, arguments: int, results: int = 0) -> Any:
    """A function of real numbers out of SciPy, which fills pointers if it has several results."""
    capsules = cython_special.__pyx_capi__
    if results:
        kinds = ["double"] * arguments + ["double *"] * results
        wanted = f"void ({', '.join(kinds)})"
        kind = types.void(*[types.float64] * arguments, *[types.CPointer(types.float64)] * results)
    else:
        wanted = f"double ({', '.join(['double'] * arguments)}, int __pyx_skip_dispatch)"
        kind = types.float64(*[types.float64] * arguments, types.int32)
    # the number of a fused type differs between functions and between versions
    for known in (name, *(f"__pyx_fuse_{k}{name}" for k in range(3))):
        if known in capsules and _signature(capsules[known]) == wanted:
            symbol = f"fastslow_{name}"
            llvm.add_symbol(symbol, _address(capsules[known]))
            return types.ExternalFunction(symbol, kind)
    raise ImportError(f"scipy.special.cython_special has no {name} with the signature {wanted}")


def _signature(capsule: Any) -> str:
    name_of = ctypes.pythonapi.PyCapsule_GetName
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    return name_of(capsule).decode()


def _address(capsule: Any) -> int:
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype = ctypes.c_void_p
    pointer_of.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(pointer_of(capsule, _signature(capsule).encode()))


# each takes one more argument of no meaning, 0
gamma = _external("gamma", 1)
loggamma = _external("loggamma", 1)
psi = _external("psi", 1)
zetac = _external("zetac", 1)
jv, yv = _external("jv", 2), _external("yv", 2)
iv, kv = _external("iv", 2), _external("kv", 2)
expi = _external("expi", 1)
expn = _external("expn", 2)
erfi = _external("erfi", 1)
erfinv, erfcinv = _external("erfinv", 1), _external("erfcinv", 1)
ellipk, ellipe = _external("ellipk", 1), _external("ellipe", 1)
ellipkinc, ellipeinc = _external("ellipkinc", 2), _external("ellipeinc", 2)
beta = _external("beta", 2)
gammainc, gammaincc = _external("gammainc", 2), _external("gammaincc", 2)
_airy = _external("airy", 1, 4)
_sici, _shichi = _external("sici", 1, 2), _external("shichi", 1, 2)
_fresnel = _external("fresnel", 1, 2)


@part
def airy(x, which):
    """Ai, Ai', Bi or Bi'."""
    out = np.empty(4)
    _airy(x, out.ctypes, out[1:].ctypes, out[2:].ctypes, out[3:].ctypes)
    return out[which]


@part
def sine_cosine_integral(x, which):
    """Si or Ci."""
    out = np.empty(2)
    _sici(x, out.ctypes, out[1:].ctypes)
    return out[which]


@part
def hyperbolic_integral(x, which):
    """Shi or Chi."""
    out = np.empty(2)
    _shichi(x, out.ctypes, out[1:].ctypes)
    return out[which]


@part
def fresnel(x, which):
    """Fresnel's S or C."""
    out = np.empty(2)
    _fresnel(x, out.ctypes, out[1:].ctypes)
    return out[which]


@part
def sinc(x):
    """Sine of x over x, also at 0."""
    return math.sin(x) / x if x != 0.0 else 1.0


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


@part
def polygamma(n, x):
    """The n-th derivative of digamma, by its sum with Euler and Maclaurin's remainder."""
    if n == 0.0:
        return psi(x, 0)
    if x <= 0.0 and x == math.floor(x):
        return math.inf if n % 2.0 == 1.0 else math.nan
    s, total = n + 1.0, 0.0
    while x < 10.0 + n:
        total += math.pow(x, -s)
        x += 1.0
    power = math.pow(x, -s)
    total += x * power / n + 0.5 * power
    factor = s * power / x
    for j in range(len(_BERNOULLI)):
        total += _BERNOULLI[j] * factor
        factor *= (s + 2.0 * j + 1.0) * (s + 2.0 * j + 2.0) / (x * x)
    sign = 1.0 if n % 2.0 == 1.0 else -1.0
    return sign * gamma(n + 1.0, 0) * total


@part
def lambertw(x, branch):
    """The real branches 0 and -1 of W exp(W) = x, by Halley's method (Corless et al. 1996)."""
    if math.isnan(x) or x < -1.0 / math.e or (branch < 0.0 and x >= 0.0):
        below = 1.0 + math.e * x
        # the branch point itself is no number in floating point
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
