"""The harmonic gear from its two inertias to the dimensionless equation, by derivation.

M. Ding, "Fast-slow Dynamical Analysis in Harmonic Gear Transmission System with
Non-smooth Gear Clearance Condition", Current Journal of Applied Science and
Technology 42(7), 66-75, 2023, doi 10.9734/CJAST/2023/v42i74082, equations (2) to (7).
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from fastslow.model.model import Model
from fastslow.model.structure import TIME, real
from fastslow.results.named import Named
from fastslow.symbolic.reduction import reduce_states
from fastslow.symbolic.scaling import (
    Identification,
    disagreements,
    identify,
    nondimensionalise,
    scale_symbol,
)
from fastslow.symbolic.verification import vanishes

#: Values of the paper that the derivation needs only for their signs.
VALUES = {
    "J": 0.0239155920,
    "Jo": 2.4e-2,
    "c": 1.31222049,
    "k1": 3000.0,
    "k2": 21000.0,
    "phi": 1.75e-2,
    "Tm": 10.0,
    "Tam": 15.0,
    "Omega": 1.0,
    "kappa": 1.0,
}


@dataclass(frozen=True)
class GearScaling:
    """The paper's scaling as it follows, and as it is printed.

    Parameters
    ----------
    equation : sympy.Expr
        Acceleration of the relative twist, derived from the two inertias (2).
    reduced : bool
        Whether that is equation (5) divided by J_eq = N² J_i J_o/(N² J_i + J_o).
    consistent : Named of sympy.Expr
        A, B, C, D, omega as they follow from equation (5).
    printed : Named of sympy.Expr
        A, B, C as the paper prints them.
    slip : Named of sympy.Expr
        A, B, C, D, omega when the factor θ_s in f_h(θ) = θ_s f(x) is left out.
    ratios : Named of sympy.Expr
        Printed to consistent, for those that differ.
    reproduced : bool
        Whether the slip gives exactly the printed A, B and C.
    agrees : bool
        Whether the consistent scaling turns (5) into (6) without contradiction.
    """

    equation: sp.Expr
    reduced: bool
    consistent: Named[sp.Expr]
    printed: Named[sp.Expr]
    slip: Named[sp.Expr]
    ratios: Named[sp.Expr]
    reproduced: bool
    agrees: bool


def two_inertia_model() -> Model:
    """Equations (2): the load side and the motor side, each with its angle and speed.

    The load torque is Tm + Tam sin(Omega t), the motor's Tm; Ji and N stand
    here only, and make J = N² Ji Jo/(N² Ji + Jo).

    Examples
    --------
    >>> two_inertia_model().states
    ('theta_o', 'v_o', 'theta_i', 'v_i')
    """
    outer, inner, v_outer, v_inner = map(real, ("theta_o", "theta_i", "v_o", "v_i"))
    ratio, j_outer, j_inner, c, w = map(real, ("N", "Jo", "Ji", "c", "w"))
    mean, wave, speed = map(real, ("Tm", "Tam", "Omega"))
    twist, rate = outer - inner / ratio, v_outer - v_inner / ratio
    inside = c * rate + _spring(twist)
    used = {name: value for name, value in VALUES.items() if name != "J"}
    return Model(
        {
            outer: v_outer,
            v_outer: (w - inside) / j_outer,
            inner: v_inner,
            v_inner: (inside - mean) / (ratio * j_inner),
        },
        forcing={w: mean + wave * sp.sin(speed * TIME)},
        parameters={**used, "N": 100.0, "Ji": 6.8e-4},
    )


def twist_equation() -> sp.Expr:
    """Acceleration of θ = θ_o − θ_i/N, derived from the two inertias (2).

    Returns
    -------
    sympy.Expr
        In theta, v, the equivalent damping c, the load torque Tm and the
        amplitude Tam of its harmonic part; 1/Jo + 1/(N² Ji) is 1/J.

    Examples
    --------
    >>> sorted(map(str, twist_equation().free_symbols))
    ['Ji', 'Jo', 'N', 'Omega', 'Tam', 'Tm', 'c', 'k1', 'k2', 'kappa', 'phi', 't', 'theta', 'v']
    """
    outer, inner, v_outer, v_inner = map(real, ("theta_o", "theta_i", "v_o", "v_i"))
    model, ratio = two_inertia_model(), real("N")
    load = {real("w"): model.forcing["w"]}
    rates = {real(name): rate.subs(load) for name, rate in model.rates.items()}
    return reduce_states(rates, {"theta": outer - inner / ratio, "v": v_outer - v_inner / ratio})[
        "v"
    ]


def _spring(twist: sp.Expr) -> sp.Expr:
    """K(θ) f_h(θ); kappa = 1 marks the factor that belongs to the scaled dead zone."""
    k1, k2, phi, kappa = map(real, ("k1", "k2", "phi", "kappa"))
    gap = sp.Piecewise((twist - phi, twist > phi), (twist + phi, twist < -phi), (0, True))
    return kappa * (k1 + k2 * twist**2) * gap


def physical_model() -> Model:
    """Equation (5) with the load as slow quantity w.

    Examples
    --------
    >>> physical_model().free, physical_model().states
    ((), ('theta', 'v'))
    """
    theta, v, w = map(real, ("theta", "v", "w"))
    inertia, j_outer, c = map(real, ("J", "Jo", "c"))
    mean, wave, speed = map(real, ("Tm", "Tam", "Omega"))
    return Model(
        {theta: v, v: (w - c * v - _spring(theta)) / inertia},
        forcing={w: mean + inertia / j_outer * wave * sp.sin(speed * TIME)},
        parameters=VALUES,
    )


def dimensionless_model() -> Model:
    """Equation (6)."""
    x, v, w = map(real, ("x", "v", "w"))
    a, b, c, d, speed = map(real, ("A", "B", "C", "D", "omega"))
    gap = sp.Piecewise((x - d, x > d), (x + d, x < -d), (0, True))
    return Model(
        {x: v, v: w - v - (x**2 + a) * gap},
        forcing={w: b + c * sp.sin(speed * TIME)},
        parameters={a: 41.6666667, b: 2.37197934, c: 3.54545564, d: 0.298869397, speed: 0.02},
    )


def gear_scaling() -> GearScaling:
    """Derive equations (5) and (6), the parameters that follow, and the slip in the printed ones.

    Examples
    --------
    >>> result = gear_scaling()
    >>> result.consistent["A"], result.reduced, result.agrees, result.reproduced
    (J*k1/c**2, True, True, True)
    >>> list(result.ratios)
    ['A', 'B', 'C']
    """
    right, wrong = _identified(False), _identified(True)
    inertia, j_outer, c = map(real, ("J", "Jo", "c"))
    k1, k2, mean, wave = map(real, ("k1", "k2", "Tm", "Tam"))
    printed = {
        "A": k1 * k2 * inertia**2 / c**4,
        "B": k2 * inertia**2 * mean / c**4,
        "C": k2 * inertia**3 * wave / (c**4 * j_outer),
    }
    followed = {n: right.values[n] for n in printed}
    slipped = {n: wrong.values[n] for n in printed}
    equation, single = twist_equation(), physical_model()
    ratio, j_inner = real("N"), real("Ji")
    equivalent = ratio**2 * j_inner * j_outer / (ratio**2 * j_inner + j_outer)
    stated = single.rates["v"].subs(real("w"), single.forcing["w"]).subs(inertia, equivalent)
    return GearScaling(
        equation,
        _same(equation, stated),
        right.values,
        Named("parameter", printed),
        wrong.values,
        disagreements(followed, printed),
        not disagreements(printed, slipped),
        right.agrees,
    )


def _same(one: sp.Expr, other: sp.Expr) -> bool:
    """Whether two rates agree, the dead zone taken as one quantity of its own."""
    gap = sp.Dummy("f_h", real=True)
    bare = [e.replace(lambda p: isinstance(p, sp.Piecewise), lambda p: gap) for e in (one, other)]
    zones = [e.atoms(sp.Piecewise) for e in (one, other)]
    return zones[0] == zones[1] and vanishes(bare[0] - bare[1])


def _identified(slip: bool) -> Identification:
    factor = 1 / scale_symbol("theta") if slip else sp.S.One
    ones = [("theta", "v"), ("v", "v"), ("v", "theta**3"), ("v", "w")]
    scaling = nondimensionalise(physical_model(), ones, replace={"kappa": factor})
    return identify(scaling, dimensionless_model(), {"theta": "x"})
