"""Several trajectories at once: functions traced into vector instructions.

Each number of a traced function is a vector with one element, or lane, for
every trajectory. The function is run once, as Python, on numbers that write
down what is done with them; its loops and whole numbers are gone by then.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

#: Trajectories side by side.
WIDTH = 8

DOUBLE = ir.DoubleType()
WHOLE = ir.IntType(64)


class Lanes:
    """A vector of numbers, or a sum of products whose terms are not yet added.

    They are added when the sum is first used, the terms that are known first
    before the others, so that none waits for the latest.
    """

    def __init__(self, trace: Trace, value: Any, terms: tuple[Any, ...] = (), steady: bool = False):
        self.trace, self.terms, self.steady = trace, terms, steady
        self._value = value
        self.age = trace.next_age() if value is not None else -1

    @property
    def value(self) -> Any:
        """The vector, with its terms added."""
        if self._value is None:
            total = self.trace.add_up(self.terms)
            self._value, self.age, self.steady = total._value, total.age, total.steady
            self.terms = ()
        return self._value

    def _parts(self, sign: int = 1) -> tuple[Any, ...]:
        if self._value is not None:
            return ((sign, self, None),)
        return tuple((sign * s, a, b) for s, a, b in self.terms)

    def _plus(self, other: Any, mine: int, its: int) -> Any:
        if not isinstance(other, Lanes):
            if other == 0:
                return self if mine > 0 else -self
            other = self.trace.constant(other)
        return Lanes(self.trace, None, self._parts(mine) + other._parts(its))

    def __add__(self, other: Any) -> Any:
        return self._plus(other, 1, 1)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self._plus(other, 1, -1)

    def __rsub__(self, other: Any) -> Any:
        return self._plus(other, -1, 1)

    def __mul__(self, other: Any) -> Any:
        if not isinstance(other, Lanes):
            if other == 0:
                return 0.0
            if other == 1:
                return self
            if other == -1:
                return -self
            other = self.trace.constant(other)
        return Lanes(self.trace, None, ((1, self, other),))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self.trace.emit("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if other == 0 else self.trace.emit("fdiv", other, self)

    def __neg__(self) -> Any:
        return self.trace.emit("fneg", self)

    def __abs__(self) -> Any:
        return self.trace.intrinsic("fabs", self)

    def __lt__(self, other: Any) -> Any:
        return self.trace.compare("<", self, other)

    def __gt__(self, other: Any) -> Any:
        return self.trace.compare(">", self, other)

    def __le__(self, other: Any) -> Any:
        return self.trace.compare("<=", self, other)

    def __ge__(self, other: Any) -> Any:
        return self.trace.compare(">=", self, other)


class Workspace(dict):
    """Coefficients by their place; what is put there is added up."""

    def __setitem__(self, place, number):
        if isinstance(number, Lanes):
            number.value  # noqa: B018
        super().__setitem__(place, number)


class Trace:
    def __init__(self, context, builder, before, width):
        self.context, self.builder, self.before, self.width = context, builder, before, width
        self.vector = ir.VectorType(DOUBLE, width)
        self.whole = ir.VectorType(WHOLE, width)
        self.ages = 0
        self.count = 0
        self.valid = []

    def next_age(self):
        self.ages += 1
        return self.ages

    def constant(self, x):
        return Lanes(self, ir.Constant(self.vector, [float(x)] * self.width), steady=True)

    def lift(self, x):
        return x if isinstance(x, Lanes) else self.constant(x)

    def _builder(self, args):
        return self.before if all(a.steady for a in args) else self.builder

    def emit(self, op, *args):
        args = [self.lift(a) for a in args]
        values = [a.value for a in args]
        b = self._builder(args)
        self.count += 1
        return Lanes(self, getattr(b, op)(*values), steady=b is self.before)

    def intrinsic(self, name, *args):
        args = [self.lift(a) for a in args]
        values = [a.value for a in args]
        b = self._builder(args)
        kind = ir.FunctionType(self.vector, [self.vector] * len(values))
        full = f"llvm.{name}.v{self.width}f64"
        f = b.module.globals.get(full) or ir.Function(b.module, kind, full)
        self.count += 1
        return Lanes(self, b.call(f, values), steady=b is self.before)

    def compare(self, op, a, b):
        a, b = self.lift(a), self.lift(b)
        return self.builder.fcmp_ordered(op, a.value, b.value)

    def select(self, mask, a, b):
        a, b = self.lift(a), self.lift(b)
        return Lanes(self, self.builder.select(mask, a.value, b.value))

    def add_up(self, terms):
        for _, a, b in terms:
            a.value
            if b is not None:
                b.value
        order = sorted(terms, key=lambda term: max(term[1].age, term[2].age if term[2] is not None else -1))
        # a single number that is added begins
        total = None
        for sign, a, b in order:
            if total is None:
                total = a if b is None else self.emit("fmul", a, b)
                if sign < 0:
                    total = self.emit("fneg", total)
            elif b is None:
                total = self.emit("fadd" if sign > 0 else "fsub", total, a)
            else:
                if sign < 0:
                    a = self.emit("fneg", a)
                total = self.intrinsic("fmuladd", a, b, total)
        return total

    def scalars(self, function, *args):
        """function of each lane, as Numba compiles it"""
        from numba import types
        from numba.core.typing import signature
        args = [self.lift(a) for a in args]
        values = [a.value for a in args]
        b = self._builder(args)
        sig = signature(types.float64, *[types.float64] * len(args))
        result = ir.Constant(self.vector, ir.Undefined)
        for i in range(self.width):
            place = ir.Constant(ir.IntType(32), i)
            one = self.context.compile_internal(b, function, sig, [b.extract_element(v, place) for v in values])
            result = b.insert_element(result, one, place)
        return Lanes(self, result, steady=b is self.before)

    def bits(self, x):
        return self.builder.bitcast(x.value, self.whole)

    def number(self, bits):
        return Lanes(self, self.builder.bitcast(bits, self.vector))

    def whole_constant(self, n):
        return ir.Constant(self.whole, [n] * self.width)


MAGIC = 1.5 * 2.0**52
P1 = float.fromhex("0x1.921fb54400000p+0")
P2 = float.fromhex("0x1.0b4611a600000p-34")
P3 = float.fromhex("0x1.3198a2e037073p-69")
SIN = [-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04, 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10]
COS = [4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05, -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11]


def horner(cs, x):
    v = cs[-1]
    for c in reversed(cs[:-1]):
        v = v * x + c
        if isinstance(v, Lanes): v.value
    return v


def sincos(x):
    T = x.trace
    if x.steady:
        import math
        return T.scalars(lambda z: math.sin(z), x), T.scalars(lambda z: math.cos(z), x)
    shifted = x * (2 / 3.141592653589793) + MAGIC
    n = shifted - MAGIC
    n.value
    r = x - n * P1
    r.value
    r = r - n * P2
    r.value
    r = r - n * P3
    r.value
    z = r * r
    z.value
    s = r + (z * r) * horner(SIN, z)
    c = 1.0 - 0.5 * z + (z * z) * horner(COS, z)
    q = T.bits(shifted)
    b = T.builder
    odd = b.trunc(q, ir.VectorType(ir.IntType(1), T.width))
    def signed(v, q):
        sign = b.shl(b.and_(q, T.whole_constant(2)), T.whole_constant(62))
        return T.number(b.xor(T.bits(v), sign))
    T.valid.append(abs(x) < 1e6)
    sine = signed(T.select(odd, c, s), q)
    cosine = signed(T.select(odd, s, c), b.add(q, T.whole_constant(1)))
    return sine, cosine


LOG2 = None
def _fit():
    import numpy as np
    from numpy.polynomial import chebyshev as C, polynomial as P
    m = np.cos(np.pi * (np.arange(40) + .5) / 40)
    c = C.chebfit(m, np.log2(1.5 + .5 * m), 4)
    p = C.cheb2poly(c)  # in u = 2 m - 3
    e = C.cheb2poly(C.chebfit(m, 2.0 ** (.5 * m), 4))
    e = e * 2.0 ** np.arange(5)
    return p, e
_L, _E = _fit()


def log2(x):
    T = x.trace; b = T.builder
    q = T.bits(x)
    e = T.number(b.or_(b.lshr(q, T.whole_constant(52)), T.whole_constant(0x4330000000000000))) - (2.0**52 + 1023.0)
    m = T.number(b.or_(b.and_(q, T.whole_constant(2**52 - 1)), T.whole_constant(0x3FF0000000000000)))
    u = 2.0 * m - 3.0
    u.value
    return e + horner([float(c) for c in _L], u)


def exp2(y):
    T = y.trace; b = T.builder
    shifted = y + MAGIC
    n = shifted - MAGIC
    n.value
    f = y - n
    f.value
    v = horner([float(c) for c in _E], f)
    return T.number(b.add(T.bits(v), b.shl(T.bits(shifted), T.whole_constant(52))))
