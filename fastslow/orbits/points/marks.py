"""Expressions in the numbers of a periodic orbit, whose zeros along a curve are special points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastslow.continuation.marks import ValueMark, check_name, marks_of
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluated, names_in, read, written_formula
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

    @property
    def words(self) -> str:
        """The condition as text."""
        return f"{self.name} ({self.expression} = 0)"

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


@dataclass(frozen=True)
class OrbitNames:
    """The names that an expression in the numbers of an orbit may contain.

    Parameters
    ----------
    parameters, columns : tuple of str
    multipliers : int
        Their number.
    """

    parameters: tuple[str, ...]
    columns: tuple[str, ...]
    multipliers: int

    @classmethod
    def of(cls, orbit: Orbit) -> OrbitNames:
        """Return the names of an orbit."""
        return cls(tuple(orbit.parameters), orbit.columns, len(orbit.multipliers))

    @property
    def numbers(self) -> list[str]:
        """The numbers of an orbit, as examples of what an expression may contain."""
        numbers = [*self.parameters, "period"]
        numbers += [f"{which}({name})" for name in self.columns for which in EXTREMES]
        return numbers + [f"{part}({name})" for name in self._multipliers for part in PARTS]

    @property
    def _multipliers(self) -> list[str]:
        return [f"multiplier_{k + 1}" for k in range(self.multipliers)]

    def read(self, name: str, given: Any) -> OrbitMark:
        """Return the mark of an expression.

        Raises
        ------
        ArgumentError
        UnknownNameError
        """
        check_name(name, [*self.numbers, *self.columns])
        text = written_formula(given)
        written, functionals = split(text)
        numbers = [*self.parameters, "period", *functionals]
        valid = {normalised(name) for name in numbers}
        names = names_of(parse(written, numbers))
        for one in names:
            if one not in valid and one not in CONSTANTS:
                raise unknown_name("number of an orbit in an expression", one, self.numbers)
        if not valid & {*names}:
            raise ArgumentError(
                f"marks: {text} is constant; expected an expression in numbers of an orbit such as "
                f"{self.numbers[len(self.parameters) + 1]} and in parameters"
            )
        read(written, numbers)
        for which, argument in functionals.values():
            if which not in PARTS:
                names_in(argument, dict.fromkeys([*self.columns, "t", *self.parameters]))
            elif argument not in self._multipliers:
                raise unknown_name("multiplier", argument, self._multipliers)
        return OrbitMark(name, text)


def read_orbit_marks(
    given: Any, names: OrbitNames, ranges: Mapping[str, tuple[float, float]]
) -> tuple[ValueMark | OrbitMark, ...]:
    """Return the marks of a branch or curve of orbits: values of parameters, and expressions.

    Parameters
    ----------
    given : sequence, mapping or None
        Values of the one parameter; or a mapping of a parameter to its values, and of names to
        expressions.
    names : OrbitNames
    ranges : mapping
        The free parameters with their ranges.

    Raises
    ------
    ArgumentError
        For a value outside the range, for a name that cannot label points, and for text that is
        not an expression.
    UnknownNameError
        For a name in an expression that is neither a parameter nor a number of an orbit.
    """
    return marks_of(given, ranges, names.read)
