"""Overlays of known models against SciPy: transitions, delays and names.

The run is integrated again by LSODA from the same equations. Intervals of fast motion are read
off that solution by the speed of the fast states alone, without a diagram; they and what the
overlay names are paired one to one.
"""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

#: A state of the run agrees with SciPy's within this fraction of its extent.
STATE = 1e-5

#: A delay is measured to this fraction: the run's own tolerance, the extremes of a slow state.
MEASURED = 1e-6

#: Samples of SciPy's solution.
SAMPLES = 40001


@dataclass(frozen=True)
class Case:
    """A run, and what is known of it.

    Parameters
    ----------
    name : str
    model : Model
    parameter : str
        The slow quantity.
    over : (float, float)
    start : list of float
    stop : float
        The run begins at t = 0.
    kinds : set of str
        Kinds of its transitions, by the literature.
    rhythm : str
        The name of its rhythm, "" for none.
    merge : float
        Fast motions that are less apart in time are one: of an oscillation longer than a period.
    speed : float
        What is fast, in units of the largest speed.
    atol : float
        Of SciPy; far below the least distance from an invariant branch that is left again.
    """

    name: str
    model: fs.Model
    parameter: str
    over: tuple
    start: list
    stop: float
    kinds: set
    rhythm: str
    merge: float
    speed: float = 0.1
    atol: float = 1e-12


@dataclass
class Report:
    """What a campaign has found."""

    rows: list = field(default_factory=list)
    failures: list = field(default_factory=list)

    def __str__(self):
        head = [
            "| model | transitions | error of the states | delays within their error | rhythm |"
        ]
        head += ["|---|---|---|---|---|"]
        end = [f"{len(self.rows)} runs, {len(self.failures)} failures"]
        return "\n".join([*head, *self.rows, "", *end, *(f"- {f}" for f in self.failures)])


def independent(case):
    """Times, the states of the model, and them at any time, by LSODA, in the model's order."""
    model = case.model
    names = _names(model)
    symbols = [sp.Symbol(name) for name in names]
    time = sp.Symbol("t")
    plain = {s: sp.Symbol(s.name) for r in _laws(model).values() for s in r.free_symbols}
    laws = {name: law.xreplace(plain) for name, law in _laws(model).items()}
    known = {sp.Symbol(n): v for n, v in model.parameters.items()}
    forcing = {sp.Symbol(n): laws[n] for n in model.forcing}
    rates = [laws[n].subs(forcing).subs(known) for n in names]
    f = sp.lambdify([time, symbols], rates, "numpy")
    at = np.linspace(0.0, case.stop, SAMPLES)
    run = solve_ivp(
        lambda t, s: np.array(f(t, s), dtype=float), (0, case.stop), case.start, "LSODA",
        t_eval=at, rtol=1e-11, atol=case.atol, max_step=case.stop / 2000, dense_output=True,
    )  # fmt: skip
    return run.t, run.y, run.sol


def _names(model):
    """Fast states and slow ones."""
    return [*model.states, *(n for n in model.slow_states if n not in model.states)]


def _laws(model):
    return {**model.rates, **model.forcing}


def active(case, time, states):
    """Intervals of fast motion, by the speed of the fast states in units of their extents."""
    names = _names(case.model)
    fast = states[[names.index(n) for n in case.model.frozen().states]]
    speed = np.abs(np.gradient(fast / np.ptp(fast, axis=1)[:, None], time, axis=1)).max(axis=0)
    # the start is a transient
    quick = (speed > case.speed * speed[len(time) // 50 :].max()).astype(int)
    edges = np.flatnonzero(np.diff(np.r_[0, quick, 0]))
    found = []
    for a, b in zip(edges[::2], edges[1::2] - 1, strict=True):
        if found and time[a] - found[-1][1] < case.merge:
            found[-1] = (found[-1][0], time[b])
        else:
            found.append((time[a], time[b]))
    return found


def named(overlay):
    """Intervals between stable branches, as the overlay has them."""
    calm = ("quasi-static", "sticking", "outside")
    return [(q.start, q.end) for q in overlay.phases if q.type not in calm]


def check(report, case):
    """One run against its independent account."""
    fail = report.failures.append
    diagram = fs.continue_equilibria(case.model.frozen(), case.parameter, over=case.over)
    run = fs.simulate(case.model, case.start, t=(0, case.stop))
    overlay = fs.overlay(diagram, run)
    time, states, solution = independent(case)
    moved, said = active(case, time, states), named(overlay)
    slack = case.merge
    for a, b in moved:
        if 0.02 * case.stop < a and b < 0.98 * time[-1]:
            hits = [1 for c, d in said if c - slack <= b and a <= d + slack]
            if not hits:
                fail(f"{case.name}: fast from t = {a:.6g} to {b:.6g}, of which nothing is said")
    for c, d in said:
        inside = 0.02 * case.stop < c and d < 0.98 * time[-1]
        if inside and not any(c - slack <= b and a <= d + slack for a, b in moved):
            fail(f"{case.name}: {c:.6g} to {d:.6g} is named, and nothing moves")
    worst = 0.0
    extent = np.ptp(states, axis=1)
    names = _names(case.model)
    rows = [names.index(n) for n in diagram.states]
    for t in overlay.transitions:
        here = solution(t.time)[rows]
        away = np.abs(here - t.state)
        if "oscillating" in (t.from_branch, t.to_branch):
            # of many oscillations the phase is lost in a delay
            continue
        worst = max(worst, float((away / extent[rows]).max()))
        if (away > STATE * extent[rows]).any():
            fail(f"{case.name}: at t = {t.time:.6g} the state is {here}, not {t.state}")
    kinds = [t.type for t in overlay.transitions]
    if set(kinds) != case.kinds:
        fail(f"{case.name}: kinds {sorted(set(kinds))}, not {sorted(case.kinds)}")
    rhythm = "" if overlay.bursting is None else str(overlay.bursting)
    if rhythm != case.rhythm:
        fail(f"{case.name}: {rhythm or 'no rhythm'!r}, not {case.rhythm or 'none'!r}")
    within = stated = 0
    for t in overlay.transitions:
        error = getattr(t.law, "error", np.nan)
        if t.law is None or not np.isfinite([t.predicted, error]).all():
            continue
        measured = t.width if t.type == "gap crossing" else t.delay
        if not np.isfinite(measured):
            continue
        stated += 1
        ok = abs(measured - t.predicted) <= error + MEASURED * abs(measured)
        within += ok
        if not ok:
            fail(
                f"{case.name}: t = {t.time:.6g}, {t.type} delay {measured:.6g}, predicted "
                f"{t.predicted:.6g} ± {error:.2g}"
            )
    counts = ", ".join(f"{kinds.count(k)} × {k}" for k in dict.fromkeys(kinds))
    delays = f"{within} of {stated}" if stated else "none stated"
    compared = f"{worst:.0e}" if worst else "not compared"
    report.rows.append(f"| {case.name} | {counts} | {compared} | {delays} | {rhythm or 'none'} |")


def cases():
    """Every run of the campaign."""
    return [*_ready_made(), *_mechanics(), *_chemistry(), *_ecology(), *_climate(), *_neurons()]


def _ready_made():
    s = fs.systems
    fold = "relaxation oscillation (symmetric fold/fold)"
    gap = "fast-slow oscillation across the gap, without bifurcation"
    two = 2 * 2 * np.pi
    found = [
        Case(f"cusp, ω = {o:g}", s.cusp(omega=o), "p", (-1.2, 1.2), [-1.0], two / o, {"jump"},
             fold, 0.01 / o)
        for o in (0.001, 0.002, 0.005)
    ]  # fmt: skip
    found += [
        Case(f"van der Pol, Liénard, ε = {e:g}", s.van_der_pol_relaxation(epsilon=e), "y",
             (-1.2, 1.2), [2.0, 0.0], 4 / e, {"jump"}, fold, 0.05 / e)
        for e in (0.002, 0.005, 0.01)
    ]  # fmt: skip
    found += [
        Case(f"van der Pol under a slow load, ω = {o:g}", s.van_der_pol(C=1.5, omega=o), "w",
             (-2, 2), [0.1, 0], two / o, {"Hopf", "end of oscillation"},
             "symmetric Hopf/Hopf bursting", 15.0)
        for o in (0.003, 0.005)
    ]  # fmt: skip
    found += [
        Case(f"FitzHugh-Nagumo, ω = {o:g}", s.fitzhugh_nagumo(I_0=0.9, I_1=0.9, omega=o), "I",
             (-0.2, 2), [-1.2, -0.6], two / o, {"Hopf", "end of oscillation"},
             "symmetric subHopf/fold cycle bursting", 80.0)
        for o in (0.0004, 0.0005)
    ]  # fmt: skip
    found += [
        Case(f"Hindmarsh-Rose, r = {r:g}", s.hindmarsh_rose(r=r), "z", (1.5, 2.6),
             [-1.5, -10, 1.9], stop, {"jump", "end of oscillation"}, "fold/homoclinic bursting",
             45.0)
        for r, stop in ((0.001, 1400), (0.003, 900), (0.006, 800))
    ]  # fmt: skip
    found += [
        Case(f"gear, D = {d:g}, ω = {o:g}", s.harmonic_gear(D=d, omega=o), "w", (-2, 6.5), [0, 0],
             two / o, {"gap crossing"}, gap, 15.0)
        for d, o in ((0.25, 0.01), (0.5, 0.01), (0.25, 0.005), (0.1, 0.01))
    ]  # fmt: skip
    found += [
        Case(f"gear, negative stiffness, ω = {o:g}",
             s.harmonic_gear(A=-0.6, B=0, C=0.4, omega=o), "w", (-1, 1), [0.9, 0], two / o,
             {"jump"}, fold, 20.0)
        for o in (0.001, 0.002)
    ]  # fmt: skip
    return found


def _mechanics():
    x, v, w, t, y = sp.symbols("x v w t y")
    well = {x: v, v: w + x - x**3 - v / 5}
    forced = fs.Model(well, forcing={w: sp.sin(t / 200)})
    linear = sp.Piecewise((-x - 2, x < -1), (-x + 2, x > 1), (x, True))
    return [
        Case("double well with weak damping", forced, "w", (-1.2, 1.2), [-1, 0.0], 800 * np.pi,
             {"jump"}, "symmetric fold/fold bursting (point-point)", 30.0),
        *(
            Case(f"van der Pol, piecewise linear, ε = {e:g}",
                 fs.Model({x: y + linear}, slow={y: -sp.Symbol("epsilon") * x},
                          parameters={"epsilon": e}),
                 "y", (-2, 2), [2.0, 0.0], 8 / e, {"jump"},
                 "relaxation oscillation (non-smooth fold/non-smooth fold)", 0.05 / e)
            for e in (0.002, 0.01)
        ),
        Case("pitchfork, ramped", fs.Model({x: w * x - x**3}, forcing={w: t / 100 - 1}), "w",
             (-1.2, 1.5), [0.01], 240, {"branch point"}, "", 10.0, atol=1e-40),
    ]  # fmt: skip


def _chemistry():
    x, y, z, t, b, eps, q = sp.symbols("x y z t b epsilon q")
    found = []
    for e in (0.01, 0.04):
        model = fs.Model(
            {x: x * (1 - x) - z * (x - q) / (x + q)},
            slow={z: eps * (x - z)},
            parameters={eps: e, q: 8e-4},
        )
        found.append(
            Case(f"Oregonator (Tyson and Fife 1980), ε = {e:g}", model, "z", (1e-3, 0.3),
                 [0.5, 0.05], 20 / e, {"jump"}, "relaxation oscillation (fold/fold)", 0.2 / e)
        )  # fmt: skip
    brusselator = {x: 1 - (b + 1) * x + x**2 * y, y: b * x - x**2 * y}
    found += [
        Case(f"Brusselator, B' = 1/{n}",
             fs.Model(brusselator, forcing={b: sp.Rational(6, 5) + t / n}),
             "b", (1, 3.6), [1.0, 1.3], 2.2 * n, {"Hopf"}, "", 30.0)
        for n in (100, 200)
    ]  # fmt: skip
    return found


def _ecology():
    x, y, t, k, r, w, i, s = sp.symbols("x y t k r w i s")
    budworm = {x: r * x * (1 - x / 10) - x**2 / (1 + x**2)}
    growth = sp.Rational(45, 100) + sp.Rational(25, 100) * sp.sin(t / 1000)
    hunters = {
        x: x * (1 - x / k) - x * y / (1 + x),
        y: y * (2 * x / (1 + x) - 1) / 2,
    }
    return [
        Case("spruce budworm (Ludwig et al. 1978)", fs.Model(budworm, forcing={r: growth}), "r",
             (0.15, 0.8), [0.6], 4000 * np.pi, {"jump"}, "relaxation oscillation (fold/fold)",
             30.0),
        Case("Rosenzweig-MacArthur, K ramped",
             fs.Model(hunters, forcing={k: 2 + t / 300}), "k", (1.5, 6), [1.0, 1.0], 900,
             {"Hopf"}, "", 30.0),
        Case("SIR, β ramped",
             fs.Model({s: (1 - s) / 10 - w * s * i, i: w * s * i - i},
                      forcing={w: sp.Rational(1, 2) + t / 200}),
             "w", (0.4, 2.2), [1.0, 1e-3], 300, {"branch point"}, "", 30.0, atol=1e-30),
    ]  # fmt: skip


def _climate():
    x, y, t, w, p = sp.symbols("x y t w p")
    stommel = {y: p - y * (1 + sp.Rational(31, 5) * (1 - y) ** 2)}
    rate = {x: (x - w) - (x - w) ** 3}
    ice = {x: w * (1 + sp.tanh(3 * x) / 2) - 1 - x / 2}
    return [
        Case("Stommel's box (Cessi 1994)",
             fs.Model(stommel, forcing={p: sp.Rational(11, 10) + 3 * sp.sin(t / 500) / 10}), "p",
             (0.7, 1.5), [0.3], 2000 * np.pi, {"jump"},
             "relaxation oscillation (symmetric fold/fold)", 10.0),
        Case("ice and albedo",
             fs.Model(ice, forcing={w: 1 + sp.Rational(6, 10) * sp.sin(t / 500)}), "w",
             (0.3, 1.7), [0.1], 2000 * np.pi, {"jump"}, "relaxation oscillation (fold/fold)",
             10.0),
        Case("moving wells, rate-induced (Ashwin et al. 2012)",
             fs.Model(rate, forcing={w: sp.Rational(5, 2) * (1 + sp.tanh((t - 60) / 2))}), "w",
             (-0.5, 5.5), [1.0], 120, {"rate-induced"}, "", 5.0),
    ]  # fmt: skip


def _neurons():
    V, n, i, eps, v, r, t, w = sp.symbols("V n I epsilon v r t w")
    open_ = (1 + sp.tanh((V + sp.Rational(6, 5)) / 18)) / 2
    rest = (1 + sp.tanh((V - 12) / sp.Rational(87, 5))) / 2
    rate = sp.Rational(23, 100) * sp.cosh((V - 12) / sp.Rational(174, 5))
    current = i - 2 * (V + 60) - 8 * n * (V + 84) - 4 * open_ * (V - 120)
    cell = sp.Piecewise((-v, v < sp.Rational(1, 8)), (1 - v, v > sp.Rational(5, 8)),
                        (v - sp.Rational(1, 4), True))  # fmt: skip
    found = [
        Case(f"Morris-Lecar (Rinzel and Ermentrout 1989), ε = {e:g}",
             fs.Model({V: current / 20, n: rate * (rest - n)}, slow={i: eps * (-26 - V)},
                      parameters={eps: e}),
             "I", (20, 60), [-30, 0.1, 36], 8 / e, {"jump", "end of oscillation"},
             "fold/homoclinic bursting", 100.0)
        for e in (0.003, 0.005)
    ]  # fmt: skip
    ramp = {v: v - v**3 / 3 - r + i, r: sp.Rational(8, 100) * (v + 0.7 - 0.8 * r)}
    found += [
        Case("FitzHugh-Nagumo, I ramped",
             fs.Model(ramp, forcing={i: sp.Rational(1, 4) + t / 5000}), "I", (0.2, 0.7),
             [-1.03, -0.41], 1500, {"Hopf"}, "", 80.0),
        *(
            Case(f"McKean, ε = {e:g}",
                 fs.Model({v: cell - w}, slow={w: eps * (v - sp.Rational(35, 100) - w / 2)},
                          parameters={eps: e}),
                 "w", (-0.6, 0.8), [0.9, 0.0], 12 / e, {"jump"},
                 "relaxation oscillation (non-smooth fold/non-smooth fold)", 0.05 / e)
            for e in (0.002, 0.01)
        ),
    ]  # fmt: skip
    return found


def campaign(*arguments):
    """Every case; with numbers only those in that order."""
    chosen = cases()
    report = Report()
    for case in [chosen[k] for k in arguments] if arguments else chosen:
        try:
            check(report, case)
        except Exception as error:
            report.failures.append(f"{case.name}: {type(error).__name__}: {error}")
    return report
