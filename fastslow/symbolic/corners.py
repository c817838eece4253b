"""Corners of the critical manifold: where the slow flow of one variable meets an interface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from fastslow.model.interfaces import Region
from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import real
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import CORNER, point_name
from fastslow.symbolic.closed_forms.boundaries import BoundaryForm
from fastslow.symbolic.deriving import derive
from fastslow.symbolic.folded_points import CLOSED_FORM_DIGITS, ZERO_NUMBER


@dataclass(frozen=True, repr=False, kw_only=True)
class CornerSide(Displayed):
    """The slow flow of one region at a corner.

    Parameters
    ----------
    region : str
    attracting : bool
        Whether all eigenvalues of f_x have negative real part.
    speed : float
        Rate of the distance to the interface in the reduced flow, dh/dt with h > 0 in the region:
        negative where the flow reaches the corner. Infinite where det f_x vanishes.
    """

    region: str
    attracting: bool
    speed: float


@dataclass(frozen=True, repr=False, kw_only=True)
class CornerPoint(Displayed):
    """An equilibrium of the fast rates on an interface, with the slow flow on both sides.

    Parameters
    ----------
    code : str
        ``"BC"`` where an attracting and another sheet meet in a non-smooth fold, else empty.
    form : BoundaryForm
        The place in closed form.
    interface : str
    values : NamedMapping of float
        The variables at the parameter values of the model.
    sides : tuple of CornerSide
    passage : str
        ``"passes"`` from one region to the other; ``"jumps"`` if the flow reaches the corner from
        both sides; ``"not reached"`` if it leaves on both; ``"corner-singular"`` where ∇h·x' = 0
        on a side.
    parameter : str
        A parameter in which the slow rate at the corner is affine, empty without one.
    value : float
        Its value at which the slow rate vanishes, so that the equilibrium is at the corner.
    """

    code: str
    form: BoundaryForm
    interface: str
    values: NamedMapping[float]
    sides: tuple[CornerSide, CornerSide]
    passage: str
    parameter: str
    value: float

    @property
    def words(self) -> str:
        """The corner with its passage."""
        at = ", ".join(f"{n} = {v:.6g}" for n, v in self.values.items())
        kinds = ["attracting" if s.attracting else "repelling" for s in self.sides]
        named = ", ".join(f"{s.region} {k}" for s, k in zip(self.sides, kinds, strict=True))
        name = point_name(self.code) if self.code else "passage"
        rest = f"; slow rate zero at {self.parameter} = {self.value:.9g}" if self.parameter else ""
        return f"{name} on {self.interface} at {at} ({named}): {self.passage}{rest}"


def corner_points(model: Model, varied: Sequence[str]) -> tuple[CornerPoint, ...]:
    """Return the corners of a model with one slow state, at its parameter values.

    Parameters
    ----------
    model : Model
    varied : sequence of str
        Parameters of which one is solved for.
    """
    if len(model.slow_states) != 1 or model.forcing or not model.interfaces:
        return ()
    found = derive(model.frozen()).boundary_equilibria
    made = [_corner(model, one, varied) for one in found if one.continuous and not one.equations]
    return tuple(one for one in made if one is not None)


def _corner(model: Model, form: BoundaryForm, varied: Sequence[str]) -> CornerPoint | None:
    """Return the corner at a boundary equilibrium, None if it is not real, or not on the border."""
    (slow,) = model.slow_states
    place = {real(n): e for n, e in (*form.state.items(), *form.parameters.items())}
    known = {real(n): sp.Float(v, CLOSED_FORM_DIGITS) for n, v in model.parameters.items()}
    names = (*model.states, slow)
    if any(real(name) not in place for name in names):
        return None
    values = [sp.N(place[real(n)].xreplace(known)) for n in names]
    if not all(v.is_real for v in values) or form.admissible.xreplace(known) != sp.true:
        return None
    at = NamedMapping("variable", dict(zip(names, map(float, values), strict=True)))
    regions = [model.regions[name] for name in form.regions[:2]]
    sides = tuple(_side(model, region, form.interface, at) for region in regions)
    rate = exact(regions[0].rates[slow]).xreplace(place)
    parameter, value = _zero_of(rate, varied, known)
    one, other = sides
    folds = one.attracting != other.attracting
    return CornerPoint(
        code=CORNER if folds else "",
        form=form,
        interface=form.interface,
        values=at,
        sides=(one, other),
        passage=_passage(one.speed, other.speed),
        parameter=parameter,
        value=value,
    )


def _side(model: Model, region: Region, interface: str, at: Mapping[str, float]) -> CornerSide:
    """Return the stability of a side, and the speed of its reduced flow from the interface."""
    (slow,) = model.slow_states
    x, y = [real(n) for n in model.states], real(slow)
    place = {real(n): sp.Float(v, CLOSED_FORM_DIGITS) for n, v in model.parameters.items()}
    place |= {real(n): sp.Float(v, CLOSED_FORM_DIGITS) for n, v in at.items()}
    f = sp.Matrix([exact(region.rates[n]) for n in model.states])
    h = region.signs[interface] * exact(model.interfaces[interface].function)

    def numbers(matrix: sp.Matrix) -> np.ndarray:
        entries = [float(sp.N(e.xreplace(place))) for e in matrix]
        return np.array(entries).reshape(matrix.shape)

    inner, push = numbers(f.jacobian(x)), numbers(f.diff(y))[:, 0]
    g = float(sp.N(exact(region.rates[slow]).xreplace(place)))
    gradient = numbers(sp.Matrix([h]).jacobian([*x, y]))[0]
    spectrum = np.linalg.eigvals(inner)
    size = np.abs(inner).max() if inner.any() else 1.0
    if abs(np.linalg.det(inner / size)) <= ZERO_NUMBER:
        speed = np.inf
    else:
        speed = float(gradient[:-1] @ -np.linalg.solve(inner, push) * g + gradient[-1] * g)
    return CornerSide(region=region.name, attracting=bool((spectrum.real < 0).all()), speed=speed)


def _passage(one: float, other: float) -> str:
    if one == 0.0 or other == 0.0 or np.isinf(one) or np.isinf(other):
        return "corner-singular"
    if one < 0.0 and other < 0.0:
        return "jumps"
    return "not reached" if one > 0.0 and other > 0.0 else "passes"


def _zero_of(
    rate: sp.Expr, varied: Sequence[str], known: Mapping[sp.Symbol, sp.Expr]
) -> tuple[str, float]:
    """Return the first parameter in which a rate is affine, and its zero."""
    for name in varied:
        symbol = real(name)
        slope = sp.diff(rate, symbol)
        if slope != 0 and symbol not in slope.free_symbols:
            others = {s: v for s, v in known.items() if s != symbol}
            slope, rest = (sp.N(e.xreplace(others)) for e in (slope, rate.subs(symbol, 0)))
            if slope.is_real and slope != 0 and rest.is_real:
                return name, float(-rest / slope)
    return "", float("nan")
