"""Piecewise-smooth oscillators: a bilinear one with a stop, and one with dry friction."""

from __future__ import annotations

import sympy as sp

from fastslow.model.model import Model


def bilinear_oscillator(
    zeta: float = 0.01, beta: float = 10.0, f: float = 0.36, omega: float = 0.8
) -> Model:
    """A linear oscillator with a one-sided elastic stop at x = 1.

    x'' + 2 ζ x' + x + β max(x − 1, 0) = w with w = f cos(ω t). The
    linear periodic orbit grazes the stop at f = √((1 − ω²)² + (2 ζ ω)²).

    Parameters
    ----------
    zeta : float
        Damping ratio.
    beta : float
        Stiffness of the stop, in units of the spring's.
    f, omega : float
        Amplitude and angular frequency of the forcing.

    Returns
    -------
    Model
        States x, v; slow quantity w.

    References
    ----------
    S. W. Shaw and P. J. Holmes, Journal of Sound and Vibration 90(1), 129-155, 1983.

    Examples
    --------
    >>> list(bilinear_oscillator().interfaces)
    ['x - 1']
    """
    x, v, w, t = sp.symbols("x v w t")
    z, b, a, o = sp.symbols("zeta beta f omega")
    return Model(
        {x: v, v: w - 2 * z * v - x - b * sp.Max(x - 1, 0)},
        forcing={w: a * sp.cos(o * t)},
        parameters={z: zeta, b: beta, a: f, o: omega},
    )


def stick_slip(F_s: float = 1.0, delta: float = 3.0, v_b: float = 0.2) -> Model:
    """A mass on a moving belt with velocity-weakening dry friction: a Filippov system.

    x'' + x = −F_s sign(x' − v_b)/(1 + δ |x' − v_b|). The mass sticks to the belt on
    the interface v = v_b. The equilibrium x = F_s/(1 + δ v_b) is an
    unstable focus.

    Parameters
    ----------
    F_s : float
        Maximal static friction force.
    delta : float
        Rate at which friction decreases with relative velocity.
    v_b : float
        Speed of the belt.

    Returns
    -------
    Model
        States x, v; discontinuous across "v - v_b".

    References
    ----------
    R. I. Leine, D. H. van Campen, A. de Kraker and L. van den Steen, Nonlinear
    Dynamics 16, 41-54, 1998.

    Examples
    --------
    >>> stick_slip().continuous
    {v - v_b: False}
    """
    x, v = sp.symbols("x v")
    s, d, b = sp.symbols("F_s delta v_b")
    slip = v - b
    friction = sp.Piecewise((-s / (1 + d * slip), slip > 0), (s / (1 - d * slip), True))
    return Model({x: v, v: friction - x}, parameters={s: F_s, d: delta, b: v_b})
