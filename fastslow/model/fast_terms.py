"""Validation of the fast periodic terms that remain functions of time in a frozen model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp

from fastslow.errors import ModelError, unknown_name
from fastslow.model.periods import frequencies
from fastslow.model.structure import TIME, Structure, Values, real
from fastslow.model.tabulated import TableValue
from fastslow.results.stored.harmonics import period_of


def require_periodic(
    structure: Structure, values: Values, fast: Sequence[str], path: Sequence[str]
) -> None:
    """Raise unless the fast terms are periodic in time with a common period.

    Parameters
    ----------
    structure : Structure
        Before freezing.
    values : mapping
        Parameter values by symbol.
    fast : sequence of str
        Forcings by name, and ``"t"`` for time in the rates.
    path : sequence of str
        Slow quantities that are frozen along a path.

    Raises
    ------
    ModelError
        Without a term, for a term that does not depend on time or is not periodic, for terms
        without a common period, and if no slow quantity is left.
    UnknownNameError
        For a name that is neither a forcing nor ``"t"``.
    """
    if not fast:
        known = ", ".join([*structure.slow_states, *structure.forcing, TIME.name])
        raise ModelError(
            f"fast is empty; expected some of {known}, or frozen() without fast= for equilibria"
        )
    terms: dict[str, tuple[str, list[sp.Expr]]] = {}
    for name in fast:
        if name == TIME.name:
            rates = [e for e in structure.rates.values() if TIME in e.free_symbols]
            terms[name] = "time in the rates", rates
        elif name in structure.forcing:
            law = structure.forcing[name]
            terms[name] = f"{name} = {law}", [law] if TIME in law.free_symbols else []
        elif name in structure.states:
            raise ModelError(
                f"fast: '{name}' is a fast state already; expected slow states, forcings, or 't' "
                "for time in the rates"
            )
        else:
            names = [*structure.slow_states, *structure.forcing, TIME.name]
            raise unknown_name("slow state or fast forcing", name, names)
        if name in path:
            raise ModelError(f"'{name}' is in slow= and in fast=; expected it in one of them")
    left = [n for n in (*structure.forcing, *structure.slow_states) if n not in terms]
    for name, (words, written) in terms.items():
        if not written:
            nothing = "occurs in no rate" if name == TIME.name else "does not depend on time"
            raise ModelError(f"fast: {words} {nothing}; expected a fast periodic term")
        _require_frequencies(words, written, left)
    if not left and not structure.free:
        raise ModelError(
            f"fast: all of {', '.join(terms)} would remain, and no slow quantity is left to "
            "freeze; use the model itself, or name only the fast terms"
        )
    _require_common_period(terms, values)


def _require_frequencies(words: str, written: Sequence[sp.Expr], left: Sequence[str]) -> None:
    """Raise if a term is not periodic, or its frequency depends on a slow quantity."""
    every = []
    for expression in written:
        found = frequencies([expression], TIME)
        if found is None:
            raise ModelError(
                f"fast: {words} is not periodic in time ({expression}); expected "
                + _accepted(expression)
            )
        every += found
    for frequency in every:
        slow = sorted(frequency.free_symbols & set(map(real, left)), key=lambda s: s.name)
        if slow:
            raise ModelError(
                f"fast: the frequency {frequency} of {words} depends on the slow quantity "
                f"{slow[0]}, and the phase of a drifting frequency is not {frequency}*t; expected "
                "a frequency of parameters, or the phase as a periodic state"
            )


def _accepted(expression: sp.Expr) -> str:
    """What is accepted in place of a term that is not periodic."""
    if any(not value.table.periodic for value in expression.atoms(TableValue)):
        return "a table of one period, Tabulated(..., periodic=True)"
    return (
        "time in sines and cosines, in sawtooths such as Mod(t, T) and t/T - floor(t/T), and in "
        "tables with periodic=True alone"
    )


def _require_common_period(terms: dict[str, tuple[str, list[sp.Expr]]], values: Values) -> None:
    """Raise if the known frequencies of the terms have no common period."""
    every = frequencies([e for _, written in terms.values() for e in written], TIME) or []
    numbers = [number for f in every if (number := f.subs(values)).is_number and number.is_real]
    if period_of(map(float, numbers)) is None and any(number != 0 for number in numbers):
        periods = sorted({2.0 * np.pi / abs(float(n)) for n in numbers if n != 0}, reverse=True)
        raise ModelError(
            f"fast: the terms have the periods {', '.join(f'{p:.9g}' for p in periods)} and no "
            "common one, so that there are no periodic orbits; expected frequencies whose ratios "
            "are fractions"
        )
