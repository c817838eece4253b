"""Models in .ode files of XPPAUT."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import sympy as sp

from fastslow.arguments import items, text, validated, word
from fastslow.errors import ModelError
from fastslow.formulas.grammar import RESERVED
from fastslow.model.model import Model
from fastslow.model.structure import TIME
from fastslow.readers.lines import text_of_file
from fastslow.readers.model_files import ModelFile, ParameterSet
from fastslow.readers.ode_events import ReadEvents, read_events
from fastslow.readers.ode_expressions import Quantities
from fastslow.readers.ode_statements import WITHOUT, Named, Statements
from fastslow.results.base.named_mapping import NamedMapping

#: Values of options that a file does not give, as in the manual.
TOTAL, START = 20.0, 0.0

#: Methods of XPPAUT that make a map of the equations.
OF_MAPS = ("di", "0")

kinds_left_out = items(word("kind to leave out", WITHOUT))


@validated(text=text, without=kinds_left_out)
def read_ode(text: str, *, without: Sequence[str] = ()) -> ModelFile:
    """Read a model from the text of an .ode file of XPPAUT.

    Everything in the manual of XPPAUT that describes ODEs is read: states, quantities, derived
    parameters, functions, arrays, tables, events, named sets and options. Formulas have the
    meaning that they have in XPPAUT, in which comparisons bind as tightly as powers. Nothing in
    the text is executed.

    Parameters
    ----------
    text : str
    without : sequence of str
        What to leave out: ``"delays"``, ``"noise"``, ``"special"``, ``"export"`` or ``"global"``
        (events). Without it, what no `Model` can have is refused.

    Returns
    -------
    ModelFile
        With the model, its initial state, span of time, sets of values, plots and notes.

    Raises
    ------
    ModelError
        For text that XPPAUT does not accept, and for delays, integrals, noise, Markov processes,
        maps, algebraic equations and sums over networks; with line and column.
    UnknownNameError
        For an unknown name in ``without``.

    See Also
    --------
    fastslow.read, fastslow.read_sbml

    Examples
    --------
    >>> file = read_ode('''
    ... # FitzHugh-Nagumo
    ... v' = v*(1-v)*(v-a) - w + I
    ... w' = eps*(v - g*w)
    ... par a=.1, I=0.2, eps=.005, g=1
    ... init v=0.3
    ... @ total=500, xp=v, yp=w
    ... done''')
    >>> file.model.states, file.initial["v"], file.t, file.plots
    (('v', 'w'), 0.3, (0.0, 500.0), (('v', 'w'),))
    >>> read_ode("x'=-a*x")
    Traceback (most recent call last):
    ...
    fastslow.errors.ModelError: line 1, column 5: rate of x: 'a' has no definition
    """
    return _read(text, None, "", frozenset(without))


def read_ode_file(path: Path, without: Sequence[str]) -> ModelFile:
    """Read an .ode file, with tables and included files from its folder."""
    written, notes = text_of_file(path)
    return _read(written, path.parent, path.name, frozenset(without), notes)


def _read(
    written: str,
    folder: Path | None,
    file: str,
    without: frozenset[str],
    notes: Sequence[str] = (),
) -> ModelFile:
    statements = Statements(folder, without)
    statements.notes += notes
    statements.read(written, file)
    where = f"{file}: " if file else ""
    if statements.options.get("meth", statements.options.get("method", ""))[:2].lower() in OF_MAPS:
        raise ModelError(f"{where}a map (method discrete); only ODEs can be read")
    if not statements.states:
        raise ModelError(f"{where}no rate such as x'=… was found; expected an .ode file of XPPAUT")
    try:
        return _Assembly(statements, where).file()
    except RecursionError:
        raise ModelError(f"{where}quantities are defined by others too many levels deep") from None


class _Assembly:
    """The model of the statements of a file."""

    def __init__(self, statements: Statements, where: str) -> None:
        self.statements, self.where = statements, where
        self.renamed: dict[str, str] = {}
        self.start = self.option("t0", START)
        self.end = self.start + self.option("total", TOTAL)
        names = {
            key: self.name(one.name, self.renamed)
            for key, one in (
                *statements.states.items(),
                *((k, named) for k, (named, _) in statements.values.items()),
            )
        }
        self.names = names
        self.laws = {
            key: self.name(one.name, self.renamed)
            for key, one in statements.fixed.items()
            if self.given("name").get(one.name, one.name) in self.given("forcing")
        }
        self.quantities = Quantities(statements, {**names, **self.laws}, self.start)

    def given(self, what: str) -> dict[str, str]:
        """Return what an exported file says of the structure of its model."""
        return self.statements.structure.get(what, {})

    def name(self, written: str, renamed: dict[str, str]) -> str:
        """Return a name that is an identifier and no word of a formula."""
        own = self.given("name").get(written)
        if own is not None:
            return own
        name = written.replace(".", "_")
        name = f"_{name}" if name[0].isdigit() else name
        while name in RESERVED or name in renamed.values():
            name += "_"
        if name != written:
            renamed[written] = name
        return name

    def option(self, name: str, default: float) -> float:
        """Return the number of an option."""
        written = self.statements.options.get(name)
        if written is None:
            return default
        try:
            value = float(written)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ModelError(f"{self.where}the option {name}={written} is no number")
        return value

    def file(self) -> ModelFile:
        """Return the record of the file."""
        s, q = self.statements, self.quantities
        for key in s.fixed:
            self.check_order(key)
            q.quantity(key)
        rates = {key: q.of(one, f"rate of {one.name}") for key, one in s.states.items()}
        events = read_events(s, q, rates, self.start)
        initial = self.initial(events)
        auxiliary = {
            self.name(one.name, self.renamed): q.of(one, f"aux {one.name}")
            for one in s.auxiliary.values()
        }
        fixed = {
            self.name(one.name, self.renamed): q.quantity(key)
            for key, one in s.fixed.items()
            if key not in self.laws
        }
        taken = {*self.names.values(), *self.laws.values(), *q.forcing}
        named = {n: e for n, e in (fixed | auxiliary).items() if n not in taken}
        model = self.model(rates, events, named)
        parsed = {name: self.set_of(*given) for name, given in s.sets.items()}
        return ModelFile(
            model=model,
            initial=NamedMapping("state", {n: initial[n] for n in model.states}),
            t=(self.start, self.end),
            sets=NamedMapping("set", parsed),
            plots=self.plots(),
            auxiliary=NamedMapping("quantity", auxiliary),
            stops=tuple(events.stops),
            options=NamedMapping("option", s.options),
            notes=(*s.notes, *q.notes),
            renamed=NamedMapping("name", self.renamed),
            comments=tuple(s.comments),
        )

    def check_order(self, key: str) -> None:
        """Note a quantity that is used before its line, where XPPAUT takes its last value."""
        later = {*list(self.statements.fixed)[list(self.statements.fixed).index(key) + 1 :]}
        one = self.statements.fixed[key]
        for name in sorted(later & _words(one.line.text)):
            other = self.statements.fixed[name]
            self.quantities.note(
                f"{one.line.place()}: {one.name} uses {other.name}, which is defined later, and is "
                "read as meant; XPPAUT takes the value of the step before"
            )

    def initial(self, events: ReadEvents) -> dict[str, float]:
        """Return the initial value of each state, and of what events change."""
        s, q = self.statements, self.quantities
        found: dict[str, float] = {}
        for key, line in s.initial_lines.items():
            if key not in s.states:
                raise line.refused(f"an initial value of {key}, which is no state")
        for key in s.states:
            given = s.initial.get(key, 0.0)
            if isinstance(given, Named):
                given = self.at_start(given, q.of(given, f"initial {given.name}"), found)
            found[self.names[key]] = given
        for key, value in events.initial.items():
            named = s.states.get(key) or s.values[key][0]
            found[self.names[key]] = self.at_start(named, value, found)
            if key in s.values:
                s.values[key] = named, found[self.names[key]]
        return found

    def at_start(self, one: Named, value: sp.Expr, known: Mapping[str, float]) -> float:
        """Return the value of a formula at the start of time."""
        q = self.quantities
        parameters = value.free_symbols & q.values.keys()
        at = {symbol: known[symbol.name] for symbol in value.free_symbols if symbol.name in known}
        number = q.number(value.xreplace({TIME: sp.Float(self.start), **at}))
        if number is None or not math.isfinite(number):
            raise one.line.refused(f"initial {one.name} has no finite value at the start")
        if parameters:
            q.note(
                f"{one.line.place()}: the initial value of {one.name} is that of the parameter "
                "values of the file"
            )
        return number

    def model(
        self,
        rates: Mapping[str, sp.Expr],
        events: ReadEvents,
        definitions: Mapping[str, sp.Expr],
    ) -> Model:
        s, q = self.statements, self.quantities
        parameters = {self.names[key]: value for key, (_, value) in s.values.items()}
        moving = {q.symbols[key]: rate for key, rate in rates.items()}
        slow = self.given("slow")
        try:
            return Model(
                {symbol: rate for symbol, rate in moving.items() if symbol.name not in slow},
                parameters=parameters,
                forcing=self.forcing(),
                slow={symbol: rate for symbol, rate in moving.items() if symbol.name in slow},
                interfaces=self.given("interface"),
                regions=self.given("region"),
                resets=events.resets,
                events=events.events,
                definitions=definitions,
            )
        except ModelError as error:
            for key, one in s.states.items():
                if str(error).startswith(f"rate of {self.names[key]}:"):
                    raise one.line.refused(str(error)) from error
            raise ModelError(f"{self.where}{error}") from error

    def forcing(self) -> dict[str, Any]:
        """Return the laws of tables, and of quantities that an exported file says are slow."""
        q = self.quantities
        tables = {name: t.in_time(self.start, self.end) for name, t in q.forcing.items()}
        return {name: q.quantity(key) for key, name in self.laws.items()} | tables

    def set_of(self, line: Any, given: Mapping[str, str]) -> ParameterSet:
        """Return the values of a named set."""
        s = self.statements
        sorted_out: tuple[dict[str, float], dict[str, float], dict[str, str]] = ({}, {}, {})
        for key, written in given.items():
            if key in s.values:
                sorted_out[0][self.names[key]] = s.number(line, key, written)
            elif key in s.states:
                sorted_out[1][self.names[key]] = s.number(line, key, written)
            else:
                sorted_out[2][key] = written
        return ParameterSet(
            NamedMapping("parameter", sorted_out[0]),
            NamedMapping("state", sorted_out[1]),
            NamedMapping("option", sorted_out[2]),
        )

    def plots(self) -> tuple[tuple[str, ...], ...]:
        """Return the quantities on the axes of each plot."""
        options = self.statements.options
        found = []
        for number in ("", *map(str, range(2, 9))):
            axes = [options.get(f"{axis}p{number}") for axis in "xyz"]
            if axes[1] is None and axes[0] is None:
                continue
            written = [axes[0] or "t", axes[1] or next(iter(self.statements.states))]
            written += [axes[2]] if axes[2] and options.get("axes", "2").startswith("3") else []
            found.append(tuple(self.shown(name) for name in written))
        for name in self.statements.only:
            if name.lower() not in ("t", ""):
                found.append(("t", self.shown(name)))
        return tuple(found)

    def shown(self, name: str) -> str:
        """Return the name of a quantity in the model."""
        key = name.lower()
        if key in self.names:
            return self.names[key]
        one = self.statements.auxiliary.get(key)
        written = one.name if one else name
        return self.renamed.get(written, key if key == "t" else written)


def _words(formula: str) -> set[str]:
    """Names in a formula, in lower case."""
    return {word.lower() for word in re.findall(r"[A-Za-z_][\w.]*", formula)}
