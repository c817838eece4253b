"""Formulas of XPPAUT, parsed to the nodes of `fastslow.formulas.grammar`.

They differ from other formulas as XPPAUT does (Ermentrout, *XPPAUT*, and its source): names are
without case; a power is ``^`` or ``**`` and associates to the left; comparisons bind as tightly
as powers, ``&`` as products and ``|`` as sums, so that ``v>a+1`` is ``(v>a)+1``; a minus sign
begins a formula, a bracket or an argument; a condition is the number 1 or 0, and a number is true
unless it is 0.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from fastslow.errors import quoted
from fastslow.formulas.grammar import (
    CONDITIONS,
    Call,
    Comparison,
    Logic,
    Name,
    Negative,
    Node,
    Number,
    Pair,
    Power,
    Product,
    Sum,
    Truth,
)
from fastslow.formulas.limits import DEPTH, LENGTH, NUMBER_CHARACTERS

#: Precedence of operators; all associate to the left.
PRECEDENCE = {
    **dict.fromkeys(["|", "+", "-"], 4),
    **dict.fromkeys(["&", "*", "/"], 6),
    **dict.fromkeys(["^", "**", "<", "<=", ">", ">=", "==", "!="], 7),
}
PREFIX, COMPARED = 6, ("<", "<=", ">", ">=", "==", "!=")

#: Functions by their names in XPPAUT: name in formulas, number of arguments.
NAMED = {
    **dict.fromkeys(["sin", "cos", "tan", "asin", "acos", "atan"], 1),
    **dict.fromkeys(["sinh", "cosh", "tanh", "exp", "sqrt", "sign", "erf", "erfc"], 1),
    **dict.fromkeys(["atan2", "besselj", "bessely", "besseli"], 2),
}
RENAMED = {
    "ln": ("log", 1),
    "log": ("log", 1),
    "log10": ("log", 1),
    "abs": ("Abs", 1),
    "flr": ("floor", 1),
    "ceil": ("ceiling", 1),
    "heav": ("Heaviside", 1),
    "lgamma": ("loggamma", 1),
    "mod": ("Mod", 2),
    "max": ("Max", 2),
    "min": ("Min", 2),
    **{name: (name, count) for name, count in NAMED.items()},
}

#: Second arguments that the functions have here: log10(x) is log(x, 10), heav(0) is 1.
_SECOND = {"log10": "10", "heav": "1"}

#: Operators that the readers of models replace, with their numbers of arguments.
OPERATORS = {
    "sum": 3,
    "shift": 2,
    "delay": 2,
    "del_shft": 3,
    "ran": 1,
    "normal": 2,
    "poisson": 1,
    "hom_bcs": 1,
}

#: Words that are neither names of quantities nor of functions of a file.
RESERVED = frozenset([*RENAMED, *OPERATORS, "if", "then", "else", "of", "not", "t", "pi", "int"])

_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[iI]'|[A-Za-z_][A-Za-z_0-9.]*)"
    r"|(?P<sign>\*\*|<=|>=|==|!=|[-+*/^<>&|(),])",
    re.ASCII,
)

ONE, ZERO = Number("1"), Number("0")


class FormulaError(ValueError):
    """The reason why a text is no formula of XPPAUT, and the position in it."""

    def __init__(self, reason: str, at: int) -> None:
        super().__init__(reason)
        self.at = at


@dataclass(frozen=True)
class Formula:
    """A formula with what is worth a note.

    Parameters
    ----------
    tree : Node
        Always a value.
    surprises : tuple of str
        Comparisons that XPPAUT reads otherwise than they look.
    """

    tree: Node
    surprises: tuple[str, ...] = field(default=())


def parse(text: str, odd: Collection[str] = ()) -> Formula:
    """Parse a formula of XPPAUT.

    Parameters
    ----------
    text : str
    odd : collection of str
        Names that begin with a digit, in lower case.

    Raises
    ------
    FormulaError
        For any other text.

    Examples
    --------
    >>> from fastslow.formulas.grammar import text_of
    >>> text_of(parse("-X^2 + heav(x-1)").tree)
    '-x**2 + Heaviside(x - 1, 1)'
    >>> found = parse("if(v>a+1)then(2)else(0)")
    >>> text_of(found.tree)
    'Piecewise((2, Piecewise((1, v > a), (0, True)) + 1 != 0), (0, True))'
    >>> found.surprises
    ('v > a comes before + 1: XPPAUT compares first',)
    """
    if len(text) > LENGTH:
        raise FormulaError(f"{len(text)} characters; expected at most {LENGTH}", 0)
    parser = _XppParser(text, odd)
    return Formula(parser.whole(), tuple(dict.fromkeys(parser.surprises)))


def as_value(node: Node) -> Node:
    """Return a condition as the number 1 or 0, and a value as it is."""
    if isinstance(node, Truth):
        return ONE if node.value else ZERO
    if isinstance(node, CONDITIONS):
        return Call("Piecewise", (Pair(ONE, node), Pair(ZERO, Truth(True))))
    return node


def as_condition(node: Node) -> Node:
    """Return a value as the condition that it is not 0, and a condition as it is."""
    if isinstance(node, CONDITIONS):
        return node
    if isinstance(node, Number):
        return Truth(node.value != 0)
    return Comparison(("!=",), (node, ZERO))


class _XppParser:
    """Parser by precedence climbing."""

    def __init__(self, text: str, odd: Collection[str]) -> None:
        self.tokens = list(_tokens(text, odd))
        self.at = 0
        self.depth = 0
        self.surprises: list[str] = []

    @property
    def now(self) -> str:
        """The next token; empty at the end."""
        return self.tokens[self.at][1]

    def take(self) -> str:
        self.at += 1
        return self.tokens[self.at - 1][1]

    def expect(self, word: str) -> None:
        if self.now != word:
            raise self.unexpected(f"'{word}'")
        self.at += 1

    def unexpected(self, expected: str) -> FormulaError:
        _, text, place = self.tokens[self.at]
        before = f" after {quoted(self.tokens[self.at - 1][1])}" if self.at else ""
        if not text:
            return FormulaError(f"the formula ends{before}, where {expected} is expected", place)
        return FormulaError(f"cannot read {quoted(text)}{before}; expected {expected}", place)

    def whole(self) -> Node:
        tree = as_value(self.expression(0))
        if self.now:
            raise self.unexpected("an operator")
        return tree

    def expression(self, least: int) -> Node:
        """Parse an expression with operators of at least a given precedence."""
        self.depth += 1
        if self.depth > DEPTH:
            reason = f"nested more than {DEPTH} levels deep; expected fewer"
            raise FormulaError(reason, self.tokens[self.at][2])
        left = self.prefixed() if self.begins() else self.atom()
        while (level := PRECEDENCE.get(self.now, -1)) >= least:
            left = self.operation(left, level)
        self.depth -= 1
        return left

    def begins(self) -> bool:
        """Return True where a sign is one of a value: after nothing, a bracket or a comma."""
        first = not self.at or self.tokens[self.at - 1][1] in ("(", ",")
        return self.now == "not" or (self.now == "-" and first)

    def prefixed(self) -> Node:
        sign = self.take()
        first = self.at
        operand = self.expression(PREFIX + 1)
        if sign == "not":
            return Logic("not", (as_condition(operand),))
        if isinstance(operand, Comparison):
            self.surprise(first, "the minus sign before it")
        return Negative(as_value(operand))

    def operation(self, left: Node, level: int) -> Node:
        """Parse consecutive operators of one precedence, of which those of one kind are joined."""
        operator = self.take()
        first = self.at
        right = self.expression(level + 1)
        if operator in COMPARED:
            if PRECEDENCE.get(self.now) in (4, 6) and self.now not in ("&", "|"):
                self.surprise(first, f"{self.now} {self.tokens[self.at + 1][1]}", operator)
            return Comparison((operator,), (as_value(left), as_value(right)))
        if operator in ("&", "|"):
            word = "and" if operator == "&" else "or"
            return Logic(word, (as_condition(left), as_condition(right)))
        left, right = as_value(left), as_value(right)
        if operator in ("^", "**"):
            return Power(left, right)
        if operator in ("+", "-"):
            return Sum(
                (*(left.terms if isinstance(left, Sum) else (("+", left),)), (operator, right))
            )
        many = left.factors if isinstance(left, Product) else (("*", left),)
        return Product((*many, (operator, right)))

    def surprise(self, at: int, what: str, operator: str = "") -> None:
        """Record a comparison that binds more tightly than arithmetic beside it."""
        if operator:
            one, other = self.tokens[at - 2][1], self.tokens[at][1]
            shown = f"{one} {operator} {other}"
        else:
            shown = " ".join(text for _, text, _ in self.tokens[at : at + 3])
        self.surprises.append(f"{shown} comes before {what}: XPPAUT compares first")

    def atom(self) -> Node:
        kind, text, _place = self.tokens[self.at]
        if kind == "number":
            return Number(self.take())
        if kind == "name":
            return self.named()
        if text == "(":
            self.take()
            inside = self.expression(0)
            self.expect(")")
            return inside
        raise self.unexpected("a value")

    def bracket(self) -> Node:
        self.expect("(")
        inside = self.expression(0)
        self.expect(")")
        return inside

    def named(self) -> Node:
        _, name, place = self.tokens[self.at]
        self.take()
        if name == "if":
            condition = as_condition(self.bracket())
            self.expect("then")
            value = as_value(self.bracket())
            self.expect("else")
            other = as_value(self.bracket())
            last: tuple[Node, ...] = (Pair(other, Truth(True)),)
            if isinstance(other, Call) and other.function == "Piecewise":
                last = other.arguments
            return Call("Piecewise", (Pair(value, condition), *last))
        if name in ("then", "else", "of"):
            self.at -= 1
            raise self.unexpected("a value")
        if self.now != "(":
            if name in RENAMED or name in OPERATORS:
                raise self.unexpected("'('")
            return Name(name)
        arguments = self.arguments()
        if name == "sum":
            self.expect("of")
            arguments.append(as_value(self.bracket()))
        if name in OPERATORS:
            _check_count(name, OPERATORS[name], len(arguments), place)
            return Call(name, tuple(arguments))
        if name not in RENAMED:
            return Call(name, tuple(arguments))
        function, count = RENAMED[name]
        _check_count(name, count, len(arguments), place)
        if name in _SECOND:
            arguments.append(Number(_SECOND[name]))
        return Call(function, tuple(arguments))

    def arguments(self) -> list[Node]:
        found: list[Node] = []
        self.expect("(")
        while True:
            found.append(as_value(self.expression(0)))
            if self.now != ",":
                break
            self.take()
        self.expect(")")
        return found


def _check_count(name: str, wanted: int, count: int, place: int) -> None:
    if count != wanted:
        plural = "s" * (wanted > 1)
        raise FormulaError(f"{name} takes {wanted} argument{plural}, received {count}", place)


def _tokens(text: str, odd: Collection[str]) -> Iterator[tuple[str, str, int]]:
    """Yield kind, text and position of each token, followed by an empty one."""
    at = 0
    names = sorted(odd, key=len, reverse=True)
    one_of = re.compile(rf"({'|'.join(map(re.escape, names))})(?!\w)", re.I) if names else None
    while at < len(text):
        if text[at].isspace():
            at += 1
            continue
        if one_of is not None and (own := one_of.match(text, at)):
            yield "name", own.group().lower(), at
            at = own.end()
            continue
        found = _TOKEN.match(text, at)
        if found is None:
            yield "other", text[at], at
            at += 1
            continue
        kind, word = found.lastgroup or "", found.group()
        if kind == "number":
            _check_number(word, text[found.end() : found.end() + 1], at)
        yield kind, word.lower(), at
        at = found.end()
    yield "end", "", len(text)


def _check_number(word: str, following: str, at: int) -> None:
    if following == "_" or following.isalnum():
        raise FormulaError(f"cannot read {quoted(word + following)}…; a product is written *", at)
    if len(word) > NUMBER_CHARACTERS:
        raise FormulaError(
            f"a number of {len(word)} characters; expected at most {NUMBER_CHARACTERS}", at
        )
    if not abs(float(word)) < float("inf"):
        raise FormulaError(f"the number {quoted(word)} is too large; expected below 1.8e308", at)
