"""Functions of several trajectories at once, traced into vector instructions.

Every number of such a function is a vector with one element, or lane, for each trajectory. The
function runs once, as Python, on numbers that record the operations applied to them; its loops
and integers are unrolled by then. Operations never mix lanes, so that each result depends on its
own lane alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

from llvmlite import ir

from fastslow.kernels.compiler.native import elementary

#: Number of lanes: enough to hide the latency of one by the others.
WIDTH = 8

_DOUBLE = ir.DoubleType()
_INTEGER = ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_INTEGERS = ir.VectorType(_INTEGER, WIDTH)


@lru_cache(maxsize=1024)
def _constant(number: str) -> Any:
    """A number, as hexadecimal text, in every lane; its text in a module is written once."""
    return ir.Constant(_VECTOR, [float.fromhex(number)] * WIDTH)


@lru_cache(maxsize=1024)
def _integers(number: int) -> Any:
    """An integer in every lane."""
    return ir.Constant(_INTEGERS, [number] * WIDTH)


class Mask:
    """A boolean for every lane: the first of 64 bits, as set by the processor's comparisons."""

    def __init__(self, trace: Trace, value: Any, bits: Any = None) -> None:
        self.trace, self.value, self._bits = trace, value, bits

    @property
    def bits(self) -> Any:
        """The booleans, one bit for each lane."""
        if self._bits is not None:
            return self._bits
        return self.trace.builder.icmp_signed("<", self.value, _integers(0))

    def __and__(self, other: Mask) -> Mask:
        return Mask(self.trace, self.trace.builder.and_(self.value, other.value))

    def __or__(self, other: Mask) -> Mask:
        return Mask(self.trace, self.trace.builder.or_(self.value, other.value))

    def __invert__(self) -> Mask:
        return Mask(self.trace, self.trace.builder.not_(self.value))

    def choose(self, a: Any, b: Any) -> Lanes:
        """Return the first number where the mask is true, else the second."""
        a, b = self.trace.lanes(a), self.trace.lanes(b)
        return Lanes(self.trace, self.trace.builder.select(self.bits, a.value, b.value))

    def all_true(self) -> Any:
        """Return whether the mask is true in every lane, for a branch."""
        builder = self.trace.builder
        kind = ir.IntType(WIDTH)
        packed = builder.bitcast(self.bits, kind)
        return builder.icmp_unsigned("==", packed, ir.Constant(kind, 2**WIDTH - 1))


class Lanes:
    """A vector of numbers, or a sum of products whose terms are not yet added.

    They are added when the sum is first used, in the order in which they become available, so
    that no addition waits for the latest of them.
    """

    def __init__(
        self, trace: Trace, value: Any, terms: tuple[Any, ...] = (), invariant: bool = False
    ) -> None:
        self.trace, self._value, self._terms = trace, value, terms
        self._invariant, self._order = invariant, trace.order()

    @property
    def value(self) -> Any:
        """The vector, its terms added."""
        if self._value is None:
            total = self.trace.sum_of(self._terms)
            self._value, self._order, self._invariant = total.value, total.order, total.invariant
            self._terms = ()
        return self._value

    @property
    def order(self) -> int:
        """A number that increases from each vector to the next."""
        return self._order if self.value is not None else 0

    @property
    def invariant(self) -> bool:
        """Whether it depends on invariants alone, and is thus computed once for all steps."""
        return self.value is not None and self._invariant

    def _signed_terms(self, sign: int) -> tuple[Any, ...]:
        if self._value is not None:
            return ((sign, self, None),)
        return tuple((sign * s, a, b) for s, a, b in self._terms)

    def _sum(self, other: Any, sign: int, other_sign: int) -> Lanes:
        other = self.trace.lanes(other)
        return Lanes(self.trace, None, self._signed_terms(sign) + other._signed_terms(other_sign))

    def __add__(self, other: Any) -> Lanes:
        if other is self:
            return evaluated(2.0 * self)
        return self if _equals(other, 0) else self._sum(other, 1, 1)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Lanes:
        return self if _equals(other, 0) else self._sum(other, 1, -1)

    def __rsub__(self, other: Any) -> Lanes:
        return self._sum(other, -1, 1)

    def __mul__(self, other: Any) -> Any:
        if _equals(other, 0):
            return 0.0
        if _equals(other, 1):
            return self
        other = self.trace.lanes(other)
        return Lanes(self.trace, None, ((1, self, other),))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Lanes:
        return self.trace.operation("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _equals(other, 0) else self.trace.operation("fdiv", other, self)

    def __neg__(self) -> Lanes:
        return self.trace.operation("fneg", self)

    def __abs__(self) -> Lanes:
        return self.trace.intrinsic("fabs", self)

    def __lt__(self, other: Any) -> Mask:
        return self.trace.comparison("<", self, other)

    def __le__(self, other: Any) -> Mask:
        return self.trace.comparison("<=", self, other)

    def __gt__(self, other: Any) -> Mask:
        return self.trace.comparison(">", self, other)

    def __ge__(self, other: Any) -> Mask:
        return self.trace.comparison(">=", self, other)

    @property
    def bits(self) -> Bits:
        """The same bits as integers of 64 bits."""
        return Bits(self.trace, self.trace.builder.bitcast(self.value, _INTEGERS))


class Bits:
    """An integer of 64 bits for every lane."""

    def __init__(self, trace: Trace, value: Any) -> None:
        self.trace, self.value = trace, value

    def _with(self, name: str, other: int | Bits) -> Bits:
        if isinstance(other, int):
            other = Bits(self.trace, _integers(other))
        return Bits(self.trace, getattr(self.trace.builder, name)(self.value, other.value))

    def __and__(self, other: int | Bits) -> Bits:
        return self._with("and_", other)

    def __or__(self, other: int | Bits) -> Bits:
        return self._with("or_", other)

    def __xor__(self, other: int | Bits) -> Bits:
        return self._with("xor", other)

    def __add__(self, other: int | Bits) -> Bits:
        return self._with("add", other)

    def __lshift__(self, other: int) -> Bits:
        return self._with("shl", other)

    def __rshift__(self, other: int) -> Bits:
        return self._with("lshr", other)

    @property
    def odd(self) -> Mask:
        """Whether the last bit is set, lane by lane."""
        return Mask(self.trace, (self << 63).value)

    @property
    def number(self) -> Lanes:
        """The number with these bits."""
        return Lanes(self.trace, self.trace.builder.bitcast(self.value, _VECTOR))


class Workspace(dict[int, Any]):
    """Coefficients by index; stored sums are evaluated."""

    def __setitem__(self, index: int, number: Any) -> None:
        super().__setitem__(index, evaluated(number))


class Trace:
    """Recorder of the instructions of a traced function.

    Parameters
    ----------
    before, builder : llvmlite.ir.IRBuilder
        Builders of instructions that depend on invariant numbers alone, and of all others.
    """

    def __init__(self, before: Any, builder: Any) -> None:
        self.before, self.builder = before, builder
        #: Conditions of validity: results of a lane in which one of these is false are discarded.
        self.conditions: list[Mask] = []
        self._count = 0

    def order(self) -> int:
        """Return a number larger than at the last call."""
        self._count += 1
        return self._count

    def lanes(self, number: Any) -> Lanes:
        """Return a number as lanes, the same in each."""
        if isinstance(number, Lanes):
            return number
        return Lanes(self, _constant(float(number).hex()), invariant=True)

    def _operands(self, arguments: Sequence[Any]) -> tuple[list[Lanes], Any, bool]:
        numbers = [self.lanes(a) for a in arguments]
        invariant = all(number.invariant for number in numbers)
        return numbers, self.before if invariant else self.builder, invariant

    def operation(self, name: str, *arguments: Any) -> Lanes:
        """Add an instruction such as ``"fdiv"``."""
        numbers, builder, invariant = self._operands(arguments)
        value = getattr(builder, name)(*(number.value for number in numbers))
        return Lanes(self, value, invariant=invariant)

    def intrinsic(self, name: str, *arguments: Any) -> Lanes:
        """Call an LLVM intrinsic for vectors, such as ``"sqrt"``."""
        numbers, builder, invariant = self._operands(arguments)
        name = f"llvm.{name}.v{WIDTH}f64"
        function = builder.module.globals.get(name) or ir.Function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * len(numbers)), name
        )
        return Lanes(self, builder.call(function, [n.value for n in numbers]), invariant=invariant)

    def lane_by_lane(self, name: str, *arguments: Any) -> Lanes:
        """Call a function of `math` for every lane."""
        numbers, builder, invariant = self._operands(arguments)
        function, _ = elementary(builder.module, name)
        value = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(WIDTH):
            index = ir.Constant(ir.IntType(32), lane)
            values = [builder.extract_element(number.value, index) for number in numbers]
            value = builder.insert_element(value, builder.call(function, values), index)
        return Lanes(self, value, invariant=invariant)

    def comparison(self, sign: str, a: Any, b: Any) -> Mask:
        """Compare lane by lane; false for NaN."""
        result = self.builder.fcmp_ordered(sign, self.lanes(a).value, self.lanes(b).value)
        return Mask(self, self.builder.sext(result, _INTEGERS), result)

    def sum_of(self, terms: Sequence[tuple[int, Lanes, Lanes | None]]) -> Lanes:
        """Return a signed sum of products, or of numbers where the second factor is None."""

        def order(term: tuple[int, Lanes, Lanes | None]) -> int:
            return max(factor.order for factor in term[1:] if isinstance(factor, Lanes))

        total: Lanes | None = None
        for sign, a, b in sorted(terms, key=order):
            if total is None:
                total = a if b is None else self.operation("fmul", a, b)
                total = -total if sign < 0 else total
            elif b is None:
                total = self.operation("fadd" if sign > 0 else "fsub", total, a)
            else:
                total = self.intrinsic("fmuladd", -a if sign < 0 else a, b, total)
        assert total is not None
        return total

    def refined(
        self, decided: Mask, masks: Sequence[Mask], refine: Callable[[], Any]
    ) -> list[Mask]:
        """Return the masks, extended by those of a refinement unless all lanes are decided.

        In a decided lane all masks must be true already; the refinement does not change it.
        """
        builder = self.builder
        first = builder.block
        inner, join = (builder.append_basic_block(name) for name in ("refine", "join"))
        builder.cbranch(decided.all_true(), join, inner)
        builder.position_at_end(inner)
        extended = [mask | more for mask, more in zip(masks, refine(), strict=True)]
        last = builder.block
        builder.branch(join)
        builder.position_at_end(join)
        merged = []
        for mask, new in zip(masks, extended, strict=True):
            value = builder.phi(_INTEGERS)
            value.add_incoming(mask.value, first)
            value.add_incoming(new.value, last)
            merged.append(Mask(self, value))
        return merged

    def load(self, pointer: Any, row: int, *, invariant: bool = False) -> Lanes:
        """Load one row of an array of doubles, with one number for each lane."""
        builder = self.before if invariant else self.builder
        return Lanes(self, builder.load(_row(builder, pointer, row), align=8), invariant=invariant)

    def store(self, number: Any, pointer: Any, row: int) -> None:
        """Store one row; the counterpart of `load`."""
        self.builder.store(self.lanes(number).value, _row(self.builder, pointer, row), align=8)


def evaluated(number: Any) -> Any:
    """Return a number, with the terms of a sum added."""
    if isinstance(number, Lanes):
        assert number.value is not None
    return number


def polynomial(coefficients: Sequence[Any], x: Any) -> Any:
    """Evaluate the sum of c_k x**k by Horner's rule."""
    value = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        value = evaluated(value * x + c)
    return value


def _equals(number: Any, value: int) -> bool:
    return isinstance(number, float | int) and number == value


def _row(builder: Any, pointer: Any, row: int) -> Any:
    place = builder.gep(pointer, [ir.Constant(_INTEGER, row * WIDTH)])
    return builder.bitcast(place, _VECTOR.as_pointer())
