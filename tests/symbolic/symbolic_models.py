"""Models of the field that the tests of symbolic/ share, frozen and derived once each."""

from functools import cache

import sympy as sp

from fastslow.model.model import Model
from fastslow.symbolic.derivation import Derivation
from fastslow.symbolic.deriving import derive

t = sp.Symbol("t")


def gear(**values: float) -> Model:
    x, v, w = sp.symbols("x v w")
    A, B, C, D, omega = sp.symbols("A B C D omega")
    f = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    return Model(
        {x: v, v: w - v - (x**2 + A) * f},
        forcing={w: B + C * sp.sin(omega * t)},
        parameters={"A": 41.67, "B": 2.372, "C": 3.546, "D": 0.25, "omega": 0.01} | values,
    )


def cusp() -> Model:
    x, p, q = sp.symbols("x p q")
    return Model({x: p + q * x - x**3}, forcing={p: sp.sin(t)}, parameters={q: 1})


def duffing() -> Model:
    x, v, w, a, b, d = sp.symbols("x v w a b d")
    rates = {x: v, v: w - d * v - a * x - b * x**3}
    return Model(rates, forcing={w: sp.cos(t / 50)}, parameters={a: -1, b: 1, d: 0.3})


def van_der_pol() -> Model:
    x, y, a, eps = sp.symbols("x y a epsilon")
    slow = {y: eps * (a - x)}
    return Model({x: y - x**3 / 3 + x}, slow=slow, parameters={a: 0.5, eps: 0.01})


def fitzhugh_nagumo() -> Model:
    v, w, current, a, b, eps = sp.symbols("v w I a b epsilon")
    rates = {v: v - v**3 / 3 - w + current, w: eps * (v + a - b * w)}
    return Model(rates, forcing={current: sp.sin(t)}, parameters={a: 0.7, b: 0.8, eps: 0.08})


def lorenz() -> Model:
    x, y, z, sigma, rho, beta = sp.symbols("x y z sigma rho beta")
    rates = {x: sigma * (y - x), y: x * (rho - z) - y, z: x * y - beta * z}
    return Model(rates, parameters={sigma: 10, rho: 28, beta: sp.Rational(8, 3)})


def hindmarsh_rose() -> Model:
    x, y, z, a, b, c, d, current, r = sp.symbols("x y z a b c d I r")
    return Model(
        {x: y - a * x**3 + b * x**2 - z + current, y: c - d * x**2 - y},
        slow={z: r * (4 * (x + 1.6) - z)},
        parameters={a: 1, b: 3, c: 1, d: 5, current: 2, r: 0.001},
    )


def chua() -> Model:
    x, y, z, alpha, beta, m0, m1 = sp.symbols("x y z alpha beta m0 m1")
    diode = m1 * x + (m0 - m1) / 2 * (sp.Abs(x + 1) - sp.Abs(x - 1))
    return Model(
        {x: alpha * (y - x - diode), y: x - y + z, z: -beta * y},
        parameters={alpha: 9, beta: 14.28, m0: -sp.Rational(8, 7), m1: -sp.Rational(5, 7)},
    )


def two_interfaces() -> Model:
    x, y, w, a, b = sp.symbols("x y w a b")
    rates = {x: y - a * sp.Max(x - 1, 0) + b * sp.Max(-y, 0) - x, y: w - x - y}
    return Model(rates, forcing={w: sp.sin(t)}, parameters={a: 2, b: 0.5})


def stick_slip() -> Model:
    x, v, w, k, d, mu, u = sp.symbols("x v w k d mu u")
    rates = {x: v, v: w - k * x - d * v - mu * sp.sign(v - u)}
    return Model(rates, forcing={w: sp.sin(t)}, parameters={k: 1, d: 0.1, mu: 0.5, u: 1})


def relay() -> Model:
    x, v, w, d, mu = sp.symbols("x v w d mu")
    rates = {x: v, v: w - x - d * v - mu * sp.sign(x - 1)}
    return Model(rates, forcing={w: sp.sin(t)}, parameters={d: 0.1, mu: 0.5})


def auto_ab() -> Model:
    u1, u2, p1, p2, p3 = sp.symbols("u1 u2 p1 p2 p3")
    hot = p1 * (1 - u1) * sp.exp(u2)
    rates = {u1: -u1 + hot, u2: -u2 + p2 * hot - p3 * u2}
    return Model(rates, forcing={p1: sp.sin(t)}, parameters={p2: 14, p3: 2})


def morris_lecar() -> Model:
    v, n, current = sp.symbols("v n I")
    open_m = (1 + sp.tanh((v + 1.2) / 18)) / 2
    open_n = (1 + sp.tanh((v - 12) / 17.4)) / 2
    ionic = 2 * (v + 60) + 4 * open_m * (v - 120) + 8 * n * (v + 84)
    rates = {v: (current - ionic) / 20, n: (open_n - n) * sp.cosh((v - 12) / 34.8) / 15}
    return Model(rates, forcing={current: sp.sin(t)})


def four_states() -> Model:
    x1, x2, x3, x4, w, a, b, c, d = sp.symbols("x1 x2 x3 x4 w a b c d")
    return Model(
        {
            x1: x2 - x1**3 + a * x1,
            x2: x3 - b * x2 + x1**2,
            x3: x4 - c * x3,
            x4: w - x4 + d * x1 * x2,
        },
        forcing={w: sp.sin(t)},
        parameters={a: 1, b: 2, c: 1, d: 0.5},
    )


def dense_linear() -> Model:
    """Four states, eight free parameters, no zero in the matrix."""
    states = sp.symbols("x1:5")
    a, b, c, d, e, f, g, h = sp.symbols("k1:9")
    w = sp.Symbol("w")
    matrix = sp.Matrix([[a, b, c, d], [e, f, g, h], [1, a, e, 2], [b, 3, f, h]])
    rates = matrix * sp.Matrix(states) + sp.Matrix([w, 1, 2, 3])
    values = {k: (-1) ** n * (n + 1) for n, k in enumerate((a, b, c, d, e, f, g, h))}
    return Model(dict(zip(states, rates, strict=True)), forcing={w: sp.sin(t)}, parameters=values)


def food_chain() -> Model:
    """Prey, predator with a Holling type II response, top predator."""
    x, y, z, r, K, a, b, e, m, d, h = sp.symbols("x y z r K a b e m d h")
    eaten = a * x * y / (1 + h * x)
    return Model(
        {x: r * x * (1 - x / K) - eaten, y: e * eaten - m * y - b * y * z, z: b * y * z - d * z},
        parameters={r: 1, K: 2, a: 2, b: 1, e: 0.5, m: 0.2, d: 0.1, h: 1},
    )


def two_responses() -> Model:
    """A food chain with a Holling type II response at both links (Hastings and Powell 1991)."""
    x, y, z, a1, b1, a2, b2, d1, d2 = sp.symbols("x y z a1 b1 a2 b2 d1 d2")
    first, second = a1 * x * y / (1 + b1 * x), a2 * y * z / (1 + b2 * y)
    return Model(
        {x: x * (1 - x) - first, y: first - second - d1 * y, z: second - d2 * z},
        parameters={a1: 5, b1: 3, a2: 0.1, b2: 2, d1: 0.4, d2: 0.01},
    )


def quadratic() -> Model:
    """Three states with all quadratic terms."""
    x, y, z, w = sp.symbols("x y z w")
    terms = [x**2, x * y, y**2, y * z, z**2, x * z, x, y, z]
    names = sp.symbols("q0:27")
    values = {q: (-1) ** n * sp.Rational(2 * n + 1, 5) for n, q in enumerate(names)}
    rates = [sum(q * s for q, s in zip(names[k : k + 9], terms, strict=True)) for k in (0, 9, 18)]
    return Model(
        {x: rates[0] + w, y: rates[1], z: rates[2]}, forcing={w: sp.sin(t)}, parameters=values
    )


def hodgkin_huxley() -> Model:
    v, m, h, n, current, g_na, g_k, g_l = sp.symbols("v m h n I g_Na g_K g_L")
    exp = sp.exp
    opening_m = (v + 40) / 10 / (1 - exp(-(v + 40) / 10))
    opening_n = (v + 55) / 100 / (1 - exp(-(v + 55) / 10))
    ionic = g_na * m**3 * h * (v - 50) + g_k * n**4 * (v + 77) + g_l * (v + 54)
    return Model(
        {
            v: current - ionic,
            m: opening_m * (1 - m) - 4 * exp(-(v + 65) / 18) * m,
            h: exp(-(v + 65) / 20) * (1 - h) * 7 / 100 - h / (1 + exp(-(v + 35) / 10)),
            n: opening_n * (1 - n) - exp(-(v + 65) / 80) * n / 8,
        },
        forcing={current: sp.sin(t)},
        parameters={g_na: 120, g_k: 36, g_l: 0.3},
    )


def coupled_oscillators() -> Model:
    x1, v1, x2, v2, w = sp.symbols("x1 v1 x2 v2 w")
    k1, k2, k3, b1, b2, d1, d2, m = sp.symbols("k1 k2 k3 b1 b2 d1 d2 m")
    pull = k3 * (x1 - x2)
    return Model(
        {
            x1: v1,
            v1: w - d1 * v1 - k1 * x1 - b1 * x1**3 - pull,
            x2: v2,
            v2: (pull - d2 * v2 - k2 * x2 - b2 * x2**3) / m,
        },
        forcing={w: sp.sin(t)},
        parameters={k1: 1, k2: 2, k3: 0.5, b1: 1, b2: 0.3, d1: 0.1, d2: 0.2, m: 1.5},
    )


@cache
def derived(name: str) -> Derivation:
    """The derivation of one of the models above, by the name of its function."""
    return derive(globals()[name]().frozen())
