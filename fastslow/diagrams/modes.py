"""The smooth motions of a frozen model: its regions, and sliding along discontinuities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from fastslow.model.derived import cached_by_partition
from fastslow.model.model import Model
from fastslow.model.motions import Motion, motions_of
from fastslow.model.structure import real


@dataclass(frozen=True, eq=False)
class Sides:
    """The regions on both sides of a sliding motion.

    Parameters
    ----------
    interface : int
        Number of the interface, h = 0.
    above, below : int
        Numbers of the regions where h > 0 and where h < 0.
    escaping : bool
        Whether both fields point away from the interface.
    drifts : (sympy.Expr, sympy.Expr)
        a = ∇h·f₁ above and b = ∇h·f₂ below.
    """

    interface: int
    above: int
    below: int
    escaping: bool
    drifts: tuple[sp.Expr, sp.Expr]


@dataclass(frozen=True, eq=False)
class Mode:
    """One smooth motion: a region's, or sliding along an interface between two regions.

    Sliding between regions A (h > 0) and B has the name ``"A|B"``, and where both
    fields point away from the interface ``"A|B (escaping)"``. Its rates are
    F = f_s − h ∇h with the sliding field f_s = f₁ + α (f₂ − f₁), α = a/(a − b)
    (Filippov 1988). Because f_s does not change h, the zeros of F on h = 0 are the
    pseudo-equilibria, and the eigenvalues there those of f_s along the interface
    and −|∇h|² across it.

    Parameters
    ----------
    name : str
    rates : tuple of sympy.Expr
    rows : tuple of sympy.Expr
        Switching functions: those of the interfaces and, in a model with sliding, −a and b.
    signs : tuple of int
        Sign of each row within the mode; 0 where a row does not bound it.
    sides : Sides, optional
        For sliding motions.
    """

    name: str
    rates: tuple[sp.Expr, ...]
    rows: tuple[sp.Expr, ...]
    signs: tuple[int, ...]
    sides: Sides | None = None


@cached_by_partition
def modes_of(model: Model) -> tuple[Mode, ...]:
    """Return the regions of a frozen model, then sliding and escaping along discontinuities.

    Sliding along several interfaces at once is not a mode of a branch; its equilibria are
    computed for one parameter value at a time (see `fastslow.diagrams.solve.equilibrium_sets`).

    Examples
    --------
    >>> x, p = sp.symbols("x p")
    >>> [m.name for m in modes_of(Model({x: p - sp.sign(x)}, parameters={p: 0}))]
    ['S1', 'S2', 'S1|S2', 'S1|S2 (escaping)']
    >>> [m.name for m in modes_of(Model({x: p - sp.Abs(x)}, parameters={p: 0}))]
    ['S1', 'S2']
    """
    functions = tuple(i.function for i in model.interfaces.values())
    motions = motions_of(model.partition, max_sliding=1)
    regions = tuple(Mode(m.name, m.rates, functions, m.signs) for m in motions.regions)
    sliding = tuple(mode for m in motions.sliding for mode in _both(model, functions, m))
    if not sliding:
        return regions
    # the rows of the drifts do not bound regions: constant placeholders
    none = (sp.Integer(1), sp.Integer(1))
    longer = (replace(r, rows=(*r.rows, *none), signs=(*r.signs, 0, 0)) for r in regions)
    return (*longer, *sliding)


def _both(model: Model, functions: Sequence[sp.Expr], motion: Motion) -> Iterator[Mode]:
    """Yield sliding along one interface and escaping from it."""
    (number,), (above, below) = motion.slides, motion.corners
    a, b = motion.bounds
    h = functions[number]
    rates = tuple(
        rate - h * h.diff(real(name)) for name, rate in zip(model.states, motion.rates, strict=True)
    )
    for escaping in (False, True):
        away = -1 if escaping else 1
        yield Mode(
            motion.name + " (escaping)" * escaping,
            rates,
            (*functions, -a, b),
            (*motion.signs, away, away),
            Sides(number, above, below, escaping, (a, b)),
        )
