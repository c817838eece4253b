"""Oscillators and a ball with impacts: walls that are fixed, and walls that move."""

from __future__ import annotations

import sympy as sp

from fastslow.model.model import Model


def impact_oscillator(
    zeta: float = 0.05, f: float = 0.6, sigma: float = 1.0, r: float = 0.8, omega: float = 0.8
) -> Model:
    """A linear oscillator with a rigid stop.

    x'' + 2 ζ x' + x = w for x < σ, with w = f cos(ω t); at x = σ the velocity v
    becomes −r v. The motion without impacts grazes the stop at
    f = |σ| √((1 − ω²)² + (2 ζ ω)²). It is the limit of `bilinear_oscillator` for a
    stiff stop.

    Parameters
    ----------
    zeta : float
        Damping ratio.
    f, omega : float
        Amplitude and angular frequency of the forcing.
    sigma : float
        Position of the stop.
    r : float
        Coefficient of restitution.

    Returns
    -------
    Model
        States x, v; slow quantity w; one reset.

    References
    ----------
    W. Chin, E. Ott, H. E. Nusse and C. Grebogi, Physical Review E 50, 4427-4444,
    1994; C. Budd, F. Dux and A. Cliffe, Journal of Sound and Vibration 184(3),
    475-502, 1995.

    Examples
    --------
    >>> print(*impact_oscillator().resets)
    x >= sigma
    """
    x, v, w, t = sp.symbols("x v w t")
    z, a, s, e, o = sp.symbols("zeta f sigma r omega")
    return Model(
        {x: v, v: w - 2 * z * v - x},
        forcing={w: a * sp.cos(o * t)},
        parameters={z: zeta, a: f, s: sigma, e: r, o: omega},
        resets={x >= s: {v: -e * v}},
    )


def moving_wall_oscillator(
    zeta: float = 0.05, a: float = 0.3, sigma: float = 0.2, r: float = 0.8, omega: float = 2.6
) -> Model:
    """A linear oscillator that is hit by a vibrating wall.

    x'' + 2 ζ x' + x = 0 for x < s(t), with the wall s = σ + a cos(ω t); at x = s the
    velocity v becomes s' − r (v − s'). Relative to the wall it is an oscillator
    with a fixed stop and the forcing −a cos(ω t) − 2 ζ s' − s''.

    Parameters
    ----------
    zeta : float
        Damping ratio.
    a, omega : float
        Amplitude and angular frequency of the wall.
    sigma : float
        Mean position of the wall.
    r : float
        Coefficient of restitution.

    Returns
    -------
    Model
        States x, v; one reset.

    References
    ----------
    S. Dubowsky and F. Freudenstein, Journal of Engineering for Industry 93(1),
    305-316, 1971: the impact pair, whose walls are moved.

    Examples
    --------
    >>> print(*moving_wall_oscillator().resets)
    x >= a*cos(omega*t) + sigma
    """
    x, v, t = sp.symbols("x v t")
    z, b, s, e, o = sp.symbols("zeta a sigma r omega")
    wall = s + b * sp.cos(o * t)
    speed = wall.diff(t)
    return Model(
        {x: v, v: -2 * z * v - x},
        parameters={z: zeta, b: a, s: sigma, e: r, o: omega},
        resets={x >= wall: {v: speed - e * (v - speed)}},
    )


def bouncing_ball(g: float = 1.0, A: float = 0.8, omega: float = 1.0, r: float = 0.8) -> Model:
    """A ball that bounces on a vibrating table.

    x'' = −g for x > s(t), with the table s = A sin(ω t); at x = s the velocity v
    becomes s' − r (v − s'). The source replaces the table's height at an impact by its
    mean, for flights that are high compared with A; here it is exact. The ball bounces once in n
    periods of the table at the phases φ = ω t with A ω cos φ = (1 − r)/(1 + r) · π n g/ω. It can
    rest on the table while s'' > −g.

    Parameters
    ----------
    g : float
        Acceleration of gravity.
    A, omega : float
        Amplitude and angular frequency of the table.
    r : float
        Coefficient of restitution.

    Returns
    -------
    Model
        States x, v; one reset.

    References
    ----------
    P. J. Holmes, Journal of Sound and Vibration 84(2), 173-189, 1982.

    Examples
    --------
    >>> print(*bouncing_ball().resets)
    x <= A*sin(omega*t)
    """
    x, v, t = sp.symbols("x v t")
    gravity, amplitude, o, e = sp.symbols("g A omega r")
    table = amplitude * sp.sin(o * t)
    speed = table.diff(t)
    return Model(
        {x: v, v: -gravity},
        parameters={gravity: g, amplitude: A, o: omega, e: r},
        resets={x <= table: {v: speed - e * (v - speed)}},
    )
