"""The delay of the jump at a smooth fold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.normal_forms import cusp_form, forms_at, null_vectors
from fastslow.errors import ArgumentError, ModelError
from fastslow.model.model import Model
from fastslow.passage.sites import (
    Site,
    drift,
    level_of,
    named_level,
    require_code,
    site_of,
    wrong_way,
)
from fastslow.results.delays import FoldDelay
from fastslow.results.points import SpecialPoint
from fastslow.simulation.settings import Integration
from fastslow.simulation.trajectories import simulate

Array = NDArray[np.float64]

#: First zero of Ai(−s), DLMF 9.9.
OMEGA_0 = 2.338107410459767

#: ∫₋∞^(Ω₀−z) −A'³/A ds / A'(Ω₀)² = ln(1/z) + MATCHING as z → 0, with A(s) = Ai(−s). By parts it
#: is −½ ln A'(Ω₀)² − ½ + ∫₋∞^Ω₀ A² ln A ds / A'(Ω₀)².
MATCHING = -1.0085182549893932

#: Jumps are timed from this part of the way on which the normal form holds: much nearer to the
#: fold rounding, which grows as 1/Y³, is larger than what extrapolation leaves.
NEAR = 1e-3

#: A coefficient below this times its terms counts as zero.
ZERO = 1e-9


@dataclass(frozen=True)
class FoldForm:
    """y' = a y² + b μ + c y³ + g μ y on the centre manifold, and how it lies in the states.

    Parameters
    ----------
    a, b, c, g : float
    along, bend : ndarray, shape (n,)
        The state is x* + y·along + ½ y²·bend.
    slowest : float
        Smallest |Re λ| of the other eigenvalues, infinite for one state.
    """

    a: float
    b: float
    c: float
    g: float
    along: Array
    bend: Array
    slowest: float


def fold_delay(
    point: SpecialPoint,
    rate: float,
    *,
    level: Mapping[Any, float] | None = None,
    parameter: object = None,
    model: Model | None = None,
) -> FoldDelay:
    """How far past a fold a drifting parameter is when the trajectory jumps.

    On the centre manifold of the fold y' = a y² + b μ + c y³ + g μ y with μ = rate·t.
    Its leading part is a Riccati equation whose solution −A'/A, A(s) = Ai(−s), ends
    at the first zero Ω₀ = 2.33810741 of the Airy function:

        delay = Ω₀ |ab|^(−1/3) |rate|^(2/3) + (c/(3a²)) |rate| ln |rate| + O(rate).

    With a level, of a state whose value tells when the jump is done, the term of
    order rate is known too, by matching to the jump of the frozen model, which is
    simulated; the error is then O(rate^(4/3)).

    Parameters
    ----------
    point : SpecialPoint
        A fold, code LP.
    rate : float
        Of the parameter, with its sign.
    level : mapping, optional
        One state and its value, e.g. ``{"x": 1.0}``.
    parameter : str or Symbol, optional
        What drifts, by default the parameter of the point's diagram.
    model : Model, optional
        For a point that was read from a file: its model.

    Returns
    -------
    FoldDelay

    Raises
    ------
    ArgumentError
        For a point of another code, a rate of zero or towards the stable sheet, a
        degenerate fold (a = 0, as at a cusp; b = 0, where the parameter does not
        unfold it; a double zero eigenvalue), or a fold whose sheets are unstable.

    References
    ----------
    E. F. Mishchenko and N. Kh. Rozov, Differential Equations with Small Parameters
    and Relaxation Oscillations, Plenum 1980. R. Haberman, SIAM J. Appl. Math. 37,
    69-106, 1979. M. Krupa and P. Szmolyan, SIAM J. Math. Anal. 33, 286-314, 2001.

    Examples
    --------
    >>> import fastslow as fs
    >>> fast = fs.systems.cusp().frozen()
    >>> fold = fs.continue_equilibria(fast, "p", over=(-1, 1)).folds[0]
    >>> law = fold_delay(fold, 1e-6, level={"x": 0.5})
    >>> round(law.coefficients[0], 8), round(law.coefficients[1], 8), f"{law.delay:.4e}"
    (1.94690271, -0.11111111, '1.9582e-04')
    """
    require_code(point, "LP", "the delay of a fold")
    speed = drift(rate)
    site = site_of(point, parameter, model)
    height = level_of(site, level)
    form = fold_form_of(site)
    if form.a * form.b * speed < 0:
        raise wrong_way(site, speed)
    d, product = form.c / form.a**2, abs(form.a * form.b)
    first = OMEGA_0 * product ** (-1.0 / 3.0)
    scale = (product * abs(speed)) ** (1.0 / 3.0)
    delay, third, words = first * abs(speed) ** (2.0 / 3.0), math.nan, _UNBOUNDED
    error = _smallness(form, d, scale)
    if height is not None:
        eta = _along(form, *height) / scale
        if eta <= 2.0:
            delay = airy_passage(eta) * abs(speed) / scale
            words = "leading order: the level lies within the slow part of the passage"
        else:
            jump = jump_time(site, form, height)
            # the inner solution to first order, matched to the jump
            third = d * math.log(product) / 3.0 - d * MATCHING + jump
            third -= form.g / (2.0 * form.a * form.b)
            words = (
                f"leading order: no jump of the frozen model to {_words(site, height)} was found"
            )
            if math.isfinite(jump):
                delay += abs(speed) * (d / 3.0 * math.log(abs(speed)) + third)
                # what the level sees of the end of the inner solution
                delay += (airy_passage(eta) + 1.0 / eta - OMEGA_0) * abs(speed) / scale
                words, error = "to the order of the rate", error**2
    return FoldDelay(
        point=point,
        parameter=site.field.parameter,
        rate=speed,
        delay=delay,
        validity=f"{words}; relative error of the order of {error:.1g}",
        quadratic=form.a,
        slope=form.b,
        cubic=form.c,
        mixed=form.g,
        coefficients=(first, d / 3.0, third),
        level=named_level(site, height),
    )


def jump_time(site: Site, form: FoldForm, level: tuple[int, float]) -> float:
    """Finite part of the time of the jump in the frozen model, from the fold to a level.

    From Y = a y on the unstable side the frozen model needs a time T(Y) that grows
    as 1/Y + (c/a²) ln Y towards the fold; with those terms taken off, and with the
    exact time of the cubic normal form in their place, it is simulated from two
    small Y and extrapolated. nan where the level is not reached.
    """
    d = form.c / form.a**2
    near = NEAR / max(abs(d), 1.0 / form.slowest, _turning(form), 1.0 / _along(form, *level))
    model = site.field.model.ramped(site.field.parameter, 0.0, float(site.u[-1]))
    found = []
    for y in (near, 0.5 * near):
        past = y / form.a
        state = site.u[:-1] + past * form.along + 0.5 * past**2 * form.bend
        try:
            run = simulate(model, state, t=(0.0, 10.0 / y), integration=Integration(rtol=1e-15))
        except ModelError:
            return math.nan
        number, height = level
        hits = run.section(site.field.model.states[number], float(site.u[number]) + height)
        if not len(hits):
            return math.nan
        found.append(float(hits.times[0]) - 1.0 / y - d * math.log(y / (1.0 + d * y)))
    return 2.0 * found[1] - found[0]


def _turning(form: FoldForm) -> float:
    """How soon the centre manifold bends, by Y."""
    return float(np.abs(form.bend).max() / (abs(form.a) * np.abs(form.along).max()))


def _words(site: Site, level: tuple[int, float]) -> str:
    number, height = level
    return f"{site.field.model.states[number]} = {float(site.u[number]) + height:g}"


_UNBOUNDED = "leading order, the order of the rate depends on the level of the jump"


def _smallness(form: FoldForm, d: float, scale: float) -> float:
    """The size of the slow part of the passage, by that at which the normal form holds."""
    return float(max(max(abs(d), 1.0 / form.slowest) * scale, np.finfo(float).eps))


def fold_form_of(site: Site) -> FoldForm:
    """The normal form on the centre manifold of a fold, by projection (Kuznetsov 2004, 5.4)."""
    region = site.region(site.point.regions[0])
    jacobian, slope = site.slopes(region)
    p, q = null_vectors(jacobian)
    label = site.point.label
    overlap = float(p @ q)
    if abs(overlap) <= ZERO:
        raise ArgumentError(
            f"{label} has a double zero eigenvalue (Bogdanov-Takens), where this law does not hold"
        )
    p = p / overlap
    forms = forms_at(site.field, region, site.u)
    bent = forms.form(q, q).real
    a, b = float(0.5 * (p @ bent)), float(p @ slope)
    if abs(a) <= ZERO * max(float(np.abs(p) @ np.abs(forms.form(abs(q), abs(q)))), 1e-300):
        raise ArgumentError(
            f"{label} is degenerate: its quadratic coefficient vanishes (a cusp); "
            "the delay there is not of the order rate^(2/3)"
        )
    if abs(b) <= ZERO * float(np.abs(p) @ np.abs(slope)) or b == 0.0:
        raise ArgumentError(
            f"{label} is not unfolded by {site.field.parameter}: the derivative of the rates by it "
            "has no part along the fold (the branch is vertical or crossed there)"
        )
    others = np.delete(*_without_zero(jacobian))
    if np.any(others.real >= 0):
        raise ArgumentError(
            f"no stable sheet ends at {label}: another eigenvalue has real part "
            f"{others.real.max():.3g}"
        )
    bordered = np.block([[jacobian, q[:, None]], [p[None, :], np.zeros((1, 1))]])
    bend = np.linalg.solve(bordered, np.append(-bent + (p @ bent) * q, 0.0))[:-1]
    lean = np.linalg.solve(bordered, np.append(-slope + b * q, 0.0))[:-1]
    mixed = float(p @ (site.mixed(region) @ q + forms.form(q, lean).real))
    slowest = float(np.abs(others.real).min(initial=math.inf))
    return FoldForm(a, b, cusp_form(forms, jacobian), mixed, q, bend, slowest)


def _without_zero(jacobian: Array) -> tuple[NDArray[np.complex128], int]:
    values = np.linalg.eigvals(jacobian).astype(complex)
    return values, int(np.argmin(np.abs(values)))


def _along(form: FoldForm, state: int, height: float) -> float:
    """a·y where the centre manifold reaches a level, the nearest way past the fold."""
    roots = np.roots([0.5 * form.bend[state], form.along[state], -height])
    found = form.a * roots[np.abs(roots.imag) <= 1e-12 * np.abs(roots)].real
    past = found[found > 0]
    if past.size:
        return float(past.min())
    return float(found.max()) if found.size else math.inf


def airy_passage(eta: float) -> float:
    """The s at which η' = η² + s, from the stable sheet, reaches η: −A'(s)/A(s) = η, A(s) = Ai(−s).

    Examples
    --------
    >>> round(airy_passage(0.0), 8), round(airy_passage(1e8), 7)
    (1.01879297, 2.3381074)
    """
    from scipy.optimize import brentq
    from scipy.special import airy, airye

    if math.isinf(eta):
        return OMEGA_0
    if eta < -500.0:
        # the quasi-static sheet, η = −√z − 1/(4 z) with z = −s, where the Airy functions overflow
        return -((eta + 0.25 / eta**2) ** 2)

    def left(s: float) -> float:
        # scaled alike, their ratio counts
        value, slope, _, _ = airye(-s) if s < 0.0 else airy(-s)
        return float(slope - eta * value)

    low = 1.0
    while left(low) > 0.0:
        low -= 1.0 + abs(low)
    return float(brentq(left, low, OMEGA_0, xtol=1e-15, rtol=1e-15))
