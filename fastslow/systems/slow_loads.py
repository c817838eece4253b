"""Whether a slow load that changes sign carries the state of a system across a gap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import (
    finite_numbers,
    flag,
    instance,
    mapping,
    numbers,
    shown,
    text,
    validated,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.model.functions import numpy_function
from fastslow.model.model import Model
from fastslow.model.periods import frequencies
from fastslow.model.structure import TIME, real
from fastslow.results.trajectory.slow_loads import SlowLoad
from fastslow.simulation.arguments import gap_regions

Floats = NDArray[np.float64]


@validated(exact=flag)
def slow_load_gap(
    B: ArrayLike,
    C: ArrayLike,
    omega: ArrayLike,
    *,
    damping: ArrayLike = 1.0,
    stiffness: ArrayLike = np.inf,
    exact: bool = False,
) -> Any:
    r"""The widest gap, as half its width, that a slow load B + C sin(ω t) drives a state across.

    In the gap x'' + c x' = w(t) = B + C sin(ω t). Integrated once from the time
    t0 at which the state leaves the near side at speed v0 to the time t1 at
    which it turns, the depth reached is −(v0 + ∫ w dt)/c. A contact of
    stiffness k that follows the load (y = w/k − c w'/k² + …) is left at
    w = −c s/k, where s = ω √(C² − B²) is the slope of the load at zero, with
    v0 = −s/k; and x' = w/c − w'/c² + … turns 1/c after the load is positive
    again. Hence, for C > B > 0 and ω → 0,

    .. math:: 2 c D^* = \frac{2}{ω}\left[\sqrt{C^2 - B^2} - B \arccos\frac{B}{C}\right]
              - \frac{ω\sqrt{C^2 - B^2}}{2 c^2}\left(1 - \frac{c^2}{k}\right)^2 + O(ω^2).

    With ``exact`` the linear equation in the gap is solved instead, from the
    state in which the steady response of the linear contact leaves it. What
    remains is the curvature of the contact and the ringing of its last impact.
    On the harmonic gear (k = A + D², A = 41.67, C/B = 1.03), against D* from
    simulation, the formula is off by −4.3 % at ω = 0.1 and −0.029 % at ω = 0.02,
    its first term alone by +9.0 % and +0.46 %, the exact one by 2e-9 and 2e-10.

    Parameters
    ----------
    B, C : array_like
        Mean and amplitude of the load; their signs do not matter.
    omega : array_like
        Angular frequency of the load, positive.
    damping : array_like
        c, positive.
    stiffness : array_like
        k of the contact where it begins, positive; infinite for a rigid one.
    exact : bool
        Whether to solve the motion in the gap instead of expanding it.

    Returns
    -------
    float or ndarray
        D*, broadcast: the far side is reached for half-widths up to it. 0 where
        the near side is never left: for C ≤ \|B\|, with ``exact`` where the steady
        response of the contact never lets go. NaN, only with ``exact``, where
        the state does not turn before the load is negative again.

    Raises
    ------
    ArgumentError
        For numbers that are not finite or not positive.

    References
    ----------
    Own derivation, as above.

    Examples
    --------
    >>> round(slow_load_gap(2.372, 1.03 * 2.372, 0.02), 6)
    0.570406
    >>> round(slow_load_gap(2.372, 1.03 * 2.372, 0.02, stiffness=42.0, exact=True), 6)
    0.570708
    >>> slow_load_gap(2.0, [1.0, 4.0], 0.1).round(3)
    array([ 0.  , 13.61])
    """
    mean, swing = np.abs(finite_numbers("B", B)), np.abs(finite_numbers("C", C))
    rate, c, k = (
        _positive("omega", omega),
        _positive("damping", damping),
        _positive("stiffness", stiffness, rigid=True),
    )
    mean, swing, rate, c, k = _broadcast(mean, swing, rate, c, k)
    result = np.asarray((_exact if exact else _expanded)(mean, swing, rate, c, k))
    return result if result.ndim else float(result)


def _expanded(B: Floats, C: Floats, omega: Floats, c: Floats, k: Floats) -> Floats:
    C = np.maximum(B, C)
    root = np.sqrt(C * C - B * B)
    impulse = 2.0 * (root - B * np.arccos(_quotient(B, C))) / omega
    return (impulse - 0.5 * omega * root * (1.0 / c - c / k) ** 2) / (2.0 * c)


def _exact(B: Floats, C: Floats, omega: Floats, c: Floats, k: Floats) -> Floats:
    """The same from the closed form of the motion; times are phases of the load, ω t."""
    rigid = np.isinf(k)
    spring = np.where(rigid, 1.0, k)
    # y = B/k + r sin(phase - lag) in contact; a rigid one is left where the load vanishes
    lag = np.where(rigid, 0.0, np.arctan2(c * omega, spring - omega**2))
    r = C / np.hypot(spring - omega**2, c * omega)
    sine = _quotient(B, np.where(rigid, C, spring * r))
    leaves = sine < 1.0
    sine = np.where(leaves, sine, 0.0)
    first = lag + np.pi + np.arcsin(sine)
    speed = np.where(rigid, 0.0, -omega * r * np.sqrt(1.0 - sine**2))

    def steady(phase: Floats) -> Floats:
        swinging = c * np.sin(phase) - omega * np.cos(phase)
        return np.asarray(B / c + C * swinging / (c * c + omega**2))

    def velocity(phase: Floats) -> Floats:
        decay = np.exp(-c * (phase - first) / omega)
        return np.asarray(steady(phase) + (speed - steady(first)) * decay)

    # a load that stays positive may still throw a compliant contact off, for an instant
    falls = np.where(C > B, np.pi + np.arcsin(_quotient(B, C)), first + 2.0 * np.pi)
    # the velocity can pass zero upwards only where the load is positive, and there only once
    early = (first < falls) & (velocity(np.maximum(first, falls)) > 0.0)
    low = np.where(early, first, np.maximum(first, 3.0 * np.pi - falls))
    high = np.where(early, falls, falls + 2.0 * np.pi)
    turns = velocity(high) > 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = velocity(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    impulse = (B * (high - first) - C * (np.cos(high) - np.cos(first))) / omega
    widest = np.where(turns, -(speed + impulse) / (2.0 * c), np.nan)
    return np.where(leaves, widest, 0.0)


@validated(model=instance(Model), parameters=mapping, exact=flag, gap=text)
def slow_load_criterion(
    model: Model,
    parameters: Mapping[Any, ArrayLike] | None = None,
    *,
    exact: bool = False,
    gap: str | None = None,
) -> SlowLoad:
    """Predict how a slow load moves the state of a model in its gap, without simulation.

    The model has the states x and v = x', a gap between two values of x, where
    v' = −c v + B + C sin(ω t + φ), and contacts that begin without a jump of
    the force, of positive stiffness. The regime is that of `slow_load_gap`: the
    state is held by the side to which the mean load pushes it, and reaches the
    other one or does not. That is for slow loads: on the harmonic gear at
    D = 0.25 the exact form is right everywhere up to ω = 0.17, and on nine
    tenths of the plane 0.1 ≤ ω ≤ 3, 1.5 ≤ C ≤ 8, where ringing decides the rest.

    Parameters
    ----------
    model : Model
    parameters : mapping, optional
        Parameter to its values, a number or an array, broadcast together.
    exact : bool
        As in `slow_load_gap`.
    gap : str, optional
        The region inside, where it is not found by itself.

    Returns
    -------
    SlowLoad

    Raises
    ------
    ArgumentError
        If the model is not of this kind.
    UnknownNameError
        For a parameter or region that is not in the model.

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(C=1.03 * 2.372, omega=0.02)
    >>> fs.systems.slow_load_criterion(gear)
    SlowLoad 2.372 ± 2.44316 at ω = 0.02: half-width 0.25, crossed up to 0.570544: bilateral
    >>> fs.systems.slow_load_criterion(gear, {"D": [0.5, 0.6], "C": 2.5}).regime
    array(['bilateral', 'bilateral'], dtype='<U16')
    """
    swept = {str(n): finite_numbers(f"parameter {n}", v) for n, v in (parameters or {}).items()}
    for name in swept:
        if name not in model.parameters:
            raise unknown_name("parameter", name, model.parameters)
    values: dict[str, Any] = {**dict(model.parameters), **swept}
    shape = _broadcast(np.zeros(()), *map(np.asarray, values.values()))[0].shape
    damping, load, omega, edges, stiffness = _gap_motion(model, gap)

    def number(expression: sp.Expr, **more: Floats) -> Floats:
        used = sorted(expression.free_symbols, key=lambda s: s.name)
        given = {**values, **more}
        result = numpy_function(used, expression)(*(given[s.name] for s in used))
        return np.broadcast_to(np.asarray(result, dtype=float), shape)

    rate = np.abs(number(omega))
    if not np.all(rate > 0.0):
        raise ArgumentError("the load's frequency vanishes; expected a periodic load")
    phases = np.array([0.0, 0.5, 1.0, 1.5, 0.3, 1.1]) * np.pi
    samples = [number(load, t=phase / rate) for phase in phases]
    mean = 0.25 * (samples[0] + samples[1] + samples[2] + samples[3])
    even, odd = 0.5 * (samples[0] - samples[2]), 0.5 * (samples[1] - samples[3])
    scale = np.abs(mean) + np.abs(even) + np.abs(odd)
    mean = np.where(np.abs(mean) > 1e-14 * scale, mean, 0.0)
    for phase, sample in zip(phases, samples, strict=True):
        expected = mean + even * np.cos(phase) + odd * np.sin(phase)
        if not np.all(np.abs(sample - expected) <= 1e-9 * scale):
            raise ArgumentError(f"the load in the gap is {load}; expected a mean and one harmonic")
    lower, upper = (number(edge) for edge in edges)
    stiff = np.where(mean > 0.0, number(stiffness[1]), number(stiffness[0]))
    swing = np.hypot(even, odd)
    c = number(damping)
    sound = (stiff > 0.0) & (c > 0.0)
    widest = np.where(
        sound,
        slow_load_gap(
            mean,
            swing,
            rate,
            damping=np.where(sound, c, 1.0),
            stiffness=np.where(sound, stiff, 1.0),
            exact=exact,
        ),
        np.nan,
    )
    return SlowLoad(mean, swing, rate, c, stiff, 0.5 * (upper - lower), widest, exact)


def _gap_motion(
    model: Model, gap: str | None
) -> tuple[sp.Expr, sp.Expr, sp.Expr, tuple[sp.Expr, sp.Expr], tuple[sp.Expr, sp.Expr]]:
    """Damping, load and its frequency in the gap; edges and stiffness below and above it."""
    between = gap_regions(model, gap)
    if between is None:
        raise ArgumentError("expected a model with a gap: three regions between two interfaces")
    if len(model.states) != 2 or model.slow_states or model.free:
        named = ", ".join((*model.states, *model.slow_states, *model.free))
        raise ArgumentError(f"expected two states x, v and forcing, received {named}")
    x, v = (real(name) for name in model.states)
    inside = model.regions[between[1]]
    laws = {real(name): law for name, law in inside.forcing.items()}
    rates = [model.regions[name].rates[v.name].subs(laws) for name in between]
    for name in between:
        if model.regions[name].rates[x.name] != v:
            raise ArgumentError(f"{x}' = {model.regions[name].rates[x.name]}; expected {v}")
    motion = sp.expand(rates[1])
    damping = -motion.diff(v)
    load = sp.expand(motion + damping * v)
    if damping.free_symbols & {x, v, TIME} or load.free_symbols & {x, v}:
        raise ArgumentError(
            f"in the gap {v}' = {motion}; expected a damping proportional to {v} and a load"
        )
    harmonics = frequencies([load], TIME)
    if harmonics is None or len(harmonics) != 1:
        raise ArgumentError(f"the load in the gap is {load}; expected a mean and one harmonic")
    edges, stiffness = [], []
    for rate, name in ((rates[0], between[0]), (rates[2], between[2])):
        signs = model.regions[name].signs
        (interface,) = (n for n in signs if signs[n] != inside.signs[n])
        function = model.interfaces[interface].function
        slope = function.diff(x)
        edge = -function.subs(x, 0) / slope
        if slope.has(x) or edge.free_symbols & {v, TIME, *laws}:
            raise ArgumentError(f"interface {interface}; expected a fixed value of {x}")
        if not model.continuous[interface]:
            raise ArgumentError(f"the force jumps at {interface}; expected a continuous one")
        stiff = -rate.diff(x).subs(x, edge)
        if stiff.free_symbols & {v, TIME}:
            raise ArgumentError(f"the stiffness at {interface} is {stiff}; expected a constant")
        edges.append(edge)
        stiffness.append(stiff)
    return damping, load, harmonics[0], (edges[0], edges[1]), (stiffness[0], stiffness[1])


def _quotient(B: Floats, C: Floats) -> Floats:
    """B/C for B ≥ 0, 1 where it is larger or undefined."""
    return np.where(C > B, B / np.where(C > B, C, 1.0), 1.0)


def _broadcast(*given: Floats) -> tuple[Floats, ...]:
    try:
        return tuple(np.broadcast_arrays(*given))
    except ValueError:
        shapes = ", ".join(str(values.shape) for values in given)
        raise ArgumentError(f"expected values of one shape, received {shapes}") from None


def _positive(name: str, given: ArrayLike, rigid: bool = False) -> Floats:
    values = (numbers if rigid else finite_numbers)(name, given)
    if not np.all(values > 0.0):
        raise ArgumentError(f"{name} = {shown(given)}; expected positive numbers")
    return values
