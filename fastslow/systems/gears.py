"""Gears with backlash: the harmonic gear and a spur gear pair."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from fastslow.arguments import finite, positive, validated, word
from fastslow.model.model import Model

Scaling = Literal["consistent", "printed"]
SCALINGS = ("consistent", "printed")


def dead_zone(x: sp.Expr, D: sp.Expr) -> sp.Expr:
    """Return the dead-zone function: x − D for x > D, x + D for x < −D, and 0 between."""
    return sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))


def harmonic_gear(
    A: float = 41.67,
    B: float = 2.372,
    C: float = 3.546,
    D: float = 0.25,
    omega: float = 0.01,
) -> Model:
    """The harmonic gear with clearance, dimensionless.

    x'' + x' + (x² + A) f(x) = w with the load w = B + C sin(ω t) and the dead
    zone f(x) = x − D for x > D, 0 inside, x + D for x < −D. Regions S1 (x > D),
    S2 (the gap) and S3 (x < −D).

    Parameters
    ----------
    A : float
        Linear part of the torsional stiffness; folds exist for A < −D² only.
    B, C : float
        Mean and amplitude of the load.
    D : float
        Half-width of the gap, in units of x.
    omega : float
        Angular frequency of the load per dimensionless time.

    Returns
    -------
    Model
        States x, v; slow quantity w.

    References
    ----------
    M. Ding, Current Journal of Applied Science and Technology 42(7), 66-75,
    2023, doi 10.9734/CJAST/2023/v42i74082, equations (6) and (7), the third
    branch of (7) read as x < −D.

    Examples
    --------
    >>> gear = harmonic_gear(D=0.5)
    >>> print(gear.regions["S1"].rates["v"])
    -v + w - (A + x**2)*(-D + x)
    >>> gear.frozen().free
    ('w',)
    """
    x, v, w, t = sp.symbols("x v w t")
    a, b, c, d, o = sp.symbols("A B C D omega")
    return Model(
        {x: v, v: w - v - (x**2 + a) * dead_zone(x, d)},
        forcing={w: b + c * sp.sin(o * t)},
        parameters={a: A, b: B, c: C, d: D, o: omega},
    )


@dataclass(frozen=True)
class GearScales:
    """Physical scales of the harmonic gear.

    Parameters
    ----------
    inertia : float
        J_eq = N² J_i J_o/(N² J_i + J_o), kg m².
    damping : float
        C_eq = 2 ξ √(J_eq K_HD), N m s/rad.
    time : float
        t_s = J_eq/C_eq, s: unit of dimensionless time.
    angle : float
        θ_s, rad: twist at x = 1.
    """

    inertia: float
    damping: float
    time: float
    angle: float


@validated(
    scaling=word("scaling", SCALINGS),
    J_i=positive,
    J_o=positive,
    N=positive,
    xi=positive,
    K_HD=positive,
    k2=positive,
)
def gear_scales(
    scaling: Scaling = "consistent",
    *,
    J_i: float = 6.8e-4,
    J_o: float = 2.4e-2,
    N: float = 100.0,
    xi: float = 0.05,
    K_HD: float = 7200.0,
    k2: float = 21000.0,
) -> GearScales:
    """Return the equivalent inertia and damping, and the scales of time and twist.

    Parameters
    ----------
    scaling : {"consistent", "printed"}
        θ_s = C_eq/√(k2 J_eq), or the scale implied by the printed parameters,
        θ_s = C_eq²/(k2 J_eq).
    J_i, J_o : float
        Inertias of the input and the output side, kg m².
    N : float
        Reduction ratio.
    xi : float
        Damping ratio.
    K_HD : float
        Mean mesh stiffness, N m/rad.
    k2 : float
        Cubic torsional stiffness, N m/rad³.

    Returns
    -------
    GearScales

    Raises
    ------
    UnknownNameError
        For another scaling.
    ArgumentError
        For a value that is not positive.

    Examples
    --------
    >>> scales = gear_scales()
    >>> f"{scales.inertia:.9g} {scales.damping:.9g} {scales.time:.9g}"
    '0.023915592 1.31222049 0.0182252846'
    """
    inertia = N**2 * J_i * J_o / (N**2 * J_i + J_o)
    damping = 2.0 * xi * math.sqrt(inertia * K_HD)
    angle = damping / math.sqrt(k2 * inertia)
    return GearScales(
        inertia, damping, inertia / damping, angle if scaling == "consistent" else angle**2
    )


@validated(
    scaling=word("scaling", SCALINGS),
    J_i=positive,
    J_o=positive,
    k1=finite,
    phi=finite,
    T_m=finite,
    T_am=finite,
    omega=finite,
)
def harmonic_gear_from_physical(
    scaling: Scaling = "consistent",
    *,
    J_i: float = 6.8e-4,
    J_o: float = 2.4e-2,
    N: float = 100.0,
    xi: float = 0.05,
    K_HD: float = 7200.0,
    k1: float = 3000.0,
    k2: float = 21000.0,
    phi: float = 1.75e-2,
    T_m: float = 10.0,
    T_am: float = 15.0,
    omega: float = 0.5,
) -> Model:
    """The dimensionless harmonic gear with parameters computed from physical values.

    Two inertias joined by a shaft with clearance, relative twist θ = θ_o − θ_i/N,

        J_eq θ'' + C_eq θ' + (k1 + k2 θ²) f_h(θ) = T_m + (J_eq/J_o) T_am sin(ω t),

    where f_h is the dead zone of half-width φ. With x = θ/θ_s and time in units
    of t_s = J_eq/C_eq this is `harmonic_gear` with, for θ_s = C_eq/√(k2 J_eq),

        A = J_eq k1/C_eq²                    B = J_eq T_m √(k2 J_eq)/C_eq³
        C = J_eq² T_am √(k2 J_eq)/(C_eq³ J_o)   D = φ/θ_s      ω_o = ω t_s.

    The source prints A = k1 k2 J_eq²/C_eq⁴, B = k2 J_eq² T_m/C_eq⁴ and
    C = k2 J_eq³ T_am/(C_eq⁴ J_o). All three follow if the factor θ_s in
    f_h(θ) = θ_s f(x) is omitted, with θ_s = C_eq²/(k2 J_eq); as the radian is
    dimensionless, the error does not show in the units. ``scaling="printed"`` gives
    these values. Only the consistent D lies in the range that the source
    studies, 0.1 to 0.5.

    Parameters
    ----------
    scaling : {"consistent", "printed"}
        The scaling derived from the equations, or that printed in the source.
    J_i, J_o, N, xi, K_HD, k2 : float
        As for `gear_scales`.
    k1 : float
        Linear torsional stiffness, N m/rad; may be negative.
    phi : float
        Half of the clearance, rad.
    T_m, T_am : float
        Mean and amplitude of the output torque, N m. The source writes
        "T_om = 15" where T_am is meant.
    omega : float
        Angular frequency of the torque, rad/s. The source states 0 < ω < 1 only.

    Returns
    -------
    Model
        The same equations as `harmonic_gear`, with omega = ω t_s. The figures of the source
        give D instead of φ, as ``with_parameters(D=0.25)`` does.

    Raises
    ------
    UnknownNameError
        For another scaling.
    ArgumentError
        For an inertia, ratio, damping or cubic stiffness that is not positive, or
        another value that is not a finite number.

    References
    ----------
    M. Ding, Current Journal of Applied Science and Technology 42(7), 66-75,
    2023, doi 10.9734/CJAST/2023/v42i74082, equations (1) to (7) and section 3.1.

    Examples
    --------
    >>> values = harmonic_gear_from_physical().parameters
    >>> [f"{name} = {values[name]:.9g}" for name in "ABCD"]
    ['A = 41.6666667', 'B = 2.37197934', 'C = 3.54545564', 'D = 0.298869397']
    """
    scales = gear_scales(scaling, J_i=J_i, J_o=J_o, N=N, xi=xi, K_HD=K_HD, k2=k2)
    inertia, damping = scales.inertia, scales.damping
    stiffness = inertia / damping**2
    torque = stiffness / scales.angle
    if scaling == "printed":
        # without the factor θ_s in f_h the stiffness keeps it as a divisor
        stiffness /= scales.angle
    return harmonic_gear(
        A=stiffness * k1,
        B=torque * T_m,
        C=torque * T_am * inertia / J_o,
        D=phi / scales.angle,
        omega=omega * scales.time,
    )


def gear_pair(
    zeta: float = 0.05, Fm: float = 0.1, Fa: float = 0.05, D: float = 1.0, Omega: float = 0.7
) -> Model:
    """A spur gear pair with backlash: piecewise linear, two interfaces.

    x'' + 2 ζ x' + g(x) = w with the load w = Fm + Fa Ω² sin(Ω t), g the dead
    zone of half-width D and unit stiffness.

    Parameters
    ----------
    zeta : float
        Damping ratio.
    Fm, Fa : float
        Mean load, and transmission error of the mesh.
    D : float
        Half of the backlash.
    Omega : float
        Mesh frequency in units of the natural frequency.

    Returns
    -------
    Model
        States x, v; slow quantity w.

    References
    ----------
    A. Kahraman and R. Singh, Journal of Sound and Vibration 142(1), 49-75, 1990.

    Examples
    --------
    >>> list(gear_pair().regions)
    ['S1', 'S2', 'S3']
    """
    x, v, w, t = sp.symbols("x v w t")
    z, m, a, d, o = sp.symbols("zeta Fm Fa D Omega")
    return Model(
        {x: v, v: w - 2 * z * v - dead_zone(x, d)},
        forcing={w: m + a * o**2 * sp.sin(o * t)},
        parameters={z: zeta, m: Fm, a: Fa, d: D, o: Omega},
    )


def rigid_gear(
    B: float = 2.372,
    C: float = 3.546,
    D: float = 0.25,
    r: float = 0.784,
    omega: float = 1.0,
) -> Model:
    """A gear pair with rigid teeth: free motion in the gap, impacts on both flanks.

    x'' + x' = w for |x| < D, with the load w = B + C sin(ω t); at x = ±D the velocity v becomes
    −r v. It is the limit A → ∞ of `harmonic_gear`, whose contacts last π/√A and have the
    restitution r = exp(−π/(2√A)) + O(1/A); the default r is that of A = 41.67.

    Parameters
    ----------
    B, C : float
        Mean and amplitude of the load.
    D : float
        Half-width of the gap.
    r : float
        Coefficient of restitution.
    omega : float
        Angular frequency of the load.

    Returns
    -------
    Model
        States x, v; slow quantity w; two resets.

    References
    ----------
    J. F. Mason and P. T. Piiroinen, SIAM Journal on Applied Dynamical Systems 8(4),
    1694-1711, 2009, doi 10.1137/090759641.

    Examples
    --------
    >>> list(rigid_gear().resets)
    ['x >= D', 'x <= -D']
    """
    x, v, w, t = sp.symbols("x v w t")
    b, c, d, e, o = sp.symbols("B C D r omega")
    return Model(
        {x: v, v: w - v},
        forcing={w: b + c * sp.sin(o * t)},
        parameters={b: B, c: C, d: D, e: r, o: omega},
        resets={x >= d: {v: -e * v}, x <= -d: {v: -e * v}},
    )
