"""Every small change of one line of a module that its tests should notice.

Places are found in the syntax tree and changed in the text, so that nothing else moves. Left
alone are docstrings and annotations, the texts of errors and of ``__repr__``, assertions for the
type checker, and how wide or opaque something is drawn.
"""

from __future__ import annotations

import ast
import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

#: An operator to those that may stand in its place.
COMPARISONS: dict[type[ast.cmpop], tuple[str, ...]] = {
    ast.Lt: ("<=", ">", ">="),
    ast.LtE: ("<", ">=", ">"),
    ast.Gt: (">=", "<", "<="),
    ast.GtE: (">", "<=", "<"),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
}
ARITHMETIC: dict[type[ast.operator], tuple[str, ...]] = {
    ast.Add: ("-",),
    ast.Sub: ("+",),
    ast.Mult: ("/",),
    ast.Div: ("*",),
    ast.FloorDiv: ("*",),
    ast.Mod: ("//",),
    ast.BitAnd: ("|",),
    ast.BitOr: ("&",),
}
TOKENS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Is: "is",
    ast.IsNot: r"is\s+not",
    ast.In: "in",
    ast.NotIn: r"not\s+in",
    ast.Add: r"\+",
    ast.Sub: "-",
    ast.Mult: r"\*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
    ast.BitAnd: "&",
    ast.BitOr: r"\|",
    ast.And: "and",
    ast.Or: "or",
}

#: Names of functions and methods to those that may stand in their place.
EXCHANGED = {
    "min": "max",
    "minimum": "maximum",
    "argmin": "argmax",
    "fmin": "fmax",
    "any": "all",
    "floor": "ceil",
    "lower": "upper",
    "first": "last",
    "real": "imag",
    "sin": "cos",
    "startswith": "endswith",
}
EXCHANGED |= {other: one for one, other in EXCHANGED.items()}

#: Names that count places in a sequence.
INDICES = {"row", "start", "stop", "index", "step", "first", "last", "column"}

#: Functions that only word a result.
WORDING = {"__repr__", "__str__", "_repr_html_", "_repr_latex_", "__dir__"}

#: How something looks: arguments whose values are a matter of taste.
LOOKS = {
    *("alpha", "borderaxespad", "borderpad", "capsize", "columnspacing", "dpi", "elinewidth"),
    *("fontsize", "handlelength", "handletextpad", "labelpad", "labelspacing", "lightness"),
    *("linewidth", "linewidths", "lw", "markeredgewidth", "markersize", "markerscale", "ms"),
    *("mutation_scale", "pad", "rasterized", "s", "shrinkA", "shrinkB", "size", "zorder"),
}


@dataclass(frozen=True)
class Change:
    """A change within one line.

    Parameters
    ----------
    kind : str
    line : int
        Counted from 1.
    start, stop : int
        The part of the source, in bytes, that is replaced.
    text : str
        What replaces it.
    """

    kind: str
    line: int
    start: int
    stop: int
    text: str

    def applied(self, source: str) -> str:
        raw = source.encode()
        return (raw[: self.start] + self.text.encode() + raw[self.stop :]).decode()

    def lines(self, source: str) -> tuple[str, str]:
        """The line before and after, without indentation."""
        return (
            source.splitlines()[self.line - 1].strip(),
            self.applied(source).splitlines()[self.line - 1].strip(),
        )


def changes_of(source: str) -> list[Change]:
    """All changes of a module's source, in order; some of a few leave no valid Python.

    Examples
    --------
    >>> [change.applied("a = b < 2") for change in changes_of("a = b < 2")]
    ['a = b <= 2', 'a = b > 2', 'a = b >= 2', 'a = b < 3', 'a = b < 4']
    """
    return sorted(set(_Places(source).changes()), key=lambda c: (c.start, c.stop, c.text))


def takes_effect(change: Change, source: str) -> bool:
    """Whether a change leaves valid Python that is not the same program."""
    try:
        tree = ast.parse(change.applied(source))
    except SyntaxError:
        return False
    return ast.dump(tree) != ast.dump(ast.parse(source))


class _Places:
    def __init__(self, source: str) -> None:
        self.raw = source.encode()
        self.tree = ast.parse(source)
        self.starts = [0]
        for line in self.raw.split(b"\n"):
            self.starts.append(self.starts[-1] + len(line) + 1)

    def changes(self) -> Iterator[Change]:
        yield from self._below(self.tree)

    def _span(self, node: ast.AST) -> tuple[int, int]:
        begin = self.starts[node.lineno - 1] + node.col_offset
        return begin, self.starts[node.end_lineno - 1] + node.end_col_offset

    def _text(self, node: ast.AST) -> str:
        begin, end = self._span(node)
        return self.raw[begin:end].decode()

    def _change(self, kind: str, begin: int, end: int, text: str) -> Iterator[Change]:
        if b"\n" not in self.raw[begin:end]:
            yield Change(kind, bisect_right(self.starts, begin), begin, end, text)

    def _between(self, one: ast.AST, other: ast.AST, operator: object) -> tuple[int, int] | None:
        """Where an operator stands between two operands."""
        begin, end = self._span(one)[1], self._span(other)[0]
        token = TOKENS[type(operator)]
        bounded = rf"\b(?:{token})\b" if token[0].isalpha() else token
        match = re.search(bounded.encode(), self.raw[begin:end])
        return None if match is None else (begin + match.start(), begin + match.end())

    def _below(self, node: ast.AST) -> Iterator[Change]:
        for child in ast.iter_child_nodes(node):
            yield from self._visit(child)

    def _visit(self, node: ast.AST) -> Iterator[Change]:
        if _left_alone(node):
            return
        special = getattr(self, f"_{type(node).__name__}", None)
        if special is not None:
            yield from special(node)
        if isinstance(node, ast.FunctionDef):
            for part in (*node.decorator_list, *node.args.defaults, *node.args.kw_defaults):
                if part is not None:
                    yield from self._visit(part)
            for statement in node.body:
                yield from self._visit(statement)
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                yield from self._visit(node.value)
        elif isinstance(node, ast.Dict):
            for key, value in zip(node.keys, node.values, strict=True):
                if not (isinstance(key, ast.Constant) and key.value in LOOKS):
                    yield from self._visit(value)
        elif not isinstance(node, ast.Raise):
            yield from self._below(node)

    def _Compare(self, node: ast.Compare) -> Iterator[Change]:
        operands = [node.left, *node.comparators]
        for one, other, operator in zip(operands, operands[1:], node.ops, strict=False):
            where = self._between(one, other, operator)
            for text in COMPARISONS[type(operator)] if where else ():
                yield from self._change("comparison", *where, text)

    def _BinOp(self, node: ast.BinOp) -> Iterator[Change]:
        if type(node.op) not in ARITHMETIC:
            return
        where = self._between(node.left, node.right, node.op)
        for text in ARITHMETIC[type(node.op)] if where else ():
            yield from self._change("arithmetic", *where, text)

    def _AugAssign(self, node: ast.AugAssign) -> Iterator[Change]:
        if type(node.op) in ARITHMETIC:
            where = self._between(node.target, node.value, node.op)
            for text in ARITHMETIC[type(node.op)] if where else ():
                yield from self._change("arithmetic", *where, text)
        yield from self._deleted(node)

    def _BoolOp(self, node: ast.BoolOp) -> Iterator[Change]:
        text = "or" if isinstance(node.op, ast.And) else "and"
        for one, other in zip(node.values, node.values[1:], strict=False):
            where = self._between(one, other, node.op)
            if where:
                yield from self._change("and, or", *where, text)

    def _UnaryOp(self, node: ast.UnaryOp) -> Iterator[Change]:
        begin, inner = self._span(node)[0], self._span(node.operand)[0]
        lead = self.raw[begin:inner].decode()
        kinds = {ast.Not: "not dropped", ast.USub: "sign dropped", ast.Invert: "not dropped"}
        if type(node.op) in kinds:
            rest = re.sub(r"not\s*|-|~", "", lead)
            yield from self._change(kinds[type(node.op)], begin, inner, rest)

    def _Constant(self, node: ast.Constant) -> Iterator[Change]:
        value = node.value
        begin, end = self._span(node)
        if isinstance(value, bool):
            yield from self._change("constant", begin, end, str(not value))
        elif isinstance(value, int):
            for text in {0: ("1",), 1: ("0", "2")}.get(value, (str(2 * value), str(value + 1))):
                yield from self._change("constant", begin, end, text)
        elif isinstance(value, float):
            for text in _other_numbers(self._text(node), value):
                yield from self._change("constant", begin, end, text)

    def _Call(self, node: ast.Call) -> Iterator[Change]:
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in EXCHANGED:
            end = self._span(node.func)[1]
            yield from self._change("function", end - len(name), end, EXCHANGED[name])
        if name == "abs" and len(node.args) == 1 and not node.keywords:
            begin, end = self._span(node.func)
            yield from self._change("abs dropped", begin, end, "")
        for one, other in zip(node.args, node.args[1:], strict=False):
            texts = self._text(one), self._text(other)
            if texts[0] != texts[1] and not any(isinstance(a, ast.Starred) for a in (one, other)):
                (begin, inner), (middle, end) = self._span(one), self._span(other)
                gap = self.raw[inner:middle].decode()
                yield from self._change("order", begin, end, texts[1] + gap + texts[0])

    def _Attribute(self, node: ast.Attribute) -> Iterator[Change]:
        if node.attr in ("real", "imag", "min", "max", "start", "stop"):
            other = {"start": "stop", "stop": "start", **EXCHANGED}[node.attr]
            end = self._span(node)[1]
            yield from self._change("attribute", end - len(node.attr), end, other)

    def _Subscript(self, node: ast.Subscript) -> Iterator[Change]:
        index = node.slice
        if isinstance(index, ast.Name) and (len(index.id) == 1 or index.id in INDICES):
            for text in (f"{index.id} + 1", f"{index.id} - 1"):
                yield from self._change("index", *self._span(index), text)

    def _Slice(self, node: ast.Slice) -> Iterator[Change]:
        for bound in (node.lower, node.upper):
            if bound is not None:
                yield from self._change("slice", *self._span(bound), "")
        if node.step is not None:
            begin, end = self._span(node.step)
            yield from self._change("slice", begin, end, "1")

    def _If(self, node: ast.If) -> Iterator[Change]:
        for text in ("True", "False"):
            yield from self._change("condition", *self._span(node.test), text)

    def _IfExp(self, node: ast.IfExp) -> Iterator[Change]:
        for text in ("True", "False"):
            yield from self._change("condition", *self._span(node.test), text)

    def _Return(self, node: ast.Return) -> Iterator[Change]:
        if node.value is not None and self._text(node.value) != "None":
            yield from self._change("return", *self._span(node.value), "None")

    def _Continue(self, node: ast.Continue) -> Iterator[Change]:
        yield from self._change("loop", *self._span(node), "break")

    def _Break(self, node: ast.Break) -> Iterator[Change]:
        yield from self._change("loop", *self._span(node), "continue")

    def _Expr(self, node: ast.Expr) -> Iterator[Change]:
        if isinstance(node.value, ast.Call | ast.Yield | ast.YieldFrom):
            yield from self._deleted(node)

    def _Raise(self, node: ast.Raise) -> Iterator[Change]:
        yield from self._deleted(node)

    def _Assign(self, node: ast.Assign) -> Iterator[Change]:
        # a name that is not bound fails by itself
        if not isinstance(node.targets[0], ast.Name | ast.Tuple):
            yield from self._deleted(node)

    def _deleted(self, node: ast.stmt) -> Iterator[Change]:
        yield from self._change("statement deleted", *self._span(node), "pass")


def _left_alone(node: ast.AST) -> bool:
    if isinstance(node, ast.JoinedStr | ast.Assert | ast.Import | ast.ImportFrom | ast.arguments):
        return True
    if isinstance(node, ast.FunctionDef):
        decorators = {getattr(d, "id", "") for d in node.decorator_list}
        return node.name in WORDING or "overload" in decorators
    if isinstance(node, ast.If):
        return "TYPE_CHECKING" in ast.dump(node.test)
    return isinstance(node, ast.keyword) and node.arg in LOOKS


def _other_numbers(text: str, value: float) -> list[str]:
    if value == 0.0:
        return ["1.0"]
    exponent = re.fullmatch(r"(.*e)([+-]?\d+)", text)
    if exponent is not None:
        power = int(exponent[2])
        return [f"{exponent[1]}{power + change}" for change in (4, -4)]
    return [repr(2.0 * value), repr(value + 1.0)]
