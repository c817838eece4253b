"""The immutable model: equations, parameter values, interfaces and regions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import sympy as sp

from fastslow.arguments import Name, formula, function, items, mapping, shown, validated
from fastslow.errors import ModelError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.model.angles import read_periods
from fastslow.model.clocks import ClockFunction
from fastslow.model.equations import name_of, read_expression, read_structure
from fastslow.model.events import Event
from fastslow.model.fast_terms import require_periodic
from fastslow.model.interfaces import Interface, Region
from fastslow.model.motions import continuity
from fastslow.model.operations import operations_of
from fastslow.model.periods import common_period
from fastslow.model.regions_by_signs import RegionsBySigns
from fastslow.model.resets import Reset
from fastslow.model.rests import check_resets, quasi_static
from fastslow.model.storing import validity_of
from fastslow.model.structure import TIME, Partition, Structure, interned, real
from fastslow.model.switches import Switch, check_switches
from fastslow.model.tracing import traced_rates
from fastslow.model.traits import traits_of
from fastslow.model.typesetting import equations_text, model_latex
from fastslow.results.base.display import Summarized
from fastslow.results.base.html import formulas
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.model import StoredModel, Traits, finite_number
from fastslow.results.stored.operations import Operations
from fastslow.results.stored.sign_names import signs_at_rest

Written = Mapping[Any, Any]


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Model(Summarized):
    """A piecewise-smooth ODE with slow quantities, written in SymPy.

    Symbols are matched by name and treated as real, so ``Symbol("x")`` and
    ``Symbol("x", real=True)`` denote the same state. Time is the symbol named t.
    Expressions and conditions may also be text, such as ``"w - x**3"`` and ``"x > D"``,
    with functions named as in SymPy.

    Models are immutable and hashable. Two models are equal when their equations, parameter
    values, interfaces, regions and periods are equal, including names and order. Names of
    regions that are empty at these values (``empty_regions``) are compared as well.

    Parameters
    ----------
    rates : mapping
        State to its rate. The order is the order of the state vector.
    forcing : mapping, optional
        Slow quantity to its law in time.
    parameters : mapping, optional
        Parameter to its value.
    slow : mapping, optional
        Slow state to its rate.
    interfaces : mapping, optional
        Name to switching function h. Interfaces that the equations imply
        (Piecewise, Abs, Max, Min, sign, Heaviside) are added unless they are named here.
    regions : mapping, optional
        Name to a condition; other regions are named S1, S2, … in lexicographic
        order of their sign patterns, + before −. Of more than 64 regions each is named by
        its signs, such as ``"+-+"``; of more than 1024 ``regions`` forms those that are asked for.
    periodic : mapping, optional
        State to its period, a number or an expression of numbers such as ``2*sp.pi``:
        an angle. States that differ by a period are identified; equilibria are given in
        the principal range (−period/2, period/2]. Rates and interfaces must be
        periodic in the state, which is checked.
    resets : mapping, optional
        Relation to the states that change when it becomes true, with their values after
        the reset: ``{x >= sigma: {v: -r*v}}``. The values are applied as written; on a wall
        that moves with velocity s, write ``{v: s - r*(v - s)}``. The relation
        ``Eq(Mod(t, T), 0)`` resets at every multiple of T but the start of a run. Models with
        resets are accepted by simulations and by functions for equilibria and periodic orbits.
    switches : mapping, optional
        Hysteretic switches: name q to a pair of relations, ``{q: (x < -1, x > 1)}``. q is 1 once
        the first relation has become true, 0 once the second one has, and keeps its value
        between them. It is a symbol in the rates, in values after resets and in the relations of
        other switches. Thresholds may depend on all symbols, and a relation may be
        ``Eq(Mod(t, T), 0)``, which is true at every multiple of T. At the start of a run the
        relation that is true decides; otherwise the initial state includes q.
    events : mapping, optional
        Name to `Event`: assignments of states and parameters, carried out once when a condition
        becomes true. ``{x > 1: {x: 0}}`` is short for ``{"x > 1": fs.Event(x > 1, {x: 0})}``.
        Unlike a reset an event may lead beyond the surface at which it occurs; walls on which a
        motion may rest are resets.
    definitions : mapping, optional
        Name to an expression that all others, also definitions in any order, may contain:
        ``{"i_Ca": "g*m_inf*(V - E)"}``. Results have them as columns, ``run["i_Ca"]``.

    Attributes
    ----------
    states, slow_states : tuple of str
    rates, forcing : NamedMapping of sympy.Expr
    parameters : NamedMapping of float
    free : tuple of str
        Parameters without a value: the slow quantities of a frozen model.
    interfaces : NamedMapping of Interface
    regions : NamedMapping of Region
    periodic : NamedMapping of float
    resets : NamedMapping of Reset
    switches : NamedMapping of Switch
    events : NamedMapping of Event
    definitions : NamedMapping of sympy.Expr
        In states, slow quantities, parameters and time.

    Raises
    ------
    ModelError
        For an unknown symbol, a missing or non-finite value, contradictory regions,
        a rate or interface that is not periodic in a periodic state, or a switch whose relations
        touch or overlap; for definitions that contain each other.

    Examples
    --------
    >>> x, D = sp.symbols("x D")
    >>> gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    >>> model = Model({x: -gap}, parameters={D: 0.5})
    >>> list(model.interfaces), list(model.regions)
    (['x - D', 'x + D'], ['S1', 'S2', 'S3'])
    >>> print(model.regions["S2"].rates["x"])
    0
    >>> Model({"x": "-x + k"}, parameters={"k": 2}).equations
    "x' = k - x"
    """

    states: tuple[str, ...]
    slow_states: tuple[str, ...]
    rates: NamedMapping[sp.Expr]
    forcing: NamedMapping[sp.Expr]
    parameters: NamedMapping[float]
    free: tuple[str, ...]
    interfaces: NamedMapping[Interface]
    regions: NamedMapping[Region]
    periodic: NamedMapping[float]
    resets: NamedMapping[Reset]
    switches: NamedMapping[Switch]
    events: NamedMapping[Event]
    definitions: NamedMapping[sp.Expr]
    structure: Structure = field(repr=False)
    partition: Partition = field(repr=False)

    @validated(
        rates=mapping,
        forcing=mapping,
        parameters=mapping,
        slow=mapping,
        interfaces=mapping,
        regions=mapping,
        periodic=mapping,
        resets=mapping,
        switches=mapping,
        events=mapping,
        definitions=mapping,
    )
    def __init__(
        self,
        rates: Written,
        *,
        forcing: Written | None = None,
        parameters: Written | None = None,
        slow: Written | None = None,
        interfaces: Written | None = None,
        regions: Written | None = None,
        periodic: Written | None = None,
        resets: Written | None = None,
        switches: Written | None = None,
        events: Written | None = None,
        definitions: Written | None = None,
    ) -> None:
        values = {
            name_of(k, "parameter"): finite_number(f"parameter {k}", v)
            for k, v in (parameters or {}).items()
        }
        if len(values) < len(parameters or {}):
            raise ModelError("two parameters have the same name; expected distinct names")
        structure = read_structure(
            rates=rates,
            forcing=forcing or {},
            slow=slow or {},
            parameters=tuple(values),
            interfaces=interfaces or {},
            free=(),
            regions=regions or {},
            resets=resets or {},
            switches=switches or {},
            events=events or {},
            definitions=definitions or {},
        )
        periods = read_periods(structure, values, periodic or {})
        periodic_states = NamedMapping("periodic state", periods)
        self._fill(interned(replace(structure, periodic=periodic_states)), values)
        if structure.resets:
            names = (*self.states, *self.slow_states)
            heights = [interface.function for interface in self.interfaces.values()]
            equations = [(self.rates, self.forcing)]
            if not isinstance(self.regions, RegionsBySigns):
                equations = [(one.rates, one.forcing) for one in self.regions.values()]
            for written, laws in equations:
                check_resets(structure.resets, names, written, laws, heights, self.values)

    @classmethod
    @validated(rhs=function, states=items(formula), parameters=mapping)
    def from_function(
        cls,
        rhs: Callable[..., Any],
        states: Sequence[Name],
        parameters: Written | None = None,
    ) -> Model:
        """Return the model of a Python function, which is called once with symbols.

        The function is that of SciPy's ``solve_ivp`` with ``args``. It may use operators, arrays,
        ``np.where``, and functions of NumPy and SymPy; both values of a decision are written, by
        ``np.where`` or ``sp.Piecewise``, because Python cannot decide by a symbol.

        Parameters
        ----------
        rhs : callable
            ``rhs(t, y, *parameters)``, which returns the rates of the states y in order.
        states : sequence of str or Symbol
            Names of the states.
        parameters : mapping, optional
            Parameter to its value, in the order of the arguments of the function.

        Raises
        ------
        ModelError
            For a function that decides by the value of a state, uses it as a number, or does not
            return one rate for each state.

        Examples
        --------
        >>> import numpy as np
        >>> def duffing(t, y, k, F):
        ...     x, v = y
        ...     return [v, F * np.cos(t) - k * v - np.where(x > 0, x, x / 2)]
        >>> model = Model.from_function(duffing, ["x", "v"], {"k": 0.1, "F": 1})
        >>> print(model.regions["S2"].rates["v"])
        F*cos(t) - k*v - x/2
        >>> Model.from_function(lambda t, y: [1 if y[0] > 0 else 0], ["x"])  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        ...
        fastslow.errors.ModelError: the condition x > 0 is decided by Python: a rate is traced ...
        """
        names = [name_of(name, "state") for name in states]
        known = [name_of(name, "parameter") for name in parameters or {}]
        rates = traced_rates(rhs, names, known)
        return cls(rates, parameters=parameters)

    def _fill(self, structure: Structure, values: Mapping[str, float]) -> None:
        partition = structure.partition(values)
        structure = partition.structure
        fields = {
            "states": structure.states,
            "slow_states": structure.slow_states,
            "rates": structure.rates,
            "forcing": structure.forcing,
            "parameters": NamedMapping("parameter", values),
            "free": structure.free,
            "interfaces": partition.interfaces,
            "regions": partition.regions,
            "periodic": structure.lengths,
            "resets": NamedMapping("reset", {r.name: r for r in structure.resets}),
            "switches": NamedMapping("switch", {s.name: s for s in structure.switches}),
            "events": structure.events,
            "definitions": structure.definitions,
            "structure": structure,
            "partition": partition,
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        if structure.switches:
            groups = (
                (*structure.states, *structure.slow_states),
                tuple(structure.forcing),
                ("t",),
            )
            symbols = tuple(tuple(map(real, group)) for group in groups)
            check_switches(structure.switches, symbols, self.values)

    @cached_property
    def _content(self) -> tuple[Partition, tuple[tuple[str, float], ...]]:
        return self.partition, tuple(self.parameters.items())

    @cached_property
    def _hash(self) -> int:
        return hash(self._content)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model):
            return NotImplemented
        return self is other or (self._hash == other._hash and self._content == other._content)

    def __copy__(self) -> Model:
        return self

    def __deepcopy__(self, memo: object) -> Model:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Model._from, (self.structure, dict(self.parameters))

    @classmethod
    def _from(cls, structure: Structure, values: Mapping[str, float]) -> Model:
        model = cls.__new__(cls)
        model._fill(structure, values)
        return model

    @validated(changes=mapping)
    def with_parameters(self, changes: Written | None = None, /, **named: float) -> Model:
        """Return the model at other parameter values; region names are kept.

        Parameters
        ----------
        changes : mapping, optional
            Parameter (symbol or name) to value.
        **named : float
            The same as keywords. A slow quantity of a frozen model may be given a value.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter of the model.
        ModelError
            For a value that is not a finite number.

        Examples
        --------
        >>> x, k = sp.symbols("x k")
        >>> Model({x: -k * x}, parameters={k: 1}).with_parameters(k=2).parameters["k"]
        2.0
        """
        values = dict(self.parameters)
        valid = [*self.parameters, *(n for n in self.free if n not in values)]
        for key, value in {**(changes or {}), **named}.items():
            name = normalised(str(key))
            if name not in valid:
                raise unknown_name("parameter", key, valid)
            values[name] = finite_number(f"parameter {key}", value)
        return self._from(self.structure, values)

    @validated(name=formula)
    def with_free(self, name: Name) -> Model:
        """Return the model with one parameter freed, so that it can be varied.

        Regions that are empty at the old value but not at all values are included;
        region names are kept.

        Parameters
        ----------
        name : str or Symbol

        Raises
        ------
        UnknownNameError
            For a name that is no parameter of the model.

        Examples
        --------
        >>> x, D = sp.symbols("x D")
        >>> model = Model({x: -sp.Max(x - D, -x - D, 0)}, parameters={D: 1})
        >>> len(model.regions), len(model.with_free("D").regions)
        (3, 6)
        """
        key = normalised(str(name))
        if key in self.free and key not in self.parameters:
            return self
        if key not in self.parameters:
            raise unknown_name("parameter", key, [*self.parameters, *self.free])
        structure = self.structure
        if key not in self.free:
            structure = structure.freed(key, self.parameters)
        values = {n: v for n, v in self.parameters.items() if n != key}
        return self._from(structure, values)

    @validated(slow=mapping, fast=items(formula))
    def frozen(self, slow: Written | None = None, *, fast: Sequence[Name] | None = None) -> Model:
        """Return the fast subsystem, in which every slow quantity is a free parameter.

        Parameters that occur only in the laws of the slow quantities are removed.

        Parameters
        ----------
        slow : mapping, optional
            Slow quantities as functions of fewer new ones, to freeze along a
            path: ``frozen(slow={w1: 2*g**2 - 1, w2: g})``.
        fast : sequence of str or Symbol, optional
            What is not frozen. Slow states by name: they remain states; with all of them the
            result is the full model, whose equilibria `fastslow.continue_equilibria` computes.
            Fast periodic terms: forcings by name, and ``"t"`` for time in the rates. With
            these the fast subsystem has periodic orbits (`fastslow.find_orbit`) where others
            have equilibria.

        Raises
        ------
        ModelError
            If a rate depends on time explicitly, outside the slow quantities and without
            ``fast=["t"]``; if ``fast`` is empty, for a fast term that does not depend on time
            or is not periodic, for fast terms without a common period, and if nothing is left
            to freeze.
        UnknownNameError
            For a name in ``slow`` that is no slow quantity, or in ``fast`` that is neither a
            slow state nor a forcing.

        Examples
        --------
        >>> x, w, t = sp.symbols("x w t")
        >>> fast = Model({x: w - x}, forcing={w: sp.sin(t)}).frozen()
        >>> fast.free, list(fast.forcing)
        (('w',), [])
        >>> forced = Model({x: w - x + sp.cos(t)}, forcing={w: sp.sin(t / 1000)})
        >>> print(forced.frozen(fast=["t"]).equations)
        x' = w - x + cos(t)
        >>> z, k = sp.symbols("z k")
        >>> full = Model({x: z - x}, slow={z: k - x}, parameters={k: 0}).frozen(fast=["z"])
        >>> full.states, full.slow_states
        (('x', 'z'), ())
        """
        kept = tuple(dict.fromkeys(normalised(str(name)) for name in fast or ()))
        states = tuple(n for n in self.slow_states if n in kept)
        if states:
            return self._with_fast(states, slow, [n for n in kept if n not in states])
        timed = [n for n in self.states if TIME in self.structure.rates[n].free_symbols]
        if timed and TIME.name not in kept:
            for name in timed:
                clocks = sorted(str(c.written()) for c in self.rates[name].atoms(ClockFunction))
                if clocks:
                    raise ModelError(
                        f"the rate of {name} contains the clock {clocks[0]}, which is neither slow "
                        "nor averaged; only slow quantities can be frozen: define a slow clock in "
                        'forcing=, or keep a fast periodic one by fast=["t"]'
                    )
            raise ModelError(
                f"the rate of {timed[0]} depends on time explicitly ({self.rates[timed[0]]}); only "
                "slow quantities can be frozen: define the time-dependent term in forcing=, or "
                'keep a fast periodic term by fast=["t"]'
            )
        quantities = (*self.forcing, *self.slow_states)
        path: dict[str, sp.Expr] = {}
        for key, law in (slow or {}).items():
            name = normalised(str(key))
            if name not in quantities:
                raise unknown_name("slow quantity", key, quantities)
            path[name] = read_expression(f"path of {key}", law, (*self.parameters, *self.free))
        if fast is not None:
            require_periodic(self.structure, self.values, kept, tuple(path))
        structure = self.structure
        if structure.resets:
            both = (structure.rates, structure.forcing, self.states)
            fixed = quasi_static(structure.resets, *both, [n for n in self.forcing if n in kept])
            structure = replace(structure, resets=fixed)
        return self._from(*structure.frozen(path, self.parameters, kept))

    @validated(states=items(formula))
    def with_slow(self, states: Sequence[Name]) -> Model:
        """Return the model with some of its states as slow states, which `frozen` freezes.

        Parameters
        ----------
        states : sequence of str or Symbol

        Raises
        ------
        UnknownNameError
            For a name that is no state.
        ModelError
            If no state is left.

        Examples
        --------
        >>> x, z = sp.symbols("x z")
        >>> burster = Model({x: x - x**3 - z, z: (x - z) / 100}).with_slow([z])
        >>> burster.states, burster.slow_states, burster.frozen().free
        (('x',), ('z',), ('z',))
        """
        names = tuple(dict.fromkeys(normalised(str(name)) for name in states))
        for name in names:
            if name not in self.states:
                raise unknown_name("state", name, self.states)
        if len(names) == len(self.states):
            raise ModelError("no state is left that is fast; expected fewer slow states")
        return self._from(self.structure.with_slow(names), self.parameters)

    def _with_fast(self, states: Sequence[str], slow: Written | None, fast: Sequence[str]) -> Model:
        """Return the model with slow states as states, and what else is slow frozen."""
        for key in slow or ():
            if normalised(str(key)) in states:
                raise ModelError(f"'{key}' is in slow= and in fast=; expected it in one of them")
        model = self._from(self.structure.with_fast(states), self.parameters)
        if slow or fast or model.forcing or model.slow_states:
            return model.frozen(slow, fast=fast or None)
        return model

    @validated(states=mapping)
    def with_switches(self, states: Written | None = None, /, **named: int) -> Model:
        """Return the model with switches in constant states; region names are kept.

        Its motions are those of the model as long as no switch changes, which it does where
        ``model.switches[name].watched(value)`` increases through zero.

        Parameters
        ----------
        states : mapping, optional
            Switch (symbol or name) to its value, 0 or 1.
        **named : int
            The same as keywords.

        Raises
        ------
        UnknownNameError
            For a name that is no switch of the model.
        ModelError
            For another value.

        Examples
        --------
        >>> x, q = sp.symbols("x q")
        >>> relay = Model({x: 2 * q - 1}, switches={q: (x < -1, x > 1)})
        >>> print(relay.with_switches(q=1).equations)
        x' = 1
        >>> print(relay.switches["q"].watched(1))
        x - 1
        """
        values = {}
        for key, value in {**(states or {}), **named}.items():
            name = normalised(str(key))
            if name not in self.switches:
                raise unknown_name("switch", key, self.switches)
            if value not in (0, 1):
                raise ModelError(f"switch {key}: expected 0 or 1, received {shown(value)}")
            values[name] = int(value)
        return self._from(self.structure.with_switches(values), self.parameters)

    @validated(name=formula)
    def with_ramp(self, name: Name, rate: float, from_value: float = 0.0) -> Model:
        """Return the model with one parameter ramped at a constant rate, from_value + rate·t.

        Both numbers become parameters named after it, so that the rate can be changed
        without new equations: ``ramp.with_parameters(w_rate=1e-4)``.

        Parameters
        ----------
        name : str or Symbol
            A parameter, or a slow quantity of a frozen model.
        rate : float
            In units of the parameter per time.
        from_value : float
            Value at t = 0.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter of the model.
        ModelError
            For a slow quantity that has a law, a number that is not finite, or if the
            model already has parameters of the new names.

        Examples
        --------
        >>> x, w, t = sp.symbols("x w t")
        >>> fast = Model({x: w - x}, forcing={w: sp.sin(t)}).frozen()
        >>> print(fast.with_ramp(w, 0.5, from_value=-1).forcing["w"])
        t*w_rate + w_start
        """
        key = normalised(str(name))
        if key in (*self.forcing, *self.slow_states):
            raise ModelError(f"'{key}' already varies in time; ramp it in model.frozen() instead")
        freed = self.with_free(key)
        first, speed = f"{key}_start", f"{key}_rate"
        numbers = {
            first: finite_number(f"parameter {first}", from_value),
            speed: finite_number(f"parameter {speed}", rate),
        }
        taken = [
            n
            for n in numbers
            if n in (*freed.states, *freed.slow_states, *freed.forcing, *freed.parameters)
        ]
        if taken:
            raise ModelError(
                f"a ramp of {key} needs the name {taken[0]}, which the model already uses"
            )
        law = real(first) + real(speed) * TIME
        structure = replace(
            freed.structure,
            forcing=NamedMapping("slow quantity", {**freed.structure.forcing, key: law}),
            free=tuple(n for n in freed.free if n != key),
        )
        return self._from(structure, {**freed.parameters, **numbers})

    def period(self) -> float | None:
        """Return the smallest common period of all time-dependent terms, None if there is none.

        Examples
        --------
        >>> x, w, t = sp.symbols("x w t")
        >>> Model({x: w - x}, forcing={w: sp.sin(4 * t)}).period() / sp.pi.evalf(15)
        0.500000000000000
        """
        return _period(self.structure, self._known(self.structure.timed))

    def _known(self, names: tuple[str, ...]) -> tuple[tuple[str, float | None], ...]:
        return tuple((name, self.parameters.get(name)) for name in names)

    @property
    def empty_regions(self) -> tuple[str, ...]:
        """Names of regions that exist at other parameter values and are empty at these.

        Examples
        --------
        >>> x, D = sp.symbols("x D")
        >>> model = Model({x: -sp.Max(x - D, -x - D, 0)}, parameters={D: 1})
        >>> model.empty_regions, model.with_parameters(D=0).empty_regions
        ((), ('S2',))
        """
        seen = {name for _, name in self.structure.names}
        return tuple(name for name in sorted(seen) if name not in self.regions)

    @property
    def assigned(self) -> tuple[str, ...]:
        """Parameters that events assign.

        Their values are those at the start of a run, in which they are columns after the slow
        states.

        Examples
        --------
        >>> Model({"x": "k"}, parameters={"k": 1}, events={"x > 1": {"k": "-k"}}).assigned
        ('k',)
        """
        return self.structure.assigned

    @property
    def path(self) -> NamedMapping[sp.Expr]:
        """Slow quantities as functions of the path's parameters, for a model frozen along a path.

        Examples
        --------
        >>> x, u, g, t = sp.symbols("x u g t")
        >>> Model({x: u - x}, forcing={u: sp.cos(t) ** 2}).frozen(slow={u: g**2}).path
        {u: g**2}
        """
        return self.structure.path

    @property
    def values(self) -> dict[sp.Symbol, float]:
        """Parameter values by real symbol, for substitution."""
        return {real(name): value for name, value in self.parameters.items()}

    @property
    def continuous(self) -> NamedMapping[bool]:
        """Continuity of the rates across each interface, decided symbolically.

        Examples
        --------
        >>> x = sp.Symbol("x")
        >>> Model({x: -sp.Abs(x)}).continuous, Model({x: -sp.sign(x)}).continuous
        ({x: True}, {x: False})
        """
        return continuity(self.partition)

    @property
    def operations(self) -> Operations:
        """The equations as lists of operations, from which machine code is generated."""
        return operations_of(self.partition)

    @property
    def traits(self) -> Traits:
        """Properties of the equations that classify the outcome of a run."""
        return traits_of(self.partition, self._known(self.structure.sloping))

    @property
    def stored(self) -> StoredModel:
        """The model as stored in files, which is simulated without SymPy or symbolic equations.

        Examples
        --------
        >>> import tempfile, fastslow as fs
        >>> x, k = sp.symbols("x k")
        >>> model = Model({x: -k * x}, parameters={k: 1})
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     model.stored.save(f"{folder}/model.npz")
        ...     again = fs.load(f"{folder}/model.npz")
        >>> fs.simulate(again, [1], t=(0, 1)) == fs.simulate(model, [1], t=(0, 1))
        True
        """
        return StoredModel(
            states=self.states,
            slow_states=self.slow_states,
            forcing=tuple(self.forcing),
            interfaces=tuple(self.interfaces),
            free=self.free,
            parameters=self.parameters,
            periodic=self.periodic,
            equations=self.equations,
            operations=self.operations,
            traits=self.traits,
            validity=validity_of(self.partition, self.parameters, self.period()),
            assigned=self.assigned,
            definition_texts=self.structure.definition_texts,
        )

    def _stored_for(self, modes: Sequence[str]) -> StoredModel:
        """Return the model as it is stored with a run; of very many regions with its modes."""
        if not isinstance(self.regions, RegionsBySigns):
            return self.stored
        count, walls = len(self.interfaces), [reset.wall for reset in self.structure.walls]
        signs = (signs_at_rest(name, count, walls) for name in modes)
        formed = [one for one in signs if one is not None]
        structure = interned(replace(self.structure, formed=tuple(formed)))
        return self._from(structure, self.parameters).stored

    @property
    def equations(self) -> str:
        """The equations as text, with parameters by name.

        Examples
        --------
        >>> x, w, k, t = sp.symbols("x w k t")
        >>> print(Model({x: w - k * x}, forcing={w: sp.sin(t)}, parameters={k: 2}).equations)
        x' = -k*x + w
        w = sin(t)
        """
        return equations_text(
            tuple(self.rates.items()),
            tuple(self.forcing.items()),
            tuple(self.structure.periodic.items()),
            (*self.structure.resets, *self.structure.switches),
            tuple(f"{name} {event}" for name, event in self.structure.events.items()),
        )

    def to_latex(self) -> str:
        """Return the equations of every region as LaTeX, for a document with amsmath."""
        return model_latex(self.partition)

    def _repr_latex_(self) -> str:
        return self.to_latex()

    def _repr_html_(self) -> str:
        return formulas(self._caption(), self.to_latex())

    def _groups(self) -> list[list[str]]:
        head = f"Model of {', '.join((*self.states, *self.slow_states))}" + (
            f" with {', '.join(self.free)} frozen" if self.free else ""
        )
        lines = []
        if isinstance(self.regions, RegionsBySigns):
            lines += [f"  {state}' = {rate}" for state, rate in self.rates.items()]
            lines.append(f"  {self.regions.how_many} regions")
        for region in () if isinstance(self.regions, RegionsBySigns) else self.regions.values():
            rates = ", ".join(f"{state}' = {rate}" for state, rate in region.rates.items())
            lines.append(f"  {region}:  {rates}" if len(self.regions) > 1 else f"  {rates}")
        empty = f"  empty at these parameter values: {', '.join(self.empty_regions)}"
        lines += [f"  {name} = {law}" for name, law in self.forcing.items()]
        lines += [f"  {name} = {named}" for name, named in self.definitions.items()]
        lines += [f"  {name} modulo {p}" for name, p in self.structure.periodic.items()]
        lines += [f"  {event}" for event in (*self.resets.values(), *self.switches.values())]
        lines += [f"  {name} {event}" for name, event in self.events.items()]
        values = "  " + ", ".join(f"{k} = {v:g}" for k, v in self.parameters.items())
        tail = [empty] * bool(self.empty_regions) + [values] * bool(self.parameters)
        return [[head], lines, tail]


#: Number of cached periods.
PERIODS = 256


@lru_cache(maxsize=PERIODS)
def _period(structure: Structure, values: tuple[tuple[str, float | None], ...]) -> float | None:
    known = {real(name): value for name, value in values if value is not None}
    return common_period(structure.written, TIME, known)
