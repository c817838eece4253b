"""Statements of .ode files: what each line declares, before any formula is read.

The syntax is that of the manual of XPPAUT and, where that is silent, of its source: the kind of a
line is decided by the first blank, ``=``, ``/``, ``'`` or ``(`` in it, and directives are
recognised by their first letters.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fastslow.errors import FileError, quoted
from fastslow.formulas.xppaut import RESERVED
from fastslow.readers.lines import Line, expanded, lines_of, text_of_file

#: What can be left out of a file on request, and how it is then read.
WITHOUT: Mapping[str, str] = {
    "delays": "delay(x, tau) is x",
    "noise": "Wiener quantities are 0; normal, poisson and ran are their means",
    "special": "sums over networks are 0",
    "export": "nothing is exchanged with libraries",
    "global": "events do not happen",
}

#: Files included by others, one inside the other.
DEEPEST_INCLUDE = 20

_NUMBER = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_PAIR = re.compile(r"([^\s=,]+)(?:\s*=\s*([^\s,]*))?")
_ODE = re.compile(r"([^\s=/'(]+)\s*'[^=]*=")
_LEIBNIZ = re.compile(r"[dD]([^\s=/'(]+)\s*/\s*[dD][tT]\s*=")
_EVENT = re.compile(r"\s*([-+]?\d+)\s*(?:\{([^{}]*)\}|([^{}]*))\s*\{(.*?)(\}|$)")


@dataclass(frozen=True)
class Named:
    """Something that a line declares: a name in lower case, and its formula.

    Parameters
    ----------
    name : str
        As written.
    line : Line
        The formula, with its places.
    arguments : tuple of str
        Names of the arguments of a function, in lower case.
    """

    name: str
    line: Line
    arguments: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """The name without case."""
        return self.name.lower()


@dataclass(frozen=True)
class GlobalEvent:
    """A ``global`` directive: sign, condition, and assignments in order."""

    line: Line
    sign: int
    condition: Line
    assignments: tuple[Named, ...]


@dataclass
class Statements:
    """Everything that a file declares, by kind and in its order."""

    folder: Path | None
    without: frozenset[str]
    states: dict[str, Named] = field(default_factory=dict)
    fixed: dict[str, Named] = field(default_factory=dict)
    derived: dict[str, Named] = field(default_factory=dict)
    functions: dict[str, Named] = field(default_factory=dict)
    tables: dict[str, Named] = field(default_factory=dict)
    wiener: dict[str, Named] = field(default_factory=dict)
    networks: dict[str, Named] = field(default_factory=dict)
    values: dict[str, tuple[Named, float]] = field(default_factory=dict)
    initial: dict[str, Named | float] = field(default_factory=dict)
    initial_lines: dict[str, Line] = field(default_factory=dict)
    auxiliary: dict[str, Named] = field(default_factory=dict)
    events: list[GlobalEvent] = field(default_factory=list)
    sets: dict[str, tuple[Line, dict[str, str]]] = field(default_factory=dict)
    options: dict[str, str] = field(default_factory=dict)
    only: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    structure: dict[str, dict[str, str]] = field(default_factory=dict)
    kinds: dict[str, tuple[str, Line]] = field(default_factory=dict)

    def read(self, text: str, file: str = "", depth: int = 0) -> None:
        """Read all statements of a text, and of the files that it includes."""
        lines, notes = lines_of(text, file)
        self.notes += notes
        first = lines[0] if lines else Line("", ((0, 1, 1),), file)
        if not depth and re.match(r"\s*\d+(\s|$)", first.text):
            raise first.refused(
                "a file of the old style, which begins with the number of equations; XPPAUT "
                "converts it by its option -convert"
            )
        for line in self._whole(expanded(lines), depth):
            if self.statement(line.part(0)):
                return

    def _whole(self, lines: Iterator[Line], depth: int) -> Iterator[Line]:
        """Yield lines other than comments, after reading the files that they include."""
        for line in lines:
            text = line.text.strip()
            if text.startswith("#include"):
                self._include(line, text[8:].strip().strip('"'), depth)
            elif text.startswith("#: "):
                # written by fastslow's export
                word, _, rest = text[3:].partition(" ")
                name, _, meaning = rest.partition(" = ")
                self.structure.setdefault(word, {})[name.strip()] = meaning.strip()
            elif text.startswith("#"):
                if comment := text.lstrip("# "):
                    self.comments.append(comment)
            elif text:
                yield line

    def _include(self, line: Line, name: str, depth: int) -> None:
        if self.folder is None:
            raise line.refused(f"the text includes the file {quoted(name)}; read it by fs.read")
        if depth >= DEEPEST_INCLUDE:
            raise line.refused(f"files include each other more than {DEEPEST_INCLUDE} times")
        text, notes = self.text_beside(line, name)
        self.notes += notes
        self.read(text, name, depth + 1)

    def text_beside(self, line: Line, name: str) -> tuple[str, list[str]]:
        """Return the text of a file in the folder of this one; errors name the line."""
        assert self.folder is not None
        try:
            return text_of_file(self.folder / name)
        except FileError as error:
            raise line.refused(str(error)) from error

    def refuse(self, line: Line, kind: str, what: str, at: int = 0) -> None:
        """Raise for what no ODE has, unless it is left out; then note it."""
        if kind in self.without:
            self.notes.append(f"{line.place(at)}: {what}, left out: {WITHOUT[kind]}")
            return
        raise line.refused(
            f'{what}, which is refused; read the file without it by without=["{kind}"] '
            f"({WITHOUT[kind]})",
            at,
        )

    def declare(self, kind: str, group: dict[str, Named], found: Named) -> None:
        """Add a name to a group, and refuse one that is taken."""
        key = found.key
        if not re.fullmatch(r"\d*[A-Za-z_][\w.]*", found.name, re.ASCII):
            raise found.line.refused(f"{quoted(found.name)} is no name; expected letters")
        if key in RESERVED:
            raise found.line.refused(f"{found.name} is a word of XPPAUT and cannot be a {kind}")
        if key in self.kinds:
            other, line = self.kinds[key]
            raise found.line.refused(
                f"{found.name} is already a {other}, {line.place()}; expected distinct names"
            )
        self.kinds[key] = kind, found.line
        group[key] = found

    def statement(self, line: Line) -> bool:
        """Read one statement; return True for the end of the file."""
        text = line.text
        if text.startswith('"'):
            self._comment(line)
            return False
        if text.startswith("@"):
            self.options |= {name.lower(): value for name, value, _ in pairs(line.part(1))}
            return False
        if re.match(r"0\s*=", text):
            raise line.refused("an algebraic equation (DAE); only ODEs can be read")
        word, sign, rest = _split(text)
        at = len(text) - len(rest)
        if sign == "=":
            name = text[1 : len(word)].strip() if word.startswith("!") else word
            group, kind = (
                (self.derived, "derived parameter")
                if word.startswith("!")
                else (
                    self.fixed,
                    "quantity",
                )
            )
            self.declare(kind, group, Named(name, line.part(at)))
        elif sign in ("'", "/"):
            self._rate(line, sign)
        elif sign == "(":
            self._with_bracket(line, word)
        else:
            return self._directive(line, word, line.part(at))
        return False

    def _rate(self, line: Line, sign: str) -> None:
        found = (_ODE if sign == "'" else _LEIBNIZ).match(line.text)
        if found is None:
            raise line.refused("expected a rate such as x'=… or dx/dt=…")
        self.declare("state", self.states, Named(found.group(1), line.part(found.end())))

    def _with_bracket(self, line: Line, word: str) -> None:
        """Read a function, an initial value, a Volterra equation or a map."""
        text = line.text
        equals = text.find("=")
        inside = text[text.find("(") + 1 : text.find(")")].strip().lower()
        if equals < 0 or text.find(")") < 0 or text.find(")") > equals:
            raise line.refused(f"cannot read {quoted(text)}; expected a declaration such as f(x)=…")
        right = line.part(equals + 1)
        if re.fullmatch(r"t\s*\+\s*1", inside):
            raise line.refused("a map (a difference equation); only ODEs can be read")
        if inside == "0":
            self.initial[word.lower()] = Named(word, right)
            self.initial_lines[word.lower()] = line
        elif inside == "t" and re.search(r"int\s*[\[{]", right.text, re.I):
            raise line.refused("a Volterra integral equation; only ODEs can be read")
        else:
            arguments = tuple(a.strip() for a in inside.split(","))
            for name in arguments:
                if not re.fullmatch(r"[a-z_][\w.]*", name, re.ASCII):
                    raise line.refused(f"{quoted(name)} is no name of an argument", len(word) + 1)
            self.declare("function", self.functions, Named(word, right, arguments))

    def _comment(self, line: Line) -> None:
        found = re.match(r'"\s*\{([^}]*)\}(.*)', line.text)
        if found:
            name = found.group(2).strip() or f"comment {len(self.sets) + 1}"
            items = {n.lower(): v for n, v, _ in pairs(line.part(found.start(1), found.end(1)))}
            self.sets[name] = line, items
        elif comment := line.text.strip('" '):
            self.comments.append(comment)

    def _directive(self, line: Line, word: str, rest: Line) -> bool:
        for prefix, read in DIRECTIVES.items():
            if word.lower().startswith(prefix):
                read(self, line, rest)
                return prefix == "d"
        # XPPAUT knows the words of a directive by their first letters, and ignores others
        self.notes.append(f"{line.place()}: {quoted(line.text)} is nothing that XPPAUT reads")
        return False

    def _parameters(self, line: Line, rest: Line) -> None:
        for name, value, at in pairs(rest):
            one = Named(name, rest.part(at))
            if re.fullmatch(r"\w+\(0\)", name):
                what = f"{quoted(name)} is a parameter that no formula can contain; dropped"
                self.notes.append(f"{one.line.place()}: {what}")
                continue
            declared: dict[str, Named] = {}
            self.declare("parameter", declared, one)
            self.values[one.key] = one, self.number(one.line, name, value)

    def _initial(self, line: Line, rest: Line) -> None:
        for name, value, at in pairs(rest):
            self.initial[name.lower()] = self.number(rest.part(at), name, value)
            self.initial_lines[name.lower()] = rest.part(at)

    def number(self, line: Line, name: str, value: str) -> float:
        """Return the number that XPPAUT reads: the one at the start of a text, otherwise 0."""
        found = _NUMBER.match(value)
        number = float(found.group()) if found else 0.0
        if value and (found is None or found.end() < len(value)):
            self.notes.append(
                f"{line.place()}: XPPAUT reads {name}={quoted(value)} as the number {number:g}"
            )
        return number

    def _wiener(self, line: Line, rest: Line) -> None:
        self.refuse(line, "noise", "a Wiener process")
        for name, _, at in pairs(rest):
            self.declare("Wiener quantity", self.wiener, Named(name, rest.part(at)))

    def _auxiliary(self, line: Line, rest: Line) -> None:
        name, equals, _ = rest.text.partition("=")
        if not equals:
            raise line.refused("expected a quantity such as aux name=formula")
        one = Named(name.strip(), rest.part(len(name) + 1))
        self.auxiliary[one.key] = one

    def _table(self, line: Line, rest: Line) -> None:
        name, _, _ = rest.text.partition(" ")
        self.declare("table", self.tables, Named(name, rest.part(len(name))))

    def _global(self, line: Line, rest: Line) -> None:
        found = _EVENT.match(rest.text)
        if found is None or not found.group(5):
            raise line.refused("expected an event such as global 1 x-1 {x=0;y=y+1}")
        condition = 2 if found.group(2) is not None else 3
        assignments = []
        for part in re.finditer(r"[^;]+", found.group(4)):
            name, equals, _ = part.group().partition("=")
            if not part.group().strip():
                continue
            start = found.start(4) + part.start()
            if not equals:
                raise line.refused(f"{quoted(part.group())} is no assignment such as x=0")
            right = rest.part(start + len(name) + 1, start + len(part.group()))
            assignments.append(Named(name.strip(), right))
        if "global" in self.without:
            self.refuse(line, "global", "an event (global)")
            return
        at = rest.part(found.start(condition), found.end(condition))
        self.events.append(GlobalEvent(line, int(found.group(1)), at, tuple(assignments)))

    def _set(self, line: Line, rest: Line) -> None:
        found = re.match(r"([^\s{]+)\s*\{([^}]*)(\}|$)", rest.text)
        if found is None or not found.group(3):
            raise line.refused("expected a set of values such as set name {a=1,x=0}")
        inside = rest.part(found.start(2), found.end(2))
        self.sets[found.group(1)] = line, {n.lower(): v for n, v, _ in pairs(inside)}

    def _only(self, line: Line, rest: Line) -> None:
        self.only += re.split(r"[\s,]+", rest.text)

    def _boundary(self, line: Line, rest: Line) -> None:
        self.notes.append(f"{line.place()}: the boundary condition {rest.text} is dropped")

    def _file_of_options(self, line: Line, rest: Line) -> None:
        self.notes.append(f"{line.place()}: the file of options {rest.text} is not read")

    def _solved(self, line: Line, rest: Line) -> None:
        raise line.refused("an algebraic variable (solv); only ODEs can be read")

    def _volterra(self, line: Line, rest: Line) -> None:
        raise line.refused("a Volterra integral equation; only ODEs can be read")

    def _markov(self, line: Line, rest: Line) -> None:
        raise line.refused("a Markov process; only ODEs can be read")

    def _group_of_parts(self, line: Line, rest: Line) -> None:
        raise line.refused("a group; only ODEs can be read")

    def _network(self, line: Line, rest: Line) -> None:
        self.refuse(line, "special", "a sum over a network (special)")
        name, _, _ = rest.text.partition("=")
        self.declare("network", self.networks, Named(name.strip(), rest.part(len(name) + 1)))

    def _export(self, line: Line, rest: Line) -> None:
        self.refuse(line, "export", "an exchange with a library (export)")

    def _done(self, line: Line, rest: Line) -> None:
        """The end of the file."""


#: Directives by their first letters, of which the first that fits is meant.
DIRECTIVES: Mapping[str, Callable[[Statements, Line, Line], None]] = {
    "p": Statements._parameters,
    "n": Statements._parameters,
    "w": Statements._wiener,
    "i": Statements._initial,
    "au": Statements._auxiliary,
    "ta": Statements._table,
    "gr": Statements._group_of_parts,
    "g": Statements._global,
    "se": Statements._set,
    "so": Statements._solved,
    "sp": Statements._network,
    "on": Statements._only,
    "o": Statements._file_of_options,
    "b": Statements._boundary,
    "ma": Statements._markov,
    "v": Statements._volterra,
    "ex": Statements._export,
    "d": Statements._done,
}


def _split(text: str) -> tuple[str, str, str]:
    """Return the first word, the sign that ends it (empty for a blank), and the rest."""
    found = re.match(r"([^\s=/'(]*)(\s*)(.*)", text)
    assert found is not None
    word, blank, rest = found.groups()
    if rest.startswith("=") and not rest.startswith("=="):
        return word, "=", rest[1:].lstrip()
    if blank or not rest:
        return word, "", rest
    return word, rest[0], rest


def pairs(line: Line) -> Iterator[tuple[str, str, int]]:
    """Yield names and values of a list such as ``a=1, b = 2 c``, with their positions."""
    for found in _PAIR.finditer(line.text.partition("#")[0]):
        yield found.group(1), found.group(2) or "", found.start()
