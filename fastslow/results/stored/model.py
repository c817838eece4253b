"""Models as stored in files: operations and numbers, without SymPy equations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import mapping, real_number, shown, validated
from fastslow.errors import ModelError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.results.base.display import Summarized
from fastslow.results.base.equality import content_hash
from fastslow.results.base.immutable import Immutable
from fastslow.results.base.result import Result
from fastslow.results.stored.arithmetic import UnknownOperationError, check_number, value_of
from fastslow.results.stored.fields import StoredField
from fastslow.results.stored.harmonics import period_of
from fastslow.results.stored.operations import Operations
from fastslow.results.stored.sign_patterns import Pattern, possible_patterns, scaled_row
from fastslow.results.stored.typed import has_types

#: Reason and remedy for operations that a stored model does not support.
INSTEAD = "it was stored as numbers, without its equations; build the Model from its equations"


@dataclass(frozen=True)
class Traits:
    """Properties of a model that the outcome of a run requires in addition to its steps.

    Parameters
    ----------
    vanishing : tuple of str
        States whose zero set is invariant.
    together : tuple of tuple of str
        Sets of states whose common zero set is invariant.
    names : tuple of str
        The parameters ``p0``, ``p1``, … of ``growth``.
    growth : tuple of tuple of str
        Growth rate at zero of each vanishing state in each region, of time, states and
        parameters; empty if unknown.
    parallel : bool
        True if two interface functions differ by a constant and bound a gap between bodies.
    rising : tuple of int
        For each interface function, 1 if it increases and −1 if it decreases with its
        first state.
    """

    vanishing: tuple[str, ...]
    together: tuple[tuple[str, ...], ...]
    names: tuple[str, ...]
    growth: tuple[tuple[str, ...], ...]
    parallel: bool
    rising: tuple[int, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Validity(Immutable):
    """Parameter values for which the operations of a stored model are valid.

    Parameters
    ----------
    names : tuple of str
        The parameters ``p0``, ``p1``, … of all texts.
    values : mapping
        Values of the parameters that determine regions, slopes and the period, at which
        these were derived.
    steady : tuple of str
        Parameters that must keep these values.
    loose : tuple of str
        For each variable of ``rows`` its name if it is a parameter without value, else
        empty.
    rows : tuple of tuple of str
        Slopes and constant of each interface function, empty if it is not affine.
    patterns : tuple of tuple of int
        The sign patterns of the regions.
    scales : tuple of str
        Factors of switching functions that contain parameters only.
    signs : tuple of int or None
        Their signs.
    slopes : tuple of str
        The slope of each interface function in its first state; empty if not constant.
    period : float or None
    frequencies : tuple of str or None
        Angular frequencies of all harmonics; None if time occurs outside periodic functions.
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
        """Return the determining parameters whose values differ."""
        deciding = dict.fromkeys([*self.values, *self.steady, *filter(None, self.loose)])
        return [n for n in deciding if values.get(n) != self.values.get(n)]

    def numbers(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return parameter values under their names in the expressions."""
        return {f"p{k}": values[n] for k, n in enumerate(self.names) if n in values}

    def patterns_at(self, values: Mapping[str, float]) -> tuple[Pattern, ...]:
        """Return the sign patterns of nonempty regions at parameter values."""
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
        """Return the signs of the parameter factors, None for one without a value."""
        numbers = self.numbers(values)
        return tuple(_sign(text, numbers) for text in self.scales)

    def rising_at(self, values: Mapping[str, float]) -> tuple[int, ...]:
        """Return 1 or −1 for interface functions that increase or decrease."""
        numbers = self.numbers(values)
        return tuple(-1 if text and _sign(text, numbers) == -1 else 1 for text in self.slopes)

    def period_at(self, values: Mapping[str, float]) -> float | None:
        """Return the common period of all harmonics."""
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
class StoredModel(Summarized, Result):
    """A model loaded from a file, which does not require SymPy.

    `fastslow.simulate` accepts it in place of the original `Model`, and so does
    `fastslow.continue_equilibria` with points of a diagram's branches, with bit-identical
    results. Its equations are available as text only; functions that need them in SymPy
    raise an error. ``Model.stored`` creates it, and results are saved with it.

    Parameters
    ----------
    states, slow_states, forcing, interfaces : tuple of str
        Names, in the model's order.
    free : tuple of str
        Slow quantities of a frozen model.
    parameters : mapping
        Parameter values.
    periodic : mapping
        The period of each periodic state.
    equations : str
        The equations as text.
    operations : Operations
    traits : Traits
    validity : Validity
    field : StoredField, optional
        For a frozen model stored with a diagram, its rates over the parameter.
    assigned : tuple of str
        Parameters that events assign.
    definition_texts : mapping
        Named definitions as text.

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
    assigned: tuple[str, ...] = ()
    definition_texts: Mapping[str, str] = dataclass_field(default_factory=dict)

    #: Reason why it is not accepted in place of a `Model`.
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

    def _stored_for(self, modes: Sequence[str]) -> StoredModel:
        """The model itself, for a run with these modes."""
        return self

    @property
    def regions(self) -> Mapping[str, Pattern]:
        """The sign of each interface function, +1 or −1, by region."""
        return self.operations.regions

    @property
    def resets(self) -> tuple[str, ...]:
        """Names of the resets."""
        return self.operations.resets

    @property
    def switches(self) -> tuple[str, ...]:
        """Names of the switches."""
        return self.operations.switches

    @property
    def events(self) -> tuple[str, ...]:
        """Names of the events."""
        return tuple(event.name for event in self.operations.events)

    def period(self) -> float | None:
        """Return the smallest common period of the forcing, None without one."""
        return self._period

    @cached_property
    def _period(self) -> float | None:
        now = self.validity
        return now.period_at(self.parameters) if now.changed(self.parameters) else now.period

    @validated(changes=mapping)
    def with_parameters(
        self, changes: Mapping[Any, Any] | None = None, /, **named: float
    ) -> StoredModel:
        """Return the model with other parameter values.

        Parameters
        ----------
        changes : mapping, optional
            Values of parameters.
        **named : float
            Values of parameters by name.

        Raises
        ------
        UnknownNameError
            For a name that is not a parameter of the model.
        ModelError
            For a value that is not a finite number, or at which the regions differ from
            the stored ones.
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
        """Return the model without the value of a frozen slow quantity.

        Raises
        ------
        ModelError
            For any other parameter.
        """
        key = normalised(str(name))
        if key not in self.free:
            raise ModelError(f"it is unknown whether the regions depend on {key}: {INSTEAD}")
        return replace(self, parameters={n: v for n, v in self.parameters.items() if n != key})

    def _check_regions(self, changed: Sequence[str], values: Mapping[str, float]) -> None:
        """Raise ModelError if the regions differ, or if this is unknown."""
        now, blocked = self.validity, [n for n in changed if n in self.validity.steady]
        what = ", ".join(f"{n} = {values[n]:g}" for n in blocked or changed if n in values)
        if blocked:
            raise ModelError(f"it is unknown whether the regions differ at {what}: {INSTEAD}")
        if now.patterns_at(values) != now.patterns or now.signs_at(values) != now.signs:
            raise ModelError(f"at {what} the regions differ from the stored ones: {INSTEAD}")

    def check(self) -> None:
        """Validate a stored model; called for each one read from a file.

        Raises
        ------
        UnknownOperationError
        """
        if not has_types(self):
            raise UnknownOperationError("expected a model as it is stored")
        numbers = [*self.parameters.values(), *self.periodic.values()]
        n_switches = len(self.switches)
        surfaces = len(self.interfaces) + self.operations.n_walls + n_switches
        surfaces += len(self.operations.triggers)
        quantities = len(self.forcing) + n_switches
        names = (*self.states, *self.slow_states, *self.assigned)
        sizes = (len(names), quantities, surfaces)
        known = {*self.parameters, *self.free}
        if not (
            all(map(math.isfinite, numbers))
            and sizes == self.operations.sizes
            and known.issuperset(self.operations.parameters)
            and known.issuperset(self.assigned)
            and known.issuperset((*self.traits.names, *self.validity.names))
        ):
            raise UnknownOperationError("expected the names and sizes of one model")
        self.operations.check()
        if self.field is not None:
            if not known.issuperset((self.field.parameter, *self.field.names)):
                raise UnknownOperationError("expected names of parameters")
            self.field.check(self.states, self.interfaces)
        self._check_traits(sizes)
        self._check_validity()

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
            and len(traits.rising) == len(self.interfaces)
            and set(traits.rising) <= {-1, 1}
        ):
            raise UnknownOperationError("expected the traits of one model")

    def _check_validity(self) -> None:
        one = self.validity
        names = {f"p{k}" for k in range(len(one.names))}
        texts = [*(text for row in one.rows for text in row), *one.scales]
        for text in (*texts, *filter(None, one.slopes), *(one.frequencies or ())):
            check_number(text, names)
        if not (
            all(len(row) in (0, 1 + len(one.loose)) for row in one.rows)
            and all(len(pattern) == len(one.rows) for pattern in one.patterns)
            and len(one.signs) == len(one.scales)
            and len(one.slopes) == len(self.interfaces)
        ):
            raise UnknownOperationError("expected the validity of one model")

    def __getattr__(self, name: str) -> NoReturn:
        if not name.startswith("_") and name in _OF_MODELS:
            raise AttributeError(f"a stored model has no {name}: {INSTEAD}")
        raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'")

    def _groups(self) -> list[list[str]]:
        named = ", ".join((*self.states, *self.slow_states))
        frozen = f" with {', '.join(self.free)} frozen" if self.free else ""
        values = "  " + ", ".join(f"{k} = {v:g}" for k, v in self.parameters.items())
        equations = [f"  {line}" for line in self.equations.splitlines()]
        return [[f"StoredModel of {named}{frozen}"], equations, [values] * bool(self.parameters)]


#: Attributes of a `Model` that require its equations.
_OF_MODELS = frozenset(
    ("continuous", "frozen", "path", "with_ramp", "rates", "to_latex", "empty_regions")
)


def finite_number(what: str, value: object) -> float:
    """Return a finite float, or raise ModelError with the value received.

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
