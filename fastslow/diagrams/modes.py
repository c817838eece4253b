"""The smooth motions of a frozen model: regions, sliding along discontinuities, rest on walls."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice

import sympy as sp

from fastslow.model.derived import cached_by_partition
from fastslow.model.model import Model
from fastslow.model.motion import Motion
from fastslow.model.motions import MOST_MOTIONS, motions_of
from fastslow.model.resets import Reset
from fastslow.model.rests import Held, held_motions
from fastslow.model.structure import real

#: Largest number of walls on which a frozen model is held at the same time.
MOST_HELD = 6


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
    """One smooth motion: of a region, sliding between two regions, or held against walls.

    Sliding between regions A (h > 0) and B has the name ``"A|B"``, and where both
    fields point away from the interface ``"A|B (escaping)"``. Its rates are
    F = f_s − h ∇h with the sliding field f_s = f₁ + α (f₂ − f₁), α = a/(a − b)
    (Filippov 1988). Because f_s does not change h, the zeros of F on h = 0 are the
    pseudo-equilibria, and the eigenvalues there those of f_s along the interface
    and −|∇h|² across it.

    Held against walls, h = h' = 0, the rates are F = f + Wλ − Σ P (h + 2h') with the contact
    forces λ that keep h'' = 0 and directions P with ∇h'·P = 1 (see `fastslow.model.rests`). Then
    h'' = −h − 2h' along F, so that the zeros of F are the held equilibria, and its eigenvalues
    those of the constrained motion and −1, twice for each wall. At λ = 0 these are zeros of f
    too, and det(F_x)/det(f_x) has the sign of −Cᵀ f_x⁻¹ W with C = −∇h.

    Parameters
    ----------
    name : str
    rates : tuple of sympy.Expr
    rows : tuple of sympy.Expr
        Switching functions: those of the interfaces and walls; then in a sliding motion −a and b,
        and in a held motion h' of every wall and the contact forces. Motions with fewer rows
        have constants between.
    signs : tuple of int
        Sign of each row within the mode; 0 where a row does not bound it.
    sides : Sides, optional
        For sliding motions.
    held : tuple of int
        Rows of the walls against which it is held.
    free : int, optional
        Number of the region of a held motion.
    pushes : tuple of tuple of sympy.Expr
        P of every wall.
    """

    name: str
    rates: tuple[sp.Expr, ...]
    rows: tuple[sp.Expr, ...]
    signs: tuple[int, ...]
    sides: Sides | None = None
    held: tuple[int, ...] = ()
    free: int | None = None
    pushes: tuple[tuple[sp.Expr, ...], ...] = ()


def walls_of(model: Model) -> tuple[Reset, ...]:
    """Return the resets of a model that are walls in the state space."""
    return tuple(reset for reset in model.structure.resets if reset.clock is None)


def all_held(model: Model) -> bool:
    """Return whether all motions held against walls are derived."""
    held = sum(bool(mode.held) for mode in modes_of(model))
    return len(walls_of(model)) <= MOST_HELD and held < MOST_MOTIONS


@cached_by_partition
def modes_of(model: Model) -> tuple[Mode, ...]:
    """Return the regions of a frozen model, then sliding and escaping, then rest on walls.

    Sliding along several interfaces at once is not a mode of a branch; its equilibria are
    computed for one parameter value at a time (see `fastslow.diagrams.solve.equilibrium_sets`).

    Examples
    --------
    >>> x, p, v = sp.symbols("x p v")
    >>> [m.name for m in modes_of(Model({x: p - sp.sign(x)}, parameters={p: 0}))]
    ['S1', 'S2', 'S1|S2', 'S1|S2 (escaping)']
    >>> [m.name for m in modes_of(Model({x: p - sp.Abs(x)}, parameters={p: 0}))]
    ['S1', 'S2']
    >>> stop = Model({x: v, v: p - x}, parameters={p: 0}, resets={x >= 1: {v: -v / 2}})
    >>> [m.name for m in modes_of(stop)]
    ['S1', 'S1 at rest on x = 1']
    """
    walls = walls_of(model)
    interfaces = tuple(i.function for i in model.interfaces.values())
    functions = (*interfaces, *(wall.function for wall in walls))
    outside = (-1,) * len(walls)
    motions = motions_of(model.partition, max_sliding=1, with_jumps=True)
    regions = (Mode(m.name, m.rates, functions, (*m.signs, *outside)) for m in motions.regions)
    sliding = (mode for m in motions.sliding for mode in _both(model, functions, outside, m))
    rests = held_motions(motions.regions, interfaces, walls, model.states, MOST_HELD)
    held = (_held(functions, one) for one in rests)
    modes = tuple(chain(regions, sliding, islice(held, MOST_MOTIONS)))
    longest = max(len(mode.rows) for mode in modes)
    return tuple(_padded(mode, len(functions), longest) for mode in modes)


def _padded(mode: Mode, first: int, count: int) -> Mode:
    """Return a mode with constants as rows that do not bound it."""
    lacking = count - len(mode.rows)
    if not lacking:
        return mode
    rows = (*mode.rows[:first], *[sp.Integer(1)] * lacking, *mode.rows[first:])
    return replace(
        mode, rows=rows, signs=(*mode.signs[:first], *[0] * lacking, *mode.signs[first:])
    )


def _both(
    model: Model, functions: Sequence[sp.Expr], outside: Sequence[int], motion: Motion
) -> Iterator[Mode]:
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
            (*motion.signs, *outside, away, away),
            Sides(number, above, below, escaping, (a, b)),
        )


def _held(functions: Sequence[sp.Expr], held: Held) -> Mode:
    """Return the motion held against some walls, given the functions of interfaces and walls."""
    count, rest = len(held.signs), held.rest
    rows = tuple(count + k for k in rest.walls)
    outside = [0 if k in rows else -1 for k in range(count, len(functions))]
    return Mode(
        rest.motion.name,
        held.rates,
        (*functions, *rest.speeds, *rest.forces),
        (*held.signs, *outside, *[0] * len(rows), *[1] * len(rows)),
        held=rows,
        free=held.region,
        pushes=rest.pushes,
    )
