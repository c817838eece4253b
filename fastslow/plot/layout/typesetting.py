"""Escaping and typesetting of names, expressions and texts for Matplotlib."""

from __future__ import annotations

import re

from matplotlib.mathtext import MathTextParser

from fastslow.errors import ArgumentError
from fastslow.formulas.elementary import ELEMENTARY
from fastslow.formulas.grammar import (
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
    parse,
    text_of,
)

#: Names of Greek letters.
LETTERS = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau "
    "upsilon phi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
)
GREEK = frozenset(LETTERS.split())

#: Functions that have a command in TeX.
COMMANDS = frozenset({"max", "min", *(one.name for one in ELEMENTARY.values() if one.in_tex)})

#: Notation of comparisons and connectives.
SIGNS = {"<=": r"\leq", ">=": r"\geq", "==": "=", "!=": r"\neq"}
JOINED = {"and": r"\wedge", "or": r"\vee"}

#: Characters of names that Matplotlib's mathtext can draw.
_LETTERS = re.compile(r"[A-Za-z0-9_\u00a1-\U0001ffff]+")


def plain(text: str) -> str:
    r"""Escape a text as one line without mathematics.

    Examples
    --------
    >>> plain("a $b"), plain("two\nlines")
    ('a \\$b', 'two lines')
    """
    line = "".join(
        c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in " ".join(text.split())
    )
    line = line.replace("$", r"\$")
    # Matplotlib omits labels with a leading underscore from legends
    return rf"$\_${line[1:]}" if line.startswith("_") else line


def as_given(text: str) -> str:
    r"""Return a user's text, keeping formulas between dollars that Matplotlib can parse.

    Examples
    --------
    >>> as_given(r"at $\omega$ = 2"), as_given(r"at $\nothing$")
    ('at $\\omega$ = 2', 'at \\$\\nothing\\$')
    """
    lines = text.split("\n")
    if all(line.isprintable() for line in lines) and not text.startswith("_"):
        try:
            for line in lines:
                if line.replace(r"\$", "").count("$") % 2 == 0:
                    MathTextParser("path").parse(line)
        except ValueError:
            return paragraph(text)
        return text
    return paragraph(text)


def paragraph(text: str) -> str:
    """Escape a text of several lines without mathematics."""
    return "\n".join(map(plain, text.split("\n")))


def typeset(name: str) -> str:
    r"""Typeset a name: Greek letters by their names, subscripts after an underscore.

    A name that is not an identifier is left unchanged.

    Examples
    --------
    >>> typeset("x"), typeset("omega_0"), typeset("theta_in"), typeset("load")
    ('$x$', '$\\omega_{0}$', '$\\theta_{\\mathrm{in}}$', '$\\mathrm{load}$')
    >>> typeset("x^{2}$")
    'x^{2}\\$'
    """
    return f"${_symbol(name)}$" if _drawn(name) else plain(name)


def _drawn(name: str) -> bool:
    return bool(_LETTERS.fullmatch(name)) and name.isidentifier()


def _symbol(name: str) -> str:
    """Typeset a name within a formula."""
    if not _drawn(name):
        return r"\mathrm{?}"
    head, *below = name.split("_")
    if not all((head, *below)):
        return r"\mathrm{" + name.replace("_", r"\_") + "}"
    return _letter(head) + (f"_{{{','.join(map(_letter, below))}}}" if below else "")


def _letter(word: str) -> str:
    if word in GREEK:
        return f"\\{word}"
    return word if len(word) < 2 else f"\\mathrm{{{word}}}"


def written(expression: str) -> str:
    r"""Typeset an expression as the label of an axis.

    Examples
    --------
    >>> written("x**2 + 2*v*omega_0"), written("sqrt((a + x)/2)"), written("load")
    ('$x^{2} + 2\\,v\\,\\omega_{0}$', '$\\sqrt{(a + x)/2}$', '$\\mathrm{load}$')
    """
    try:
        tree = parse(expression)
    except ArgumentError:  # a name that is not an identifier
        return typeset(expression)
    return typeset(tree.name) if isinstance(tree, Name) else f"${_mathematics(tree)[0]}$"


def _mathematics(node: Node) -> tuple[str, int]:
    """Typeset a subexpression; return it with its operator precedence."""
    match node:
        case Name(name):
            return _symbol(name), 4
        case Number(text):
            number, _, exponent = text.lower().partition("e")
            if not exponent:
                return number, 4
            return rf"{number}\cdot 10^{{{int(exponent)}}}", 2
        case Negative(operand):
            return f"-{_bound(operand, 2)}", 1
        case Sum(((_, first), *rest)):
            terms = [_bound(first, 1)]
            # a − (b − c) needs its brackets
            terms += [f" {sign} {_bound(term, 1 + (sign == '-'))}" for sign, term in rest]
            return "".join(terms), 1
        case Product(((_, first), *rest)):
            factors = [_bound(first, 2)]
            for sign, factor in rest:
                factors += ["/" if sign == "/" else r"\,", _bound(factor, 2 + (sign == "/"))]
            return "".join(factors), 2
        case Power(base, exponent):
            return f"{_bound(base, 4)}^{{{_mathematics(exponent)[0]}}}", 3
        case Call("sqrt", (inside,)):
            return rf"\sqrt{{{_mathematics(inside)[0]}}}", 4
        case Call("abs" | "Abs", (inside,)):
            return f"|{_mathematics(inside)[0]}|", 4
        case Call(function, arguments):
            name, inside_all = function.lower(), ", ".join(_mathematics(a)[0] for a in arguments)
            command = f"\\{name}" if name in COMMANDS else rf"\mathrm{{{name}}}"
            return f"{command}({inside_all})", 4
        case Pair(value, condition):
            return rf"{_mathematics(value)[0]}\;\mathrm{{if}}\;{_mathematics(condition)[0]}", 0
        case Comparison(operators, operands):
            sides = [_bound(o, 1) for o in operands]
            signs = [SIGNS.get(sign, sign) for sign in operators]
            compared = [f" {sign} {o}" for sign, o in zip(signs, sides[1:], strict=True)]
            return sides[0] + "".join(compared), 0
        case Logic("not", (operand,)):
            return rf"\neg {_bound(operand, 4)}", 0
        case Logic(word, operands):
            return f" {JOINED[word]} ".join(_bound(o, 4) for o in operands), 0
    return rf"\mathrm{{{text_of(node)}}}", 4


def _bound(node: Node, level: int) -> str:
    text, own = _mathematics(node)
    return f"({text})" if own < level else text
