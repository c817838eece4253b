"""Functions of several trajectories at once, traced into vector instructions.

Every number of such a function is a vector with one element, or lane, for each
trajectory. The function runs once, as Python, on numbers that write down what
is done with them; its loops and whole numbers are gone by then. An operation on
lanes never mixes them, so that what comes out of one depends on it alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir

from fastslow.kernels.native import elementary

#: Trajectories side by side: enough to hide the latency of one by another.
WIDTH = 8

_DOUBLE = ir.DoubleType()
_WHOLE = ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_WHOLES = ir.VectorType(_WHOLE, WIDTH)


class Mask:
    """A truth value for every lane: the first of 64 bits, as the processor's comparisons set it."""

    def __init__(self, trace: Trace, value: Any) -> None:
        self.trace, self.value = trace, value

    @property
    def bits(self) -> Any:
        """One bit for every lane."""
        nothing = ir.Constant(_WHOLES, [0] * WIDTH)
        return self.trace.builder.icmp_signed("<", self.value, nothing)

    def __and__(self, other: Mask) -> Mask:
        return Mask(self.trace, self.trace.builder.and_(self.value, other.value))

    def __or__(self, other: Mask) -> Mask:
        return Mask(self.trace, self.trace.builder.or_(self.value, other.value))

    def __invert__(self) -> Mask:
        return Mask(self.trace, self.trace.builder.not_(self.value))

    def choose(self, a: Any, b: Any) -> Lanes:
        """The first number where it is true, else the second."""
        a, b = self.trace.lanes(a), self.trace.lanes(b)
        return Lanes(self.trace, self.trace.builder.select(self.bits, a.value, b.value))

    def everywhere(self) -> Any:
        """Whether it is true of every lane, for a branch."""
        builder = self.trace.builder
        kind = ir.IntType(WIDTH)
        packed = builder.bitcast(self.bits, kind)
        return builder.icmp_unsigned("==", packed, ir.Constant(kind, 2**WIDTH - 1))


class Lanes:
    """A vector of numbers, or a sum of products whose terms are not added yet.

    They are added when the sum is first used, the terms that are known first
    before the others, so that no addition waits for the latest of them.
    """

    def __init__(
        self, trace: Trace, value: Any, terms: tuple[Any, ...] = (), steady: bool = False
    ) -> None:
        self.trace, self._value, self._terms = trace, value, terms
        self._steady, self._age = steady, trace.age()

    @property
    def value(self) -> Any:
        """The vector, its terms added."""
        if self._value is None:
            total = self.trace.sum_of(self._terms)
            self._value, self._age, self._steady = total.value, total.age, total.steady
            self._terms = ()
        return self._value

    @property
    def age(self) -> int:
        """A number that grows from each vector to the next."""
        return self._age if self.value is not None else 0

    @property
    def steady(self) -> bool:
        """Whether it depends on steady numbers alone, so that it is computed once for all steps."""
        return self.value is not None and self._steady

    def _parts(self, sign: int) -> tuple[Any, ...]:
        if self._value is not None:
            return ((sign, self, None),)
        return tuple((sign * s, a, b) for s, a, b in self._terms)

    def _plus(self, other: Any, mine: int, its: int) -> Lanes:
        other = self.trace.lanes(other)
        return Lanes(self.trace, None, self._parts(mine) + other._parts(its))

    def __add__(self, other: Any) -> Lanes:
        if other is self:
            return added(2.0 * self)
        return self if _is(other, 0) else self._plus(other, 1, 1)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Lanes:
        return self if _is(other, 0) else self._plus(other, 1, -1)

    def __rsub__(self, other: Any) -> Lanes:
        return self._plus(other, -1, 1)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0):
            return 0.0
        if _is(other, 1):
            return self
        other = self.trace.lanes(other)
        return Lanes(self.trace, None, ((1, self, other),))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Lanes:
        return self.trace.operation("fdiv", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0) else self.trace.operation("fdiv", other, self)

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
        """The same as whole numbers of 64 bits."""
        return Bits(self.trace, self.trace.builder.bitcast(self.value, _WHOLES))


class Bits:
    """A whole number of 64 bits for every lane."""

    def __init__(self, trace: Trace, value: Any) -> None:
        self.trace, self.value = trace, value

    def _with(self, name: str, other: int | Bits) -> Bits:
        if isinstance(other, int):
            other = Bits(self.trace, ir.Constant(_WHOLES, [other] * WIDTH))
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
        """Whether the last bit is set."""
        return Mask(self.trace, (self << 63).value)

    @property
    def number(self) -> Lanes:
        """The number with these bits."""
        return Lanes(self.trace, self.trace.builder.bitcast(self.value, _VECTOR))


class Workspace(dict[int, Any]):
    """Coefficients by their place; sums that are put there are added."""

    def __setitem__(self, place: int, number: Any) -> None:
        super().__setitem__(place, added(number))


class Trace:
    """Where the instructions of a traced function go.

    Parameters
    ----------
    before, builder : llvmlite.ir.IRBuilder
        For what depends on steady numbers alone, and for everything else.
    """

    def __init__(self, before: Any, builder: Any) -> None:
        self.before, self.builder = before, builder
        #: Where what was traced holds: a lane in which one of these is false is not to be used.
        self.conditions: list[Mask] = []
        self._count = 0

    def age(self) -> int:
        """One more than the last time."""
        self._count += 1
        return self._count

    def lanes(self, number: Any) -> Lanes:
        """A number as lanes, the same in each."""
        if isinstance(number, Lanes):
            return number
        return Lanes(self, ir.Constant(_VECTOR, [float(number)] * WIDTH), steady=True)

    def _place(self, arguments: Sequence[Any]) -> tuple[list[Lanes], Any, bool]:
        numbers = [self.lanes(a) for a in arguments]
        steady = all(number.steady for number in numbers)
        return numbers, self.before if steady else self.builder, steady

    def operation(self, name: str, *arguments: Any) -> Lanes:
        """An instruction such as ``"fdiv"``."""
        numbers, builder, steady = self._place(arguments)
        value = getattr(builder, name)(*(number.value for number in numbers))
        return Lanes(self, value, steady=steady)

    def intrinsic(self, name: str, *arguments: Any) -> Lanes:
        """A function that LLVM knows for vectors, such as ``"sqrt"``."""
        numbers, builder, steady = self._place(arguments)
        name = f"llvm.{name}.v{WIDTH}f64"
        function = builder.module.globals.get(name) or ir.Function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * len(numbers)), name
        )
        return Lanes(self, builder.call(function, [n.value for n in numbers]), steady=steady)

    def one_by_one(self, name: str, *arguments: Any) -> Lanes:
        """A function of `math`, called for every lane."""
        numbers, builder, steady = self._place(arguments)
        function, _ = elementary(builder.module, name)
        value = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(WIDTH):
            place = ir.Constant(ir.IntType(32), lane)
            values = [builder.extract_element(number.value, place) for number in numbers]
            value = builder.insert_element(value, builder.call(function, values), place)
        return Lanes(self, value, steady=steady)

    def comparison(self, sign: str, a: Any, b: Any) -> Mask:
        """Whether it holds, false of what is not a number."""
        holds = self.builder.fcmp_ordered(sign, self.lanes(a).value, self.lanes(b).value)
        return Mask(self, self.builder.sext(holds, _WHOLES))

    def sum_of(self, terms: Sequence[tuple[int, Lanes, Lanes | None]]) -> Lanes:
        """The sum of products (of numbers where the second factor is None), with their signs."""

        def age(term: tuple[int, Lanes, Lanes | None]) -> int:
            return max(factor.age for factor in term[1:] if isinstance(factor, Lanes))

        total: Lanes | None = None
        for sign, a, b in sorted(terms, key=age):
            if total is None:
                total = a if b is None else self.operation("fmul", a, b)
                total = -total if sign < 0 else total
            elif b is None:
                total = self.operation("fadd" if sign > 0 else "fsub", total, a)
            else:
                total = self.intrinsic("fmuladd", -a if sign < 0 else a, b, total)
        assert total is not None
        return total

    def unless(self, clear: Mask, masks: Sequence[Mask], closer: Callable[[], Any]) -> list[Mask]:
        """The masks, and where one lane at least is not clear what a closer look adds to them.

        A lane that is clear must have all of them already, so that it does not
        matter to it whether others are looked at.
        """
        builder = self.builder
        first = builder.block
        look, together = (builder.append_basic_block(name) for name in ("closer", "together"))
        builder.cbranch(clear.everywhere(), together, look)
        builder.position_at_end(look)
        seen = [mask | more for mask, more in zip(masks, closer(), strict=True)]
        last = builder.block
        builder.branch(together)
        builder.position_at_end(together)
        merged = []
        for mask, new in zip(masks, seen, strict=True):
            value = builder.phi(_WHOLES)
            value.add_incoming(mask.value, first)
            value.add_incoming(new.value, last)
            merged.append(Mask(self, value))
        return merged

    def load(self, pointer: Any, row: int, *, steady: bool = False) -> Lanes:
        """One row of an array of doubles whose rows hold a number for each lane."""
        builder = self.before if steady else self.builder
        return Lanes(self, builder.load(_row(builder, pointer, row), align=8), steady=steady)

    def store(self, number: Any, pointer: Any, row: int) -> None:
        """The counterpart of `load`."""
        self.builder.store(self.lanes(number).value, _row(self.builder, pointer, row), align=8)


def added(number: Any) -> Any:
    """The number, its terms added if it is a sum."""
    if isinstance(number, Lanes):
        assert number.value is not None
    return number


def polynomial(coefficients: Sequence[Any], x: Any) -> Any:
    """The sum of c_k x**k by Horner's rule."""
    value = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        value = added(value * x + c)
    return value


def _is(number: Any, value: int) -> bool:
    return isinstance(number, float | int) and number == value


def _row(builder: Any, pointer: Any, row: int) -> Any:
    place = builder.gep(pointer, [ir.Constant(_WHOLE, row * WIDTH)])
    return builder.bitcast(place, _VECTOR.as_pointer())
