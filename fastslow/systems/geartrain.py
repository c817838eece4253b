"""The harmonic gear as two inertias, their relative twist, and its nondimensionalisation.

M. Ding, "Fast-slow Dynamical Analysis in Harmonic Gear Transmission System with
Non-smooth Gear Clearance Condition", Current Journal of Applied Science and
Technology 42(7), 66-75, 2023, doi 10.9734/CJAST/2023/v42i74082, equations (2) to (7).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from fastslow.arguments import finite, positive, validated
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.reduction import reduce_states
from fastslow.symbolic.scaling import (
    Identification,
    compare_scalings,
    identify,
    nondimensionalise,
    scale_symbol,
)
from fastslow.symbolic.solving.verification import vanishes
from fastslow.systems.gears import dead_zone, gear_scales, harmonic_gear

#: Validators of the physical parameters.
PHYSICAL = {
    "J_i": positive,
    "J_o": positive,
    "N": positive,
    "xi": positive,
    "K_HD": positive,
    "k1": finite,
    "k2": positive,
    "phi": positive,
    "T_m": finite,
    "T_am": finite,
    "omega": finite,
}


@validated(**PHYSICAL)
def harmonic_gear_two_inertias(
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
    """The harmonic gear as two inertias with the angles θ_o and θ_i, in rad, N m and s.

    With the relative twist θ = θ_o − θ_i/N and the dead zone f_h of half-width φ,

        J_o θ_o'' + C_eq θ' + (k1 + k2 θ²) f_h(θ) = w
        J_i θ_i'' − [C_eq θ' + (k1 + k2 θ²) f_h(θ)]/N = −T_m/N

    with the load torque w = T_m + T_am sin(ω t). The motor torque T_m refers to the
    output side. All angles may grow by θ_o + c, θ_i + N c: the gear turns as a whole and
    has no equilibrium. `harmonic_gear_twist` is the model reduced by this symmetry.

    Parameters
    ----------
    J_i, J_o, N, xi, K_HD, k2 : float
        As for `gear_scales`.
    k1 : float
        Linear torsional stiffness, N m/rad; may be negative.
    phi : float
        Half of the clearance, rad.
    T_m, T_am : float
        Mean and amplitude of the load torque, N m.
    omega : float
        Angular frequency of the torque, rad/s.

    Returns
    -------
    Model
        States theta_o, v_o, theta_i, v_i (rad and rad/s); slow quantity w (N m).

    Raises
    ------
    ArgumentError
        For an inertia, ratio, damping, clearance or cubic stiffness that is not positive,
        or another value that is not a finite number.

    References
    ----------
    M. Ding, Current Journal of Applied Science and Technology 42(7), 66-75, 2023,
    doi 10.9734/CJAST/2023/v42i74082, equations (1) to (4).

    Examples
    --------
    >>> harmonic_gear_two_inertias().states
    ('theta_o', 'v_o', 'theta_i', 'v_i')
    """
    outer, inner, v_outer, v_inner = map(real, ("theta_o", "theta_i", "v_o", "v_i"))
    ratio, j_outer, j_inner, c, w = map(real, ("N", "J_o", "J_i", "C_eq", "w"))
    mean, wave, speed = map(real, ("T_m", "T_am", "omega"))
    inside = c * (v_outer - v_inner / ratio) + _spring(outer - inner / ratio)
    scales = gear_scales(J_i=J_i, J_o=J_o, N=N, xi=xi, K_HD=K_HD, k2=k2)
    return Model(
        {
            outer: v_outer,
            v_outer: (w - inside) / j_outer,
            inner: v_inner,
            v_inner: (inside - mean) / (ratio * j_inner),
        },
        forcing={w: mean + wave * sp.sin(speed * TIME)},
        parameters={
            ratio: N,
            j_outer: J_o,
            j_inner: J_i,
            c: scales.damping,
            "k1": k1,
            "k2": k2,
            "phi": phi,
            mean: T_m,
            wave: T_am,
            speed: omega,
        },
    )


@validated(**PHYSICAL)
def harmonic_gear_twist(
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
    """The relative twist of the harmonic gear, in rad, N m and s.

    J_eq θ'' + C_eq θ' + (k1 + k2 θ²) f_h(θ) = w with the torque
    w = T_m + (J_eq/J_o) T_am sin(ω t): `harmonic_gear_two_inertias` without the motion of
    the gear as a whole.

    Parameters
    ----------
    J_i, J_o, N, xi, K_HD, k1, k2, phi, T_m, T_am, omega : float
        As for `harmonic_gear_two_inertias`.

    Returns
    -------
    Model
        States theta (rad) and v (rad/s); slow quantity w (N m).

    Raises
    ------
    ArgumentError
        For an inertia, ratio, damping, clearance or cubic stiffness that is not positive,
        or another value that is not a finite number.

    References
    ----------
    M. Ding, Current Journal of Applied Science and Technology 42(7), 66-75, 2023,
    doi 10.9734/CJAST/2023/v42i74082, equation (5).

    Examples
    --------
    >>> twist = harmonic_gear_twist()
    >>> print(twist.regions["S1"].rates["v"])
    (-C_eq*v + w - (k1 + k2*theta**2)*(-phi + theta))/J_eq
    >>> f"{twist.parameters['J_eq']:.9g}"
    '0.023915592'
    """
    scales = gear_scales(J_i=J_i, J_o=J_o, N=N, xi=xi, K_HD=K_HD, k2=k2)
    return _twist(
        {
            "J_eq": scales.inertia,
            "J_o": J_o,
            "C_eq": scales.damping,
            "k1": k1,
            "k2": k2,
            "phi": phi,
            "T_m": T_m,
            "T_am": T_am,
            "omega": omega,
        },
        sp.S.One,
    )


def _twist(values: Mapping[str, float], factor: sp.Expr) -> Model:
    """Equation (5), with a factor at the dead zone."""
    theta, v, w = map(real, ("theta", "v", "w"))
    inertia, j_outer, c = map(real, ("J_eq", "J_o", "C_eq"))
    mean, wave, speed = map(real, ("T_m", "T_am", "omega"))
    return Model(
        {theta: v, v: (w - c * v - factor * _spring(theta)) / inertia},
        forcing={w: mean + inertia / j_outer * wave * sp.sin(speed * TIME)},
        parameters=values,
    )


def _spring(twist: sp.Expr) -> sp.Expr:
    """K(θ) f_h(θ)."""
    k1, k2, phi = map(real, ("k1", "k2", "phi"))
    return (k1 + k2 * twist**2) * dead_zone(twist, phi)


@dataclass(frozen=True)
class GearScaling:
    """Scaling of the source as derived and as printed.

    Parameters
    ----------
    equation : sympy.Expr
        Acceleration of the relative twist, derived from the two inertias (2).
    reduced : bool
        True if it is equation (5) divided by J_eq = N² J_i J_o/(N² J_i + J_o).
    consistent : NamedMapping of sympy.Expr
        A, B, C, D, omega as derived from equation (5).
    printed : NamedMapping of sympy.Expr
        A, B, C as printed.
    slip : NamedMapping of sympy.Expr
        A, B, C, D, omega if the factor θ_s in f_h(θ) = θ_s f(x) is omitted.
    ratios : NamedMapping of sympy.Expr
        Ratios of printed to consistent parameters, where they differ.
    reproduced : bool
        True if the omission yields exactly the printed A, B and C.
    agrees : bool
        True if the consistent scaling transforms (5) into (6).
    """

    equation: sp.Expr
    reduced: bool
    consistent: NamedMapping[sp.Expr]
    printed: NamedMapping[sp.Expr]
    slip: NamedMapping[sp.Expr]
    ratios: NamedMapping[sp.Expr]
    reproduced: bool
    agrees: bool


def twist_equation() -> sp.Expr:
    """Return the acceleration of θ = θ_o − θ_i/N, derived from the two inertias (2).

    Returns
    -------
    sympy.Expr
        In theta, v, the equivalent damping C_eq, the load torque T_m and the
        amplitude T_am of its harmonic part; 1/J_o + 1/(N² J_i) is 1/J_eq.

    Examples
    --------
    >>> sorted(map(str, twist_equation().free_symbols))
    ['C_eq', 'J_i', 'J_o', 'N', 'T_am', 'T_m', 'k1', 'k2', 'omega', 'phi', 't', 'theta', 'v']
    """
    outer, inner, v_outer, v_inner = map(real, ("theta_o", "theta_i", "v_o", "v_i"))
    model, ratio = harmonic_gear_two_inertias(), real("N")
    load = {real("w"): model.forcing["w"]}
    rates = {real(name): rate.subs(load) for name, rate in model.rates.items()}
    return reduce_states(rates, {"theta": outer - inner / ratio, "v": v_outer - v_inner / ratio})[
        "v"
    ]


def gear_scaling() -> GearScaling:
    """Derive equations (5) and (6), their parameters, and the error in the printed ones.

    Examples
    --------
    >>> result = gear_scaling()
    >>> result.consistent["A"], result.reduced, result.agrees, result.reproduced
    (J_eq*k1/C_eq**2, True, True, True)
    >>> list(result.ratios)
    ['A', 'B', 'C']
    """
    right, wrong = _identified(False), _identified(True)
    inertia, j_outer, c = map(real, ("J_eq", "J_o", "C_eq"))
    k1, k2, mean, wave = map(real, ("k1", "k2", "T_m", "T_am"))
    printed = {
        "A": k1 * k2 * inertia**2 / c**4,
        "B": k2 * inertia**2 * mean / c**4,
        "C": k2 * inertia**3 * wave / (c**4 * j_outer),
    }
    followed = {n: right.values[n] for n in printed}
    slipped = {n: wrong.values[n] for n in printed}
    equation, single = twist_equation(), harmonic_gear_twist()
    ratio, j_inner = real("N"), real("J_i")
    equivalent = ratio**2 * j_inner * j_outer / (ratio**2 * j_inner + j_outer)
    stated = single.rates["v"].subs(real("w"), single.forcing["w"]).subs(inertia, equivalent)
    return GearScaling(
        equation,
        _same(equation, stated),
        right.values,
        NamedMapping("parameter", printed),
        wrong.values,
        compare_scalings(followed, printed),
        not compare_scalings(printed, slipped),
        right.agrees,
    )


def _same(one: sp.Expr, other: sp.Expr) -> bool:
    """Check that two rates are equal, with the dead zone as an independent quantity."""
    gap = sp.Dummy("f_h", real=True)
    bare = [e.replace(lambda p: isinstance(p, sp.Piecewise), lambda p: gap) for e in (one, other)]
    zones = [e.atoms(sp.Piecewise) for e in (one, other)]
    return zones[0] == zones[1] and vanishes(bare[0] - bare[1])


def _identified(slip: bool) -> Identification:
    """Equation (5) in the scales of (6), without or with the error in f_h(θ) = θ_s f(x)."""
    marked = _twist({**harmonic_gear_twist().parameters, "kappa": 1.0}, real("kappa"))
    factor = 1 / scale_symbol("theta") if slip else sp.S.One
    unit = [("theta", "v"), ("v", "v"), ("v", "theta**3"), ("v", "w")]
    scaling = nondimensionalise(marked, unit, replace={"kappa": factor})
    return identify(scaling, harmonic_gear(), {"theta": "x"})
