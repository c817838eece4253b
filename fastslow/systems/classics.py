"""Classical smooth models of bifurcation theory and fast-slow dynamics."""

from __future__ import annotations

import sympy as sp

from fastslow.model.model import Model


def cusp(q: float = 1.0, a: float = 1.0, omega: float = 0.01) -> Model:
    """The cusp normal form under slow forcing: x' = p + q x − x³, p = a sin(ω t).

    For q > 0 the frozen model has folds at p = ±2 (q/3)^(3/2), x = ∓√(q/3).

    Parameters
    ----------
    q : float
        Splitting parameter.
    a, omega : float
        Amplitude and angular frequency of p.

    Returns
    -------
    Model
        State x; slow quantity p.

    References
    ----------
    Yu. A. Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., Springer
    2004, section 8.2.

    Examples
    --------
    >>> cusp().states
    ('x',)
    """
    x, p, t = sp.symbols("x p t")
    split, amplitude, o = sp.symbols("q a omega")
    return Model(
        {x: p + split * x - x**3},
        forcing={p: amplitude * sp.sin(o * t)},
        parameters={split: q, amplitude: a, o: omega},
    )


def van_der_pol(mu: float = 1.0, B: float = 0.0, C: float = 2.0, omega: float = 0.01) -> Model:
    """The van der Pol oscillator under a slow load.

    x'' − μ (1 − x²) x' + x = w with w = B + C sin(ω t). The frozen equilibrium
    x = w has Hopf points at w = ±1 (frequency 1), between which it is unstable.

    Parameters
    ----------
    mu : float
        Strength of the nonlinear damping.
    B, C, omega : float
        Mean, amplitude and angular frequency of the load.

    Returns
    -------
    Model
        States x, v; slow quantity w.

    References
    ----------
    B. van der Pol, Philosophical Magazine 2(11), 978-992, 1926.

    Examples
    --------
    >>> van_der_pol().frozen().free
    ('w',)
    """
    x, v, w, t = sp.symbols("x v w t")
    m, b, c, o = sp.symbols("mu B C omega")
    return Model(
        {x: v, v: m * (1 - x**2) * v - x + w},
        forcing={w: b + c * sp.sin(o * t)},
        parameters={m: mu, b: B, c: C, o: omega},
    )


def van_der_pol_relaxation(a: float = 0.0, epsilon: float = 0.01) -> Model:
    """The van der Pol oscillator in Liénard form, a relaxation oscillator with one slow state.

    x' = y − x³/3 + x, y' = ε (a − x). The frozen model over y has folds at
    x = ±1, y = ∓2/3.

    Parameters
    ----------
    a : float
        Position of the equilibrium; relaxation oscillations for |a| < 1.
    epsilon : float
        Ratio of the time scales.

    Returns
    -------
    Model
        State x, slow state y.

    References
    ----------
    J. Grasman, Asymptotic Methods for Relaxation Oscillations and Applications,
    Springer 1987, chapter 2.

    Examples
    --------
    >>> van_der_pol_relaxation().slow_states
    ('y',)
    """
    x, y, shift, e = sp.symbols("x y a epsilon")
    return Model(
        {x: y - x**3 / 3 + x},
        slow={y: e * (shift - x)},
        parameters={shift: a, e: epsilon},
    )


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
