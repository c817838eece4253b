"""Neurons: two smooth ones, and one that fires and is reset."""

from __future__ import annotations

import sympy as sp

from fastslow.model.model import Model


def fitzhugh_nagumo(
    a: float = 0.7,
    b: float = 0.8,
    epsilon: float = 0.08,
    I_0: float = 0.5,
    I_1: float = 0.5,
    omega: float = 0.001,
) -> Model:
    """The FitzHugh-Nagumo neuron under a slowly varying current.

    v' = v − v³/3 − r + I, r' = ε (v + a − b r), I = I_0 + I_1 sin(ω t). Hopf
    points where v² = 1 − ε b.

    Parameters
    ----------
    a, b, epsilon : float
        Constants of the recovery r.
    I_0, I_1, omega : float
        Mean, amplitude and angular frequency of the current.

    Returns
    -------
    Model
        States v, r; slow quantity I.

    References
    ----------
    R. FitzHugh, Biophysical Journal 1(6), 445-466, 1961.

    Examples
    --------
    >>> fitzhugh_nagumo().states
    ('v', 'r')
    """
    v, r, current, t = sp.symbols("v r I t")
    shift, slope, e, mean, swing, o = sp.symbols("a b epsilon I_0 I_1 omega")
    return Model(
        {v: v - v**3 / 3 - r + current, r: e * (v + shift - slope * r)},
        forcing={current: mean + swing * sp.sin(o * t)},
        parameters={shift: a, slope: b, e: epsilon, mean: I_0, swing: I_1, o: omega},
    )


def hindmarsh_rose(
    I_0: float = 2.0,
    r: float = 0.006,
    a: float = 1.0,
    b: float = 3.0,
    c: float = 1.0,
    d: float = 5.0,
    s: float = 4.0,
    x_R: float = -1.6,
) -> Model:
    """The Hindmarsh-Rose model of a bursting neuron: two fast states, one slow.

    x' = y − a x³ + b x² − z + I_0, y' = c − d x² − y, z' = r (s (x − x_R) − z).
    The frozen model over z has folds where 3 a x² + 2 (d − b) x = 0.

    Parameters
    ----------
    I_0 : float
        Applied current.
    r : float
        Ratio of the time scales.
    a, b, c, d, s, x_R : float
        Constants of the model.

    Returns
    -------
    Model
        States x, y; slow state z.

    References
    ----------
    J. L. Hindmarsh and R. M. Rose, Proceedings of the Royal Society B 221,
    87-102, 1984.

    Examples
    --------
    >>> hindmarsh_rose().slow_states
    ('z',)
    """
    x, y, z = sp.symbols("x y z")
    names = sp.symbols("I_0 r a b c d s x_R")
    current, rate, a_, b_, c_, d_, s_, rest = names
    return Model(
        {x: y - a_ * x**3 + b_ * x**2 - z + current, y: c_ - d_ * x**2 - y},
        slow={z: rate * (s_ * (x - rest) - z)},
        parameters=dict(zip(names, (I_0, r, a, b, c, d, s, x_R), strict=True)),
    )


def izhikevich(
    I_0: float = 10.0, a: float = 0.02, b: float = 0.2, c: float = -50.0, d: float = 2.0
) -> Model:
    """Izhikevich's neuron: a quadratic integrate-and-fire model with a recovery variable.

    v' = 0.04 v² + 5 v + 140 − u + I_0, u' = a (b v − u), in millivolts and
    milliseconds; at v = 30 the neuron has fired, v becomes c and u becomes u + d.
    The frozen model over u has a fold at v = −62.5, u = I_0 − 16.25. The default values are
    those of a bursting ("chattering") cell.

    Parameters
    ----------
    I_0 : float
        Applied current.
    a : float
        Ratio of the time scales.
    b : float
        Sensitivity of the recovery to v.
    c : float
        Voltage after a spike.
    d : float
        Increment of the recovery at a spike.

    Returns
    -------
    Model
        State v, slow state u; one reset.

    References
    ----------
    E. M. Izhikevich, IEEE Transactions on Neural Networks 14(6), 1569-1572, 2003,
    equations (1) to (3) and figure 2.

    Examples
    --------
    >>> izhikevich().slow_states
    ('u',)
    """
    v, u = sp.symbols("v u")
    current, a_, b_, c_, d_ = sp.symbols("I_0 a b c d")
    return Model(
        {v: v**2 / 25 + 5 * v + 140 - u + current},
        slow={u: a_ * (b_ * v - u)},
        parameters={current: I_0, a_: a, b_: b, c_: c, d_: d},
        resets={v >= 30: {v: c_, u: u + d_}},
    )
