"""Generated source straight to LLVM.

What is generated for a model is a small part of Python: numbers, arrays that are handed in, sums,
products, comparisons, conditions, loops over whole numbers, and calls of known functions. It is
translated from its syntax tree. Whatever else it might contain raises
`UnknownSourceError`, and so does a name that is not assigned on every way to where it is read: the
source is the project's own, so that this is a fault of the project and never one of a model.

Values are those of IEEE arithmetic: a division by zero gives an infinity or no number, the
comparison with what is no number is false. Nothing is reordered.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from llvmlite import ir

WHOLE, REAL, TRUTH = ir.IntType(64), ir.DoubleType(), ir.IntType(1)
ARRAY = REAL.as_pointer()

#: Of the arguments of every generated function: its mode, inputs, parameters and outputs.
ENTRY = (WHOLE, ARRAY, ARRAY, ARRAY)

#: Functions of `math` that LLVM knows, and those of the C library with their numbers of arguments.
_INTRINSICS = {
    **{name: (f"llvm.{name}.f64", 1) for name in ("sin", "cos", "exp", "log", "sqrt", "fabs")},
    **{name: (f"llvm.{name}.f64", 1) for name in ("floor", "exp2", "log2", "log10")},
    **{name: (f"llvm.{name}.f64", 2) for name in ("pow", "copysign")},
}
_LIBRARY = {
    **dict.fromkeys(("tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"), 1),
    **dict.fromkeys(("asinh", "acosh", "atanh", "erf", "erfc", "log1p", "expm1"), 1),
    "atan2": 2,
}
_CONSTANTS = {"pi": math.pi, "e": math.e, "inf": math.inf, "nan": math.nan}

#: Exponents from which a power is no product of squares.
_LARGEST_POWER = 0x10000

_WHOLE_OPERATIONS: dict[type[ast.operator], str] = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
}
_REAL_OPERATIONS: dict[type[ast.operator], str] = {
    ast.Add: "fadd",
    ast.Sub: "fsub",
    ast.Mult: "fmul",
    ast.Div: "fdiv",
}
_FOLDED: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


class UnknownSourceError(Exception):
    """Generated source contains what cannot be translated: a fault of the project itself."""


@dataclass(frozen=True)
class External:
    """A function of compiled code.

    Parameters
    ----------
    symbol : str
        Under which its address is given when the code is loaded.
    arguments : int
        Number of arguments, all real.
    results : int
        How many numbers it fills by pointers; none if it returns one.
    last : int, optional
        A whole number that it takes as last argument.
    """

    symbol: str
    arguments: int
    results: int = 0
    last: int | None = None


#: A function that generated source may call by a name: compiled code, or source to translate.
Callee = External | ast.FunctionDef

#: Functions and tuples of numbers by the names that they have in generated source.
Names = Mapping[str, Callee | tuple[float, ...]]


@dataclass(frozen=True)
class _Value:
    """A number or a truth value of the function, and what it is if it is known already."""

    kind: ir.Type
    value: Any
    known: float | None = None


def declared(module: ir.Module, name: str, result: ir.Type, arguments: Sequence[ir.Type]) -> Any:
    """A function of another library in a module, declared once."""
    function = module.globals.get(name)
    if function is None:
        function = ir.Function(module, ir.FunctionType(result, arguments), name)
        function.attributes.add("nounwind")
    return function


def elementary(module: ir.Module, name: str) -> tuple[Any, int]:
    """A function of `math` in a module, and its number of arguments.

    Raises
    ------
    UnknownSourceError
        If it is none of those that generated source may call.
    """
    if name in _INTRINSICS:
        symbol, count = _INTRINSICS[name]
        return declared(module, symbol, REAL, [REAL] * count), count
    if name not in _LIBRARY:
        raise UnknownSourceError(f"math has no '{name}' that generated source may call")
    function = declared(module, name, REAL, [REAL] * _LIBRARY[name])
    # equal calls are made once
    function.attributes.add("readonly")
    return function, _LIBRARY[name]


def translate(source: str, module: ir.Module, names: Names | None = None) -> None:
    """Add the one function of some generated source to a module, as its entry.

    Parameters
    ----------
    source : str
        One function of mode, inputs, parameters and outputs.
    module : llvmlite.ir.Module
    names : mapping, optional
        What the source may use beside `math`.

    Raises
    ------
    UnknownSourceError
        If the source contains anything that has no translation.
    """
    functions = [n for n in ast.parse(source).body if not _is_text(n)]
    if len(functions) != 1 or not isinstance(functions[0], ast.FunctionDef):
        raise UnknownSourceError("expected the source of one function")
    tree = functions[0]
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), ENTRY), tree.name)
    _Function(entry, tree, names or {}).translate()


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


class _Function:
    """The translation of one function.

    Parameters
    ----------
    function : llvmlite.ir.Function
        Where its instructions go.
    tree : ast.FunctionDef
    names : mapping
        What it may use beside `math`.
    fused : bool
        Whether a product and a sum may be rounded at once.
    """

    def __init__(
        self, function: Any, tree: ast.FunctionDef, names: Names, *, fused: bool = False
    ) -> None:
        self.function, self.tree, self.names = function, tree, names
        self.flags = ("contract",) if fused else ()
        function.attributes.add("nounwind")
        start, body = (function.append_basic_block(name) for name in ("start", "body"))
        #: Block in which variables are allocated.
        self.start = ir.IRBuilder(start)
        self.builder = ir.IRBuilder(body)
        self.body = body
        self.arrays: dict[str, Any] = {}
        #: Kinds of the variables that are assigned on every way to here.
        self.variables: dict[str, ir.Type] = {}
        self.allocated: dict[tuple[str, str], Any] = {}
        #: Where the loops that are open go on after them, and the variables known there.
        self.ends: list[tuple[Any, list[dict[str, ir.Type]]]] = []

    def translate(self) -> None:
        names = [a.arg for a in self.tree.args.args]
        if len(names) != len(self.function.args):
            raise self.unknown(self.tree, f"expected {len(self.function.args)} arguments")
        for name, argument in zip(names, self.function.args, strict=True):
            argument.name = name
            if argument.type == ARRAY:
                self.arrays[name] = argument
            else:
                self.assign(name, _Value(argument.type, argument))
        self.block(self.tree.body)
        if not self.builder.block.is_terminated:
            if self.function.return_value.type != ir.VoidType():
                raise self.unknown(self.tree, "expected a result on every way through it")
            self.builder.ret_void()
        self.start.branch(self.body)

    def unknown(self, node: ast.AST, why: str = "") -> UnknownSourceError:
        """The error that shows a piece of the source."""
        text = ast.unparse(node) if isinstance(node, ast.stmt | ast.expr) else ast.dump(node)
        line = getattr(node, "lineno", "?")
        reason = f": {why}" if why else ""
        return UnknownSourceError(
            f"line {line} of the generated function '{self.tree.name}' has no translation"
            f"{reason}: {text.splitlines()[0][:200]}"
        )

    # statements

    def block(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self.builder.block.is_terminated:
                raise self.unknown(statement, "it is never reached")
            self.statement(statement)

    def statement(self, s: ast.stmt) -> None:
        if isinstance(s, ast.Assign) and len(s.targets) == 1:
            self.put(s.targets[0], self.expression(s.value))
        elif isinstance(s, ast.AugAssign):
            whole = ast.copy_location(ast.BinOp(s.target, s.op, s.value), s)
            self.put(s.target, self.expression(whole))
        elif isinstance(s, ast.If):
            self.condition(s)
        elif isinstance(s, ast.For):
            self.loop(s)
        elif isinstance(s, ast.While) and not s.orelse:
            self.repeat(s)
        elif isinstance(s, ast.Break) and self.ends:
            end, known = self.ends[-1]
            known.append(dict(self.variables))
            self.builder.branch(end)
        elif isinstance(s, ast.Return) and s.value is not None:
            self.builder.ret(self.real(self.expression(s.value), s))
        elif not (isinstance(s, ast.Pass) or _is_text(s)):
            raise self.unknown(s)

    def put(self, target: ast.expr, value: _Value) -> None:
        if isinstance(target, ast.Name):
            if target.id in self.arrays:
                raise self.unknown(target, "it is an array")
            self.assign(target.id, value)
        elif isinstance(target, ast.Subscript):
            self.builder.store(self.real(value, target), self.place(target))
        else:
            raise self.unknown(target)

    def assign(self, name: str, value: _Value) -> None:
        self.variables[name] = value.kind
        allocation = self.allocated.get((name, str(value.kind)))
        if allocation is None:
            allocation = self.start.alloca(value.kind, name=name)
            self.allocated[name, str(value.kind)] = allocation
        self.builder.store(value.value, allocation)

    def condition(self, s: ast.If) -> None:
        test = self.truth(self.expression(s.test), s)
        yes, no, end = self.blocks("yes", "no", "end")
        self.builder.cbranch(test, yes, no)
        before, ways = dict(self.variables), []
        for start, statements in ((yes, s.body), (no, s.orelse)):
            self.builder.position_at_end(start)
            self.variables = dict(before)
            self.block(statements)
            if not self.builder.block.is_terminated:
                self.builder.branch(end)
                ways.append(self.variables)
        self.builder.position_at_end(end)
        if ways:
            self.variables = _common(ways)
        else:
            self.builder.unreachable()

    def loop(self, s: ast.For) -> None:
        match s:
            case ast.For(
                target=ast.Name(id=name),
                iter=ast.Call(func=ast.Name(id="range"), args=limits, keywords=[]),
                orelse=[],
            ) if len(limits) in (1, 2):
                bounds = [self.whole(self.expression(limit), limit) for limit in limits]
            case _:
                raise self.unknown(s, "expected a loop over a range of one or two numbers")
        first, stop = bounds if len(bounds) == 2 else (ir.Constant(WHOLE, 0), bounds[0])
        count = self.start.alloca(WHOLE)
        self.builder.store(first, count)

        def test() -> Any:
            return self.builder.icmp_signed("<", self.builder.load(count), stop)

        def body() -> None:
            self.assign(name, _Value(WHOLE, self.builder.load(count)))
            self.block(s.body)
            if not self.builder.block.is_terminated:
                one = ir.Constant(WHOLE, 1)
                number = self.builder.add(self.builder.load(count), one, flags=("nsw",))
                self.builder.store(number, count)

        self.cycle(s, test, body)

    def repeat(self, s: ast.While) -> None:
        self.cycle(s, lambda: self.truth(self.expression(s.test), s), lambda: self.block(s.body))

    def cycle(self, s: ast.stmt, test: Callable[[], Any], body: Callable[[], None]) -> None:
        """A test, and what is done as long as it holds."""
        head, inside, end = self.blocks("head", "inside", "after")
        self.builder.branch(head)
        self.builder.position_at_end(head)
        before = dict(self.variables)
        self.builder.cbranch(test(), inside, end)
        self.builder.position_at_end(inside)
        self.ends.append((end, [before]))
        body()
        _, ways = self.ends.pop()
        if not self.builder.block.is_terminated:
            for name, kind in before.items():
                if self.variables.get(name) != kind:
                    raise self.unknown(s, f"'{name}' changes its kind")
            self.builder.branch(head)
        self.builder.position_at_end(end)
        self.variables = _common(ways)

    def blocks(self, *names: str) -> list[Any]:
        return [self.function.append_basic_block(name) for name in names]

    # expressions

    def expression(self, e: ast.expr) -> _Value:
        constant = _constant(e)
        if constant is not None:
            return self.constant(constant, e)
        match e:
            case ast.Name():
                return self.variable(e)
            case ast.Subscript():
                return _Value(REAL, self.builder.load(self.place(e)))
            case ast.Attribute(value=ast.Name(id="math")) if e.attr in _CONSTANTS:
                return self.constant(_CONSTANTS[e.attr], e)
            case ast.UnaryOp():
                return self.sign(e)
            case ast.BinOp():
                return self.operation(e)
            case ast.Compare() if len(e.ops) == 1:
                return self.comparison(e)
            case ast.BoolOp():
                return self.logic(e)
            case ast.IfExp():
                return self.choice(e)
            case ast.Call() if not e.keywords:
                return self.call(e)
        raise self.unknown(e)

    def constant(self, number: Any, e: ast.expr) -> _Value:
        if isinstance(number, bool):
            return _Value(TRUTH, ir.Constant(TRUTH, int(number)), number)
        if isinstance(number, int):
            if not -(2**63) <= number < 2**63:
                raise self.unknown(e, "a whole number has 64 bits")
            return _Value(WHOLE, ir.Constant(WHOLE, number), number)
        if isinstance(number, float):
            return _Value(REAL, ir.Constant(REAL, number), number)
        raise self.unknown(e, "expected a real number")

    def variable(self, e: ast.Name) -> _Value:
        if e.id not in self.variables:
            raise self.unknown(e, f"'{e.id}' is not assigned on every way to here")
        kind = self.variables[e.id]
        return _Value(kind, self.builder.load(self.allocated[e.id, str(kind)]))

    def place(self, e: ast.Subscript) -> Any:
        """Pointer to an element of an array."""
        name = e.value.id if isinstance(e.value, ast.Name) else ""
        index = self.whole(self.expression(e.slice), e)
        if name in self.arrays:
            return self.builder.gep(self.arrays[name], [index])
        numbers = self.names.get(name)
        if not isinstance(numbers, tuple):
            raise self.unknown(e, f"'{name}' is no array")
        kind = ir.ArrayType(REAL, len(numbers))
        table = self.function.module.globals.get(name)
        if table is None:
            table = ir.GlobalVariable(self.function.module, kind, name)
            table.linkage, table.global_constant = "internal", True
            table.initializer = ir.Constant(kind, list(numbers))
        return self.builder.gep(table, [ir.Constant(WHOLE, 0), index])

    def sign(self, e: ast.UnaryOp) -> _Value:
        value = self.expression(e.operand)
        if isinstance(e.op, ast.Not):
            return _Value(TRUTH, self.builder.not_(self.truth(value, e)))
        if isinstance(e.op, ast.USub) and value.kind == REAL:
            return _Value(REAL, self.builder.fneg(value.value, flags=self.flags))
        if isinstance(e.op, ast.USub) and value.kind == WHOLE:
            return _Value(WHOLE, self.builder.neg(value.value))
        if isinstance(e.op, ast.UAdd) and value.kind != TRUTH:
            return value
        raise self.unknown(e)

    def operation(self, e: ast.BinOp) -> _Value:
        if isinstance(e.op, ast.Pow):
            return self.power(e)
        a, b = self.expression(e.left), self.expression(e.right)
        kind = type(e.op)
        if a.kind == b.kind == WHOLE:
            if kind in _WHOLE_OPERATIONS:
                make = getattr(self.builder, _WHOLE_OPERATIONS[kind])
                return _Value(WHOLE, make(a.value, b.value, flags=("nsw",)))
            if kind in (ast.FloorDiv, ast.Mod):
                return self.division(e, a, b)
        if kind not in _REAL_OPERATIONS:
            raise self.unknown(e)
        make = getattr(self.builder, _REAL_OPERATIONS[kind])
        return _Value(REAL, make(self.real(a, e), self.real(b, e), flags=self.flags))

    def division(self, e: ast.BinOp, a: _Value, b: _Value) -> _Value:
        """A whole number divided by a power of two, or its rest."""
        known = b.known
        if not isinstance(known, int) or known <= 0 or known & (known - 1):
            raise self.unknown(e, "expected a division by a power of two")
        if isinstance(e.op, ast.Mod):
            return _Value(WHOLE, self.builder.and_(a.value, ir.Constant(WHOLE, known - 1)))
        places = ir.Constant(WHOLE, known.bit_length() - 1)
        return _Value(WHOLE, self.builder.ashr(a.value, places))

    def power(self, e: ast.BinOp) -> _Value:
        a, b = self.expression(e.left), self.expression(e.right)
        if b.kind == REAL:
            function, _ = elementary(self.function.module, "pow")
            arguments = [self.real(a, e), b.value]
            return _Value(REAL, self.builder.call(function, arguments, fastmath=self.flags))
        exponent = b.known
        if a.kind != REAL or not isinstance(exponent, int) or abs(exponent) > _LARGEST_POWER:
            raise self.unknown(e, "expected a real number and a constant exponent")
        result, square, left = ir.Constant(REAL, 1.0), a.value, abs(exponent)
        while left:
            if left & 1:
                result = self.builder.fmul(result, square, flags=self.flags)
            left >>= 1
            if left:
                square = self.builder.fmul(square, square, flags=self.flags)
        if exponent < 0:
            result = self.builder.fdiv(ir.Constant(REAL, 1.0), result, flags=self.flags)
        return _Value(REAL, result)

    def comparison(self, e: ast.Compare) -> _Value:
        a, b = self.expression(e.left), self.expression(e.comparators[0])
        sign = _COMPARISONS.get(type(e.ops[0]))
        if sign is None:
            raise self.unknown(e)
        if a.kind == b.kind == WHOLE:
            return _Value(TRUTH, self.builder.icmp_signed(sign, a.value, b.value))
        return _Value(TRUTH, self.compared(sign, self.real(a, e), self.real(b, e)))

    def compared(self, sign: str, a: Any, b: Any) -> Any:
        # what is no number differs from everything
        make = self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered
        return make(sign, a, b, flags=self.flags)

    def logic(self, e: ast.BoolOp) -> _Value:
        make = self.builder.and_ if isinstance(e.op, ast.And) else self.builder.or_
        result, *others = (self.truth(self.expression(v), v) for v in e.values)
        for other in others:
            result = make(result, other)
        return _Value(TRUTH, result)

    def choice(self, e: ast.IfExp) -> _Value:
        test = self.expression(e.test)
        if test.kind == TRUTH and test.known is not None:
            return self.expression(e.body if test.known else e.orelse)
        yes, no, end = self.blocks("yes", "no", "end")
        self.builder.cbranch(self.truth(test, e), yes, no)
        results = []
        for start, branch in ((yes, e.body), (no, e.orelse)):
            self.builder.position_at_end(start)
            value = self.real(self.expression(branch), e)
            results.append((value, self.builder.block))
            self.builder.branch(end)
        self.builder.position_at_end(end)
        result = self.builder.phi(REAL)
        for value, block in results:
            result.add_incoming(value, block)
        return _Value(REAL, result)

    def call(self, e: ast.Call) -> _Value:
        match e.func:
            case ast.Name(id="abs" | "max" | "min" as name):
                return self.builtin(e, name)
            case ast.Name(id="len"):
                return self.length(e)
            case ast.Attribute(value=ast.Name(id="math"), attr="isnan" | "isinf" as name):
                (x,) = self.arguments(e, 1)
                if name == "isnan":
                    return _Value(TRUTH, self.builder.fcmp_unordered("uno", x, x))
                size = self.builder.call(elementary(self.function.module, "fabs")[0], [x])
                infinity = ir.Constant(REAL, math.inf)
                return _Value(TRUTH, self.builder.fcmp_ordered("==", size, infinity))
            case ast.Attribute(value=ast.Name(id="math"), attr=name):
                function, count = elementary(self.function.module, name)
                arguments = self.arguments(e, count)
                return _Value(REAL, self.builder.call(function, arguments, fastmath=self.flags))
            case ast.Name(id=name) | ast.Attribute(value=ast.Name(id="special"), attr=name):
                callee = self.names.get(name)
                if isinstance(callee, External):
                    return self.external(e, callee)
                if isinstance(callee, ast.FunctionDef):
                    arguments = self.arguments(e, len(callee.args.args))
                    return _Value(REAL, self.builder.call(self.translated(callee), arguments))
        raise self.unknown(e, "the function is not known")

    def arguments(self, e: ast.Call, count: int) -> list[Any]:
        if len(e.args) != count:
            raise self.unknown(e, f"expected {count} arguments")
        return [self.real(self.expression(a), a) for a in e.args]

    def builtin(self, e: ast.Call, name: str) -> _Value:
        if name == "abs":
            (x,) = self.arguments(e, 1)
            function, _ = elementary(self.function.module, "fabs")
            return _Value(REAL, self.builder.call(function, [x], fastmath=self.flags))
        first, *others = self.arguments(e, max(len(e.args), 2))
        # as Python has it: what is no number is passed over where it comes later
        for x in others:
            better = self.compared(">" if name == "max" else "<", x, first)
            first = self.builder.select(better, x, first)
        return _Value(REAL, first)

    def length(self, e: ast.Call) -> _Value:
        numbers = self.names.get(e.args[0].id) if isinstance(e.args[0], ast.Name) else None
        if len(e.args) != 1 or not isinstance(numbers, tuple):
            raise self.unknown(e, "expected a tuple of numbers")
        return self.constant(len(numbers), e)

    def external(self, e: ast.Call, callee: External) -> _Value:
        """A call of compiled code; of several results the one that the last argument names."""
        given = self.arguments(e, callee.arguments + bool(callee.results))
        module = self.function.module
        if not callee.results:
            kinds = [REAL] * callee.arguments
            if callee.last is not None:
                kinds.append(ir.IntType(32))
                given.append(ir.Constant(ir.IntType(32), callee.last))
            function = declared(module, callee.symbol, REAL, kinds)
            return _Value(REAL, self.builder.call(function, given, fastmath=self.flags))
        which = _constant(e.args[-1])
        if not isinstance(which, int) or not 0 <= which < callee.results:
            raise self.unknown(e, f"expected one of {callee.results} results")
        allocated = [self.start.alloca(REAL) for _ in range(callee.results)]
        kinds = [REAL] * callee.arguments + [ARRAY] * callee.results
        function = declared(module, callee.symbol, ir.VoidType(), kinds)
        self.builder.call(function, [*given[:-1], *allocated])
        return _Value(REAL, self.builder.load(allocated[which]))

    def translated(self, tree: ast.FunctionDef) -> Any:
        """A function that is known by its source, translated once for a module."""
        module = self.function.module
        function = module.globals.get(tree.name)
        if function is None:
            kinds = [REAL] * len(tree.args.args)
            function = ir.Function(module, ir.FunctionType(REAL, kinds), tree.name)
            function.linkage = "internal"
            _Function(function, tree, self.names, fused=True).translate()
        return function

    # kinds

    def real(self, value: _Value, node: ast.AST) -> Any:
        if value.kind == REAL:
            return value.value
        if value.kind != WHOLE:
            raise self.unknown(node, "expected a number")
        if value.known is not None:
            return ir.Constant(REAL, float(value.known))
        return self.builder.sitofp(value.value, REAL)

    def whole(self, value: _Value, node: ast.AST) -> Any:
        if value.kind != WHOLE:
            raise self.unknown(node, "expected a whole number")
        return value.value

    def truth(self, value: _Value, node: ast.AST) -> Any:
        if value.kind != TRUTH:
            raise self.unknown(node, "expected a comparison")
        return value.value


def _common(ways: Sequence[dict[str, ir.Type]]) -> dict[str, ir.Type]:
    """The variables that have one kind on all ways that come together."""
    first, *others = ways
    return {n: kind for n, kind in first.items() if all(o.get(n) == kind for o in others)}


def _constant(e: ast.expr) -> Any:
    """The number that an expression of literals is, as Python has it; None for others."""
    match e:
        case ast.Constant():
            return e.value
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            number = _constant(e.operand)
            if isinstance(number, int | float):
                return -number if isinstance(e.op, ast.USub) else +number
        case ast.BinOp():
            a, b = _constant(e.left), _constant(e.right)
            if isinstance(a, int | float) and isinstance(b, int | float):
                try:
                    return _FOLDED[type(e.op)](a, b)
                except (ArithmeticError, KeyError):
                    return None
    return None
