"""A model as it is kept in a file: operations and numbers, without its equations in SymPy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import mapping, real_number, shown, validated
from fastslow.errors import ModelError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.results.base.equality import content_hash
from fastslow.results.base.immutable import Immutable
from fastslow.results.base.result import Result
from fastslow.results.stored.arithmetic import UnknownOperationError, check_number, value_of
from fastslow.results.stored.fields import StoredField
from fastslow.results.stored.harmonics import period_of
from fastslow.results.stored.operations import Operations
from fastslow.results.stored.sign_patterns import Pattern, possible_patterns, scaled_row
from fastslow.results.stored.typed import has_types

#: What a stored model cannot do, and what to do then.
INSTEAD = "it was stored as numbers, without its equations; build the Model from its equations"


@dataclass(frozen=True)
class Traits:
    """What the steps of a run do not say of a model, and its outcome needs.

    Parameters
    ----------
    vanishing : tuple of str
        States that stay zero once they are.
    together : tuple of tuple of str
        Sets of states that stay zero together.
    names : tuple of str
        The parameters ``p0``, ``p1``, … of ``growth``.
    growth : tuple of tuple of str
        Growth rate at zero of each vanishing state in each region, of time, states and
        parameters; empty where it is not known.
    parallel : bool
        Whether there are two interfaces that differ by a constant.
    rising : tuple of int
        For each interface whether its function rises (1) or falls (−1) with the first state in it.
    """

    vanishing: tuple[str, ...]
    together: tuple[tuple[str, ...], ...]
    names: tuple[str, ...]
    growth: tuple[tuple[str, ...], ...]
    parallel: bool
    rising: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Validity(Immutable):
    """At which parameter values the operations of a stored model hold, and what changes there.

    Parameters
    ----------
    names : tuple of str
        The parameters ``p0``, ``p1``, … of all texts.
    values : mapping
        Values of those that decide on regions, slopes and the period, at which all this was
        derived.
    steady : tuple of str
        Parameters that must keep these values.
    loose : tuple of str
        By which the interface functions are written in ``rows``: a name where it is a
        parameter without value, else empty.
    rows : tuple of tuple of str
        Slopes and constant of each interface function, none where it is not affine.
    patterns : tuple of tuple of int
        The sign patterns of the regions.
    scales : tuple of str
        Factors of switching functions that hold parameters alone.
    signs : tuple of int or None
        Their signs.
    slopes : tuple of str
        By the first state in it, the slope of each interface; empty where it is no number.
    period : float or None
    frequencies : tuple of str or None
        Of all harmonics; None where time stands outside of periodic functions.
    """

    names: tuple[str, ...]
    values: Mapping[str, float]
    steady: tuple[str, ...]
    loose: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    patterns: tuple[Pattern, ...]
    scales: tuple[str, ...]
    signs: tuple[int | None, ...]
    slopes: tuple[str, ...]
    period: float | None
    frequencies: tuple[str, ...] | None

    def changed(self, values: Mapping[str, float]) -> list[str]:
        """The deciding parameters with other values."""
        deciding = dict.fromkeys([*self.values, *self.steady, *filter(None, self.loose)])
        return [n for n in deciding if values.get(n) != self.values.get(n)]

    def numbers(self, values: Mapping[str, float]) -> dict[str, float]:
        """Parameter values under the names of the texts."""
        return {f"p{k}": values[n] for k, n in enumerate(self.names) if n in values}

    def patterns_at(self, values: Mapping[str, float]) -> tuple[Pattern, ...]:
        """The sign patterns that are not empty at parameter values."""
        numbers, known = self.numbers(values), np.array([n in values for n in self.loose])
        given = np.array([values.get(n, 0.0) for n in self.loose])
        rows: list[NDArray[np.float64] | None] = []
        for texts in self.rows:
            row = np.array([value_of(text, numbers) for text in texts])
            if not len(row):
                rows.append(None)
                continue
            rest = row[-1] + float(row[:-1][known] @ given[known])
            rows.append(scaled_row([*row[:-1][~known], rest]))
        return tuple(possible_patterns(rows))

    def signs_at(self, values: Mapping[str, float]) -> tuple[int | None, ...]:
        """Signs of the factors of parameters alone, None where one has no value."""
        numbers = self.numbers(values)
        return tuple(_sign(text, numbers) for text in self.scales)

    def rising_at(self, values: Mapping[str, float]) -> tuple[int, ...]:
        """Whether each interface function rises or falls."""
        numbers = self.numbers(values)
        return tuple(-1 if text and _sign(text, numbers) == -1 else 1 for text in self.slopes)

    def period_at(self, values: Mapping[str, float]) -> float | None:
        """The common period of all harmonics."""
        if self.frequencies is None:
            return None
        numbers = self.numbers(values)
        return period_of([float(value_of(text, numbers)) for text in self.frequencies])


def _sign(text: str, numbers: Mapping[str, float]) -> int | None:
    try:
        number = float(value_of(text, numbers))
    except UnknownOperationError:
        return None
    return int(np.sign(number)) if math.isfinite(number) else None


@dataclass(frozen=True, eq=False, repr=False)
class StoredModel(Result):
    """A model from a file, which runs without SymPy.

    `fastslow.simulate` takes it in place of the `Model` that it was, and so does
    `fastslow.continue_equilibria` from points of a diagram's branches, with the same
    results bit for bit. It has that model's equations as text alone: what needs them in
    SymPy says so. ``Model.stored`` makes one; runs are saved with the one of their model.

    Parameters
    ----------
    states, slow_states, forcing, interfaces : tuple of str
        Names, in the model's order.
    free : tuple of str
        Slow quantities of a frozen model.
    parameters : mapping
        Parameter values.
    periodic : mapping
        State to its period.
    equations : str
        As they were written.
    operations : Operations
    traits : Traits
    validity : Validity
    field : StoredField, optional
        Of a frozen model that is kept with a diagram: its rates over the parameter.

    Examples
    --------
    >>> import fastslow as fs
    >>> model = fs.Model({"x": "-k*x"}, parameters={"k": 1})
    >>> stored = model.stored
    >>> stored
    StoredModel of x
      x' = -k*x
      k = 1
    >>> run = fs.simulate(stored.with_parameters(k=2), [1], t=(0, 1))
    >>> bool(run == fs.simulate(model.with_parameters(k=2), [1], t=(0, 1)))
    True
    """

    states: tuple[str, ...]
    slow_states: tuple[str, ...]
    forcing: tuple[str, ...]
    interfaces: tuple[str, ...]
    free: tuple[str, ...]
    parameters: Mapping[str, float]
    periodic: Mapping[str, float]
    equations: str
    operations: Operations
    traits: Traits
    validity: Validity
    field: StoredField | None = None

    #: Why it is not what is asked for where a `Model` is.
    not_enough = INSTEAD

    @cached_property
    def _hash(self) -> int:
        return content_hash((self.states, self.equations, self.parameters))

    def __hash__(self) -> int:
        return self._hash

    @property
    def stored(self) -> StoredModel:
        """The model itself."""
        return self

    @property
    def regions(self) -> Mapping[str, Pattern]:
        """The side of every interface, +1 or −1, in each region by its name."""
        return self.operations.regions

    def period(self) -> float | None:
        """Smallest common period of everything that depends on time, None if there is none."""
        return self._period

    @cached_property
    def _period(self) -> float | None:
        now = self.validity
        return now.period_at(self.parameters) if now.changed(self.parameters) else now.period

    @validated(changes=mapping)
    def with_parameters(
        self, changes: Mapping[Any, Any] | None = None, /, **named: float
    ) -> StoredModel:
        """The same model at other parameter values.

        Parameters
        ----------
        changes : mapping, optional
            Parameter to value.
        **named : float
            The same by name.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter of the model.
        ModelError
            For a value that is not a finite number, or one at which the model has other
            regions than those that were stored.
        """
        values = dict(self.parameters)
        valid = [*values, *(n for n in self.free if n not in values)]
        for key, value in {**(changes or {}), **named}.items():
            name = normalised(str(key))
            if name not in valid:
                raise unknown_name("parameter", key, valid)
            values[name] = finite_number(f"parameter {key}", value)
        traits, changed = self.traits, self.validity.changed(values)
        if changed:
            self._check_regions(changed, values)
            traits = replace(traits, rising=self.validity.rising_at(values))
        return replace(self, parameters=values, traits=traits)

    def with_free(self, name: object) -> StoredModel:
        """The model without the value of a slow quantity that was frozen.

        Raises
        ------
        ModelError
            For any other parameter.
        """
        key = normalised(str(name))
        if key not in self.free:
            raise ModelError(
                f"whether the regions stay the same over {key} is not known: {INSTEAD}"
            )
        return replace(self, parameters={n: v for n, v in self.parameters.items() if n != key})

    def _check_regions(self, changed: Sequence[str], values: Mapping[str, float]) -> None:
        """Raise where the model has other regions, or that cannot be told."""
        now, blocked = self.validity, [n for n in changed if n in self.validity.steady]
        what = ", ".join(f"{n} = {values[n]:g}" for n in blocked or changed if n in values)
        if blocked:
            raise ModelError(f"whether the regions are the same at {what} is not known: {INSTEAD}")
        if now.patterns_at(values) != now.patterns or now.signs_at(values) != now.signs:
            raise ModelError(f"at {what} the model has other regions than stored: {INSTEAD}")

    def check(self) -> None:
        """Refuse what no model is stored as; called for every one that is read from a file.

        Raises
        ------
        UnknownOperationError
        """
        if not has_types(self):
            raise UnknownOperationError("expected a model as it is stored")
        numbers = [*self.parameters.values(), *self.periodic.values()]
        sizes = (len(self.states) + len(self.slow_states), len(self.forcing), len(self.interfaces))
        known = {*self.parameters, *self.free}
        if not (
            all(map(math.isfinite, numbers))
            and sizes == self.operations.sizes
            and known.issuperset(self.operations.parameters)
            and known.issuperset((*self.traits.names, *self.validity.names))
        ):
            raise UnknownOperationError("expected the names and sizes of one model")
        self.operations.check()
        if self.field is not None:
            if not known.issuperset((self.field.parameter, *self.field.names)):
                raise UnknownOperationError("expected names of parameters")
            self.field.check(self.states, self.interfaces)
        self._check_traits(sizes)
        self._check_validity(sizes)

    def _check_traits(self, sizes: tuple[int, int, int]) -> None:
        traits = self.traits
        moving = {"t", *(f"y{k}" for k in range(sizes[0])), *(f"w{k}" for k in range(sizes[1]))}
        names = {f"p{k}" for k in range(len(traits.names))} | moving
        for row in traits.growth:
            for text in row:
                if text:
                    check_number(text, names)
        states = {*self.states, *self.slow_states}
        if not (
            states.issuperset((*traits.vanishing, *(n for some in traits.together for n in some)))
            and len(traits.growth) == len(traits.vanishing)
            and all(len(row) == len(self.regions) for row in traits.growth)
            and len(traits.rising) == sizes[2]
            and set(traits.rising) <= {-1, 1}
        ):
            raise UnknownOperationError("expected the traits of one model")

    def _check_validity(self, sizes: tuple[int, int, int]) -> None:
        one = self.validity
        names = {f"p{k}" for k in range(len(one.names))}
        texts = [*(text for row in one.rows for text in row), *one.scales]
        for text in (*texts, *filter(None, one.slopes), *(one.frequencies or ())):
            check_number(text, names)
        if not (
            all(len(row) in (0, 1 + len(one.loose)) for row in one.rows)
            and all(len(pattern) == len(one.rows) for pattern in one.patterns)
            and len(one.signs) == len(one.scales)
            and len(one.slopes) == sizes[2]
        ):
            raise UnknownOperationError("expected the validity of one model")

    def __getattr__(self, name: str) -> NoReturn:
        if not name.startswith("_") and name in _OF_MODELS:
            raise AttributeError(f"a stored model has no {name}: {INSTEAD}")
        raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'")

    def __repr__(self) -> str:
        named = ", ".join((*self.states, *self.slow_states))
        frozen = f" with {', '.join(self.free)} frozen" if self.free else ""
        lines = [f"StoredModel of {named}{frozen}"]
        lines += [f"  {line}" for line in self.equations.splitlines()]
        if self.parameters:
            lines.append("  " + ", ".join(f"{k} = {v:g}" for k, v in self.parameters.items()))
        return "\n".join(lines)


#: What a `Model` can do by its equations alone.
_OF_MODELS = frozenset(
    ("continuous", "frozen", "path", "with_ramp", "rates", "to_latex", "empty_regions")
)


def finite_number(what: str, value: object) -> float:
    """A finite float, or an error that shows what was received.

    Examples
    --------
    >>> finite_number("parameter A", "1/0")
    Traceback (most recent call last):
    ...
    fastslow.errors.ModelError: parameter A: expected a finite number, received '1/0'
    """
    result = real_number(value)
    if result is None or not math.isfinite(result):
        raise ModelError(f"{what}: expected a finite number, received {shown(value)}")
    # −0.0 is 0.0: equal models have equal values
    return result + 0.0
