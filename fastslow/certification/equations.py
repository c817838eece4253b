"""The exact equations of equilibria of a frozen model, motion by motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import sympy as sp

from fastslow.diagrams.field import require_frozen
from fastslow.errors import ModelError, refuse_events, refuse_switches, unknown_name
from fastslow.model.expansion import without_cancellation
from fastslow.model.model import Model
from fastslow.model.motions import PARTITIONS_KEPT, motions_of
from fastslow.model.rational import exact
from fastslow.model.structure import exact_values, real

#: The weight of the two fields of a pseudo-equilibrium; not a valid symbol name.
WEIGHT = sp.Symbol("(weight)", real=True)


@dataclass(frozen=True, eq=False)
class ExactEquations:
    """Equations of the equilibria of one smooth motion, with exact numbers.

    Parameters
    ----------
    region : str
        Name of the region, or ``"S1|S2"`` for sliding between two.
    unknowns : tuple of Symbol
        States, then, when sliding, the weight s, then the parameters.
    rows : tuple of Expr
        Rates, which vanish; when sliding those of (f₁ + f₂)/2 + s (f₁ − f₂)/2, and h.
    heights : tuple of Expr
        Interface functions that bound the region.
    signs : tuple of int
        Their signs in it, 1 or −1.
    interfaces : tuple of str
        Their names.
    continuum : bool
        True for equilibria that form a continuum at each value of the parameter: a rate vanishes
        everywhere, or, as under dry friction, that of both fields on the interface.
    """

    region: str
    unknowns: tuple[sp.Symbol, ...]
    rows: tuple[sp.Expr, ...]
    heights: tuple[sp.Expr, ...]
    signs: tuple[int, ...]
    interfaces: tuple[str, ...]
    continuum: bool = False

    @property
    def slides(self) -> bool:
        """True for pseudo-equilibria."""
        return WEIGHT in self.unknowns


@lru_cache(maxsize=PARTITIONS_KEPT)
def exact_equations(model: Model, *parameters: str) -> tuple[ExactEquations, ...]:
    """Return the equations of every region, and of sliding along each discontinuity.

    A region without equilibria because one of its rates is a multiple of an interface function
    is left out.

    Parameters
    ----------
    model : Model
        Frozen; floating-point numbers are the shortest decimals that are read as them.
    *parameters : str

    Raises
    ------
    ModelError
        If the model is not frozen, has switches or walls, or a parameter has no value.
    UnknownNameError
        If a parameter does not belong to the model.
    """
    states, last, functions, rates = exact_rates(model, *parameters)
    names = tuple(model.interfaces)
    motions = motions_of(model.partition)
    found = []
    for motion, rows in zip(motions.regions, rates, strict=True):
        if any(_multiples(row, f) for row in rows for f in functions):
            continue
        used = [k for k, f in enumerate(functions) if f.free_symbols & {*states, *last}]
        found.append(
            ExactEquations(
                motion.name,
                (*states, *last),
                rows,
                tuple(functions[k] for k in used),
                tuple(motion.signs[k] for k in used),
                tuple(names[k] for k in used),
                any(sp.expand(row) == 0 for row in rows),
            )
        )
    for motion in motions.sliding:
        if len(motion.slides) == 1:
            (own,) = motion.slides
            above, below = (rates[k] for k in motion.corners)
            mixed = tuple(
                (a + b) / 2 + WEIGHT * (a - b) / 2 for a, b in zip(above, below, strict=True)
            )
            others = [k for k in range(len(names)) if k != own]
            found.append(
                ExactEquations(
                    motion.name,
                    (*states, WEIGHT, *last),
                    (*mixed, functions[own]),
                    tuple(functions[k] for k in others),
                    tuple(motion.signs[k] for k in others),
                    tuple(names[k] for k in others),
                    any(_multiples(row, functions[own]) for row in mixed),
                )
            )
    return tuple(found)


@lru_cache(maxsize=PARTITIONS_KEPT)
def exact_rates(
    model: Model, *parameters: str
) -> tuple[
    tuple[sp.Symbol, ...],
    tuple[sp.Symbol, ...],
    tuple[sp.Expr, ...],
    tuple[tuple[sp.Expr, ...], ...],
]:
    """Return states, parameters, interface functions, and the rates of every region.

    Parameters and errors are those of `exact_equations`.
    """
    require_frozen(model, "certify")
    refuse_switches(model.switches, "certify")
    refuse_events(model.events, "certify")
    for name in model.resets:
        raise ModelError(f"the model has the reset '{name}'; certify accepts models without resets")
    known = {*model.parameters, *model.free}
    for parameter in parameters:
        if parameter not in known:
            raise unknown_name("parameter", parameter, known)
    missing = [n for n in model.free if n not in parameters and n not in model.parameters]
    if missing:
        raise ModelError(
            f"the frozen slow quantity '{missing[0]}' has no value; give one with "
            f"with_parameters({missing[0]}=…)"
        )
    values = exact_values(model.parameters, parameters)

    def number(expression: Any) -> sp.Expr:
        return exact(sp.sympify(expression)).xreplace(values)

    states, last = tuple(map(real, model.states)), tuple(map(real, parameters))
    functions = tuple(number(i.function) for i in model.interfaces.values())
    rates = tuple(
        tuple(without_cancellation(number(region.rates[n])) for n in model.states)
        for region in model.regions.values()
    )
    return states, last, functions, rates


def _multiples(row: sp.Expr, function: sp.Expr) -> bool:
    """Return True for a non-zero multiple of a function."""
    row, function = sp.expand(row), sp.expand(function)
    if row.free_symbols != function.free_symbols:
        return False
    ratio = sp.cancel(row / function)
    return bool(ratio.is_number and ratio != 0)
