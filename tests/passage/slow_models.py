"""Models of several fields that pass a special point slowly, measured without the library.

Each case is a full model with a slow state or a forcing, the point that it passes, and what ends
the passage. `measured` integrates the model's equations with SciPy; `predicted` is the law
for the drift that the equations give.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import fastslow as fs
from fastslow.model.structure import TIME, real
from fastslow.passage.delays.drifts import drift_of_law

x, y, v, p, w, e, t = sp.symbols("x y v p w epsilon t")

#: Where slow states are held other than the one that passes.
HELD = 1.5

#: Error control of the reference.
PRECISE = {"method": "LSODA", "rtol": 1e-12, "atol": 1e-14}


@dataclass(frozen=True, eq=False)
class Case:
    """A model that passes a point.

    Parameters
    ----------
    name : str
    model : fs.Model
        With the parameter epsilon, the rate of the drift.
    slow : str
        The slow quantity.
    over : (float, float)
        Of its diagram.
    point : callable
        Picks the point from the diagram.
    start : float
        Slow quantity at the start, on the branch before the point.
    guess : tuple
        Near the state there.
    level : mapping, "turn" or None
        None at a gap or with persistence: the interface that is reached.
    rates : tuple of float
    """

    name: str
    model: fs.Model
    slow: str
    over: tuple[float, float]
    point: Callable
    start: float
    guess: tuple
    level: Mapping | str | None
    rates: tuple[float, ...] = (1e-2, 1e-3, 1e-4)


@cache
def special(case):
    """The point of a case, and its frozen model."""
    frozen = case.model.frozen()
    if "epsilon" in frozen.parameters:
        frozen = frozen.with_parameters(epsilon=0.01)
    others = {n: HELD for n in frozen.free if n != case.slow}
    frozen = frozen.with_parameters(others) if others else frozen
    return case.point(fs.continue_equilibria(frozen, case.slow, over=case.over)), frozen


def _law(case, eps):
    """w' in states, w, other slow states and t; and w(t) of a forcing."""
    model = case.model.with_parameters(epsilon=eps)
    values = {n: sp.Float(value, 17) for n, value in model.values.items()}
    if case.slow in model.forcing:
        forced = model.forcing[case.slow].xreplace(values)
        return forced.diff(TIME), forced
    return model.rates[case.slow].xreplace(values), None


def predicted(case, eps):
    """The law at a rate; with several slow states the others are at rest."""
    point, frozen = special(case)
    law, forced = _law(case, eps)
    if forced is not None:
        passed = _passing_time(case, forced, point[case.slow], eps)
        law = law.xreplace({TIME: TIME + sp.Float(passed, 17)})
    law = law.xreplace(
        {real(n): sp.Float(HELD, 17) for n in case.model.slow_states if n != case.slow}
    )
    here = {n: point[n] for n in (*case.model.states, case.slow)}
    return fs.predict_delay(
        point,
        drift_of_law(law, here),
        level=case.level,
        parameter=case.slow,
        model=frozen,
    )


def _passing_time(case, forced, value, eps):
    function = sp.lambdify(TIME, forced)
    begin = _begin(case, forced, eps)
    times = begin + np.linspace(0.0, 20.0 / eps, 20001)
    height = np.array([function(time) for time in times]) - value
    k = int(np.flatnonzero(np.diff(np.sign(height)))[0])
    return brentq(lambda s: function(s) - value, times[k], times[k + 1], xtol=1e-13)


def _begin(case, forced, eps):
    function = sp.lambdify(TIME, forced)
    times = np.linspace(-2.0 / eps, 8.0 / eps, 20001)
    height = np.array([function(time) for time in times]) - case.start
    k = int(np.flatnonzero(np.diff(np.sign(height)))[0])
    return brentq(lambda s: function(s) - case.start, times[k], times[k + 1])


def measured(case, eps):
    """How far past the point the slow quantity is, by SciPy."""
    point, _ = special(case)
    model = case.model.with_parameters(epsilon=eps)
    law, forced = _law(case, eps)
    values = {n: sp.Float(value, 17) for n, value in model.values.items()}
    held = {real(n): HELD for n in model.slow_states if n != case.slow}
    names = [real(n) for n in (*model.states, case.slow)]
    fast = [model.rates[n].xreplace({**values, **held}) for n in model.states]
    rates = sp.lambdify([*names, TIME], [*fast, law.xreplace(held)])
    n = len(model.states)
    state = fsolve(lambda s: rates(*s, case.start, 0.0)[:n], case.guess, xtol=1e-13)
    begin = 0.0 if forced is None else _begin(case, forced, eps)
    value = point[case.slow]

    def flow(time, z):
        return rates(*z, time)

    def passes(time, z):
        return z[n] - value

    passes.terminal = True
    z = [*state, case.start]
    first = solve_ivp(flow, (begin, begin + 50 / eps), z, events=passes, **PRECISE)
    assert first.status == 1, "the point is not passed"
    way = np.sign(value - case.start)

    def done(time, z):
        if case.level == "turn":
            return way * rates(*z, time)[n]
        if case.level is None:
            return far(*z[:n])
        ((name, height),) = case.level.items()
        return z[model.states.index(name)] - height

    if case.level is None:
        name = far_interface(case)
        far = sp.lambdify(names[:n], model.interfaces[name].function.xreplace(values))
    done.terminal = True
    last = first.y[:, -1]
    second = solve_ivp(flow, (first.t[-1], first.t[-1] + 50 / eps), last, events=done, **PRECISE)
    assert second.status == 1, "the passage does not end"
    return float(way * (second.y[n, -1] - value))


def far_interface(case):
    law = predicted(case, case.rates[-1])
    return getattr(law, "interfaces", (None, case.point and law.point.interface))[1]


def _fold(side):
    """The fold with the largest (+1) or smallest (−1) first state."""

    def pick(diagram):
        return max(diagram.folds, key=lambda f: side * f[diagram.states[0]])

    return pick


def _corner(code_subtype, key=lambda b: 0.0):
    def pick(diagram):
        found = [b for b in diagram.boundary_equilibria if b.type == code_subtype]
        return min(found, key=key)

    return pick


def cusp():
    model = fs.Model({x: p + x - x**3}, forcing={p: sp.sin(e * t)}, parameters={e: 0.01})
    return Case(
        "cusp, sine", model, "p", (-1, 1), _fold(-1), -0.6, (-1.2,), {"x": 0.5},
        (3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
    )  # fmt: skip


def stommel(way):
    """Salinity difference under a freshwater flux, flow |1 − y| (Stommel 1961, T relaxed)."""
    model = fs.Model(
        {y: p - sp.Abs(1 - y) * y},
        forcing={p: (0.1 if way > 0 else 0.3) + way * e * t},
        parameters={e: 0.01},
    )
    if way > 0:
        return Case("Stommel, fold", model, "p", (-0.2, 0.5), _fold(-1), 0.1, (0.11,), {"y": 1.1})
    return Case(
        "Stommel, corner", model, "p", (-0.2, 0.5), _corner("non-smooth fold"), 0.3, (1.24,),
        {"y": 0.6},
    )  # fmt: skip


def van_der_pol():
    model = fs.systems.van_der_pol_relaxation(a=0.1)
    return Case(
        "van der Pol", model, "y", (-1, 1), _fold(1), 0.5, (2.0,), "turn",
        (3e-2, 1e-2, 1e-3, 1e-4, 1e-5),
    )  # fmt: skip


def van_der_pol_linear():
    force = sp.Piecewise((x - 2, x > 1), (x + 2, x < -1), (-x, True))
    model = fs.Model({x: w - force}, slow={w: -e * x}, parameters={e: 0.01})
    return Case(
        "van der Pol, piecewise linear", model, "w", (-2, 2),
        _corner("non-smooth fold", lambda b: -b["x"]), 0.5, (2.5,), "turn",
        (3e-2, 1e-2, 1e-3, 1e-4),
    )  # fmt: skip


def mckean():
    """H. P. McKean, Advances in Mathematics 4, 209-223, 1970; continuous, with three slopes."""
    force = sp.Piecewise((-v, v < sp.Rational(1, 8)), (1 - v, v > sp.Rational(5, 8)),
                         (v - sp.Rational(1, 4), True))  # fmt: skip
    model = fs.Model(
        {v: force - w + sp.Rational(1, 2)}, slow={w: e * (v - w / 2 + 0.1)}, parameters={e: 0.01}
    )
    return Case(
        "McKean", model, "w", (-1, 2), _corner("non-smooth fold", lambda b: -b["v"]), 0.6,
        (0.9,), "turn",
    )  # fmt: skip


def oregonator(side):
    """J. J. Tyson and P. C. Fife, J. Chem. Phys. 73, 2224-2237, 1980; time by the fast one."""
    q = sp.Rational(8, 10000)
    model = fs.Model(
        {x: x * (1 - x) - w * (x - q) / (x + q)}, slow={w: e * (x - w)}, parameters={e: 0.04}
    )
    if side > 0:
        return Case(
            "Oregonator, upper fold", model, "w", (0.002, 0.4), _fold(1), 0.15, (0.8,), "turn",
            (4e-2, 1e-2, 1e-3),
        )  # fmt: skip
    return Case(
        "Oregonator, lower fold", model, "w", (0.002, 0.4), _fold(-1), 0.1, (0.00081,), "turn",
        (4e-2, 1e-2, 1e-3),
    )  # fmt: skip


def koper():
    """M. T. M. Koper, Physica D 80, 72-94, 1995, with its second slow state held."""
    z = sp.Symbol("z")
    model = fs.Model(
        {x: -10 * y - x**3 + 3 * x + 7},
        slow={y: e * (x - 2 * y + z), z: e * (y - z)},
        parameters={e: 0.01},
    )
    return Case("Koper", model, "y", (0, 2), _fold(1), 0.6, (1.9,), "turn", (1e-1, 1e-2, 1e-3))


def fitzhugh_nagumo():
    model = fs.Model(
        {v: v - v**3 / 3 - w + sp.Rational(1, 2)},
        slow={w: e * (v + 0.7 - 0.8 * w)},
        parameters={e: 0.01},
    )
    return Case("FitzHugh-Nagumo", model, "w", (-1, 2), _fold(1), 0.6, (1.7,), "turn",
                (8e-2, 1e-2, 1e-3, 1e-4))  # fmt: skip


def morris_lecar():
    """C. Morris and H. Lecar, Biophysical Journal 35, 193-213, 1981; w slow, volts by 100 mV."""
    gate = (1 + sp.tanh((v + 0.01) / 0.15)) / 2
    rest = (1 + sp.tanh((v + 0.1) / 0.145)) / 2
    model = fs.Model(
        {v: 0.6 - 0.5 * (v + 0.5) - 1.1 * gate * (v - 1) - 2 * w * (v + 0.7)},
        slow={w: e * (rest - w) * sp.cosh((v + 0.1) / 0.29)},
        parameters={e: 0.01},
    )
    return Case("Morris-Lecar", model, "w", (-0.2, 1.2), _fold(1), 0.1, (0.5,), "turn",
                (3e-2, 1e-2, 1e-3))  # fmt: skip


def laser():
    """Intensity with a saturable absorber, the pump falling."""
    model = fs.Model(
        {x: x * (-1 + w / (1 + x) - 2 / (1 + 6 * x))}, forcing={w: 4 - e * t}, parameters={e: 0.01}
    )
    return Case("laser", model, "w", (1, 4.5), _fold(1), 3.5, (2.1,), {"x": 0.1})


def budworm():
    """D. Ludwig, D. D. Jones and C. S. Holling, J. Animal Ecology 47, 315-332, 1978."""
    model = fs.Model(
        {x: x * (1 - x / w) / 2 - x**2 / (1 + x**2)},
        slow={w: -e * w * (1 + x / 8) / 4},
        parameters={e: 0.01},
    )
    return Case("budworm", model, "w", (2, 20), _fold(1), 12.0, (9.0,), {"x": 1.0})


def harvest():
    model = fs.Model(
        {x: x * (1 - x) - w * x**2 / (x**2 + 0.01)},
        forcing={w: 0.15 + e * t + e**2 * t**2 / 4},
        parameters={e: 0.01},
    )
    return Case("harvest, load speeding up", model, "w", (0.02, 0.4), _fold(1), 0.16, (0.8,),
                {"x": 0.1})  # fmt: skip


def gear():
    model = fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25).frozen()
    contact = dict(model.rates)
    load = 1 - 3 * sp.sin(e * t)
    full = fs.Model(contact, forcing={w: load}, parameters={**model.parameters, e: 0.01})
    return Case("gear, gap", full, "w", (-2, 6), _corner("degenerate", lambda b: -b["x"]), 1.0,
                (0.3, 0.0), None, (2e-2, 1e-2, 1e-3))  # fmt: skip


def curved_corner():
    model = fs.Model(
        {x: p + sp.Abs(x) + 0.3 * x**2}, forcing={p: e * t - 0.5}, parameters={e: 0.01}
    )
    return Case("corner with curvature", model, "p", (-1, 1), _corner("non-smooth fold"), -0.4,
                (-0.5,), {"x": 1.0}, (3e-2, 1e-2, 1e-3, 1e-4, 1e-5))  # fmt: skip


def curved_lag():
    model = fs.Model(
        {x: p - 2 * x - sp.Abs(x) + 0.3 * x**2}, forcing={p: e * t - 0.5}, parameters={e: 0.01}
    )
    return Case("lag with curvature", model, "p", (-1, 1), _corner("persistence"), -0.4, (-0.3,),
                None)  # fmt: skip


def two_gaps(number):
    """A body that is pushed through two clearances with a spring between them."""
    contact = sp.Piecewise(
        (4 * (x + 2), x < -2),
        (0, x < -1),
        (4 * (x + 1), x < 1),
        (8, x < 2),
        (8 + 4 * (x - 2), True),
    )
    model = fs.Model(
        {x: v, v: w - v - contact}, forcing={w: 11 - e * t if number else 2 - e * t},
        parameters={e: 0.01},
    )  # fmt: skip
    at = 2.0 if number else -1.0
    return Case(
        f"two clearances, {'upper' if number else 'lower'}", model, "w", (-3, 12),
        _corner("degenerate", lambda b: abs(b["x"] - at)), 10.5 if number else 1.5,
        (2.6, 0.0) if number else (-0.6, 0.0), None, (2e-2, 1e-2, 1e-3),
    )  # fmt: skip


CASES = (
    cusp(),
    stommel(1),
    stommel(-1),
    van_der_pol(),
    van_der_pol_linear(),
    mckean(),
    oregonator(1),
    oregonator(-1),
    koper(),
    fitzhugh_nagumo(),
    morris_lecar(),
    laser(),
    budworm(),
    harvest(),
    gear(),
    curved_corner(),
    curved_lag(),
    two_gaps(0),
    two_gaps(1),
)
