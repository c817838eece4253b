"""Systems of equations whose equilibria are proved: rates, unknowns and windows."""

from itertools import combinations_with_replacement

import numpy as np
import sympy as sp

R = sp.Rational


def cusp():
    x, p = sp.symbols("x p", real=True)
    return [p + x - x**3], [x, p], [(-3, 3), (-2, 2)]


def morris_lecar():
    """The set of class I of Rinzel and Ermentrout (1998)."""
    v, w, current = sp.symbols("V w I", real=True)
    m, n = ((1 + sp.tanh((v - a) / b)) / 2 for a, b in ((R("-1.2"), 18), (12, R("17.4"))))
    rates = [
        (current - 2 * (v + 60) - 4 * m * (v - 120) - 8 * w * (v + 84)) / 20,
        R(1, 15) * (n - w) * sp.cosh((v - 12) / (2 * R("17.4"))),
    ]
    return rates, [v, w, current], [(-80, 60), (0, 1), (-50, 300)]


def hodgkin_huxley(potassium=-12):
    """Hodgkin and Huxley (1952) at 6.3 °C, with depolarisation positive."""
    v, m, h, n, current = sp.symbols("V m h n I", real=True)
    am = (25 - v) / 10 / (sp.exp((25 - v) / 10) - 1)
    an = (10 - v) / 100 / (sp.exp((10 - v) / 10) - 1)
    ah, bh = R("0.07") * sp.exp(-v / 20), 1 / (sp.exp((30 - v) / 10) + 1)
    rates = [
        current
        - 120 * m**3 * h * (v - 115)
        - 36 * n**4 * (v - potassium)
        - R("0.3") * (v - R("10.6")),
        am * (1 - m) - 4 * sp.exp(-v / 18) * m,
        ah * (1 - h) - bh * h,
        an * (1 - n) - R("0.125") * sp.exp(-v / 80) * n,
    ]
    return rates, [v, m, h, n, current], [(-20, 120), (0, 1), (0, 1), (0, 1), (-10, 200)]


def brusselators():
    """Two coupled Brusselators, one of them with another inflow."""
    a, b, c, d, rate = sp.symbols("a b c d B", real=True)
    rates = [
        2 - (rate + 1) * a + a**2 * b + R(1, 5) * (c - a),
        rate * a - a**2 * b + 3 * (d - b),
        2 - (rate + 1) * c + c**2 * d + R(1, 5) * (a - c) + R(1, 25),
        rate * c - c**2 * d + 3 * (b - d),
    ]
    return rates, [a, b, c, d, rate], [(R(1, 10), 8)] * 4 + [(1, 7)]


def fitzhugh_nagumo_ring(cells):
    """A ring of FitzHugh-Nagumo cells with weak coupling and slightly different currents."""
    xs, ys = (sp.symbols(f"{name}:{cells}", real=True) for name in "ab")
    current, rates = sp.Symbol("I", real=True), []
    for k, (a, b) in enumerate(zip(xs, ys, strict=True)):
        coupling = R(1, 20) * (xs[(k + 1) % cells] - a)
        rates += [a - a**3 / 3 - b + current + R(k, 100) + coupling]
        rates += [R(2, 25) * (a + R(7, 10) - R(12, 5) * b)]
    states = [s for pair in zip(xs, ys, strict=True) for s in pair]
    return rates, [*states, current], [(-3, 3)] * (2 * cells) + [(-1, 1)]


def cubic(n, seed):
    """Dense polynomials of degree 3 with random coefficients."""
    rng = np.random.default_rng(seed)
    states, p = sp.symbols(f"x:{n}", real=True), sp.Symbol("p", real=True)
    terms = [
        sp.Mul(*c) for degree in range(4) for c in combinations_with_replacement(states, degree)
    ]
    rates = []
    for _ in range(n):
        row = sum(R(int(rng.integers(-20, 21)), 10) * term for term in terms)
        rates.append(row + p * R(int(rng.integers(5, 15)), 10))
    return rates, [*states, p], [(-2, 2)] * (n + 1)


SYSTEMS = {
    "cusp": cusp,
    "Morris-Lecar": morris_lecar,
    "Hodgkin-Huxley": hodgkin_huxley,
    "cubic n = 2": lambda: cubic(2, 2),
    "cubic n = 3": lambda: cubic(3, 1),
    "Brusselator pair": brusselators,
    "cubic n = 4": lambda: cubic(4, 3),
}


def window_of(ranges):
    """Bounds of a window as arrays."""
    return tuple(np.array([float(r[k]) for r in ranges]) for k in (0, 1))
