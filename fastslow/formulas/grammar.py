"""The grammar of formulas: a parser from text to a tree of nodes."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache

from fastslow.errors import ArgumentError, quoted, unknown_name
from fastslow.formulas.functions import CONNECTIVES, FUNCTIONS, RELATIONS
from fastslow.formulas.limits import DEPTH, LENGTH, NUMBER_CHARACTERS, PIECES


@dataclass(frozen=True, slots=True)
class Number:
    """A decimal number in its original form."""

    text: str

    @property
    def value(self) -> float:
        """The nearest float."""
        return float(self.text)


@dataclass(frozen=True, slots=True)
class Name:
    """A name, normalised."""

    name: str


@dataclass(frozen=True, slots=True)
class Negative:
    """Minus an operand."""

    operand: Node


@dataclass(frozen=True, slots=True)
class Sum:
    """A sum of signed terms, from left to right."""

    terms: tuple[tuple[str, Node], ...]


@dataclass(frozen=True, slots=True)
class Product:
    """A product of factors and divisors, from left to right."""

    factors: tuple[tuple[str, Node], ...]


@dataclass(frozen=True, slots=True)
class Power:
    """A power: base and exponent."""

    base: Node
    exponent: Node


@dataclass(frozen=True, slots=True)
class Call:
    """A function call; the arguments of Piecewise are pairs."""

    function: str
    arguments: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Pair:
    """A value of Piecewise with its condition."""

    value: Node
    condition: Node


@dataclass(frozen=True, slots=True)
class Comparison:
    """A chained comparison, with one operator fewer than operands."""

    operators: tuple[str, ...]
    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Logic:
    """Conditions joined by ``and``, ``or`` or ``not``."""

    operator: str
    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Truth:
    """``True`` or ``False``."""

    value: bool


Node = Number | Name | Negative | Sum | Product | Power | Call | Pair | Comparison | Logic | Truth

CONDITIONS = (Comparison, Logic, Truth)

#: Precedence of operators, as in Python.
PRECEDENCE = {
    **dict.fromkeys(["or"], 1),
    **dict.fromkeys(["and"], 2),
    **dict.fromkeys(["<", "<=", ">", ">=", "==", "!="], 4),
    **dict.fromkeys(["|"], 5),
    **dict.fromkeys(["&"], 6),
    **dict.fromkeys(["+", "-"], 7),
    **dict.fromkeys(["*", "/"], 8),
}
NOT, COMPARED, SIGN = 3, 4, 9

#: Logical operations by their operators.
WORDS = {"&": "and", "|": "or", "and": "and", "or": "or"}

#: Reserved words.
RESERVED = ("and", "or", "not", "True", "False")

#: Alternatives to unsupported characters.
INSTEAD = {
    "^": "a power is written **",
    "%": "a remainder is written Mod(a, b)",
    "//": "a quotient without remainder is written floor(a/b)",
    "=": "an equality is written ==",
    "−": "minus is written -",
    "–": "minus is written -",
    "·": "a product is written *",
    "×": "a product is written *",
    "²": "a power is written **2",
    "³": "a power is written **3",
    "≤": "write <=",
    "≥": "write >=",
    "≠": "write !=",
    ".": "attributes cannot be read",
    "[": "write the name of a column alone",
    "'": "names stand without quotes",
    '"': "names stand without quotes",
}

_TOKEN = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_\u0080-\U0010ffff][A-Za-z_0-9\u0080-\U0010ffff]*)"
    r"|(?P<sign>\*\*|//|<=|>=|==|!=|[-+*/<>&|~(),])",
    re.ASCII,
)
_SPACE = re.compile(r"[ \t\r\n]*")


class _Refused(ValueError):
    """The reason why a text is not a formula."""


def normalised(name: str) -> str:
    """Normalise an identifier to NFKC, as Python does; other names are unchanged.

    Examples
    --------
    >>> normalised("ℌ"), normalised("x - D")
    ('H', 'x - D')
    """
    if name.isascii() or not name.isidentifier():
        return name
    return unicodedata.normalize("NFKC", name)


def parse(text: str, valid: Iterable[str] | None = None) -> Node:
    """Read a formula or a condition.

    Parameters
    ----------
    text : str
    valid : iterable of str, optional
        The accepted names, for errors; the names in the formula are not checked here.

    Raises
    ------
    ArgumentError
        For text that is not a formula, with the reason.

    Examples
    --------
    >>> parse("2*x - 1")
    Sum(terms=(('+', Product(factors=(('*', Number(text='2')), ('*', Name(name='x'))))), \
('-', Number(text='1'))))
    >>> parse("x.real")
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: 'x.real' is not an expression: cannot read '.' after 'x': \
attributes cannot be read
    """
    found = _parsed(str(text))
    if isinstance(found, str):
        raise refused(text, found, valid)
    return found


def refused(text: str, reason: str, valid: Iterable[str] | None = None) -> ArgumentError:
    """Return the error for a text that is not a formula."""
    names = "" if valid is None else f" in {_listed(valid)}"
    return ArgumentError(f"{quoted(text)} is not an expression{names}: {reason}")


def _listed(names: Iterable[str]) -> str:
    known = list(names)
    more = [f"{len(known) - 12} more"] if len(known) > 12 else []
    return ", ".join([*known[:12], *more])


@lru_cache(maxsize=1024)
def _parsed(text: str) -> Node | str:
    """Return the tree of a text, or the reason why it cannot be parsed."""
    if len(text) > LENGTH:
        return f"{len(text)} characters; expected at most {LENGTH}"
    try:
        return _Parser(text).whole()
    except _Refused as error:
        return str(error)


def nodes(tree: Node) -> Iterator[Node]:
    """Yield every node of a tree."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += parts(node)


def parts(node: Node) -> tuple[Node, ...]:
    """Return the children of a node."""
    match node:
        case Negative(operand):
            return (operand,)
        case Sum(pairs) | Product(pairs):
            return tuple(part for _, part in pairs)
        case Power(base, exponent):
            return base, exponent
        case Call(_, arguments):
            return arguments
        case Pair(value, condition):
            return value, condition
        case Comparison(_, operands) | Logic(_, operands):
            return operands
    return ()


def names_of(tree: Node) -> tuple[str, ...]:
    """Return the names in a tree, each once."""
    return tuple(dict.fromkeys(node.name for node in nodes(tree) if isinstance(node, Name)))


def text_of(node: Node) -> str:
    """Return a tree as text, from which the same tree is parsed.

    Examples
    --------
    >>> text_of(parse("-(x+1) ** 2 / max(x, 3)"))
    '-(x + 1)**2/max(x, 3)'
    """
    return _written(node, 0)


def _written(node: Node, least: int) -> str:
    text, level = _level(node)
    return f"({text})" if level < least else text


def _level(node: Node) -> tuple[str, int]:
    """Return the text of a node and its precedence."""
    match node:
        case Number(text):
            return text, 11
        case Name(name):
            return name, 11
        case Truth(value):
            return str(value), 11
        case Negative(operand):
            return f"-{_written(operand, SIGN)}", SIGN
        case Sum(pairs):
            terms = [f" {sign} {_written(term, 8)}" for sign, term in pairs]
            return "".join(terms)[3:], 7
        case Product(pairs):
            factors = [f"{sign}{_written(factor, SIGN)}" for sign, factor in pairs]
            return "".join(factors)[1:], 8
        case Power(base, exponent):
            return f"{_written(base, 11)}**{_written(exponent, SIGN)}", 10
        case Call(function, arguments):
            return f"{function}({', '.join(_written(a, 0) for a in arguments)})", 11
        case Pair(value, condition):
            return f"({_written(value, 0)}, {_written(condition, 0)})", 11
        case Comparison(operators, operands):
            first, *rest = (_written(o, 5) for o in operands)
            compared = [f" {sign} {o}" for sign, o in zip(operators, rest, strict=True)]
            return first + "".join(compared), COMPARED
        case Logic("not", (operand,)):
            return f"not {_written(operand, NOT)}", NOT
        case Logic(word, operands):
            level = PRECEDENCE[word]
            return f" {word} ".join(_written(o, level + 1) for o in operands), level
    raise TypeError(node)


class _Parser:
    """Parser by precedence climbing, with one method for all binary operators."""

    def __init__(self, text: str) -> None:
        self.tokens = list(_tokens(text))
        self.at = 0
        self.depth = 0

    @property
    def now(self) -> tuple[str, str]:
        return self.tokens[self.at]

    def take(self) -> str:
        _, text = self.tokens[self.at]
        self.at += 1
        return text

    def accept(self, sign: str) -> bool:
        found = self.now == ("sign", sign)
        self.at += found
        return found

    def whole(self) -> Node:
        if self.now[0] == "end":
            raise _Refused("it is empty")
        tree = self.expression(0)
        if isinstance(tree, Pair) or self.now == ("sign", ","):
            raise _Refused("pairs stand in Piecewise alone")
        if self.now[0] != "end":
            raise self.unexpected("an operator")
        return tree

    def unexpected(self, expected: str) -> _Refused:
        kind, text = self.now
        before = f" after {self.tokens[self.at - 1][1]!r}" if self.at else ""
        if kind == "end":
            return _Refused(f"it ends{before}, where {expected} is expected")
        if text in INSTEAD:
            return _Refused(f"cannot read {text!r}{before}: {INSTEAD[text]}")
        return _Refused(
            f"cannot read {quoted(text)}{before}; expected {expected} (a formula holds names, "
            "numbers, + - * / ** and functions)"
        )

    def expression(self, least: int) -> Node:
        """Parse an expression with operators of at least a given precedence."""
        self.depth += 1
        if self.depth > DEPTH:
            raise _Refused(f"nested more than {DEPTH} levels deep; expected fewer")
        left = self.operand()
        while True:
            level = PRECEDENCE.get(self.now[1], 0) if self.now[0] == "sign" else 0
            if not level or level < least:
                break
            left = self.operation(left, level)
        self.depth -= 1
        return left

    def operation(self, left: Node, level: int) -> Node:
        """Parse consecutive operators of equal precedence as one node."""
        operators, operands = [], [left]
        while self.now[0] == "sign" and PRECEDENCE.get(self.now[1]) == level:
            operators.append(self.take())
            operands.append(self.expression(level + 1))
        if level == COMPARED:
            return Comparison(tuple(operators), tuple(map(_value, operands)))
        if operators[0] in WORDS:
            return Logic(WORDS[operators[0]], tuple(map(_condition, operands)))
        values = tuple(map(_value, operands))
        if level == PRECEDENCE["+"]:
            return Sum(tuple(zip(("+", *operators), values, strict=True)))
        return Product(tuple(zip(("*", *operators), values, strict=True)))

    def operand(self) -> Node:
        """Parse an operand with its signs and exponent."""
        negative = signed = False
        while self.now in (("sign", "-"), ("sign", "+")):
            negative ^= self.take() == "-"
            signed = True
        if self.now in (("sign", "~"), ("sign", "not")):
            if signed:
                raise self.unexpected("a value")
            level = SIGN if self.take() == "~" else NOT
            return Logic("not", (_condition(self.expression(level)),))
        base = self.atom()
        if self.accept("**"):
            # right-associative, with lower precedence than the sign of the exponent
            base = Power(_value(base), _value(self.expression(SIGN)))
        if signed:
            base = _value(base)
        return Negative(base) if negative else base

    def atom(self) -> Node:
        kind, _ = self.now
        if kind == "number":
            return Number(self.take())
        if kind == "name":
            return self.named()
        if kind == "truth":
            return Truth(self.take() == "True")
        if self.accept("("):
            inside = self.expression(0)
            if self.accept(","):
                inside = Pair(_value(inside), _condition(self.expression(0)))
                self.accept(",")
            self.close()
            return inside
        raise self.unexpected("a value")

    def named(self) -> Node:
        name = self.take()
        if self.now != ("sign", "("):
            return Name(name)
        if name not in FUNCTIONS and name not in RELATIONS and name not in CONNECTIVES:
            nearest = str(unknown_name("function", name, FUNCTIONS)).partition(" (known")[0]
            raise _Refused(f"{nearest} (functions have their names in SymPy, such as sqrt, Max)")
        self.take()
        arguments: list[Node] = []
        while not self.accept(")"):
            if arguments and not self.accept(","):
                self.close()
                break
            if arguments and self.accept(")"):
                break
            arguments.append(self.expression(0))
        return _called(name, arguments)

    def close(self) -> None:
        if not self.accept(")"):
            raise self.unexpected("')'")


def _called(name: str, arguments: list[Node]) -> Node:
    """Return a function call after checking the number and kind of its arguments."""
    if name in RELATIONS:
        _check_count(name, 2, 2, len(arguments))
        return Comparison((RELATIONS[name],), tuple(map(_value, arguments)))
    if name in CONNECTIVES:
        _check_count(name, 1, 1 if name == "Not" else PIECES, len(arguments))
        return Logic(CONNECTIVES[name], tuple(map(_condition, arguments)))
    _check_count(name, FUNCTIONS[name].least, FUNCTIONS[name].most, len(arguments))
    if name == "Piecewise":
        if not all(isinstance(a, Pair) for a in arguments):
            raise _Refused("Piecewise takes pairs (value, condition)")
        return Call(name, tuple(arguments))
    return Call(name, tuple(map(_value, arguments)))


def _check_count(name: str, least: int, most: int, count: int) -> None:
    if least <= count <= most:
        return
    wanted = f"{least} to {most}" if most > 2 else " or ".join(map(str, range(least, most + 1)))
    raise _Refused(f"{name} takes {wanted} argument{'s' * (most > 1)}, received {count}")


def _value(node: Node) -> Node:
    """Return a node if it is a value."""
    if isinstance(node, CONDITIONS):
        raise _Refused(f"{quoted(text_of(node))} is a condition; expected a value")
    if isinstance(node, Pair):
        raise _Refused("pairs stand in Piecewise alone")
    return node


def _condition(node: Node) -> Node:
    """Return a node if it is a condition."""
    if not isinstance(node, CONDITIONS):
        raise _Refused(f"{quoted(text_of(node))} is a value; expected a condition such as (x > 0)")
    return node


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    """Yield kind and text of each token, followed by one of kind "end"."""
    at = _SPACE.match(text).end()  # type: ignore[union-attr]
    while at < len(text):
        found = _TOKEN.match(text, at)
        if found is None:
            yield "other", text[at]
            return
        kind, word = found.lastgroup or "", found.group()
        at = found.end()
        if kind == "number":
            _check_number(word, text[at : at + 1])
        elif kind == "name" and not word.isidentifier():
            length = next(
                (k for k, c in enumerate(word) if not ("a" + c).isidentifier()), len(word)
            )
            length = length if word[:length].isidentifier() else 0
            if length:
                yield "name", normalised(word[:length])
            yield "other", word[length]
            return
        elif kind == "name":
            word = normalised(word)
            kind = {"True": "truth", "False": "truth"}.get(word, kind)
            kind = "sign" if word in ("and", "or", "not") else kind
        yield kind, word
        at = _SPACE.match(text, at).end()  # type: ignore[union-attr]
    yield "end", ""


def _check_number(word: str, following: str) -> None:
    if following in ("j", "J"):
        raise _Refused(f"{quoted(word + following)} is complex; expected real numbers")
    if following == "_" or following.isalnum():
        raise _Refused(
            f"cannot read {quoted(word + following)}…; numbers are decimal, such as 1000 or 1e3, "
            "and a product is written *"
        )
    if len(word) > NUMBER_CHARACTERS:
        raise _Refused(f"a number of {len(word)} characters; expected at most {NUMBER_CHARACTERS}")
    value = float(word)
    if math.isinf(value):
        raise _Refused(f"the number {quoted(word)} is too large; expected less than 1.8e308")
    if value == 0.0 and re.search("[1-9]", re.split("[eE]", word)[0]):
        raise _Refused(f"the number {quoted(word)} is too small; expected more than 5e-324")
