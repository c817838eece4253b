"""What is derived of a model in closed form, with its report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import sympy as sp
from sympy.core.relational import Relational

from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.closed_forms.boundaries import BoundaryForm
from fastslow.symbolic.closed_forms.conserved import ConservedQuantity
from fastslow.symbolic.closed_forms.equilibrium_sets import EquilibriumSetForm
from fastslow.symbolic.closed_forms.forms import Continuum, CriticalPoint
from fastslow.symbolic.closed_forms.regions import RegionForms
from fastslow.symbolic.closed_forms.symmetries import FreeDirection
from fastslow.symbolic.decimals import rounds
from fastslow.symbolic.report import typesetting, wording
from fastslow.symbolic.report.region_reports import RegionReport
from fastslow.symbolic.report.typesetting import Block
from fastslow.symbolic.solving.verification import weakest


@dataclass(frozen=True, repr=False)
class Derivation(RegionReport[RegionForms]):
    """Equilibria, stability and bifurcations of a frozen model in closed form.

    Parameters
    ----------
    states : tuple of str
    free : tuple of str
        Frozen slow quantities.
    assumptions : tuple of relations
        Assumed signs of parameters, such as D > 0.
    regions : NamedMapping of RegionForms
        Regions can also be accessed as ``derivation["S1"]``; in a model with switches, those of
        every state as ``derivation["S1 (q = 0)"]``. In a model with resets followed by
        the motions held against walls, such as ``derivation["S1 at rest on x = sigma"]``, with
        rates along which the walls attract, and eigenvalues −1 twice for every wall.
    boundary_equilibria : tuple of BoundaryForm
        Equilibria on interfaces and walls.
    equilibrium_sets : tuple of EquilibriumSetForm
        Sets of pseudo-equilibria on discontinuities, such as a sticking band.
    free_directions : tuple of FreeDirection
        Translations of the states under which all rates are invariant, with the reduction.
    conserved_quantities : tuple of ConservedQuantity
        Linear combinations of the states that are constant, with the reduction.
    omitted : tuple of str
        Regions past the budget of work, which are not in ``regions``.
    omitted_pairs : tuple of tuple of str
        Neighbouring regions past the budget, whose boundary equilibria are not derived.
    omitted_sets : tuple of str
        Sliding motions past the budget, whose sets of equilibria are not derived.
    """

    states: tuple[str, ...]
    free: tuple[str, ...]
    assumptions: tuple[Relational, ...]
    regions: NamedMapping[RegionForms]
    boundary_equilibria: tuple[BoundaryForm, ...]
    equilibrium_sets: tuple[EquilibriumSetForm, ...] = ()
    free_directions: tuple[FreeDirection, ...] = ()
    conserved_quantities: tuple[ConservedQuantity, ...] = ()
    omitted: tuple[str, ...] = ()
    omitted_pairs: tuple[tuple[str, str], ...] = ()
    omitted_sets: tuple[str, ...] = ()

    @property
    def folds(self) -> tuple[CriticalPoint, ...]:
        """Folds of all regions."""
        return tuple(p for r in self.regions.values() for p in r.folds)

    @property
    def hopf(self) -> tuple[CriticalPoint, ...]:
        """Hopf points of all regions."""
        return tuple(p for r in self.regions.values() for p in r.hopf)

    @property
    def continua(self) -> tuple[Continuum, ...]:
        """Continua of equilibria of all regions."""
        return tuple(c for r in self.regions.values() for c in r.continua)

    @property
    def verified(self) -> bool:
        """True if every complete closed form satisfies its equations on substitution."""
        return bool(self.check)

    @property
    def check(self) -> str:
        """Method of verification: ``"exact"``, ``"50 digits"`` (at points), or empty for none."""
        points = [b.check for b in self.boundary_equilibria if not b.equations]
        return weakest([*(r.check for r in self.regions.values()), *points])

    def _blocks(self) -> list[Block]:
        """Return headings with typeset formulas."""
        taken = self._names()
        blocks = [typesetting.assumptions(self.assumptions)] if self.assumptions else []
        blocks += [typesetting.free_direction(free) for free in self.free_directions]
        if self.conserved_quantities:
            blocks.append(typesetting.conserved(self.conserved_quantities))
        blocks += [typesetting.region(one, taken) for one in self.regions.values()]
        blocks += [typesetting.equilibrium_set(one) for one in self.equilibrium_sets]
        return blocks + [typesetting.boundary(form, taken) for form in self.boundary_equilibria]

    def _groups(self) -> list[list[str]]:
        """Return the lines of the report: the heading, and what is derived, region by region."""
        frozen = f" with {', '.join(self.free)} frozen" if self.free else ""
        assumed = ", ".join(map(str, self.assumptions)) or "nothing"
        taken = self._names()
        heading = wording.wrapped(
            f"Derivation of {', '.join(self.states)}{frozen}; assumed:", assumed.split(", "), "  "
        )
        notes = [wording.ROUNDED] if any(map(rounds, self._formulas())) else []
        notes += [str(one) for one in (*self.free_directions, *self.conserved_quantities[:1])]
        notes += wording.left_out(self.omitted, self.omitted_pairs, self.omitted_sets)
        for note in notes:
            heading += wording.sentence("", note, "  ")
        lines: list[str] = []
        for region in self.regions.values():
            lines += wording.region(region, taken)
        for one in self.equilibrium_sets:
            lines += wording.equilibrium_set(one, taken)
        for form in self.boundary_equilibria:
            lines += wording.boundary(form, taken)
        return [heading, lines]

    def _formulas(self) -> Iterator[sp.Basic]:
        """Yield the formulas of the report."""
        for region in self.regions.values():
            yield from region.conditions
            points = (*region.folds, *region.branch_points, *region.cusps, *region.hopf)
            for form in region.equilibria:
                yield from (*form.state.values(), *form.equations, form.admissible)
                yield from (*form.parameters.values(), *form.conditions)
                yield from form.contact_forces.values()
            for point in points:
                yield from (*point.state.values(), *point.equations, point.admissible)
                yield from point.parameters.values()
        for one in self.boundary_equilibria:
            yield from (*one.state.values(), *one.parameters.values(), *one.equations)

    def _names(self) -> set[str]:
        """Return the names used by the model, which are excluded for subexpressions."""
        names = {*self.states, *self.free, *self.regions}
        for region in self.regions.values():
            for expression in (*region.rates.values(), *region.conditions):
                names |= {s.name for s in expression.free_symbols}
        paths = (form.clarke for form in self.boundary_equilibria)
        return names | {path.weight.name for path in paths if path is not None}
