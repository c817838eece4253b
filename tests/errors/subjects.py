"""A good call of every public function: what the tests of bad input spoil, argument by argument."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import sympy as sp

import fastslow as fs
from fastslow.results.branch.point_branch import PointCurves

#: Data of results: made by functions, and checked there.
RESULTS = (
    fs.Analysis,
    fs.ModelFile,
    fs.ParameterSet,
    fs.Attractors,
    fs.BasinFractions,
    fs.BoundaryDelay,
    fs.Branch,
    fs.BranchPointExit,
    fs.Certificate,
    fs.CriticalRate,
    fs.Delay,
    fs.DelayScaling,
    fs.Derivation,
    fs.SlowFlow,
    fs.Diagram,
    fs.EdgeState,
    fs.BeyondFold,
    fs.Enclosure,
    fs.Ensemble,
    fs.Equilibrium,
    fs.FoldDelay,
    fs.GapCrossing,
    fs.Grid,
    fs.HopfExit,
    fs.Canard,
    fs.Canards,
    fs.SingularCycle,
    fs.LyapunovExponents,
    fs.MinimalShock,
    fs.Orbit,
    fs.OrbitBranch,
    fs.Overlay,
    fs.PointBranch,
    fs.PointCurves,
    fs.ProvedCurve,
    fs.RateThreshold,
    fs.RefinedMap,
    fs.RegimeSet,
    fs.Regimes,
    fs.Section,
    fs.systems.SlowLoad,
    fs.Sensitivity,
    fs.Shock,
    fs.SobolIndices,
    fs.SpecialPoint,
    fs.Spectrum,
    fs.Periodicity,
    fs.BifurcationSweep,
    fs.ThresholdCurve,
    fs.Trajectory,
)
SPECIAL = ("__call__", "__getitem__")


@dataclass(frozen=True)
class Subject:
    """A public function with a call that is good."""

    name: str
    function: Callable
    arguments: dict
    more: dict = field(default_factory=dict)

    @property
    def signature(self):
        return inspect.signature(self.function)

    @property
    def parameters(self):
        """The names of its parameters, without those given to **kwargs."""
        return tuple(self.signature.parameters)

    def call(self, **changes):
        """Call it with some arguments changed; a single ``*`` or ``**`` parameter counts as one."""
        given = {**self.arguments, **changes}
        kinds = {n: p.kind for n, p in self.signature.parameters.items()}
        positional, named = [], {}
        for name, kind in kinds.items():
            if name not in given:
                if kind is inspect.Parameter.POSITIONAL_ONLY:
                    positional.append(self.signature.parameters[name].default)
                continue
            if kind is inspect.Parameter.VAR_POSITIONAL:
                positional += given[name]
            elif kind is inspect.Parameter.VAR_KEYWORD:
                named |= given[name]
            elif kind is inspect.Parameter.POSITIONAL_ONLY:
                positional.append(given[name])
            else:
                named[name] = given[name]
        return self.function(*positional, **named)


@cache
def results():
    """The smallest result of each kind, by name."""
    x, p, q = sp.symbols("x p q")
    full = fs.systems.cusp(omega=0.01)
    fast = full.frozen()
    diagram = fs.continue_equilibria(fast, "p", over=(-1, 1))
    fold = diagram.folds[0]
    plane = {"p": (-1, 1), "q": (-1, 2)}
    run = fs.simulate(full, [-1.0], periods=1)
    gear = fs.systems.harmonic_gear(omega=0.1, C=2.443)
    gap = fs.simulate(gear, [0.0, 0.0], periods=2)
    orbit = fs.find_orbit(gear, [0.0, 0.0])
    square = {"x": (-1, 1), "y": (-1, 1)}
    reached = fs.attractors(cycle(), square, 2)
    backlash = fs.continue_equilibria(gear.frozen(), "w", over=(-1, 1))
    # its folds are the line p = q/4
    slanted = fs.Model({x: p - q / 4 + x**2}, parameters={p: 0, q: 1})
    other = fs.continue_equilibria(slanted, "p", over=(-1, 1)).folds[0]
    turning = fs.continue_equilibria(hopf(), "p", over=(-2, 2))
    certificate = fs.certify(fast, diagram, window={"x": (-2, 2)})
    many = fs.simulate_many(gear, [0.0, 0.0], parameters={"C": [2.0, 3.0]}, periods=1, samples=8)
    return {
        "full": full,
        "fast": fast,
        "diagram": diagram,
        "branch": diagram[0],
        "fold": fold,
        "certificate": certificate,
        "proved curve": certificate.curves[0],
        "enclosure": certificate.points[0].enclosure,
        "equilibrium": diagram.at(p=0.0)[0],
        "curve": fs.continue_points(fold, ("p", "q"), over=plane),
        "other curve": fs.continue_points(other, ("p", "q"), over=plane),
        "run": run,
        "overlay": fs.overlay(diagram, run),
        "gear": gear,
        "gap": gap,
        "corner": backlash.boundary_equilibria[0],
        "turning": turning,
        "hopf": turning.special("HB")[0],
        "many": many,
        "swept": fs.bifurcation_sweep(gear, "C", [2.0, 2.5], [0, 0], settle=1, keep=1),
        "map": fs.refined_map(
            lambda a, b: a > b,
            {"a": (0, 1), "b": (0, 1)},
            refinement=fs.Refinement(cells=(2, 2), levels=1),
        ),
        "grid": fs.sweep(lambda a, b: {"sum": a + b}, {"a": [0, 1], "b": [0.5, 1.5]}),
        "sobol": fs.sobol(lambda a, b: {"sum": a + b}, {"a": (0, 1), "b": (0, 1)}, 8),
        "section": gap.stroboscopic(),
        "spectrum": gap.spectrum("x"),
        "steady": gap.periodicity(),
        "regimes": gap.regimes(),
        "motions": fs.classify_regime(gear, [0.0, 0.0], periods=2, max_periods=2),
        "orbit": orbit,
        "orbits": fs.continue_orbits(orbit, "C", over=(2.442, 2.444)),
        "attractors": reached,
        "basin fractions": fs.attractors(cycle(), square, 2, along=turning, samples=2),
        "basins": fs.basins(
            cycle(), square, known=reached, refinement=fs.Refinement(cells=(1, 1), levels=0)
        ),
        "sensitivity": fs.simulate(gear, [0.0, 0.0], t=(0.0, 1.0)).sensitivity(["C"]),
        "exponents": fs.lyapunov(gear, [0.0, 0.0], t=(0.0, 1.0)),
        "scaling": fs.delay_scaling(fast, fold, [1e-5, 1e-6], level={"x": 0.5}),
        "laws": laws(backlash, turning),
        "load": fs.systems.slow_load_criterion(gear),
        "law": fs.derive(fs.Model({x: p - q * x}, parameters={p: 0, q: 1})),
        "slow flow": fs.slow_flow(relaxation()),
        "critical rate": fs.critical_rate(shifting(), "r", (1.2, 4)),
        "canard": fs.find_canard(*canard_point(), "r"),
        "threshold curve": threshold_curve(),
        "canards": fs.find_canards(*funnel()),
        "singular cycle": fs.singular_cycle(relaxation(), [2, 0]),
        "beyond fold": fs.beyond_fold(shifted(), turn(), "p", 0.01),
        "edge state": fs.edge_state(bistable(), [-1.0], [1.0]),
        "shock": fs.minimal_shock(bistable(), fs.equilibria(bistable())[0], ["x"]),
    }


def laws(backlash, turning):
    """A prediction of each law of delay, by the name of its class."""
    x, p = sp.symbols("x p")
    fold = fs.predict_delay(fs.continue_equilibria(*bending(x**2), over=(-1, 1)).folds[0], 1e-3)
    corner = fs.continue_equilibria(*bending(sp.Abs(x)), over=(-1, 1)).boundary_equilibria[0]
    crossing = fs.continue_equilibria(
        fs.Model({x: x * (p - x)}, parameters={p: 0}), "p", over=(-1, 1)
    )
    contact = next(b for b in backlash.boundary_equilibria if b["x"] > 0)
    hopf = turning.special("HB")[0]
    transcritical = crossing.special("BP")[0]
    return {
        "Delay": fold,
        "FoldDelay": fold,
        "BoundaryDelay": fs.predict_delay(corner, 0.01, level={"x": 1}),
        "GapCrossing": fs.predict_delay(contact, -0.001),
        "HopfExit": fs.predict_delay(hopf, 0.05, diagram=turning, entry=-1),
        "BranchPointExit": fs.predict_delay(transcritical, 0.05, diagram=crossing, entry=-0.5),
    }


def bending(term):
    """A model x' = p + term, and its parameter."""
    x, p = sp.symbols("x p")
    return fs.Model({x: p + term}, parameters={p: 0}), "p"


@cache
def hopf():
    """The Hopf normal form over p."""
    x, y, p = sp.symbols("x y p")
    size = x**2 + y**2
    return fs.Model({x: p * x - y - x * size, y: x + p * y - y * size}, parameters={p: 0})


def cycle():
    """The Hopf normal form at p = 1, with a cycle of radius 1."""
    return hopf().with_parameters(p=1)


@cache
def orbit_overlay():
    """A run with a fast periodic term over the orbits of its frozen model."""
    x, w, t = sp.symbols("x w t")
    full = fs.Model({x: w - x + sp.cos(t)}, forcing={w: t / 50})
    orbit = fs.find_orbit(full.frozen(fast=["t"]).with_parameters(w=0), [0.5])
    branch = fs.continue_orbits(orbit, "w", over=(-0.1, 1.1))
    return fs.overlay(branch, fs.simulate(full, [0.5], t=(0.0, 50.0)))


@cache
def logistic():
    x, r, K = sp.symbols("x r K")
    return fs.Model({x: r * x * (1 - x / K)}, parameters={r: 2, K: 3})


def shifting():
    """A ramp that stops, fast enough to tip at rates above 2.13."""
    x, w, t, r, D = sp.symbols("x w t r D")
    ramp = {w: sp.Min(r * t, D)}
    return fs.Model({x: sp.Abs(x + w) - 1}, forcing=ramp, parameters={r: 2, D: 2.7})


@cache
def threshold_curve():
    found = fs.critical_rate(shifting(), "r", (1.2, 4))
    few = fs.Continuation(step=0.1, max_step=0.2, max_turn=0.5)
    over = {"r": (2, 2.3), "D": (2.5, 2.9)}
    return fs.continue_points(found[0], ("r", "D"), over=over, continuation=few)


@cache
def bistable():
    x = sp.Symbol("x")
    return fs.Model({x: x - x**3})


def shifted():
    x, p = sp.symbols("x p")
    return fs.Model({x: p + x - x**3}, parameters={p: 0})


def turn():
    return fs.continue_equilibria(shifted(), "p", over=(0, 1)).folds[0]


def relaxation():
    x, y, r = sp.symbols("x y r")
    return fs.Model({x: y - x**3 / 3 + x}, slow={y: r - x}, parameters={r: 0.5})


@cache
def canard_point():
    """A model with the fast rate fifty times as large, and its canard point."""
    x, y, r = sp.symbols("x y r")
    model = fs.Model({x: 50 * (y - x**3 / 3 + x)}, slow={y: r - x}, parameters={r: 0.5})
    return model, fs.slow_flow(model).points[0]


@cache
def funnel():
    """A model with one fast and two slow states, and its folded node."""
    x, y, z = sp.symbols("x y z")
    model = fs.Model({z: x + z**2}, slow={x: 0.11 * y - 1.22 * z, y: 1})
    return model, fs.slow_flow(model).points[0]


def simulations(r):
    gear, fold = r["gear"], r["fold"]
    kept = {"t": (0.0, 1.0)}
    return {
        "simulate": {"model": gear, "state": [0.0, 0.0], **kept},
        "simulate_many": {"model": gear, "states": [0.0, 0.0], **kept},
        "lyapunov": {"model": gear, "state": [0.0, 0.0], **kept},
        "bifurcation_sweep": {
            "model": gear,
            "parameter": "C",
            "values": [2.0],
            "state": [0.0, 0.0],
            "settle": 0,
            "keep": 1,
            "back": False,
        },
        "classify_regime": {
            "model": gear,
            "states": [0.0, 0.0],
            "periods": 2,
            "max_periods": 2,
            "execution": fs.Execution(threads=1),
        },
        "regime_map": {
            "model": gear,
            "over": {"C": (2.0, 3.0), "D": (0.1, 0.2)},
            "state": [0.0, 0.0],
            "refinement": fs.Refinement(cells=(1, 1), levels=0),
            "periods": 1,
        },
        "sobol": {
            "function": lambda a, b: a + b,
            "over": {"a": (0, 1), "b": (0, 1)},
            "n": 8,
        },
        "sweep": {"function": lambda a, b: a + b, "values": {"a": [0, 1], "b": [0.5, 1.5]}},
        "refined_map": {
            "function": lambda a, b: a > b,
            "over": {"a": (0, 1), "b": (0, 1)},
            "refinement": fs.Refinement(cells=(1, 1), levels=0),
        },
        "tipping_map": {
            "model": shifting(),
            "rate": "r",
            "over": {"r": (1.2, 4), "D": (1, 4)},
            "refinement": fs.Refinement(cells=(1, 1), levels=0),
        },
        "basin_instability": {
            "diagram": fs.continue_equilibria(shifting().frozen(), "w", over=(0, 4)),
            "refinement": fs.Refinement(cells=(1, 1), levels=0),
        },
        "beyond_fold": {"model": shifted(), "point": turn(), "parameter": "p", "distance": 0.01},
        "edge_state": {"model": bistable(), "a": [-1.0], "b": [1.0]},
        "minimal_shock": {
            "model": bistable(),
            "point": fs.equilibria(bistable())[0],
            "states": ["x"],
        },
        "critical_rate": {"model": shifting(), "rate": "r", "over": (1.2, 4)},
        "delay_scaling": {
            "model": r["fast"],
            "point": fold,
            "rates": [1e-5, 1e-6],
            "level": {"x": 0.5},
            "integration": fs.Integration(rtol=1e-13, max_steps=2000),
        },
        "attractors": {
            "model": cycle(),
            "over": {"x": (-1, 1), "y": (-1, 1)},
            "n": 2,
            "along": r["turning"],
            "samples": [1.0],
        },
        "basins": {
            "model": cycle(),
            "over": {"x": (-1, 1), "y": (-1, 1)},
            "known": r["attractors"],
            "refinement": fs.Refinement(cells=(1, 1), levels=0),
        },
        "find_orbit": {"model": gear, "guess": [0.0, 0.0]},
        "continue_cycles": {"diagram": r["diagram"]},
        "continue_orbits": {"orbit": r["orbit"], "parameter": "C", "over": (2.442, 2.444)},
        "precompile": {"models": []},
        "explore": {"model": gear, "over": (-1.0, 1.0), "sliders": {"C": (2.0, 3.0)}, **kept},
    }


def analyses(r):
    fold, fast = r["fold"], r["fast"]
    x, k, u, a, b = sp.symbols("x k u a b")
    return {
        "equilibria": {"model": fast, "named": {"p": 0.0}},
        "tangencies": {"model": hopf(), "named": {"p": 0.0}},
        "continue_equilibria": {"model": fast, "parameter": "p", "over": (-1, 1)},
        "certify": {"model": fast, "diagram": r["diagram"], "window": {"x": (-2, 2)}},
        "continue_points": {
            "point": fold,
            "plane": ("p", "q"),
            "over": {"p": (-1, 1), "q": (-1, 2)},
        },
        "derive": {"model": logistic()},
        "slow_flow": {"model": relaxation()},
        "find_canard": dict(zip(("model", "point"), canard_point(), strict=True), parameter="r"),
        "find_canards": dict(zip(("model", "point"), funnel(), strict=True)),
        "singular_cycle": {"model": relaxation(), "state": [2, 0]},
        "compare_scalings": {"one": {"A": k}, "other": {"A": k}},
        "nondimensionalise": {
            "model": logistic(),
            "unit_coefficients": [("x", "x"), ("x", "x**2")],
        },
        "reduce_states": {"rates": {a: -k * (a - b), b: k * (a - b)}, "combinations": {u: a - b}},
        "export": {"model": logistic(), "format": "numpy"},
        "predict_delay": {"point": fold, "rate": 1e-3},
        "overlay": {"diagram": r["diagram"], "run": r["run"]},
        "analyse": {
            "model": fs.Model({"x": "x - x**3 - v", "v": "k*x"}, parameters={"k": 0.01}),
            "state": {"x": 1.0, "v": 0.0},
            "t": (0, 200),
        },
        "load": {"path": "nothing.npz"},
        "read": {"path": "nothing.ode"},
        "read_auto": {"path": "b.nothing"},
        "read_ode": {"text": "x'=-x"},
        "read_sbml": {"path": "nothing.xml"},
        "pick": {"drawing": fs.plot.diagram(r["diagram"]), "result": r["diagram"]},
        "Model": {"rates": {x: -k * x}, "parameters": {k: 1.0}},
        "prove": {"model": fast, "point": fold},
        "Certification": {},
        "Continuation": {},
        "Drift": {"rate": 0.01},
        "Event": {"when": "x > 1", "then": {"x": 0}},
        "Execution": {},
        "Integration": {},
        "Observation": {},
        "Refinement": {},
        "Tabulated": {"times": [0.0, 1.0], "values": [1.0, 2.0]},
    }


def methods(r):
    """Object, and a good call of each public method that takes an argument."""
    save = {"path": "unused.npz"}
    look = {"stable": None}
    rows = {"__getitem__": {"key": "x"}, "select": {}}
    return {
        "Model": (
            r["gear"],
            {
                "with_parameters": {"changes": {"C": 2.0}},
                "with_switches": {"states": {}},
                "with_free": {"name": "C"},
                "with_slow": {"states": ["v"]},
                "frozen": {},
                "with_ramp": {"name": "C", "rate": 0.1},
            },
        ),
        "Analysis": (
            fs.analyse(fs.systems.cusp(omega=0.01), [-1.0], t=(0, 300)),
            {"plot": {"y": "x"}},
        ),
        "ModelFile": (fs.read_ode("x'=-x\nset a {x=1}"), {"with_set": {"name": "a"}}),
        "Tabulated": (fs.Tabulated([0.0, 1.0], [1.0, 2.0]), {"__call__": {"t": 0.5}}),
        "Branch": (
            r["branch"],
            {
                "__getitem__": {"key": "x"},
                "at": {"value": {"p": 0.0}, **look},
                "select": look,
                "nearest": {"values": {"p": 0.0}},
                "intersections": {"other": r["turning"][0], "x": "x", "y": "p"},
                "save": save,
            },
        ),
        "Diagram": (
            r["diagram"],
            {
                "__getitem__": {"key": "x"},
                "at": {"value": {"p": 0.0}, **look},
                "select": look,
                "bistable": {},
                "nearest": {"values": {"p": 0.0}},
                "save": save,
            },
        ),
        "Certificate": (r["certificate"], {"count": {"value": {"p": 0.0}}, "save": save}),
        "ProvedCurve": (r["proved curve"], {"save": save}),
        "Enclosure": (r["enclosure"], {"__getitem__": {"name": "x"}, "save": save}),
        "Derivation": (r["law"], {"__getitem__": {"region": "S1"}}),
        "SlowFlow": (r["slow flow"], {"__getitem__": {"region": "S1"}}),
        **{
            name: (one, {"gradient": {"name": "rate"}, "save": save})
            for name, one in r["laws"].items()
        },
        "DelayScaling": (r["scaling"], {"save": save}),
        "CriticalRate": (
            r["critical rate"],
            {
                "__getitem__": {"key": "x"},
                "select": {},
                "nearest": {"values": {"x": 1.0}},
                "gradient": {"name": "D"},
                "save": save,
            },
        ),
        "EdgeState": (r["edge state"], {"__getitem__": {"name": "x"}, "save": save}),
        "BeyondFold": (r["beyond fold"], {"save": save}),
        "MinimalShock": (
            r["shock"],
            {
                "__getitem__": {"key": "length"},
                "select": {},
                "nearest": {"values": {"length": 1.0}},
                "save": save,
            },
        ),
        "Shock": (r["shock"][0], {"save": save}),
        "ThresholdCurve": (
            r["threshold curve"],
            {
                "__getitem__": {"key": "r"},
                "at": {"value": {"D": 2.7}},
                "folds": {"name": "r"},
                "save": save,
            },
        ),
        "RateThreshold": (r["critical rate"][0], {"gradient": {"name": "D"}, "save": save}),
        "Canards": (r["canards"], {**rows, "nearest": {"values": {"x": 0.1}}, "save": save}),
        "SingularCycle": (
            r["singular cycle"],
            {**rows, "nearest": {"values": {"x": 0.1}}, "save": save},
        ),
        "Canard": (r["canard"], {"__getitem__": {"key": "x"}, "save": save}),
        "Ensemble": (
            r["many"],
            {**rows, "nearest": {"values": {"C": 2.0}}, "save": save},
        ),
        "Equilibrium": (
            r["equilibrium"],
            {"__getitem__": {"name": "x"}, "gradient": {"name": "p"}, "save": save},
        ),
        "SpecialPoint": (
            r["fold"],
            {"__getitem__": {"name": "x"}, "gradient": {"name": "q"}, "save": save},
        ),
        "BasinFractions": (r["basin fractions"], {"__getitem__": {"key": "A1"}, "save": save}),
        "Attractors": (
            r["attractors"],
            {
                "__getitem__": {"key": "fraction"},
                "select": {},
                "nearest": {"values": {"fraction": 1.0}},
                "save": save,
            },
        ),
        "Orbit": (
            r["orbit"],
            {
                "__call__": {"t": 0.0},
                "__getitem__": {"key": "x"},
                "dense_columns": {"t": 0.0},
                "extremes": {"name": "x"},
                "gradient": {"name": "C"},
                "hits": {"interface": "x - D"},
                "save": save,
            },
        ),
        "OrbitBranch": (
            r["orbits"],
            {
                "__getitem__": {"key": "max(x)"},
                "at": {"value": {"C": 2.443}, **look},
                "select": look,
                "nearest": {"values": {"C": 2.443}},
                "save": save,
            },
        ),
        "Overlay": (
            r["overlay"],
            {
                "__getitem__": {"key": "x"},
                "at": {"value": {"p": 0.0}},
                "gradient": {"transition": 0, "name": "q"},
                "select": {},
                "nearest": {"values": {"p": 0.0}},
                "save": save,
            },
        ),
        "PointBranch": (
            r["curve"],
            {
                **rows,
                "at": {"value": {"q": 1.0}},
                "nearest": {"values": {"q": 1.0}},
                "intersections": {"other": r["other curve"]},
                "save": save,
            },
        ),
        "PointCurves": (
            PointCurves([r["curve"]], ("p", "q")),
            {
                **rows,
                "at": {"value": {"q": 1.0}},
                "nearest": {"values": {"q": 1.0}},
                "save": save,
            },
        ),
        "Grid": (
            r["grid"],
            {
                "__getitem__": {"key": "sum"},
                "at": {"values": {"a": 0, "b": 0.5}},
                "select": {},
                "save": save,
            },
        ),
        "SobolIndices": (
            r["sobol"],
            {"__getitem__": {"key": ("sum", "a")}, "save": save},
        ),
        "RefinedMap": (
            r["map"],
            {
                "__getitem__": {"key": "a"},
                "at": {"values": [0.5, 0.2]},
                "boundary": {"one": True, "other": False},
                "compare": {"predict": lambda a, b: a > b},
                "save": save,
            },
        ),
        "Section": (
            r["section"],
            {**rows, "nearest": {"values": {"x": 0.0}}, "save": save},
        ),
        "systems.SlowLoad": (r["load"], {"save": save}),
        "Spectrum": (
            r["spectrum"],
            {"__getitem__": {"key": "amplitude"}, "peaks": {}, "save": save},
        ),
        "LyapunovExponents": (r["exponents"], {"save": save}),
        "RegimeSet": (r["motions"], {"save": save}),
        "Sensitivity": (r["sensitivity"], {"__getitem__": {"key": ("x", "C")}, "save": save}),
        "Regimes": (r["regimes"], {"save": save}),
        "Periodicity": (r["steady"], {"save": save}),
        "BifurcationSweep": (
            r["swept"],
            {
                **rows,
                "at": {"value": {"C": 2.0}},
                "hysteresis": {},
                "nearest": {"values": {"C": 2.0}},
                "save": save,
            },
        ),
        "Trajectory": (
            r["gap"],
            {
                "__call__": {"t": 0.0},
                "__getitem__": {"key": "x"},
                "at": {"value": {"x": 0.0}},
                "select": {},
                "nearest": {"values": {"x": 0.0}},
                "dense_columns": {"t": 0.0},
                "regions_at": {"t": [0.0]},
                "contacts": {},
                "extremes": {"name": "x"},
                "hits": {"interface": "x - D"},
                "section": {"expression": "x"},
                "spectrum": {"name": "x"},
                "regimes": {},
                "periodicity": {},
                "mixed_mode": {"name": "x"},
                "sensitivity": {"names": ["C"]},
                "stroboscopic": {},
                "save": save,
            },
        ),
    }


def figures(r):
    return {
        "axes": {"layout": "ab", "height": 50.0},
        "basins": {"result": r["basins"], "attractors": r["attractors"]},
        "clarke_path": {"point": r["corner"]},
        "delay_scaling": {"scaling": r["scaling"]},
        "diagram": {"diagram": r["diagram"]},
        "eigenvalue_path": {"source": r["branch"]},
        "freezing": {"band": r["overlay"].freezing},
        "multipliers": {"source": r["orbits"]},
        "overlay": {"overlay": r["overlay"]},
        "panel": {"overlay": r["overlay"]},
        "parameter_plane": {"curves": [r["curve"]]},
        "phase_portrait": {"run": r["gap"]},
        "regime_map": {"result": r["map"]},
        "grid": {"result": r["grid"]},
        "sobol": {"indices": r["sobol"]},
        "response": {"branch": r["orbits"]},
        "section": {"section": r["section"]},
        "spectrum": {"spectrum": r["spectrum"]},
        "sweep": {"sweep": r["swept"]},
        "time_series": {"run": r["run"]},
        "tipping_map": {"result": r["map"]},
    }


def of_systems(r):
    """What must be given to those of `fastslow.systems` that have no defaults."""
    return {
        "slow_load_criterion": {"model": r["gear"]},
        "slow_load_gap": {"B": 2.0, "C": 4.0, "omega": 0.1},
    }


def fuller(r):
    """What more a good call may hold, so that what is inside can be spoiled too."""
    x, v, k, w, p, t = sp.symbols("x v k w p t")
    run = {"state": {"x": 0.0, "v": 0.0}}
    return {
        "simulate": {**run, "samples": [0.0, 0.5]},
        "classify_regime": {"states": {"x": [0.0, 0.1], "v": 0.0}},
        "lyapunov": run,
        "simulate_many": {"states": {"x": [0.0, 0.1], "v": 0.0}, "parameters": {"C": [2.0, 3.0]}},
        "bifurcation_sweep": {**run, "observe": fs.Observation("section", section="v")},
        "regime_map": {
            "over": {"ratio": (0.9, 1.1), "D": (0.1, 0.2)},
            "parameters": {"C": "B*ratio"},
        },
        "delay_scaling": {"level": {"x": 0.5}},
        "continue_equilibria": {"marks": [0.1]},
        "equilibria": {"values": {"q": 1.0}},
        "tangencies": {"values": {"p": 0.0}},
        "derive": {"assume": {"r": "positive"}, "parameter": "r", "regions": ["S1"]},
        "slow_flow": {"assume": {"r": "positive"}, "parameter": "r", "regions": ["S1"]},
        "nondimensionalise": {"replace": {"r": "r"}},
        "export": {"values": {"r": 1.0}, "state": {"x": 0.5}},
        "predict_delay": {"level": {"x": 0.5}},
        "systems.slow_load_criterion": {"parameters": {"D": [0.1, 0.2]}},
        "systems.slow_load_gap": {"B": [1.0, 2.0]},
        "Model": {
            "rates": {x: v, v: w - k * x - sp.Abs(x)},
            "forcing": {w: sp.sin(t)},
            "slow": {p: -p},
            "interfaces": {"wall": x},
            "regions": {"right": x > 0},
        },
        "Model.frozen": {"slow": {"w": "g"}},
        "Model.with_parameters": {"changes": {"C": 2.0}},
        "Branch.select": {"between": (-0.5, 0.5)},
        "Diagram.select": {"between": (-0.5, 0.5)},
        "Overlay.select": {"between": (0.0, 50.0)},
        "Trajectory.select": {"between": (0.0, 50.0)},
        "Trajectory.__call__": {"t": [0.0, 1.0]},
        "plot.time_series": {
            "interface_values": {"edge": ("x", 0.0)},
            "phases": list(r["overlay"].phases),
        },
        "plot.phase_portrait": {"interface_values": {"edge": ("x", 0.0)}},
        "plot.regime_map": {
            "curves": {"line": ([0.0, 1.0], [0.0, 1.0])},
            "annotate": {"here": (0.5, 0.5)},
            "fills": {True: "black"},
        },
        "plot.spectrum": {"frequencies": (0.0, 1.0)},
    }


def public_functions():
    """The name in the documentation of everything public that takes an argument."""
    found = set()
    for home, prefix in ((fs, ""), (fs.plot, "plot."), (fs.systems, "systems.")):
        for name in home.__all__:
            thing = getattr(home, name)
            if inspect.isfunction(thing):
                found |= {prefix + name} if inspect.signature(thing).parameters else set()
            elif inspect.isclass(thing) and not issubclass(thing, Exception):
                found |= {f"{prefix}{name}.{m}" for m in methods_of(thing)}
                if thing not in RESULTS and prefix == "":
                    found.add(name)
    # the drawings share one way to save, but for the panel
    saves = {n for n in found if n.endswith("Drawing.save")}
    return found - saves | {"plot.Drawing.save", "plot.PanelDrawing.save"}


def methods_of(kind):
    for name in dir(kind):
        method = inspect.getattr_static(kind, name)
        if not inspect.isfunction(method) or (name.startswith("_") and name not in SPECIAL):
            continue
        if len(inspect.signature(method).parameters) > 1:
            yield name


@cache
def subjects():
    """Every public function, by its name in the documentation."""
    r = results()
    found = [
        Subject(name, getattr(fs, name), arguments)
        for name, arguments in {**simulations(r), **analyses(r)}.items()
    ]
    found += [
        Subject(f"{kind}.{name}", getattr(thing, name), arguments)
        for kind, (thing, calls) in methods(r).items()
        for name, arguments in calls.items()
    ]
    found += [Subject(f"plot.{n}", getattr(fs.plot, n), a) for n, a in figures(r).items()]
    drawing = fs.plot.spectrum(r["spectrum"])
    found.append(Subject("plot.Drawing.save", drawing.save, {"path": "unused.png", "dpi": 20}))
    panel = fs.plot.panel(r["overlay"])
    found.append(Subject("plot.PanelDrawing.save", panel.save, {"path": "unused.png", "dpi": 20}))
    given = of_systems(r)
    found += [
        Subject(f"systems.{name}", getattr(fs.systems, name), given.get(name, {}))
        for name in fs.systems.__all__
        if not inspect.isclass(getattr(fs.systems, name))
    ]
    more = fuller(r)
    return {s.name: replace(s, more={**s.arguments, **more.get(s.name, {})}) for s in found}
