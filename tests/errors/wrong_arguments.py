"""Wrong arguments with what their errors must say: by parameter, or by function and parameter.

A row is (what is given, the error, words of its message). A parameter of the same name means
the same in every function, so that one entry serves them all.
"""

import numpy as np

import fastslow as fs

NAN, INF = float("nan"), float("inf")
Wrong, Unknown, BadModel = fs.ArgumentError, fs.UnknownNameError, fs.ModelError

FLAG = [(NAN, Wrong, "nan; expected True or False"), (1, Wrong, "= 1; expected True or False")]
NUMBER = [
    (NAN, Wrong, "nan; expected a finite number"),
    ("5", Wrong, "'5'; expected a finite number"),
    (True, Wrong, "True; expected a finite number"),
    ([1.0], Wrong, "[1.0]; expected a finite number"),
]
POSITIVE = [
    (0, Wrong, "0; expected a positive number"),
    (-1, Wrong, "-1; expected a positive number"),
    (INF, Wrong, "inf; expected a positive number"),
    ("5", Wrong, "'5'; expected a positive number"),
]
TOLERANCE = [*POSITIVE, (1.0, Wrong, "1.0; expected a number from 1e-16 to 0.1")]
COUNT = [
    (-1, Wrong, "-1; expected"),
    (1.5, Wrong, "1.5; expected a whole number"),
    (True, Wrong, "True; expected a whole number"),
    ("3", Wrong, "'3'; expected a whole number"),
]
TEXT = [(3, Wrong, "3; expected text")]
SYMBOL = [(2.5, Wrong, "2.5; expected a name or an expression")]
MAPPING = [([1], Wrong, "[1]; expected a mapping"), ("x", Wrong, "'x'; expected a mapping")]
PATH = [
    ("", Wrong, "path = ''; expected the path of a file"),
    (3, Wrong, "path = 3; expected the path of a file"),
]
SAVE = [
    *PATH,
    ("gear.csv", Wrong, "gear.csv: expected a name that ends in .npz or .nc"),
    ("nowhere/gear.npz", fs.FileError, "nowhere/gear.npz cannot be written: No such file"),
]
FIGURE = [
    *PATH,
    ("gear.pgn", Unknown, "unknown figure format 'pgn'; did you mean 'png'?"),
    ("nowhere/gear.pdf", fs.FileError, "nowhere/gear.pdf cannot be written: No such file"),
]
RANGE = [
    ((1, 1), Wrong, "(1, 1); expected two finite numbers, the lower one first"),
    ((2, -1), Wrong, "the lower one first; did you mean (-1, 2)?"),
    ((0, INF), Wrong, "(0, inf); expected two finite numbers"),
    ((0, NAN), Wrong, "(0, nan); expected two finite numbers"),
    ((0, 1, 2), Wrong, "(0, 1, 2); expected two finite numbers"),
    (("0", "1"), Wrong, "('0', '1'); expected two finite numbers"),
    (3, Wrong, "3; expected two finite numbers"),
]
PLANE = [
    (3, Wrong, "over = 3; expected a mapping"),
    ({"C": (0, 1)}, Wrong, "over"),
    ({"C": (1, 0), "D": (0, 1)}, Wrong, "over"),
]
COLUMN = [("omga", Unknown, "omga"), ("x +", Wrong, "'x +' is no expression")]
NAME = [("omga", Unknown, "unknown"), (None, Unknown, "None")]


def a(kind):
    """Rows for an argument that is an object of a class."""
    article = "an" if kind[0] in "AEIO" else "a"
    return [
        (None, Wrong, f"expected {article} {kind}, received None"),
        ("omga", Wrong, f"expected {article} {kind}, received a str"),
        (np.zeros(3), Wrong, f"expected {article} {kind}, received a ndarray"),
    ]


BY_PARAMETER = {
    "angular": FLAG,
    "arrows": COUNT,
    "assume": [
        (3, Wrong, "assume: received 3; expected a strict inequality"),
        ({"R": "positive"}, Unknown, "unknown parameter 'R'; did you mean 'r'?"),
        ({"r": "positiv"}, Wrong, "r is 'positiv'; expected 'positive', 'negative'"),
        ("r >= 0", Wrong, "expected a strict inequality"),
    ],
    "at_least": [*COUNT, (0, Wrong, "at_least = 0; expected a whole number from 1")],
    "ax": [("omga", Wrong, "ax: expected an Axes, received a str")],
    "back": FLAG,
    "between": [
        ((1, 0), Wrong, "between = (1, 0); expected two numbers, the lower one first"),
        ((0, NAN), Wrong, "between = (0, nan)"),
        (("0", "1"), Wrong, "between = ('0', '1')"),
    ],
    "branches": COUNT,
    "cells": [
        ((0, 1), Wrong, "cells = 0; expected a whole number from 1"),
        ((1, 1.5), Wrong, "cells = 1.5; expected a whole number"),
        (3, Wrong, "cells = 3; expected two whole numbers"),
    ],
    "changes": [
        *MAPPING,
        ({"omga": 1}, Unknown, "unknown parameter 'omga'; did you mean 'omega'?"),
        ({"C": NAN}, BadModel, "parameter C: expected a finite number, received nan"),
        ({"C": "2"}, BadModel, "parameter C: expected a finite number, received '2'"),
    ],
    "code": [
        ("LQ", Unknown, "'LQ'; did you mean 'LP'?"),
        (3, Wrong, "code = 3; expected text"),
    ],
    "color": [("omga", Wrong, "color = 'omga'; expected a colour")],
    "column": [*SYMBOL, ("y", Unknown, "unknown column 'y'")],
    "combinations": MAPPING,
    "crossings": FLAG,
    "dense": FLAG,
    "diagnostics": [("", Wrong, "diagnostics = ''; expected the path")],
    "diagram": a("Diagram"),
    "direction": [
        (2, Wrong, "direction = 2; expected -1"),
        (True, Wrong, "direction = True; expected -1"),
        ("up", Wrong, "direction = 'up'; expected -1"),
    ],
    "dpi": [(0, Wrong, "dpi = 0; expected a number from 10"), (NAN, Wrong, "dpi = nan")],
    "entry": [*NUMBER, (5, Wrong, "entry = 5; expected a value of p on the sheet before HB1")],
    "exact": FLAG,
    "expression": COLUMN,
    "fills": [*MAPPING, ({True: "blu"}, Wrong, "'blu'; expected a colour")],
    "forcing": [*MAPPING, ({"x": "1"}, BadModel, "'x' is both a state and a slow quantity")],
    "format": [*TEXT, ("atuo", Unknown, "unknown export format 'atuo'; did you mean 'auto'?")],
    "function": [
        (3, Wrong, "function = 3; expected a function"),
        (lambda a, b: [True], Wrong, "the function returned 1 labels for"),
        (lambda a, b: a + 0.5, Wrong, "is no label of a map; expected a string"),
    ],
    "gain": POSITIVE,
    "gap": [*TEXT, ("S9", Unknown, "unknown region 'S9'; did you mean")],
    "guard": COUNT,
    "implicit": FLAG,
    "interfaces": FLAG,
    "iterations": COUNT,
    "keep": [*COUNT, (0, Wrong, "keep = 0; expected a whole number from 1")],
    "key": [
        *COLUMN,
        (10**6, fs.OutOfRangeError, "1000000; the last of"),
        (True, Wrong, "'True' is no expression"),
    ],
    "label": FLAG,
    "largest_step": POSITIVE,
    "largest_turn": POSITIVE,
    "lay": a("Overlay"),
    "least": [(-1, Wrong, "least = -1; expected a number from 0"), (NAN, Wrong, "least = nan")],
    "legend": FLAG,
    "level": NUMBER,
    "levels": COUNT,
    "max_crossings": [*COUNT, (0, Wrong, "max_crossings = 0; expected a whole number from 1")],
    "max_steps": [*COUNT, (0, Wrong, "max_steps = 0; expected a whole number from 1")],
    "model": a("Model"),
    "models": [([None], Wrong, "models: expected a Model, received None")],
    "most": [*COUNT, (0, Wrong, "most = 0; expected a whole number from 1")],
    "name": [("omga", Unknown, "unknown"), (None, fs.FastSlowError, "None")],
    "named": [({"omga": 1.0}, Unknown, "unknown")],
    "names": MAPPING,
    "observed": [*SYMBOL, ("y", Unknown, "unknown state 'y'")],
    "ones": [
        (3, Wrong, "ones = 3; expected a sequence"),
        ([("x",)], Wrong, "expected a state and a term of its rate"),
        ([("y", "x")], Unknown, "unknown state 'y'"),
        ([("x", "x**7")], Wrong, "the rate of x has no term x**7"),
    ],
    "order": [*COUNT, (2, Wrong, "order = 2; expected a whole number from 4 to 40")],
    "over": RANGE,
    "parameter": [*SYMBOL, ("omga", Unknown, "unknown parameter 'omga'")],
    "peaks": COUNT,
    "period": POSITIVE,
    "phase": NUMBER,
    "phases": [(3, Wrong, "phases = 3"), ([3], Wrong, "phases[0]: expected a Phase")],
    "point": a("SpecialPoint"),
    "points": COUNT,
    "predict": [
        (3, Wrong, "predict = 3; expected a function"),
        (lambda a, b: [], Wrong, "the prediction has 0 labels for"),
    ],
    "progress": FLAG,
    "radius": [*NUMBER, (2, Wrong, "radius = 2; expected a number between 0 and 1")],
    "rate": NUMBER,
    "reach": POSITIVE,
    "region": [*TEXT, ("S9", Unknown, "unknown region 'S9'; did you mean 'S1'?")],
    "regions": [
        *MAPPING,
        ({"r": "x > 0"}, BadModel, "x = 0 decides a branch but is not one of the interfaces"),
        ({"r": "x + 1"}, BadModel, "region r: expected a condition such as x > D"),
    ],
    "replace": MAPPING,
    "result": a("RefinedMap"),
    "run": a("Trajectory"),
    "run_tol": TOLERANCE,
    "samples": [
        (1, Wrong, "samples = 1; expected"),
        (NAN, Wrong, "samples"),
        ("x", Wrong, "samples"),
    ],
    "section": SYMBOL,
    "settings": [(3, Wrong, "settings: expected a Continuation, received a int")],
    "settle": [(-1, Wrong, "settle = -1"), ("5", Wrong, "settle = '5'; expected")],
    "since": [*NUMBER, (-5, Wrong, "since = -5 is outside the run, which is [0,")],
    "size": POSITIVE,
    "slow": MAPPING,
    "smallest_step": POSITIVE,
    "solutions": [("", Wrong, "solutions = ''; expected the path")],
    "source": [("omga", Wrong, "source: expected an Overlay or Branch, received a str")],
    "spectrum": a("Spectrum"),
    "stable": FLAG,
    "state": [
        ([0.0], Wrong, "the initial state has shape (1,); expected 2 values, for x, v"),
        ([0.0, NAN], Wrong, "initial v = nan; expected a finite number"),
        (["a", 0], Wrong, "the initial state: expected numbers, received ['a', 0]"),
        ([True, False], Wrong, "the initial state: expected numbers"),
        ({"x": 0, "u": 0}, Unknown, "unknown state 'u'"),
    ],
    "states": [
        ([0.0], Wrong, "the initial states have shape (1,); expected (m, 2) or (2,), for x, v"),
        ({"x": 0, "u": 0}, Unknown, "unknown state 'u'"),
        ([0.0, NAN], Wrong, "v = nan of trajectory 0; expected a finite number"),
    ],
    "step": POSITIVE,
    "stiffness": [(0, Wrong, "stiffness = 0; expected positive numbers")],
    "style": [
        ({"linewdth": 1.0}, Unknown, "unknown property of a line 'linewdth'; did you mean"),
        ({"linewidth": "x"}, Wrong, "linewidth = 'x'"),
        ({"linewidth": NAN}, Wrong, "linewidth = nan; expected a finite number"),
    ],
    "sweep": a("Sweep"),
    "t": [
        ((1, 0), Wrong, "t = (1, 0); expected finite times, start < end"),
        ((0, 0), Wrong, "t = (0, 0); expected finite times, start < end"),
        ((0, INF), Wrong, "t = (0, inf); expected finite times"),
        (5, Wrong, "t = 5; expected a pair (start, end)"),
        (("0", "1"), Wrong, "t: expected numbers, received ('0', '1')"),
        (None, Wrong, "expected t=(start, end) or periods=, received neither"),
    ],
    "threads": [*COUNT, (0, Wrong, "threads = 0; expected a whole number from 1")],
    "times": [
        (-1, Wrong, "time -1 is outside the run, which is [0,"),
        (NAN, Wrong, "time nan is outside the run"),
        ("5", Wrong, "times: expected numbers, received '5'"),
    ],
    "title": TEXT,
    "tol": TOLERANCE,
    "tolerance": POSITIVE,
    "turning": FLAG,
    "until": [*NUMBER, (1e9, Wrong, "until = 1e+09; expected a time from 0 to")],
    "value": [
        ({"q": 0.0}, Unknown, "parameter 'q'"),
        ({"p": 7.0}, Wrong, "p = 7 is outside this"),
        ({"p": NAN}, Wrong, "p = nan; expected a finite number"),
        ({"p": "0"}, Wrong, "p = '0'; expected a finite number"),
    ],
    "values": [
        ({"omga": 1.0}, Unknown, "unknown"),
        (3, Wrong, "values = 3; expected a mapping"),
    ],
    "virtual": FLAG,
    "what": [*TEXT, ("extrema", Unknown, "'extrema'; did you mean 'extremes'?")],
    "width": [(0, Wrong, "width = 0; expected a number from 2 to 40")],
    "window": [*TEXT, ("han", Unknown, "unknown window 'han'; did you mean 'hann'?")],
    "x": [("omga", Unknown, "omga")],
    "y": [("omga", Unknown, "omga")],
}

POSITIVES = [
    (0, Wrong, "= 0; expected positive numbers"),
    (NAN, Wrong, "= nan; expected finite numbers"),
    ("5", Wrong, "expected numbers, received '5'"),
    (INF, Wrong, "= inf; expected finite numbers"),
]
LABEL = [("yes", Unknown, "unknown label 'yes'"), (np.zeros(2), Unknown, "unknown label")]
LEVEL = [
    (3, Wrong, "level = 3; expected a mapping"),
    ({"y": 1.0}, Unknown, "unknown state of the level 'y'"),
    ({"x": NAN}, Wrong, "level of x = nan; expected a finite number"),
    ({"x": "1"}, Wrong, "level of x = '1'; expected a finite number"),
]
SIDES = [
    *MAPPING,
    ({"edge": 3}, Wrong, "interfaces['edge'] = 3; expected a state and its value"),
    ({"edge": ("x", NAN)}, Wrong, "interfaces['edge'] = nan; expected a finite number"),
]

BY_FUNCTION = {
    "Branch.intersections.other": a("Branch"),
    "Branch.nearest.values": [
        ({"omga": 1.0}, Unknown, "unknown state or parameter 'omga'"),
        ({}, Wrong, "expected values of some of x, p, received none"),
        ({"p": NAN}, Wrong, "p = nan; expected a finite number"),
    ],
    "Continuation.starts": COUNT,
    "Derivation.__getitem__.region": [("S9", Unknown, "unknown region 'S9'; did you mean 'S1'?")],
    "Diagram.nearest.values": [
        ({"omga": 1.0}, Unknown, "unknown state or parameter 'omga'"),
        ({"p": "0"}, Wrong, "p = '0'; expected a finite number"),
    ],
    "Diagram.select.between": [
        ((1, 0), Wrong, "between = (1, 0); expected two numbers, the lower one first"),
        ((5, 6), Wrong, "between=(5, 6) is outside this diagram's range [-1, 1]"),
    ],
    "Model.interfaces": [
        *MAPPING,
        ({"edge": "omga"}, BadModel, "interface edge: unknown symbol 'omga'"),
    ],
    "Model.with_parameters.named": [
        ({"omga": 1}, Unknown, "unknown parameter 'omga'; did you mean 'omega'?"),
        ({"C": True}, BadModel, "parameter C: expected a finite number, received True"),
    ],
    "predict_delay.model": [("omga", Wrong, "model: expected a Model, received a str")],
    "Model.parameters": [
        *MAPPING,
        ({"k": NAN}, BadModel, "parameter k: expected a finite number, received nan"),
        ({"k": "1"}, BadModel, "parameter k: expected a finite number, received '1'"),
        ({}, BadModel, "rate of x: unknown symbol 'k'"),
    ],
    "Model.ramped.rate": [(NAN, BadModel, "parameter C_rate: expected a finite number")],
    "Model.ramped.start": [("0", BadModel, "parameter C_start: expected a finite number")],
    "Model.rates": [
        *MAPPING,
        ({}, BadModel, "at least one state"),
        ({"x": "omga"}, BadModel, "rate of x: unknown symbol 'omga'"),
        ({"x": None}, BadModel, "rate of x: expected an expression, received None"),
        ({"x": "x +"}, BadModel, "rate of x: expected an expression, received 'x +'"),
    ],
    "Model.frozen.slow": [
        *MAPPING,
        ({"u": "g"}, Unknown, "unknown slow quantity 'u'"),
        ({"w": None}, BadModel, "path of w: expected an expression, received None"),
    ],
    "Ensemble.__getitem__.name": [("y", Unknown, "unknown column 'y'")],
    "PointBranch.intersections.other": a("PointBranch"),
    "RefinedMap.at.named": [({"omga": 0.5}, Unknown, "unknown axis 'omga'")],
    "RefinedMap.at.values": [
        ([5.0, 0.0], Wrong, "a = 5; the map covers [0, 1]"),
        ([0.5], Wrong, "expected a value for each of a, b"),
        ([NAN, 0.0], Wrong, "a = nan; the map covers [0, 1]"),
        (["0", 0.0], Wrong, "a: expected numbers, received '0'"),
        ([[0.1, 0.2], [0.1, 0.2, 0.3]], Wrong, "a and b have the shapes (2,) and (3,)"),
    ],
    "RefinedMap.boundary.one": LABEL,
    "RefinedMap.boundary.other": LABEL,
    "Spectrum.peaks.n": COUNT,
    "Sweep.hysteresis.tol": [(-1, Wrong, "tol = -1; expected a number from 0 to 1")],
    "Trajectory.hits.interface": [
        ("x - E", Unknown, "did you mean 'x - D'?"),
        (2.5, Unknown, "2.5"),
    ],
    "Trajectory.section.interface": [
        (2.5, Wrong, "interface = 2.5; expected a name or an expression"),
        ("x - D", Wrong, "expected an expression with its level, or interface=, received both"),
    ],
    "Trajectory.extremes.name": NAME,
    "Trajectory.spectrum.name": NAME,
    "Trajectory.spectrum.samples": [
        *COUNT,
        (2, Wrong, "samples = 2; expected a whole number from 8"),
    ],
    "Trajectory.steady.tol": POSITIVE,
    "bifurcation_sweep.level": NUMBER,
    "bifurcation_sweep.phase": [*NUMBER, (2, Wrong, "phase = 2; expected a part of the period")],
    "bifurcation_sweep.settle": COUNT,
    "bifurcation_sweep.values": [
        ([1, 3, 2], Wrong, "values: expected strictly rising or strictly falling numbers"),
        ([], Wrong, "values of shape (0,); expected a one-dimensional array"),
        ([NAN], Wrong, "values = [nan]; expected finite numbers"),
        ("12", Wrong, "values: expected numbers, received '12'"),
    ],
    "continue_equilibria.marks": [
        ([5], Wrong, "mark p = 5 is outside the range [-1, 1]"),
        ([NAN], Wrong, "marks[0] = nan; expected a finite number"),
        (3, Wrong, "marks = 3; expected a sequence"),
    ],
    "continue_points.over": [
        (3, Wrong, "over = 3; expected a mapping"),
        ({"p": (-1, 1), "q": (1, 1)}, Wrong, "over['q'] = (1, 1); expected two finite numbers"),
        ({"p": (-1, 1)}, Wrong, "over has no range for 'q'"),
        ({"p": (-1, 1), "r": (0, 1)}, Unknown, "unknown parameter in over 'r'"),
        ({"p": (5, 6), "q": (5, 6)}, Wrong, "lies outside over="),
    ],
    "continue_points.parameters": [
        (("p", "p"), Wrong, "expected two different parameters"),
        ("p", Wrong, "parameters = 'p'; expected a sequence"),
        (("p", "omga"), fs.FastSlowError, "omga"),
    ],
    "delay_scaling.level": LEVEL,
    "delay_scaling.rates": [
        ([1e-3], Wrong, "expected at least two positive speeds"),
        ([1e-3, -1e-3], Wrong, "expected at least two positive speeds"),
        ("12", Wrong, "rates: expected numbers, received '12'"),
    ],
    "delay_scaling.start": [*NUMBER, (5, Wrong, "start = 5; expected a value")],
    "disagreements.one": [*MAPPING, ({"B": 1}, Unknown, "unknown entry 'B'")],
    "disagreements.other": MAPPING,
    "equilibria.named": [
        ({"p": NAN}, BadModel, "parameter p: expected a finite number, received nan"),
        ({"P": 1.0}, Unknown, "unknown parameter 'P'; did you mean 'p'?"),
        ({}, BadModel, "'p'"),
    ],
    "export.path": [(3, Wrong, "path = 3; expected the path of a file")],
    "export.start": [*MAPPING, ({"y": 0.0}, Unknown, "unknown state 'y'")],
    "hopf_exit.rate": [*NUMBER, (-0.05, Wrong, "expected rate > 0")],
    "plot.parameter_plane.curves": [([None], Wrong, "curves: expected a PointBranch")],
    "plot.panel.state": [*SYMBOL, ("y", Unknown, "unknown state 'y'")],
    "plot.phase_portrait.interfaces": SIDES,
    "plot.regime_map.curves": [
        *MAPPING,
        ({"line": ([0, 1], [0])}, Wrong, "expected two columns of equal length"),
    ],
    "plot.regime_map.marks": [
        *MAPPING,
        ({"here": 3}, Wrong, "marks['here'] = 3; expected a sequence"),
        ({"here": (0, NAN)}, Wrong, "marks['here'][1] = nan; expected a finite number"),
    ],
    "plot.delay_scaling.scaling": a("DelayScaling"),
    "plot.section.section": a("Section"),
    "plot.spectrum.over": RANGE,
    "plot.time_series.interfaces": SIDES,
    "predict_delay.level": LEVEL,
    "read_auto.parameter": TEXT,
    "reduce_to.rates": MAPPING,
    "refined_map.levels": [
        *COUNT,
        (100, Wrong, "levels = 100; expected a whole number from 0 to 60"),
    ],
    "refined_map.over": PLANE,
    "refined_map.tol": POSITIVE,
    "regime_map.over": PLANE,
    "regime_map.parameters": [
        (3, Wrong, "parameters = 3; expected a mapping"),
        ({"E": "C"}, Unknown, "unknown parameter 'E'"),
        ({"B": "C +"}, Wrong, "'C +' is no expression"),
        (lambda a, b: 3, Wrong, "what parameters returns = 3; expected a mapping"),
    ],
    "regime_map.periods": POSITIVE,
    "regime_map.tol": POSITIVE,
    "simulate_many.parameters": [
        *MAPPING,
        ({"omga": 1.0}, Unknown, "unknown parameter 'omga'; did you mean 'omega'?"),
        ({"C": [1.0, NAN]}, Wrong, "C = nan of trajectory 1; expected a finite number"),
        ({"C": [1, 2], "D": [1, 2, 3]}, Wrong, "parameters broadcast to one length"),
    ],
    "simulate_many.period": [
        (0, Wrong, "period = 0.0; expected a positive number"),
        ("5", Wrong, "period"),
    ],
    "slow_load_criterion.parameters": [
        *MAPPING,
        ({"omga": 1.0}, Unknown, "unknown parameter 'omga'; did you mean 'omega'?"),
        ({"D": [1, 2], "C": [1, 2, 3]}, Wrong, "expected values of one shape"),
    ],
    "slow_load_gap.B": POSITIVES[1:],
    "slow_load_gap.C": POSITIVES[1:],
    "slow_load_gap.damping": POSITIVES,
    "slow_load_gap.omega": POSITIVES,
}
#: Periods stand beside the t of the good call.
for _name in ("simulate", "simulate_many"):
    BY_FUNCTION[f"{_name}.periods"] = [(3, Wrong, "or periods=, received both")]
    BY_FUNCTION[f"{_name}.start"] = [*NUMBER, (2, Wrong, "start= goes with periods=")]

#: The parameters of ready-made models are numbers, unless said otherwise above.
OF_SYSTEMS = [
    (NAN, fs.FastSlowError, "nan"),
    ("5", fs.FastSlowError, "'5'"),
    (None, fs.FastSlowError, "None"),
    (True, fs.FastSlowError, "True"),
]
SCALING = [("consistnt", Unknown, "unknown scaling 'consistnt'; did you mean 'consistent'?")]
BY_FUNCTION["systems.gear_scales.scaling"] = SCALING
BY_FUNCTION["systems.harmonic_gear_physical.scaling"] = SCALING
BY_FUNCTION["systems.harmonic_gear_physical.D"] = OF_SYSTEMS[:2]
for _name in ("J_i", "J_o", "N", "xi", "K_HD", "k2"):
    BY_FUNCTION[f"systems.gear_scales.{_name}"] = POSITIVE


def rows_of(function, parameter):
    """The rows of a parameter of a function, None where there are none."""
    own = BY_FUNCTION.get(f"{function}.{parameter}")
    if own is not None:
        return own
    if function.startswith("systems."):
        return OF_SYSTEMS
    if parameter == "path":
        return (
            FIGURE if function.startswith("plot.") else SAVE if function.endswith("save") else PATH
        )
    return BY_PARAMETER.get(parameter)
