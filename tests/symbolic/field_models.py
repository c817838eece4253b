"""Models of several fields whose closed forms the tests of derive() compare with numbers."""

import sympy as sp

from fastslow.model.model import Model

t = sp.Symbol("t")


def boost_converter() -> Model:
    """Averaged boost converter with saturated duty, input voltage frozen."""
    i, v, v_in, ind, cap, res, ref, k = sp.symbols("i v V_in L C R V_ref k")
    duty = sp.Min(1, sp.Max(0, k * (ref - v)))
    return Model(
        {i: (v_in - (1 - duty) * v) / ind, v: ((1 - duty) * i - v / res) / cap},
        forcing={v_in: 5 + sp.sin(t / 100)},
        parameters={ind: 1, cap: 1, res: 2, ref: 10, k: 0.5},
    ).frozen()


def wheelset() -> Model:
    """Railway wheelset with flange dead band, lateral and yaw motion, speed frozen."""
    y, vy, psi, vp = sp.symbols("y vy psi vp")
    speed, conicity, kf, ky, c, d, r0 = sp.symbols("V lambda k_f k_y c d r_0")
    flange = sp.Piecewise((y - d, y > d), (y + d, y < -d), (0, True))
    return Model(
        {
            y: vy,
            vy: -2 * c / speed * vy + 2 * c * psi - ky * y - kf * flange,
            psi: vp,
            vp: -2 * c / speed * vp - 2 * c * conicity / r0 * y - ky * psi,
        },
        forcing={speed: 1 + t / 1000},
        parameters={conicity: 0.05, kf: 100, ky: 1, c: 2, d: 0.01, r0: 0.45},
    ).frozen()


def toggle_switch() -> Model:
    """Two genes that repress each other, inducer frozen (Gardner, Cantor and Collins 2000)."""
    u, v, a1, a2, inducer, k = sp.symbols("u v alpha_1 alpha_2 I K")
    return Model(
        {u: a1 / (1 + v**2) - u, v: a2 / (1 + u / (1 + inducer / k) ** 2) - v},
        forcing={inducer: t / 1000},
        parameters={a1: 156.25, a2: 15.6, k: 1},
    ).frozen()


def rosenzweig_macarthur() -> Model:
    """Predator and prey, carrying capacity frozen."""
    x, y, big, a, h, e, m = sp.symbols("x y K a h e m")
    eaten = a * x * y / (1 + a * h * x)
    return Model(
        {x: x * (1 - x / big) - eaten, y: e * eaten - m * y},
        forcing={big: 2 + t / 100},
        parameters={a: 1, h: 0.5, e: 0.6, m: 0.3},
    ).frozen()


def sir_with_capacity() -> Model:
    """Infection with limited treatment (Wang 2006), contact rate frozen."""
    s, i, rate, d, g, eps, r, cap, m = sp.symbols("S I lambda d gamma epsilon r I_c m")
    return Model(
        {s: m - d * s - rate * s * i, i: rate * s * i - (d + g + eps) * i - r * sp.Min(i, cap)},
        forcing={rate: 0.1 + t / 1000},
        parameters={m: 2, d: 0.1, g: 0.1, eps: 0.05, r: 0.3, cap: 1},
    ).frozen()


def mckean() -> Model:
    """Piecewise-linear nerve (McKean 1970), current frozen."""
    v, w, current, a, g = sp.symbols("v w I a gamma")
    f = sp.Piecewise((-v, v < a / 2), (v - a, v < (1 + a) / 2), (1 - v, True))
    return Model(
        {v: f - w + current, w: v - g * w},
        forcing={current: sp.sin(t)},
        parameters={a: 0.25, g: 0.5},
    ).frozen()


def stommel() -> Model:
    """Box model of the ocean (Stommel 1961), freshwater flux frozen."""
    x, y, flux, eta1, eta3 = sp.symbols("x y F eta_1 eta_3")
    flow = sp.Abs(x - y)
    return Model(
        {x: eta1 - x * (1 + flow), y: flux - y * (eta3 + flow)},
        forcing={flux: 1 + sp.sin(t) / 10},
        parameters={eta1: 3, eta3: 0.3},
    ).frozen()


def welander() -> Model:
    """Convection that sets in at a density (Welander 1982), its threshold frozen."""
    x, y, eps, b, k1, k2 = sp.symbols("x y epsilon beta k_1 k_2")
    mixing = sp.Piecewise((k1, y - x > eps), (k2, True))
    return Model(
        {x: 1 - x - mixing * x, y: b * (1 - y) - mixing * y},
        forcing={eps: sp.sin(t) / 100},
        parameters={b: 0.5, k1: 1, k2: 0.1},
    ).frozen()


def quantity_named_q() -> Model:
    x, y, q, a = sp.symbols("x y q a")
    return Model(
        {x: y - a * sp.Max(x, 0), y: q - x - y}, forcing={q: sp.sin(t)}, parameters={a: 2}
    ).frozen()


def daisyworld(*, numbers: bool = False, root: bool = False, black: bool = True) -> Model:
    """Two kinds of daisies (Watson and Lovelock 1983), luminosity frozen.

    The temperature that radiates what is absorbed is a fourth root, or that linearised. Without
    ``black`` there are white daisies only.
    """
    white, light = sp.symbols("a_w L")
    dark = sp.Symbol("a_b") if black else sp.Integer(0)
    a_w, a_b, a_g, s, sigma, q, death, best, k, p = sp.symbols("A_w A_b A_g S sigma q g T_0 k p")
    ground = sp.Max(0, p - white - dark)
    albedo = (p - white - dark) * a_g + white * a_w + dark * a_b

    absorbed = s * light * (1 - albedo) / sigma
    warmth = sp.root(absorbed, 4) - 273.15 if root else absorbed / (4 * 295**3) - 50

    def growth(own: sp.Symbol) -> sp.Expr:
        local = 20 * (albedo - own) + warmth
        return sp.Max(0, 1 - k * (best - local) ** 2)

    values = {a_w: 0.75, a_b: 0.25, a_g: 0.5, s: 917.0, sigma: 5.67e-8, q: 20.0}
    values |= {death: 0.3, best: 22.5, k: 0.003265, p: 1.0}
    values.pop(q)
    rates = {white: white * (ground * growth(a_w) - death)}
    if black:
        rates[dark] = dark * (ground * growth(a_b) - death)
    if numbers:
        rates = {n: e.subs(values) for n, e in rates.items()}
    return Model(
        rates, forcing={light: 0.6 + t / 1000}, parameters={} if numbers else values
    ).frozen()
