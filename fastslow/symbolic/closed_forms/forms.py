"""What a derivation gives back: equilibria, critical points and continua in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.closed_forms.stability import Stability


@dataclass(frozen=True)
class EquilibriumForm:
    """Equilibria of one region, in closed form or on an implicit curve.

    Parameters
    ----------
    region : str
    kind : str
        ``"explicit"``: the state in parameters; ``"curve"``: a parameter in
        terms of one unknown state; ``"implicit"``: equations are left.
    state : NamedMapping of sympy.Expr
        Every state; one that is an unknown stands for itself.
    unknowns : tuple of Symbol
        The unknown states that the rest is expressed by.
    equations : tuple of sympy.Expr
        What the unknowns satisfy, = 0.
    parameter : NamedMapping of sympy.Expr
        The parameter solved for and its value along the family; may be empty.
    exists, admissible : Boolean
        When it is real, and when it is real and lies in its region.
    possible : bool or None
        Whether the latter holds under the assumptions; None where that is open.
    parameter_range : Boolean or None
        The admissible part of a monotone curve as a condition on its parameter.
    stability : Stability
    discriminant : sympy.Expr or None
        Of the equation of the unknown.
    check : str
        How it is known that the rates vanish on substitution: ``"exact"``,
        ``"50 digits"`` (at fixed points), or empty where it is not known.
    note : str
    conditions : tuple of sympy.Expr
        What the parameters must fulfil besides, = 0.
    """

    region: str
    kind: str
    state: NamedMapping[sp.Expr]
    unknowns: tuple[sp.Symbol, ...]
    equations: tuple[sp.Expr, ...]
    parameter: NamedMapping[sp.Expr]
    exists: Boolean
    admissible: Boolean
    possible: bool | None
    parameter_range: Boolean | None
    stability: Stability
    discriminant: sp.Expr | None
    check: str
    note: str = ""
    conditions: tuple[sp.Expr, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether the rates vanish on substitution."""
        return bool(self.check)


@dataclass(frozen=True)
class Continuum:
    """A set of equilibria that are not isolated, in a singular region.

    Parameters
    ----------
    region : str
    free : tuple of Symbol
        States that take any value.
    state : NamedMapping of sympy.Expr
    parameters : NamedMapping of sympy.Expr
        Parameter values at which it exists; empty where it exists for all.
    equations : tuple of sympy.Expr
        What else must vanish.
    conditions : tuple of Boolean
        Where the free states stay in the region; its closure belongs to it in
        a continuous model.
    eigenvalues : tuple of sympy.Expr
        Those with a short closed form; zero is among them.
    check : str
        As in `EquilibriumForm`.
    """

    region: str
    free: tuple[sp.Symbol, ...]
    state: NamedMapping[sp.Expr]
    parameters: NamedMapping[sp.Expr]
    equations: tuple[sp.Expr, ...]
    conditions: tuple[Boolean, ...]
    eigenvalues: tuple[sp.Expr, ...]
    check: str

    @property
    def verified(self) -> bool:
        """Whether the closed form is complete and satisfies its equations."""
        return bool(self.check)


@dataclass(frozen=True)
class CriticalPoint:
    """A fold, branch point, cusp or Hopf point of one region in closed form.

    Parameters
    ----------
    code : str
        LP, BP, CP or HB.
    region : str
    state : NamedMapping of sympy.Expr
        A state that could not be solved for stands for itself.
    parameters : NamedMapping of sympy.Expr
        The parameters solved for.
    equations : tuple of sympy.Expr
        What is left to hold, = 0; empty when the closed form is complete.
    exists : Boolean
        When the point is real (and, for a Hopf point, has a frequency).
    admissible : Boolean
        When it exists and lies in its region.
    possible : bool or None
        Whether that holds under the assumptions; None where that is open.
    frequency_squared : sympy.Expr or None
        At a Hopf point.
    check : str
        As in `EquilibriumForm`, for the rates and the defining condition; empty
        where equations are left.
    """

    code: str
    region: str
    state: NamedMapping[sp.Expr]
    parameters: NamedMapping[sp.Expr]
    equations: tuple[sp.Expr, ...]
    exists: Boolean
    admissible: Boolean
    possible: bool | None
    frequency_squared: sp.Expr | None
    check: str

    @property
    def verified(self) -> bool:
        """Whether the closed form is complete and satisfies its equations."""
        return bool(self.check)
