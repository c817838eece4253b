"""Delay of the jump at a smooth fold (saddle-node)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import Name
from fastslow.diagrams.points.normal_forms import (
    cusp_form,
    forms_at,
    null_vectors,
    solve_bordered,
)
from fastslow.errors import ArgumentError, ModelError
from fastslow.model.model import Model
from fastslow.passage.delays.delay_law import FORGOTTEN, LocalLaw
from fastslow.passage.delays.local_field import (
    TURN,
    Level,
    LocalField,
    delay_fields,
    level_of,
    named_level,
    passage_at,
    require_law,
    wrong_way,
)
from fastslow.passage.delays.local_passages import (
    EndOfPassage,
    LocalDrift,
    PassagePlace,
    bound_of,
    quasi_static,
    reached_delay,
)
from fastslow.passage.roots import sign_change
from fastslow.results.overlay.delays import Delay, FoldDelay
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Integration

Array = NDArray[np.float64]

#: First zero of Ai(−s), DLMF 9.9.
OMEGA_0 = 2.338107410459767

#: ∫₋∞^(Ω₀−z) −A'³/A ds / A'(Ω₀)² = ln(1/z) + MATCHING as z → 0, with A(s) = Ai(−s). By parts it
#: is −½ ln A'(Ω₀)² − ½ + ∫₋∞^Ω₀ A² ln A ds / A'(Ω₀)².
MATCHING = -1.0085182549893932

#: Initial distance of a jump relative to the validity of the normal form, and the number of
#: halvings; rounding grows as 1/Y³.
JUMP_START, JUMP_HALVINGS = 0.4, 6

#: Tolerance of the extrapolated limit, in units of the time of a jump.
LIMIT_TOLERANCE = 1e-8

#: Level, in units of δ, below which the jump ends within the slow part of the passage.
SLOW_PART = 2.0

#: Distances before the fold, in units of δ, at which the integrated passage may start: initial
#: transients decay as exp(−4/3 s^(3/2)), from the last one by exp(−40).
DISTANCES_BEFORE = (1.0, 1.5, 2.0, 3.0, 4.0, 5.5, 7.5, 9.65)

#: Durations of the simulation of a jump beyond 1/Y, relative to it, tried in order, so that the
#: motion after the jump is not simulated unnecessarily.
JUMP_DURATIONS = (0.25, 1.0, 9.0)

#: Points per step of a run at which the sign of the drift is checked.
DRIFT_CHECKS = 4

#: Gauss nodes per step of a run, whose series has order 16.
GAUSS = np.polynomial.legendre.leggauss(10)

#: Size of a zero coefficient relative to its terms.
ZERO_COEFFICIENT = 1e-9


@dataclass(frozen=True)
class FoldForm:
    """Normal form y' = a y² + b μ + c y³ + g μ y on the center manifold, with its embedding.

    Parameters
    ----------
    a, b, c, g : float
    along, bend, lean : ndarray, shape (n,)
        The state is x* + y·along + ½ y²·bend + μ·lean.
    slowest : float
        Smallest |Re λ| of the other eigenvalues, infinite for one state.
    """

    a: float
    b: float
    c: float
    g: float
    along: Array
    bend: Array
    lean: Array
    slowest: float


def fold_delay(
    point: SpecialPoint,
    rate: float | Drift,
    *,
    level: Mapping[Any, float] | str | None = None,
    parameter: Name | None = None,
    model: Model | None = None,
) -> FoldDelay:
    """Delay of the jump in a slow passage through a fold (saddle-node).

    On the center manifold of the fold y' = a y² + b μ + c y³ + g μ y with μ' = rate + k y + ….
    In units of δ = (|ab rate|)^(1/3), with μ as the independent variable, its leading part is
    a Riccati equation whose solution −A'/A, A(s) = Ai(−s), ends at the first zero
    Ω₀ = 2.33810741 of the Airy function; the feedback κ = k/(a rate) acts like a part of the
    cubic term:

        delay = Ω₀ |ab|^(−1/3) |rate|^(2/3) + ((c/a² − κ)/3) |rate| ln |rate| + O(rate).

    With a level that ends the jump, the value of a state or the extremum of the slow
    quantity, the term of order rate follows by matching to the simulated jump of the frozen
    model, with the drift integrated along it. A rate that varies with time (c₁) or with the
    parameter (c₂) adds (2/5) Ω₀² (c₁/rate + c₂) |rate|/δ². The neglected terms are
    O(rate^(4/3)); ``error`` bounds them by numerical integration of the same passage. Where the
    other states relax more slowly than the fold is passed, in the time 1/δ, there is no law, and
    with a level the delay is that of the integrated passage.

    Parameters
    ----------
    point : SpecialPoint
        A fold, code LP.
    rate : float or Drift
        Signed rate of the parameter.
    level : mapping or "turn", optional
        One state and its value, e.g. ``{"x": 1.0}``, or the extremum of the parameter.
    parameter : str or Symbol, optional
        The drifting parameter, by default that of the point's diagram.
    model : Model, optional
        The model of a point that was read from a file.

    Returns
    -------
    FoldDelay

    Raises
    ------
    ArgumentError
        For a point of another code, a rate of zero or towards the stable branch, a
        degenerate fold (a = 0, as at a cusp; b = 0, where the parameter does not
        unfold it; a double zero eigenvalue), or a fold whose branches are unstable.

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
    require_law(point, LAW.name, "the delay at a fold")
    local, drift = passage_at(point, rate, parameter, model)
    height = level_of(local, level, drift)
    form = fold_form_of(local)
    if form.a * form.b * drift.rate < 0:
        raise wrong_way(local, drift.rate)
    speed, product = abs(drift.rate), abs(form.a * form.b)
    feedback, change = _moved(local, form, drift)
    # with μ as the independent variable, feedback contributes to the cubic and the mixed term
    kappa = feedback / (form.a * drift.rate)
    d, g = form.c / form.a**2 - kappa, form.g / (form.a * form.b) - kappa
    scale = (product * speed) ** (1.0 / 3.0)
    first = OMEGA_0 * product ** (-1.0 / 3.0)
    changed = 0.4 * OMEGA_0**2 * change * speed / scale**2
    delay, third = first * speed ** (2.0 / 3.0) + changed, math.nan
    words = "leading order; the term of order rate depends on the level that ends the jump"
    if height is not None:
        eta = _end(form, height, kappa) / scale
        slow = height != TURN and eta <= SLOW_PART
        jump = math.nan if slow else jump_time(local, form, drift, kappa, height)
        if slow:
            words = "to first order: the level is within the slow part of the passage"
            terms = (d * scale, g * scale, change / scale)
            delay = slow_part(eta, terms) * speed / scale
        elif math.isnan(jump):
            goal = "an extremum" if isinstance(height, str) else _words(local, height)
            words = f"leading order: no jump of the frozen model to {goal} was found"
        else:
            # the inner solution to first order, matched to the jump
            third = d * (math.log(product) / 3.0 - MATCHING) + jump - g / 2.0
            delay += speed * (d / 3.0 * math.log(speed) + third)
            if height != TURN:
                # effect of the level on the end of the inner solution
                delay += (airy_passage(eta) + 1.0 / eta - OMEGA_0) * speed / scale
            words = "to the order of the rate"
    passed, time = math.nan, math.nan
    if height is not None:
        passed, time = _passed(local, form, drift, height, scale)
    error, more = bound_of(local, delay, passed, drift)
    if form.slowest < scale:
        # the passage is not one on the center manifold
        delay, error = passed, math.nan
        words = (
            "no law: the other states relax more slowly than the fold is passed (rates "
            f"{form.slowest:.2g} and {scale:.2g})"
        )
        more = "" if math.isnan(passed) else "; the delay is that of the integrated passage"
    return FoldDelay(
        **delay_fields(local, drift),
        delay=delay,
        validity=words + more,
        error=error,
        delay_time=time if not drift.constant else math.nan,
        quadratic=form.a,
        slope=form.b,
        cubic=form.c,
        mixed=form.g,
        feedback=feedback,
        coefficients=(first, d / 3.0, third),
        level=named_level(local, height),
    )


def _moved(local: LocalField, form: FoldForm, drift: Drift) -> tuple[float, float]:
    """Feedback k in μ' = rate + k y + …, and the relative change of the rate with time and μ."""
    by_state = np.array([drift.by_state.get(n, 0.0) for n in local.field.model.states])
    change = drift.change / drift.rate + drift.by_value + float(by_state @ form.lean)
    return float(by_state @ form.along), change


def _end(form: FoldForm, level: Level, kappa: float) -> float:
    """a·y at the end of the jump, on the center manifold."""
    if isinstance(level, str):
        return -1.0 / kappa if kappa < 0.0 else math.inf
    return _along(form, *level)


def _passed(
    local: LocalField, form: FoldForm, drift: Drift, level: Level, scale: float
) -> tuple[float, float]:
    """Delay and time of the integrated passage; nan if the integration fails."""
    region, start = local.region(local.point.regions[0]), None
    for before in DISTANCES_BEFORE:
        mu = -before * drift.rate / scale
        if start is None:
            y = -math.copysign(math.sqrt(-form.b * mu / form.a), form.a)
            guess = y * form.along + 0.5 * y**2 * form.bend + mu * form.lean
        else:
            guess = start[:-1]
        found = quasi_static(local, drift, region, mu, guess)
        if found is None:
            break
        start = found
    place = None if start is None else PassagePlace(region, start, 0.0)
    return reached_delay(local, drift, place, EndOfPassage(level), 200.0 / scale)


def jump_time(local: LocalField, form: FoldForm, drift: Drift, kappa: float, level: Level) -> float:
    """Finite part of the time of the jump in the frozen model, from the fold to a level.

    Time is weighted by w'/rate, which gives the change of the slow quantity along the jump. From
    Y = a y on the unstable side the frozen model needs a time T(Y) that grows as
    1/Y + d ln Y towards the fold, d = c/a² − κ; after subtraction of these terms and with the
    exact time of the cubic normal form, the remainder is a series in Y. It is simulated from
    decreasing Y and extrapolated to 0 by Romberg's scheme. nan if the level is not reached.
    """
    cubic = form.c / form.a**2
    end = _end(form, level, kappa)
    bends = _turning(form, local.unit)
    usual = max(abs(cubic), abs(kappa), 1.0 / form.slowest, bends, 1.0 / end)
    y = JUMP_START / usual
    while not _inside(local, _past(local, form, y)):
        y *= 0.5
    best, change = math.nan, math.inf
    row: list[float] = []
    for _ in range(JUMP_HALVINGS + 1):
        gone = _gone(local, drift, _past(local, form, y), 1.0 / y, level)
        following = [gone - 1.0 / y - (cubic - kappa) * math.log(y / (1.0 + cubic * y))]
        for k, last in enumerate(row):
            following.append(following[k] + (following[k] - last) / (2.0 ** (k + 1) - 1.0))
        apart = abs(following[-1] - row[-1]) if row else math.inf
        if math.isnan(gone) or (len(row) > 2 and not apart < change):
            break
        best, change = following[-1], apart
        if change <= LIMIT_TOLERANCE * max(usual, abs(best)):
            break
        row, y = following, 0.5 * y
    return best


def _past(local: LocalField, form: FoldForm, y: float) -> Array:
    """State on the center manifold at Y past a fold, to second order."""
    past = y / form.a
    return np.asarray(local.u[:-1] + past * form.along + 0.5 * past**2 * form.bend)


def _inside(local: LocalField, state: Array) -> bool:
    """Whether a state at the fold's parameter is in the region of the fold."""
    region, count = local.region(local.point.regions[0]), len(local.field.interfaces)
    _, _, heights, _ = local.field.evaluate(region, np.append(state, local.u[-1]))
    return bool((local.field.signs[region, :count] * heights[:count] >= 0.0).all())


def _gone(local: LocalField, drift: Drift, state: Array, slow: float, level: Level) -> float:
    """∫ w' dt/rate along the jump of the frozen model from a state; nan if it does not end.

    Parameters
    ----------
    local : LocalField
    drift : Drift
    state : ndarray, shape (n,)
    slow : float
        Its duration to leading order.
    level : (int, float) or "turn"
    """
    model = local.field.model.with_ramp(local.field.parameter, 0.0, float(local.u[-1]))
    speed = LocalDrift(local, drift)
    # beyond the level a stiff escape may take many steps
    stop = () if isinstance(level, str) else (_above(local, level),)
    for longer in JUMP_DURATIONS:
        span = (0.0, (1.0 + longer) * slow)
        try:
            run = simulate(model, state, t=span, stop=stop, integration=Integration(rtol=1e-15))
        except ModelError:
            return math.nan
        done = _done(run, local, speed, level)
        if not (math.isnan(done) and run.outcome):
            break
    return done if drift.constant or math.isnan(done) else _integral(run, speed, done)


def _done(run: Trajectory, local: LocalField, speed: LocalDrift, level: Level) -> float:
    """Time at which a jump of the frozen model reaches a level, else nan."""
    if isinstance(level, str):
        return _turned(run, speed)
    return run.span[1] if run.outcome.code == "stopped" else math.nan


def _above(local: LocalField, level: tuple[int, float]) -> sp.Expr:
    """Height of the state above a level."""
    number, height = level
    return sp.Symbol(local.field.model.states[number]) - (float(local.u[number]) + height)


def _turned(run: Trajectory, speed: LocalDrift) -> float:
    """First zero of w' along a jump of the frozen model, else nan."""

    def relative(time: float) -> float:
        return float(speed.on_a_path(run(np.array([time])).T)[0] / speed.drift.rate)

    parts = np.arange(DRIFT_CHECKS) / DRIFT_CHECKS
    times = np.append((run.steps[:, :1] + run.steps[:, 1:2] * parts).ravel(), run.span[1])
    back = np.flatnonzero(speed.on_a_path(run(times).T) / speed.drift.rate <= 0.0)
    if not len(back) or back[0] == 0:
        return math.nan
    before, after = times[back[0] - 1 : back[0] + 1].tolist()
    return sign_change(relative, before, after, 1e-15 * run.span[1])


def _integral(run: Trajectory, speed: LocalDrift, until: float) -> float:
    """∫ w' dt/rate along a jump of the frozen model, by Gauss quadrature on every step."""
    nodes, weights = GAUSS
    edges = np.append(run.step_starts[run.step_starts < until], until)
    half = 0.5 * np.diff(edges)
    times = (0.5 * (edges[1:] + edges[:-1]))[:, None] + half[:, None] * nodes
    rate = speed.on_a_path(run(times.ravel()).T).reshape(times.shape) / speed.drift.rate
    return float(((rate @ weights) * half).sum())


def _turning(form: FoldForm, unit: Array) -> float:
    """Relative curvature of the center manifold by Y, with each state in its unit."""
    bend, along = (np.abs(v / unit).max() for v in (form.bend, form.along))
    return float(bend / (abs(form.a) * along))


def _words(local: LocalField, level: tuple[int, float]) -> str:
    number, height = level
    return f"{local.field.model.states[number]} = {float(local.u[number]) + height:g}"


def fold_form_of(local: LocalField) -> FoldForm:
    """Normal form on the center manifold of a fold, by projection (Kuznetsov 2004, 5.4)."""
    region = local.region(local.point.regions[0])
    jacobian, slope = local.slopes(region)
    p, q = null_vectors(jacobian, local.unit)
    label = local.point.label
    overlap = float(p @ q)
    if abs(overlap) <= ZERO_COEFFICIENT * np.linalg.norm(p * local.unit) * np.linalg.norm(
        q / local.unit
    ):
        raise ArgumentError(
            f"{label} has a double zero eigenvalue (Bogdanov-Takens), where this law is not valid"
        )
    p = p / overlap
    forms = forms_at(local.field, region, local.u)
    bent = forms.form(q, q).real
    a, b = float(0.5 * (p @ bent)), float(p @ slope)
    if abs(a) <= ZERO_COEFFICIENT * max(
        float(np.abs(p) @ np.abs(forms.form(abs(q), abs(q)))), 1e-300
    ):
        raise ArgumentError(
            f"{label} is degenerate: its quadratic coefficient vanishes (a cusp); "
            "the delay is not of the order rate^(2/3)"
        )
    if abs(b) <= ZERO_COEFFICIENT * float(np.abs(p) @ np.abs(slope)) or b == 0.0:
        raise ArgumentError(
            f"{label} is not unfolded by {local.field.parameter}: the parameter derivative of the "
            "rates has no component along the critical mode (a vertical branch or a branch point)"
        )
    others = np.delete(*_without_zero(jacobian))
    if np.any(others.real >= 0):
        raise ArgumentError(
            f"no stable branch ends at {label}: another eigenvalue has real part "
            f"{others.real.max():.3g}"
        )
    bend = solve_bordered(jacobian, p, q, -bent + (p @ bent) * q)
    lean = solve_bordered(jacobian, p, q, -slope + b * q)
    mixed = float(p @ (local.mixed(region) @ q + forms.form(q, lean).real))
    slowest = float(np.abs(others.real).min(initial=math.inf))
    return FoldForm(a, b, cusp_form(forms, jacobian, local.unit), mixed, q, bend, lean, slowest)


def _without_zero(jacobian: Array) -> tuple[NDArray[np.complex128], int]:
    values = np.linalg.eigvals(jacobian).astype(complex)
    return values, int(np.argmin(np.abs(values)))


def _along(form: FoldForm, state: int, height: float) -> float:
    """a·y of the nearest intersection of the center manifold with a level past the fold."""
    roots = np.roots([0.5 * form.bend[state], form.along[state], -height])
    found = form.a * roots[np.abs(roots.imag) <= 1e-12 * np.abs(roots)].real
    past = found[found > 0]
    if past.size:
        return float(past.min())
    return float(found.max()) if found.size else math.inf


def slow_part(eta: float, terms: tuple[float, float, float]) -> float:
    """Solve η' = η² + m + c₁ η³ + c₂ m η − c₃ (m η² + m²) for the m at η, to first order in c.

    With η₀ = −A'/A and the integrating factor A², A(s) = Ai(−s), the solution is
    η₀ + A⁻² ∫ A² f dm, so that a value is reached earlier by the added term over η₀'.

    Examples
    --------
    >>> slow_part(0.5, (0.0, 0.0, 0.0)) == airy_passage(0.5)
    True
    """
    from scipy.integrate import quad
    from scipy.special import airy

    at = airy_passage(eta)
    if not any(terms) or at <= -DISTANCES_BEFORE[-1]:
        return at

    def added(m: float) -> float:
        value, minus_slope, _, _ = airy(-m)
        slope = -minus_slope
        cubic, mixed = -(slope**3) / value, -m * value * slope
        return float(terms[0] * cubic + terms[1] * mixed - terms[2] * m * (slope**2 + m * value**2))

    whole, _ = quad(added, -DISTANCES_BEFORE[-1], at, epsabs=1e-14, epsrel=1e-9, limit=200)
    value = float(airy(-at)[0])
    return float(at - whole / (value**2 * (eta**2 + at)))


def airy_passage(eta: float) -> float:
    """Solve −A'(s)/A(s) = η, A(s) = Ai(−s): the s at which η' = η² + s reaches η.

    Examples
    --------
    >>> round(airy_passage(0.0), 8), round(airy_passage(1e8), 7)
    (1.01879297, 2.3381074)
    """
    from scipy.special import airy, airye

    if math.isinf(eta):
        return OMEGA_0
    if eta < -500.0:
        # the quasi-static branch, η = −√z − 1/(4 z) with z = −s, where the Airy functions overflow
        return -((eta + 0.25 / eta**2) ** 2)

    def left(s: float) -> float:
        # scaled equally, only the ratio matters
        value, slope, _, _ = airye(-s) if s < 0.0 else airy(-s)
        return float(slope - eta * value)

    low = 1.0
    while left(low) > 0.0:
        low -= 1.0 + abs(low)
    return sign_change(left, low, OMEGA_0, 4e-16 * max(1.0, abs(low)))


class FoldLaw(LocalLaw):
    """The delay of the jump at a fold."""

    name = "fold"

    def at_point(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None,
        parameter: Name | None,
        model: Model | None,
    ) -> Delay:
        return fold_delay(point, rate, level=level, parameter=parameter, model=model)

    def settling_distance(self, local: LocalField, delay: Delay) -> float:
        # |λ| = 2 √(|ab| |μ|) next to the fold
        form = fold_form_of(local)
        pull = math.sqrt(abs(form.a * form.b))
        return float((0.75 * FORGOTTEN * abs(delay.rate) / pull) ** (2.0 / 3.0))


LAW = FoldLaw()
