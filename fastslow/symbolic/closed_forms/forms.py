"""Equilibria, critical points and continua in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.closed_forms.stability import Stability


@dataclass(frozen=True)
class EquilibriumForm(Displayed):
    """Equilibria of one region, in closed form or on an implicit curve.

    Parameters
    ----------
    region : str
    type : str
        ``"explicit"``: the state in parameters; ``"curve"``: a parameter in
        terms of one unknown state; ``"implicit"``: equations are left.
    state : NamedMapping of sympy.Expr
        Every state; an unknown is given by its own symbol.
    unknowns : tuple of Symbol
        Unknown states in which the other quantities are expressed.
    equations : tuple of sympy.Expr
        Equations for the unknowns, = 0.
    parameters : NamedMapping of sympy.Expr
        The parameter solved for and its value along the family; may be empty.
    exists, admissible : Boolean
        Conditions for it to be real, and to be real and inside its region.
    possible : bool or None
        Truth value of ``admissible`` under the assumptions; None if undecided.
    parameter_range : Boolean or None
        The admissible segment of a monotone curve as a condition on its parameter.
    stability : Stability
    discriminant : sympy.Expr or None
        Discriminant of the equation for the unknown.
    check : str
        Method by which vanishing rates were verified: ``"exact"``,
        ``"50 digits"`` (at fixed points), or empty for none.
    note : str
    conditions : tuple of sympy.Expr
        Further conditions on the parameters, = 0.
    contact_forces : NamedMapping of sympy.Expr
        Of an equilibrium held against walls, each wall to λ in f + Wλ = 0, positive where it is
        admissible; see `fastslow.Equilibrium`.
    """

    region: str
    type: str
    state: NamedMapping[sp.Expr]
    unknowns: tuple[sp.Symbol, ...]
    equations: tuple[sp.Expr, ...]
    parameters: NamedMapping[sp.Expr]
    exists: Boolean
    admissible: Boolean
    possible: bool | None
    parameter_range: Boolean | None
    stability: Stability
    discriminant: sp.Expr | None
    check: str
    note: str = ""
    conditions: tuple[sp.Expr, ...] = ()
    contact_forces: NamedMapping[sp.Expr] = field(default_factory=partial(NamedMapping, "wall"))

    @property
    def verified(self) -> bool:
        """True if the rates are verified to vanish on substitution."""
        return bool(self.check)


@dataclass(frozen=True)
class Continuum(Displayed):
    """A continuum of non-isolated equilibria in a region.

    Parameters
    ----------
    region : str
    free : tuple of Symbol
        States with arbitrary values.
    state : NamedMapping of sympy.Expr
    parameters : NamedMapping of sympy.Expr
        Parameter values at which it exists; empty if it exists for all.
    equations : tuple of sympy.Expr
        Further equations, = 0.
    conditions : tuple of Boolean
        Conditions for the free states to be inside the region; for a continuous model
        the continuum includes the closure.
    eigenvalues : tuple of sympy.Expr
        Eigenvalues with a short closed form, including zero.
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
        """True if the closed form is complete and verified to satisfy its equations."""
        return bool(self.check)


@dataclass(frozen=True)
class CriticalPoint(Displayed):
    """A fold, branch point, cusp or Hopf point of one region in closed form.

    Parameters
    ----------
    code : str
        LP, BP, CP or HB.
    region : str
    state : NamedMapping of sympy.Expr
        A state that was not solved for is given by its own symbol.
    parameters : NamedMapping of sympy.Expr
        Parameters solved for.
    equations : tuple of sympy.Expr
        Remaining equations, = 0; empty if the closed form is complete.
    exists : Boolean
        Condition for the point to be real (and, for a Hopf point, to have a frequency).
    admissible : Boolean
        Condition for it to exist inside its region.
    possible : bool or None
        Truth value of ``admissible`` under the assumptions; None if undecided.
    frequency_squared : sympy.Expr or None
        Squared frequency of a Hopf point.
    check : str
        As in `EquilibriumForm`, for the rates and the defining condition; empty
        if equations remain.
    note : str
        An integer in the state, such as k in x = 2πk, or a divisor assumed nonzero.
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
    note: str = ""

    @property
    def verified(self) -> bool:
        """True if the closed form is complete and verified to satisfy its equations."""
        return bool(self.check)
