"""Formulas of .ode files as expressions in states, parameters and time."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
import sympy as sp

from fastslow.errors import ArgumentError, ModelError, quoted
from fastslow.formulas import xppaut
from fastslow.formulas.grammar import Call, Name, Node, names_of
from fastslow.formulas.symbolic import Builder, built
from fastslow.model.structure import TIME, real
from fastslow.readers.lines import Line
from fastslow.readers.ode_statements import Named, Statements
from fastslow.readers.ode_tables import LookupTable, read_table

#: Greatest number of operations of a rate with all quantities written out, terms of a sum, and
#: pieces of a table in a state.
LARGEST_RATE, MOST_TERMS, MOST_PIECES = 500_000, 10_000, 16

#: Quantities of XPPAUT's animations, which are 0 in a run without one.
MOUSE = ("mouse_x", "mouse_y", "mouse_vx", "mouse_vy")


class Quantities:
    """Expressions of all names of a file, built when they are first used.

    Parameters
    ----------
    statements : Statements
    names : mapping
        Name in the model of each state and parameter, by lower case.
    start : float
        Start of time.
    """

    def __init__(self, statements: Statements, names: Mapping[str, str], start: float) -> None:
        self.statements, self.start = statements, start
        self.symbols = {key: real(name) for key, name in names.items()}
        self.values = {self.symbols[key]: value for key, (_, value) in statements.values.items()}
        self.forcing: dict[str, LookupTable] = {}
        self.notes: list[str] = []
        self._found: dict[str, sp.Expr] = {}
        self._bodies: dict[str, tuple[tuple[sp.Symbol, ...], sp.Expr]] = {}
        self._tables: dict[str, LookupTable] = {}
        self._open: list[str] = []
        self._index: list[int] = []
        self._sizes: dict[sp.Basic, int] = {}
        groups = (statements.fixed, statements.derived, statements.states, statements.values)
        self._odd = {key for group in groups for key in group if key[0].isdigit()}

    def of(self, one: Named, what: str, local: Mapping[str, sp.Expr] | None = None) -> sp.Expr:
        """Return the expression of a formula.

        Parameters
        ----------
        one : Named
        what : str
            What it is, for errors.
        local : mapping, optional
            Expressions of the arguments of a function.

        Raises
        ------
        ModelError
            With the line and the column.
        """
        line = one.line
        try:
            formula = xppaut.parse(line.text, self._odd)
        except xppaut.FormulaError as error:
            if re.search(r"\bint\s*[\[{]", line.text, re.I):
                reason = f"{what} contains an integral (Volterra); only ODEs can be read"
                raise line.refused(reason, error.at) from None
            raise line.refused(f"{what}: {error}", error.at) from None
        for surprise in formula.surprises:
            self.note(f"{line.place()}: {surprise}")
        try:
            builder = _Resolved(self, line, what, local or {}).builder
            known = {*names_of(formula.tree)} - {"pi"}
            found = sp.sympify(built(formula.tree, line.text, known, builder))
        except ArgumentError as error:
            raise line.refused(f"{what}: {error}") from error
        if self.size(found) > LARGEST_RATE:
            raise line.refused(
                f"{what} has more than {LARGEST_RATE} operations, with all quantities written out"
            )
        return found

    def note(self, text: str) -> None:
        """Add a note, once."""
        if text not in self.notes:
            self.notes.append(text)

    def size(self, expression: sp.Basic) -> int:
        """Return the number of operations of an expression, each counted where it is written."""
        known = self._sizes.get(expression)
        if known is None:
            known = 1 + sum(map(self.size, expression.args))
            self._sizes[expression] = known
        return known

    def quantity(self, key: str) -> sp.Expr:
        """Return the expression of a fixed quantity or a derived parameter."""
        if key in self._found:
            return self._found[key]
        one = self.statements.fixed.get(key) or self.statements.derived[key]
        with self._opened(key, one):
            self._found[key] = self.of(one, one.name)
        return self._found[key]

    def body(self, key: str) -> tuple[tuple[sp.Symbol, ...], sp.Expr]:
        """Return the arguments of a function, as symbols, and its expression in them."""
        if key not in self._bodies:
            one = self.statements.functions[key]
            arguments = {name: real(f"{name} of {key}") for name in one.arguments}
            # older files write arg1, arg2, …
            numbered = {f"arg{k}": arguments[n] for k, n in enumerate(one.arguments, start=1)}
            with self._opened(key, one):
                found = self.of(one, f"{one.name}(…)", {**numbered, **arguments})
            self._bodies[key] = tuple(arguments.values()), found
        return self._bodies[key]

    @contextmanager
    def _opened(self, key: str, one: Named) -> Iterator[None]:
        """Mark a name as being built; refuse one that is needed for itself."""
        if key in self._open:
            circle = " → ".join([*self._open[self._open.index(key) :], key])
            raise one.line.refused(f"{one.name} is defined by itself: {circle}")
        self._open.append(key)
        try:
            yield
        finally:
            self._open.pop()

    def table(self, key: str) -> LookupTable:
        """Return the values of a table."""
        if key not in self._tables:
            one = self.statements.tables[key]

            def values(formula: Named, times: Sequence[float]) -> np.ndarray:
                with self._opened(key, one):
                    expression = self.of(formula, f"table {one.name}")
                found = [self.number(expression.xreplace({TIME: sp.Float(t)})) for t in times]
                if expression.free_symbols & self.values.keys():
                    self.note(
                        f"{one.line.place()}: table {one.name} is that of the parameter values of "
                        "the file"
                    )
                return np.array([np.nan if v is None else v for v in found])

            self._tables[key] = read_table(self.statements, one, values)
        return self._tables[key]

    def number(self, expression: sp.Expr) -> float | None:
        """Return the value of an expression in parameters, None if it contains anything else."""
        if expression.free_symbols - self.values.keys():
            return None
        value = complex(expression.xreplace({s: sp.Float(v) for s, v in self.values.items()}))
        return value.real if value.imag == 0 else math.nan


class _Resolved:
    """Names and calls of one formula."""

    def __init__(
        self,
        quantities: Quantities,
        line: Line,
        what: str,
        local: Mapping[str, sp.Expr],
    ) -> None:
        self.all, self.line, self.what, self.local = quantities, line, what, local
        self.statements = quantities.statements
        self.builder = Builder(self.named, False, self.called)

    def refused(self, name: str, reason: str) -> ModelError:
        found = re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.])", self.line.text, re.I)
        return self.line.refused(f"{self.what}: {reason}", found.start() if found else 0)

    def named(self, name: str) -> sp.Expr:
        """Return the expression of a name."""
        if name in self.local:
            return self.local[name]
        if name == "i'" and self.all._index:
            return sp.Integer(self.all._index[-1])
        if name in self.all.symbols:
            return self.all.symbols[name]
        if name == "t":
            return TIME
        if name == "pi":
            return sp.pi
        if name in self.statements.fixed or name in self.statements.derived:
            return self.all.quantity(name)
        if name in self.statements.wiener or name in MOUSE:
            return sp.S.Zero
        if name in ("arg1", "arg2") or name == "i'":
            raise self.refused(name, f"{name} has a meaning only inside a function or a sum")
        s = self.statements
        known = [*s.states, *s.values, *s.fixed, *s.derived, *s.functions, *self.local]
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
        hint = f"; did you mean {near[0]}?" if near else ""
        if name in s.auxiliary:
            hint = "; an auxiliary quantity (aux) cannot be used in formulas"
        if name in s.functions:
            hint = "; it is a function"
        raise self.refused(name, f"{quoted(name)} has no definition{hint}")

    def built(self, node: Node) -> sp.Expr:
        """Return the expression of an argument."""
        return sp.sympify(self.builder.of(node))

    def called(self, call: Call) -> sp.Expr | None:
        """Return the expression of a call of the file, None for an elementary function."""
        name = call.function
        if name in _SPECIAL:
            return _SPECIAL[name](self, call)
        if name in self.statements.functions:
            arguments, body = self.all.body(name)
            if len(arguments) != len(call.arguments):
                raise self.refused(
                    name, f"{name} takes {len(arguments)} arguments, received {len(call.arguments)}"
                )
            given = map(self.built, call.arguments)
            return body.xreplace(dict(zip(arguments, given, strict=True)))
        if name in self.statements.tables:
            return self.looked_up(name, call)
        if name in self.statements.networks:
            return sp.S.Zero
        if name in xppaut.RENAMED or name in _MEANT:
            return None
        known = [*self.statements.functions, *self.statements.tables, *xppaut.RENAMED]
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
        hint = f"; did you mean {near[0]}?" if near else "; a product is written *"
        raise self.refused(name, f"{name} is no function{hint}")

    def looked_up(self, name: str, call: Call) -> sp.Expr:
        """Return a table at an argument: of time as a table, of a state in pieces."""
        if len(call.arguments) != 1:
            raise self.refused(name, f"table {name} takes 1 argument, received several")
        table, argument = self.all.table(name), self.built(call.arguments[0])
        value = self.all.number(argument)
        if value is not None:
            if argument.free_symbols:
                self.all.note(
                    f"{self.line.place()}: {name} is looked up at the parameter values of the file"
                )
            return sp.Float(table.at(value))
        if argument == TIME:
            law = real(f"{name}_of_t")
            self.all.forcing[law.name] = table
            return law
        if len(table.knots) > MOST_PIECES:
            raise self.refused(
                name,
                f"table {name} of {len(table.knots)} values is looked up at {argument}, and each "
                f"value would be an interface; expected the argument t, or at most {MOST_PIECES}",
            )
        return table.pieces(argument)

    def sum(self, call: Call) -> sp.Expr:
        low, high, term = call.arguments
        ends = [self.all.number(self.built(end)) for end in (low, high)]
        if ends[0] is None or ends[1] is None:
            raise self.refused("sum", "the limits of a sum depend on states; expected numbers")
        first, last = (int(end) for end in ends if end is not None)
        if last - first >= MOST_TERMS:
            raise self.refused("sum", f"a sum of {last - first + 1} terms; expected {MOST_TERMS}")
        terms = []
        for index in range(first, last + 1):
            self.all._index.append(index)
            terms.append(self.built(term))
            self.all._index.pop()
        return sp.Add(*terms)

    def shift(self, call: Call) -> sp.Expr:
        """Return the quantity so many places after a name, as states and quantities are listed."""
        first, by = call.arguments
        if not isinstance(first, Name):
            raise self.refused("shift", "shift begins with a name, such as shift(x0, 3)")
        places = self.all.number(self.built(by))
        if places is None:
            raise self.refused("shift", "the second argument of shift depends on states")
        s = self.statements
        constants = [*s.values, *s.wiener]
        for names in ([*s.states, *s.fixed], constants):
            if first.name in names:
                at = names.index(first.name) + int(places)
                if 0 <= at < len(names):
                    return self.named(names[at])
                raise self.refused("shift", f"nothing is {int(places)} places after {first.name}")
        raise self.refused("shift", f"{first.name} is neither a state, a quantity nor a parameter")

    def delay(self, call: Call) -> sp.Expr:
        self.refuse("delays", "a delay", call.function)
        return self.built(call.arguments[0])

    def delayed_shift(self, call: Call) -> sp.Expr:
        self.refuse("delays", "a delay", call.function)
        return self.shift(Call("shift", call.arguments[:2]))

    def mean(self, call: Call) -> sp.Expr:
        """Return the mean of a random number."""
        self.refuse("noise", "a random number", call.function)
        first = self.built(call.arguments[0])
        return first / 2 if call.function == "ran" else first

    def exponential(self, call: Call) -> sp.Expr:
        """Return an exponential of exact decimals: SymPy would split exp(x + 0.5), and overflow."""
        builder = Builder(self.named, True, self.called)
        return sp.exp(builder.of(call.arguments[0]))

    def boundary(self, call: Call) -> sp.Expr:
        raise self.refused("hom_bcs", "hom_bcs is a boundary condition")

    def refuse(self, kind: str, what: str, word: str) -> None:
        found = re.search(word, self.line.text, re.I)
        before = len(self.statements.notes)
        self.statements.refuse(self.line, kind, what, found.start() if found else 0)
        for note in self.statements.notes[before:]:
            self.all.note(note)
        del self.statements.notes[before:]


_SPECIAL: Mapping[str, Callable[[_Resolved, Call], sp.Expr]] = {
    "sum": _Resolved.sum,
    "shift": _Resolved.shift,
    "delay": _Resolved.delay,
    "del_shft": _Resolved.delayed_shift,
    "ran": _Resolved.mean,
    "normal": _Resolved.mean,
    "poisson": _Resolved.mean,
    "exp": _Resolved.exponential,
    "hom_bcs": _Resolved.boundary,
}

#: Names of functions in trees.
_MEANT = frozenset(["Piecewise", *(name for name, _ in xppaut.RENAMED.values())])
