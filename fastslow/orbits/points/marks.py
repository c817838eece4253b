"""Expressions in the numbers of a periodic orbit, whose zeros along a curve are special points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastslow.arguments import finite, items
from fastslow.continuation.marks import check_name, value_mark
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluated, read, written_formula
from fastslow.formulas.functions import CONSTANTS
from fastslow.formulas.grammar import names_of, normalised, parse
from fastslow.results.orbits.functionals import EXTREMES, PARTS, split
from fastslow.results.orbits.orbit import Orbit

#: Error of a number of an orbit, as a fraction of its size: orbits are solved to rounding, and
#: their extremes follow from the polynomials of a free run.
MARK_ROUNDING = 1e-12


@dataclass(frozen=True)
class OrbitMark:
    """An expression with a name, by which its zeros are labelled.

    Parameters
    ----------
    name, expression : str
    """

    name: str
    expression: str

    def value(self, orbit: Orbit) -> float:
        """The expression at an orbit."""
        return self._evaluated(self._numbers(orbit))

    def rounding(self, orbit: Orbit) -> float:
        """Error of the expression at an orbit, by the errors of its numbers."""
        numbers = self._numbers(orbit)
        sizes = {name: abs(value) for name, value in numbers.items()}
        for name, (which, argument) in self._functionals.items():
            if which not in PARTS:
                # an extreme near zero is known to the digits of the largest value
                sizes[name] = max(abs(orbit[f"{one}({argument})"]) for one in EXTREMES)
        here, total = self._evaluated(numbers), 0.0
        for name, size in sizes.items():
            step = MARK_ROUNDING * max(size, MARK_ROUNDING)
            moved = ({**numbers, name: numbers[name] + move} for move in (step, -step))
            # beside a discontinuity the change on one side is none of rounding
            total += min(abs(self._evaluated(each) - here) for each in moved)
        return total

    @property
    def _functionals(self) -> dict[str, tuple[str, str]]:
        return split(self.expression)[1]

    def _numbers(self, orbit: Orbit) -> dict[str, float]:
        """Parameters, period and functionals of an orbit by name."""
        named = self._functionals.items()
        values = {name: orbit[f"{which}({argument})"] for name, (which, argument) in named}
        return {**orbit.parameters, "period": orbit.period, **values}

    def _evaluated(self, numbers: Mapping[str, float]) -> float:
        return float(evaluated(split(self.expression)[0], numbers))


def read_orbit_marks(
    given: Any, orbit: Orbit, parameter: str, over: tuple[float, float]
) -> tuple[tuple[float, ...], tuple[OrbitMark, ...]]:
    """Return the marks of a branch of an orbit: values of its parameter, and expressions.

    Parameters
    ----------
    given : sequence or mapping
        Values; or a mapping of the parameter to its values, and of names to expressions.
    orbit : Orbit
    parameter : str
        The parameter of the branch.
    over : (float, float)
        Its range.

    Raises
    ------
    ArgumentError
        For a value outside the range, for a name that cannot label points, and for text that is
        not an expression.
    UnknownNameError
        For a name in an expression that is neither a parameter nor a number of an orbit.
    """
    if not isinstance(given, Mapping):
        given = {parameter: given}
    count = len(orbit.multipliers)
    known = [*orbit.parameters, "period"]
    known += [f"{which}({name})" for name in orbit.columns for which in EXTREMES]
    known += [f"{part}(multiplier_{k + 1})" for k in range(count) for part in PARTS]
    values: list[float] = []
    found = []
    for key, entry in given.items():
        name = str(key)
        if not (isinstance(entry, str) or hasattr(entry, "free_symbols")):
            if name != parameter:
                raise unknown_name("parameter in marks", name, [parameter])
            several = items(finite)(f"marks['{name}']", entry)
            values += [value_mark(name, value, {parameter: over}).value for value in several]
            continue
        check_name(name, [*known, *orbit.columns])
        text = written_formula(entry)
        _check(text, orbit, known)
        found.append(OrbitMark(name, text))
    return tuple(values), tuple(found)


def _check(text: str, orbit: Orbit, known: list[str]) -> None:
    """Check that all names of an expression are numbers of an orbit."""
    written, functionals = split(text)
    numbers = [*orbit.parameters, "period", *functionals]
    valid = {normalised(name) for name in numbers}
    names = names_of(parse(written, numbers))
    for name in names:
        if name not in valid and name not in CONSTANTS:
            raise unknown_name("number of an orbit in an expression", name, known)
    if not valid & {*names}:
        raise ArgumentError(
            f"marks: {text} is constant; expected an expression in numbers of an orbit such as "
            f"{known[len(orbit.parameters) + 1]} and in parameters"
        )
    read(written, numbers)
    for which, argument in functionals.values():
        orbit[f"{which}({argument})"]
