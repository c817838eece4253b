"""Models with known periodic orbits."""

import sympy as sp

import fastslow as fs

x, v, t = sp.symbols("x v t")


def gap_force(half):
    """Force of a unit stiffness outside a gap."""
    return sp.Piecewise((x - half, x > half), (x + half, x < -half), (0, True))


def gear_pair(**values):
    """Gear pair with the unit dead zone, after Kahraman and Singh (1990)."""
    z, Fm, Fa, W = sp.symbols("z Fm Fa W")
    rate = -2 * z * v - gap_force(1) + Fm + Fa * W**2 * sp.sin(W * t)
    standard = {"z": 0.05, "Fm": 0.1, "Fa": 0.05, "W": 0.75}
    return fs.Model({x: v, v: rate}, parameters=standard | values)


def smooth_gear():
    """A gear without contact loss at these values."""
    A, B, C, D, omega, w = sp.symbols("A B C D omega w")
    return fs.Model(
        {x: v, v: w - v - (x**2 + A) * gap_force(D)},
        forcing={w: B + C * sp.sin(omega * t)},
        parameters={A: 0.5, B: 1, C: 0.6, D: 0.25, omega: 1},
    )


def van_der_pol(mu=1, direction=1):
    """Van der Pol's oscillator, with direction −1 in reversed time."""
    m = sp.Symbol("mu")
    rates = {x: direction * v, v: direction * (m * (1 - x**2) * v - x)}
    return fs.Model(rates, parameters={m: mu})


def block_on_belt():
    """A block with friction that decreases with the sliding speed, on a belt of speed 0.2."""
    slip = v - sp.Rational(1, 5)
    return fs.Model({x: v, v: -x - sp.sign(slip) * 0.3 / (1 + 3 * sp.Abs(slip))})


def two_sided(**values):
    """Oscillator between two stops, symmetric under x → −x with F → −F."""
    F, omega = sp.symbols("F omega")
    rate = F * sp.cos(omega * t) - v / 5 - x - 10 * gap_force(1)
    return fs.Model({x: v, v: rate}, parameters={"F": 1, "omega": 1} | values)
