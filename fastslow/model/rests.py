"""Motion at rest on walls, and checks of the resets there."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import sympy as sp

from fastslow.errors import ModelError
from fastslow.model.expansion import cancelled, expanded
from fastslow.model.interfaces import vanishes_on
from fastslow.model.motion import Motion, drift
from fastslow.model.rational import exact
from fastslow.model.resets import Reset
from fastslow.model.structure import TIME, real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.operations import AT_REST

#: Largest number of walls at which a model rests at the same time.
MOST_WALLS = 3


def check_resets(
    resets: Sequence[Reset],
    names: Sequence[str],
    rates: Mapping[str, sp.Expr],
    laws: Mapping[str, sp.Expr],
    interfaces: Sequence[sp.Expr],
    values: Mapping[sp.Symbol, float],
) -> None:
    """Check that resets stop the motion into their walls, and warn of unusual ones.

    Parameters
    ----------
    resets : sequence of Reset
    names : sequence of str
        States and slow states.
    rates, laws : mapping
        Of one region, or as written.
    interfaces : sequence of sympy.Expr
        Switching functions.
    values : mapping
        Parameter values.

    Raises
    ------
    ModelError
        For a reset beyond its wall, one after which the motion into the wall continues, or one
        whose relation or values are not finite.
    """
    for reset in resets:
        for written in reset.expressions:
            if written.subs(values).has(sp.zoo, sp.nan, sp.oo, -sp.oo):
                used = sorted(s.name for s in written.free_symbols & {*values})
                where = ", ".join(f"{name} = {values[real(name)]:g}" for name in used)
                raise ModelError(
                    f"reset {reset}: {written} is not finite at {where}; expected parameter values "
                    "at which it is"
                )
        if reset.clock is not None:
            continue
        speed = drift(reset.function, names, [rates[n] for n in names], laws)
        if speed.has(sp.Piecewise):
            # of regions that are not formed
            continue
        after = _after(reset)
        height = reset.function.xreplace(after)
        left = expanded(height - reset.function)
        beyond = height.subs(values)
        if _number(beyond) > 0:
            raise ModelError(
                f"reset {reset}: the state after it is beyond the wall, where {reset.function} = "
                f"{_number(beyond):g}; expected a state on the wall or outside of it"
            )
        if any(expanded(h.xreplace(after) - h) != 0 for h in interfaces):
            # the motion after it may be that of another region
            continue
        onward = speed.xreplace(after).subs(values)
        if left != 0 and beyond == 0 and _number(onward) > 0:
            raise ModelError(
                f"reset {reset}: the state after it is on the wall, and moves into it; expected "
                "one on the other side, or a motion away from the wall"
            )
        if left != 0:
            continue
        share = cancelled(exact(-speed.xreplace(after) / speed)) if speed != 0 else sp.S.Zero
        number = _number(share.subs(values))
        if number < 0:
            raise ModelError(
                f"reset {reset}: the motion into the wall continues after it, at "
                f"{-number:g} times the speed; expected the opposite direction"
            )
        if number > 1:
            warnings.warn(
                f"reset {reset}: the motion after it is {number:g} times faster than before",
                UserWarning,
                stacklevel=6,
            )
        fixed = drift(reset.function, names, [rates[n] for n in names])
        fixed -= reset.function.diff(TIME)
        if fixed != speed and not _identity_on(reset, speed) and _identity_on(reset, fixed):
            warnings.warn(
                f"reset {reset}: its wall moves, but the reset reverses the absolute velocity; "
                "with the velocity s of the wall, write v: s - r*(v - s)",
                UserWarning,
                stacklevel=6,
            )


def _number(expression: sp.Expr) -> float:
    """The value of a real number, NaN of any other expression."""
    known = expression.is_number and expression.is_extended_real
    return float(expression) if known else math.nan


def _after(reset: Reset) -> dict[sp.Expr, sp.Expr]:
    return {real(n): value for n, value in reset.jump.items()}


def _identity_on(reset: Reset, speed: sp.Expr) -> bool:
    """Check that a reset changes nothing where a speed vanishes."""
    return speed != 0 and all(
        vanishes_on(value - state, speed) for state, value in _after(reset).items()
    )


@dataclass(frozen=True)
class Rest:
    """The motion at rest on one or several walls, and the state in which it begins.

    Parameters
    ----------
    motion : Motion
        Its name joins the region and the walls; its bounds are −1 and the acceleration into
        the wall without contact, of which the second is positive while the contact is.
    walls : tuple of int
    entry : tuple of sympy.Expr
        State on the walls with zero relative velocity, of a state near it.
    speeds : tuple of sympy.Expr
        h' of every wall.
    pushes : tuple of tuple of sympy.Expr
        For every wall the direction P of the state with ∇h'·P = 1, and 0 for the other walls:
        the rates at rest are f − Σ P h''.
    """

    motion: Motion
    walls: tuple[int, ...]
    entry: tuple[sp.Expr, ...]
    speeds: tuple[sp.Expr, ...]
    pushes: tuple[tuple[sp.Expr, ...], ...]

    @property
    def forces(self) -> tuple[sp.Expr, ...]:
        """Contact force of every wall: the acceleration into it without this contact."""
        # those of sliding are first
        return self.motion.bounds[-2 * len(self.walls) :][1::2]


def rests_of(
    regions: Sequence[Motion],
    resets: Sequence[Reset],
    names: Sequence[str],
    forcing: Sequence[str],
    max_walls: int = MOST_WALLS,
) -> tuple[Rest, ...]:
    """Derive the motions at rest: on every wall whose reset R is the identity where h' = 0.

    Then R(z) = z + W h', and at rest, h = h' = 0, the rates f become f − W λ with
    λ = h''/(∇h'·W): the contact force that keeps h'' = 0. On several walls λ solves the linear
    system of all of them.

    Parameters
    ----------
    regions : sequence of Motion
    resets : sequence of Reset
    names, forcing : sequence of str
        States with slow states, and slow quantities.
    max_walls : int
        Largest number of walls at the same time.
    """
    found = []
    symbols = [real(n) for n in names]
    for region in regions:
        laws = dict(zip(forcing, region.laws, strict=True))
        rates = [exact(rate) for rate in region.rates]
        pushed: dict[int, tuple[sp.Expr, list[sp.Expr]]] = {}
        for k, reset in enumerate(resets):
            speed = drift(exact(reset.function), names, rates, laws)
            pushes = _pushes(reset, speed, symbols)
            if pushes is not None:
                pushed[k] = speed, pushes
        for count in range(1, min(len(pushed), max_walls) + 1):
            for walls in combinations(pushed, count):
                rest = _rest(region, walls, pushed, resets, names, rates, laws)
                if rest is not None:
                    found.append(rest)
    return tuple(found)


def _pushes(reset: Reset, speed: sp.Expr, symbols: Sequence[sp.Symbol]) -> list[sp.Expr] | None:
    """W of a reset z + W h', None if it has not this form."""
    if not _identity_on(reset, speed):
        return None
    after = _after(reset)
    pushes = []
    for symbol in symbols:
        change = exact(after.get(symbol, symbol) - symbol)
        if change == 0:
            pushes.append(sp.S.Zero)
            continue
        push = cancelled(sp.together(change / speed))
        below = sp.fraction(push)[1]
        if not below.is_number and vanishes_on(below, speed):
            return None
        pushes.append(push)
    return pushes


def _rest(
    region: Motion,
    walls: tuple[int, ...],
    pushed: Mapping[int, tuple[sp.Expr, list[sp.Expr]]],
    resets: Sequence[Reset],
    names: Sequence[str],
    rates: Sequence[sp.Expr],
    laws: Mapping[str, sp.Expr],
) -> Rest | None:
    symbols = [real(n) for n in names]
    speeds = [pushed[k][0] for k in walls]
    pushes = [pushed[k][1] for k in walls]
    matrix = sp.Matrix(
        [[_dot([s.diff(z) for z in symbols], push) for push in pushes] for s in speeds]
    )
    if cancelled(matrix.det()) == 0 or any(cancelled(matrix[k, k]) == 0 for k in range(len(walls))):
        return None
    accelerations = sp.Matrix([drift(s, names, rates, laws) for s in speeds])
    inverse = matrix.inv().applyfunc(cancelled)
    force, braking = inverse * accelerations, inverse * sp.Matrix(speeds)
    at_rest = [
        cancelled(rate - _dot(force, [push[i] for push in pushes])) for i, rate in enumerate(rates)
    ]
    bounds: list[sp.Expr] = []
    for k in range(len(walls)):
        bounds += [sp.Integer(-1), cancelled(force[k] * matrix[k, k])]
    entry = [
        cancelled(z - _dot(braking, [push[i] for push in pushes])) for i, z in enumerate(symbols)
    ]
    entry = on_walls(entry, [resets[k] for k in walls], symbols)
    name = region.name + AT_REST + " and ".join(resets[k].wall for k in walls)
    return Rest(
        Motion(
            name,
            region.signs,
            tuple(at_rest),
            region.laws,
            region.corners,
            tuple(bounds),
        ),
        walls,
        tuple(entry),
        tuple(speeds),
        tuple(
            tuple(
                cancelled(_dot(column, [push[i] for push in pushes])) for i in range(len(symbols))
            )
            for column in (list(inverse[:, k]) for k in range(len(walls)))
        ),
    )


def on_walls(
    entry: list[sp.Expr], walls: Sequence[Reset], symbols: Sequence[sp.Symbol]
) -> list[sp.Expr]:
    """Return values of all states on walls, before the velocities are evaluated there."""
    for wall in walls:
        function = wall.function
        fixed = next((z for z in symbols if z in function.free_symbols), None)
        slope = None if fixed is None else function.diff(fixed)
        if fixed is not None and slope is not None and not slope.has(*symbols):
            on_wall = expanded(fixed - function / slope)
            entry = [e.xreplace({fixed: on_wall}) for e in entry]
    return entry


@dataclass(frozen=True)
class RestOnWall:
    """The rest on one wall, whatever the region: the rates f become f − P h''.

    Parameters
    ----------
    speed : sympy.Expr
        h'.
    push : tuple of sympy.Expr
        P, with ∇h'·P = 1.
    entry : tuple of sympy.Expr
        As in `Rest`.
    """

    speed: sp.Expr
    push: tuple[sp.Expr, ...]
    entry: tuple[sp.Expr, ...]


def contacts_of(
    walls: Sequence[Reset],
    names: Sequence[str],
    rates: Sequence[sp.Expr],
    laws: Mapping[str, sp.Expr],
) -> dict[int, RestOnWall]:
    """Derive the rest on every wall whose speed is the same in all regions; see `rests_of`.

    Parameters
    ----------
    walls : sequence of Reset
    names : sequence of str
        States with slow states.
    rates : sequence of sympy.Expr
        As written, with their pieces.
    laws : mapping
        Of the slow quantities.

    Returns
    -------
    dict
        By the number of the wall.
    """
    symbols, found = [real(n) for n in names], {}
    for k, wall in enumerate(walls):
        speed = exact(drift(wall.function, names, rates, laws))
        pushes = None if speed.has(sp.Piecewise) else _pushes(wall, speed, symbols)
        if pushes is None:
            continue
        used = zip(symbols, pushes, strict=True)
        size = cancelled(sp.Add(*(speed.diff(z) * push for z, push in used if push != 0)))
        if size == 0:
            continue
        push = tuple(cancelled(one / size) if one != 0 else one for one in pushes)
        entry = [z - p * speed if p != 0 else z for z, p in zip(symbols, push, strict=True)]
        whole = on_walls([cancelled(e) for e in entry], [wall], symbols)
        found[k] = RestOnWall(speed, push, tuple(whole))
    return found


@dataclass(frozen=True)
class Held:
    """The motion at rest on walls, with a stable return to them.

    Parameters
    ----------
    rest : Rest
    signs : tuple of int
        Sign of every interface, 0 where it does not bound the motion.
    rates : tuple of sympy.Expr
        F = f − Σ P (h'' + h + 2h'), so that h'' = −h − 2h' along F: its zeros are the equilibria
        on the walls.
    """

    rest: Rest
    signs: tuple[int, ...]
    rates: tuple[sp.Expr, ...]

    @property
    def region(self) -> int:
        """Number of the region."""
        return self.rest.motion.corners[0]


def held_motions(
    regions: Sequence[Motion],
    interfaces: Sequence[sp.Expr],
    walls: Sequence[Reset],
    names: Sequence[str],
    max_walls: int = MOST_WALLS,
) -> Iterator[Held]:
    """Yield the motions held against walls of a model without slow quantities.

    Of interfaces that vanish at rest, as of dry friction in contact, the side moving away counts.

    Parameters
    ----------
    regions : sequence of Motion
    interfaces : sequence of sympy.Expr
        Switching functions.
    walls : sequence of Reset
    names : sequence of str
        States.
    max_walls : int
        Largest number of walls at the same time.
    """
    for rest in rests_of(regions, walls, names, (), max_walls):
        signs = list(rest.motion.signs)
        for j, h in enumerate(interfaces):
            share = next((cancelled(h / s) for s in rest.speeds if vanishes_on(h, s)), None)
            if share is not None and share.is_number:
                # 2 where the other side counts
                signs[j] = 0 if float(share) * signs[j] < 0 else 2
            elif share is not None:
                signs[j] = 2
        if 2 in signs:
            continue
        pulls = [walls[k].function + 2 * s for k, s in zip(rest.walls, rest.speeds, strict=True)]
        rates = tuple(
            expanded(rate - _dot([push[i] for push in rest.pushes], pulls))
            for i, rate in enumerate(rest.motion.rates)
        )
        yield Held(rest, tuple(signs), rates)


def quasi_static(
    resets: Sequence[Reset],
    rates: Mapping[str, sp.Expr],
    laws: Mapping[str, sp.Expr],
    states: Sequence[str],
    kept: Sequence[str],
) -> tuple[Reset, ...]:
    """Return resets for a model in which slow quantities are constant.

    A reset z + W h' of a wall that moves with slow quantities becomes z + W h' with the h' of the
    resting wall.

    Parameters
    ----------
    resets : sequence of Reset
    rates, laws : mapping
        Of all states and slow states, and of all slow quantities.
    states, kept : sequence of str
        States, and slow quantities that remain functions of time.
    """
    names = list(rates)
    found = []
    for reset in resets:
        speed = drift(reset.function, names, list(rates.values()), laws)
        fixed = drift(
            reset.function, states, [rates[n] for n in states], {n: laws[n] for n in kept}
        )
        if reset.clock is None and fixed != speed and not speed.has(sp.Piecewise):
            pushes = _pushes(reset, exact(speed), [real(n) for n in names])
            if pushes is not None:
                by_name = dict(zip(names, pushes, strict=True))
                jump = {n: expanded(real(n) + by_name[n] * fixed) for n in reset.jump}
                reset = replace(reset, jump=NamedMapping("state", jump))
        found.append(reset)
    return tuple(found)


def _dot(one: Sequence[sp.Expr], other: Sequence[sp.Expr]) -> sp.Expr:
    return sp.Add(*(a * b for a, b in zip(one, other, strict=True)))
