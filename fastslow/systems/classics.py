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
