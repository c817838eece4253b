"""Wrong arguments with what their errors must say, by function and parameter."""

from types import SimpleNamespace

import numpy as np

import fastslow as fs
from tests.errors.wrong_by_parameter import BY_PARAMETER
from tests.errors.wrong_values import (
    COUNT,
    FIGURE,
    FLAG,
    INF,
    MAPPING,
    NAME,
    NAN,
    NUMBER,
    PATH,
    PLANE,
    POSITIVE,
    RANGE,
    SAVE,
    SYMBOL,
    TEXT,
    BadModel,
    Unknown,
    Wrong,
    a,
)

MODULO = [
    (NAN, Wrong, "t = nan; expected finite numbers"),
    ("1", Wrong, "t: expected numbers, received '1'"),
]
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
    ({"edge": 3}, Wrong, "interface_values['edge'] = 3; expected a state and its value"),
    ({"edge": ("x", NAN)}, Wrong, "interface_values['edge'] = nan; expected a finite number"),
]

INTEGRATION = [
    *a("Integration"),
    (fs.Integration(atol={"nowhere": 1.0}), Unknown, "unknown state 'nowhere'"),
]
BOX = [
    (3, Wrong, "over = 3; expected a mapping"),
    ({"x": (0, 1)}, Wrong, "no range of the initial values of y"),
    ({"x": (0, 1), "y": (1, 0)}, Wrong, "did you mean (0, 1)?"),
    ({"x": (0, 1), "y": 3}, Wrong, "over[y] = 3; expected two finite numbers"),
    ({"x": (0, 1), "y": (0, 1), "z": (0, 1)}, Unknown, "unknown state 'z'"),
]
REGION = [*TEXT, ("S9", Unknown, "unknown region 'S9'; did you mean 'S3'?")]
NEAR = [
    ({"omga": 1.0}, Unknown, "unknown column 'omga'"),
    ({}, Wrong, "expected values of some of"),
    ({"x": "0"}, Wrong, "x = '0'; expected a finite number"),
]

NEAR_CURVE = [
    ({"omga": 1.0}, Unknown, "unknown state or parameter 'omga'"),
    ({}, Wrong, "expected values of some of x, p, q"),
]

WINDOW = [
    *MAPPING,
    ({"omga": (0, 1)}, Unknown, "unknown state of the window 'omga'"),
    ({"x": (1, 0)}, Wrong, "window of x = (1, 0); expected two numbers, the lower one first"),
    ({"x": (1, 0)}, Wrong, "did you mean (0, 1)?"),
    ({"x": 3}, Wrong, "window of x = 3; expected two numbers"),
    ({"x": (0, "1")}, Wrong, "window of x = (0, '1'); expected two numbers"),
    ({"x": (NAN, 1)}, Wrong, "window of x = (nan, 1); expected two numbers"),
]

ROUTE = [
    ("S1", Wrong, "itinerary = 'S1'; expected a sequence"),
    ([3], Wrong, "itinerary[0] = 3; expected text"),
    (["S9"], Unknown, "unknown itinerary 'S9'"),
]
LEFT_OUT = [
    ("noise", Wrong, "without = 'noise'; expected a sequence"),
    (["nose"], Unknown, "unknown kind to leave out 'nose'; did you mean 'noise'?"),
]

#: Regions of a model of which few are formed.
OF_MANY = [
    ("S1", Wrong, "regions = 'S1'; expected a sequence"),
    ([3], Wrong, "regions[0] = 3; expected text"),
    (["S1"], Wrong, "regions of the model are all considered; expected None"),
]

BY_FUNCTION = {
    "Tabulated.times": [
        ([0.0], Wrong, "times have shape (1,), values (2,); expected two lists of the same length"),
        ([1.0, 0.0], Wrong, "times[0] = 1 is followed by 0; expected increasing times"),
        ([0.0, NAN], Wrong, "times[1] = nan; expected a number"),
        ("ab", Wrong, "times: expected numbers, received 'ab'"),
    ],
    "Tabulated.values": [
        ([0.0, INF], Wrong, "values[1] = inf; expected a number"),
        ("ab", Wrong, "values: expected numbers, received 'ab'"),
    ],
    "Tabulated.interpolation": [
        ("spline", Unknown, "unknown interpolation 'spline'"),
        (3, Unknown, "(known: linear, cubic, previous)"),
        ("cubic", Wrong, "received 2 times; cubic interpolation needs at least 4"),
    ],
    "Tabulated.periodic": [
        *FLAG,
        (True, Wrong, "begins with the value 1 and ends with 2; expected equal values"),
    ],
    "Tabulated.__call__.t": [
        (2.0, Wrong, "t = 2 is outside the table, 0 ≤ t ≤ 1"),
        (NAN, Wrong, "t = nan is outside the table"),
        ("a", Wrong, "t: expected numbers, received 'a'"),
    ],
    "Tabulated.__call__.derivative": [
        (-1, Wrong, "derivative = -1"),
        (0.5, Wrong, "derivative = 0.5"),
    ],
    "certify.window": [
        *WINDOW,
        ({}, Wrong, "window of x: received no range; expected a finite range of every state"),
        ({"x": (0, INF)}, Wrong, "window of x: received (0.0, inf); expected a finite range"),
    ],
    "equilibria.regions": OF_MANY,
    "continue_equilibria.regions": OF_MANY,
    "derive.regions": [
        ("S1", Wrong, "regions = 'S1'; expected a sequence"),
        ([3], Wrong, "regions[0] = 3; expected text"),
        (["S9"], Unknown, "unknown region 'S9'; did you mean 'S1'?"),
    ],
    "slow_flow.regions": [
        ("S1", Wrong, "regions = 'S1'; expected a sequence"),
        ([3], Wrong, "regions[0] = 3; expected text"),
        (["S9"], Unknown, "unknown region 'S9'; did you mean 'S1'?"),
    ],
    "find_canard.point": [
        ("CN", Wrong, "point: expected a FoldedPoint or CornerPoint, received a str"),
    ],
    "find_canards.point": [
        ("FN", Wrong, "point: expected a FoldedPoint, received a str"),
    ],
    "singular_cycle.state": [
        ([0], Wrong, "the initial state has shape (1,); expected 2 values, for x, y"),
        ({"x": 0}, Wrong, "the initial state has no value for y"),
    ],
    "singular_cycle.parameter": [
        (3, Wrong, "parameter = 3; expected a name or an expression"),
        ("r", Wrong, "parameter and over: expected both"),
    ],
    "find_canard.section": [
        (3, Wrong, "section = 3; expected a name or an expression"),
        ("y", Wrong, "section = y; expected a curve across the fast direction"),
        ("x - 40", Wrong, "section: x - 40 = 0 is missed by both slow manifolds"),
    ],
    "find_orbit.at": [
        ({"x": 1.0}, Wrong, "at= is a point of a canard cycle, and required with a canard"),
        (3, Wrong, "at = 3; expected"),
    ],
    "prove.digits": COUNT,
    "Certification.max_boxes": COUNT,
    "Certification.width": [
        (NAN, Wrong, "width = nan; expected a number from 1e-12 to 0.01"),
        ("small", Wrong, "width = 'small'; expected a number from 1e-12 to 0.01"),
        (0.5, Wrong, "width = 0.5; expected a number from 1e-12 to 0.01"),
    ],
    "Certificate.count.value": [
        ({"omga": 1.0}, Unknown, "unknown parameter of the certificate 'omga'"),
        ({}, Wrong, "expected a value of p, received none"),
        ({"p": "0"}, Wrong, "p = '0'; expected a finite number"),
        ({"p": 7}, Wrong, "p = 7 is outside this certificate's range [-1, 1]"),
        ({"p": 2 / 27**0.5}, Wrong, "is not decided: a fold"),
    ],
    "continue_equilibria.window": WINDOW,
    "continue_equilibria.from_points": [
        (3, Wrong, "from_points = 3; expected a sequence"),
        ([], Wrong, "expected at least one point of a branch"),
        (
            [0.5],
            Wrong,
            "from_points[0] = 0.5; expected an Equilibrium, a SpecialPoint or a mapping",
        ),
        ([{"x": 0.5}], Wrong, "from_points[0] has no value of p"),
        ([{"x": 0.5, "q": 1}], Unknown, "unknown state or parameter of from_points[0] 'q'"),
        ([{"x": NAN, "p": 0}], Wrong, "from_points[0]['x'] = nan; expected a finite number"),
        ([{"x": 0.5, "p": 7}], Wrong, "from_points[0]: p = 7 is outside the range [-1, 1]"),
    ],
    "equilibria.window": WINDOW,
    "Branch.intersections.other": a("Branch"),
    "Branch.nearest.values": [
        ({"omga": 1.0}, Unknown, "unknown state or parameter 'omga'"),
        ({}, Wrong, "expected values of some of x, p, received none"),
        ({"p": NAN}, Wrong, "p = nan; expected a finite number"),
    ],
    "Continuation.starts": COUNT,
    "Execution.chunk": [*COUNT, (0, Wrong, "chunk = 0; expected an integer from 1")],
    "Execution.errors": [("ignore", Unknown, "unknown treatment of errors 'ignore'")],
    "Execution.executor": [
        (3, Wrong, "executor = 3; expected a concurrent.futures.Executor, such as"),
        (
            SimpleNamespace(get_executor=3),
            Wrong,
            "expected a concurrent.futures.Executor, here that of get_exec",
        ),
    ],
    "Execution.keep": [
        ("regime", Wrong, "keep = 'regime'; expected a sequence"),
        ([3], Wrong, "keep[0] = 3; expected text"),
    ],
    "Execution.progress": FLAG,
    "Execution.resume": [
        (NAN, Wrong, "nan; expected True, False or 'anyway'"),
        ("yes", Wrong, "'yes'; expected True, False or 'anyway'"),
    ],
    "Execution.store": [(3, Wrong, "store = 3; expected the path of a file")],
    "Execution.threads": [*COUNT, (0, Wrong, "threads = 0; expected an integer from 1")],
    "Drift.by_state": [
        *MAPPING,
        ({"x": NAN}, Wrong, "by_state['x'] = nan; expected a finite number"),
    ],
    "Drift.by_value": NUMBER,
    "Drift.change": NUMBER,
    "Drift.complete": FLAG,
    "Drift.law": TEXT,
    "Drift.rate": [
        ("fast", Wrong, "rate = 'fast'; expected a finite rate of drift"),
        (NAN, Wrong, "rate = nan; expected a finite rate of drift"),
        (0, Wrong, "rate = 0; expected a finite rate of drift other than zero"),
    ],
    "Integration.atol": [
        (-1, Wrong, "atol = -1; expected a finite number from 0"),
        (NAN, Wrong, "atol = nan; expected a finite number from 0"),
        ("1e-9", Wrong, "atol = '1e-9'; expected a finite number from 0"),
        (True, Wrong, "atol = True; expected a finite number from 0"),
        ([1e-9, -1], Wrong, "atol[1] = -1; expected a finite number from 0"),
        ({"x": INF}, Wrong, "atol of x = inf; expected a finite number from 0"),
        ({"x": "0"}, Wrong, "atol of x = '0'; expected a finite number from 0"),
    ],
    "SlowFlow.__getitem__.region": [("S9", Unknown, "unknown region 'S9'; did you mean 'S1'?")],
    "Derivation.__getitem__.region": [("S9", Unknown, "unknown region 'S9'; did you mean 'S1'?")],
    "Diagram.nearest.values": [
        ({"omga": 1.0}, Unknown, "unknown state or parameter 'omga'"),
        ({"p": "0"}, Wrong, "p = '0'; expected a finite number"),
    ],
    "Diagram.select.between": [
        ((1, 0), Wrong, "between = (1, 0); expected two numbers, the lower one first"),
        ((5, 6), Wrong, "between=(5, 6) is outside this diagram's range [-1, 1]"),
    ],
    "Model.resets": [
        *MAPPING,
        ({"x >= 1": 3}, BadModel, "expected a mapping of states to their values"),
        ({"x >= 1": {"y": 0}}, BadModel, "y is no state; a reset changes states: x"),
        ({"x": {"x": 0}}, BadModel, "expected one inequality such as x >= sigma"),
    ],
    "Model.switches": [
        *MAPPING,
        ({"q": ("x > 1",)}, BadModel, "switch q: expected two relations"),
        ({"q": ("x < 0", "x > 0")}, BadModel, "touch, so that it has no hysteresis"),
    ],
    "Model.definitions": [
        *MAPPING,
        ({"a": "b", "b": "a"}, BadModel, "definitions contain each other: a → b → a"),
        ({"a": "unknown"}, BadModel, "definition a: unknown symbol 'unknown'"),
        ({"x": "2"}, BadModel, "'x' is both a state and a definition"),
        ({"two words": "x"}, BadModel, "definition 'two words': expected an identifier"),
        ({"a": None}, BadModel, "definition a: expected an expression"),
    ],
    "Model.events": [
        *MAPPING,
        ({"x >= 1": 3}, BadModel, "event x >= 1: expected fs.Event(when=condition"),
        ({"x > 1": {"y": 0}}, BadModel, "y is no name of the model; an event assigns states"),
        (
            {"x": {"x": 0}},
            BadModel,
            "event x: expected inequalities joined by And, Or and Not, received x",
        ),
        ({"x > 1": {}}, BadModel, "event x > 1: expected at least one assignment"),
    ],
    "Event.when": [(3, Wrong, "when = 3; expected a condition such as x > 1")],
    "Event.delay": [([1], Wrong, "delay = [1]; expected an expression or a number")],
    "Event.priority": [({}, Wrong, "priority = {}; expected an expression or a number")],
    "Event.then": MAPPING,
    "Event.persistent": FLAG,
    "Event.initially": FLAG,
    "Event.values": [
        ("before", Unknown, "unknown time of values 'before'"),
        (3, Unknown, "unknown time of values '3'"),
    ],
    "Model.with_switches.states": [
        *MAPPING,
        ({"omga": 1}, Unknown, "unknown switch 'omga'"),
    ],
    "Model.periodic": [
        *MAPPING,
        ({"x": 1}, BadModel, "x modulo 1: the rate of x, -k*x, is not periodic in x"),
        ({"x": NAN}, BadModel, "period of x: expected a positive number"),
        ({"x": "k"}, BadModel, "period of x: expected a positive number"),
        ({"omga": 1}, Unknown, "unknown state in periodic 'omga'"),
    ],
    "Model.interfaces": [
        *MAPPING,
        ({"edge": "omga"}, BadModel, "interface edge: unknown symbol 'omga'"),
    ],
    "Model.with_parameters.named": [
        ({"omga": 1}, Unknown, "unknown parameter 'omga'; did you mean 'omega'?"),
        ({"C": True}, BadModel, "parameter C: expected a finite number, received True"),
    ],
    "predict_delay.diagram": [("omga", Wrong, "diagram: expected a Diagram, received a str")],
    "predict_delay.entry": [*NUMBER, (0.5, Wrong, "diagram= and entry= go with a Hopf")],
    "predict_delay.model": [("omga", Wrong, "model: expected a Model, received a str")],
    "Model.parameters": [
        *MAPPING,
        ({"k": NAN}, BadModel, "parameter k: expected a finite number, received nan"),
        ({"k": "1"}, BadModel, "parameter k: expected a finite number, received '1'"),
        ({}, BadModel, "rate of x: unknown symbol 'k'"),
    ],
    "Model.with_ramp.rate": [(NAN, BadModel, "parameter C_rate: expected a finite number")],
    "Model.with_ramp.from_value": [("0", BadModel, "parameter C_start: expected a finite number")],
    "Model.rates": [
        *MAPPING,
        ({}, BadModel, "at least one state"),
        ({"x": "omga"}, BadModel, "rate of x: unknown symbol 'omga'"),
        ({"x": None}, BadModel, "rate of x: expected an expression, received None"),
        ({"x": "x +"}, BadModel, "rate of x: 'x +' is not an expression: it ends after '+'"),
    ],
    "Model.frozen.slow": [
        *MAPPING,
        ({"u": "g"}, Unknown, "unknown slow quantity 'u'"),
        ({"w": None}, BadModel, "path of w: expected an expression, received None"),
    ],
    "Model.frozen.fast": [
        ("w", Wrong, "fast = 'w'; expected a sequence"),
        ([], BadModel, "fast is empty; expected some of w, t"),
        (["u"], Unknown, "unknown slow state or fast forcing 'u'"),
        (["x"], BadModel, "'x' is a fast state already; expected slow states"),
        (["t"], BadModel, "time in the rates occurs in no rate"),
        (["w"], BadModel, "no slow quantity is left to freeze"),
    ],
    "Overlay.at.value": [
        ({"q": 0.0}, Unknown, "unknown column 'q'"),
        ({"p": 7.0}, Wrong, "p = 7 is outside this run's range"),
        ({"p": "0"}, Wrong, "p = '0'; expected a finite number"),
        ({"p": 0.0, "x": 0.0}, Wrong, "a value of one of p, x, t, received p, x"),
    ],
    "Overlay.nearest.values": NEAR,
    "Overlay.select.type": [
        *TEXT,
        ("jmp", Unknown, "unknown type of phase 'jmp'; did you mean 'jump'?"),
    ],
    "Trajectory.at.value": [
        ({"q": 0.0}, Unknown, "unknown column 'q'"),
        ({"x": 70.0}, Wrong, "x = 70 is outside this run's range"),
        ({"t": -1}, Wrong, "t = -1 is outside this run's range [0, "),
        ({"x": NAN}, Wrong, "x = nan; expected a finite number"),
    ],
    "Trajectory.at.region": REGION,
    "Trajectory.nearest.values": NEAR,
    "Trajectory.regions_at.t": [("x", Wrong, "t: expected numbers, received 'x'")],
    "Trajectory.select.region": REGION,
    "Ensemble.nearest.values": NEAR[:2],
    "Canards.nearest.values": NEAR[:2],
    "SingularCycle.nearest.values": NEAR[:2],
    "Section.nearest.values": NEAR,
    "BifurcationSweep.nearest.values": NEAR,
    "BifurcationSweep.at.value": [
        ({"q": 0.0}, Unknown, "unknown sweep parameter 'q'"),
        ({"C": 7.0}, Wrong, "C = 7 is outside this sweep's range [2, 2.5]"),
        ({"C": [[2.0]]}, Wrong, "expected a number or an array of shape (m,)"),
    ],
    "PointBranch.at.value": [
        ({}, Wrong, "expected a value of one of p, q, received none"),
        ({"p": 0.0, "q": 0.0}, Wrong, "expected a value of one of p, q, received p, q"),
        ({"omga": 0.0}, Unknown, "unknown curve parameter 'omga'"),
        ({"q": "0"}, Wrong, "q = '0'; expected a finite number"),
    ],
    "PointBranch.nearest.values": NEAR_CURVE,
    "PointBranch.select.admissible": FLAG,
    "PointCurves.at.value": [({"omga": 0.0}, Unknown, "unknown curve parameter 'omga'")],
    "PointCurves.nearest.values": NEAR_CURVE,
    "PointCurves.select.matching": [
        ({"omga": 1.0}, Unknown, "unknown column to select by 'omga'"),
        ({"code": "XX"}, Unknown, "unknown special point code 'XX'"),
    ],
    "PointBranch.intersections.other": a("PointBranch"),
    "Grid.__getitem__.key": [
        ("omga", Unknown, "unknown column 'omga'"),
        ("sum +", Wrong, "is not an expression"),
        (3, Wrong, "received 3"),
    ],
    "Grid.at.values": [
        ({"omga": 0.5}, Unknown, "unknown axis 'omga'"),
        ({"a": 0}, Wrong, "expected a value of each of a, b"),
        ({"a": 0.2, "b": 0.5}, Wrong, "a = 0.2 is not a value of this axis; the nearest are 0, 1"),
        ({"a": NAN, "b": 0.5}, Wrong, "a = nan is not a value of this axis"),
        ({"a": "0", "b": 0.5}, Wrong, "a = '0'; expected a number of this axis"),
        ({"a": [0, 1], "b": [0.5]}, Wrong, "expected numbers, or arrays of one length"),
    ],
    "Grid.select.matching": [
        ({"omga": 1.0}, Unknown, "unknown axis or output 'omga'"),
        ({"a": (1, 0)}, Wrong, "a = (1, 0); expected a value, or a range (low, high)"),
        ({"sum": 1}, Wrong, "sum is a number; select it by a condition"),
    ],
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
    "BifurcationSweep.hysteresis.resolution": [
        (-1, Wrong, "resolution = -1; expected a number from 0 to 1")
    ],
    "Trajectory.hits.interface": [
        ("x - E", Unknown, "did you mean 'x - D'?"),
        (2.5, Unknown, "2.5"),
    ],
    "Trajectory.section.interface": [
        (2.5, Wrong, "interface = 2.5; expected a name or an expression"),
        ("x - D", Wrong, "expected an expression with its level, or interface=, received both"),
    ],
    "Trajectory.sensitivity.names": [
        (["omga"], Unknown, "unknown parameter or state 'omga'; did you mean 'omega'?"),
        (["w"], Wrong, "w is a slow quantity, given by its law"),
        ([], Wrong, "expected at least one name"),
        (["C", "C"], Wrong, "C is given twice"),
        ([1], Wrong, "names[0] = 1; expected a name"),
    ],
    "Overlay.gradient.transition": [
        ("jump", Wrong, "transition = 'jump'; expected a Transition of this overlay, or its index"),
        (True, Wrong, "transition = True; expected a Transition of this overlay"),
        (9, fs.OutOfRangeError, "no transition 9; the last of 2 is 1"),
    ],
    "Overlay.gradient.name": [
        ("omga", Unknown, "unknown parameter or state 'omga'; did you mean 'omega'?"),
        ("p", Wrong, "p is a slow quantity, given by its law a*sin(omega*t); expected a parameter"),
        (3, Wrong, "name = 3; expected a name"),
    ],
    "Sensitivity.__getitem__.key": [
        ("x", Wrong, "received 'x'; expected a state and a parameter"),
        (("x", "D"), Unknown, "unknown parameter 'D'"),
        (("y", "C"), Unknown, "unknown state 'y'"),
    ],
    "SobolIndices.__getitem__.key": [
        ("sum", Wrong, "received 'sum'; expected an output and a parameter: one of sum and one of"),
        (("sum", "c"), Unknown, "unknown parameter 'c'"),
        (("summ", "a"), Unknown, "unknown output 'summ'; did you mean 'sum'?"),
    ],
    "Trajectory.extremes.name": NAME,
    "Trajectory.spectrum.name": NAME,
    "Trajectory.mixed_mode.name": [
        (3, Wrong, "name = 3; expected a name or an expression"),
        ("omga", Unknown, "unknown state 'omga'"),
    ],
    "Trajectory.spectrum.samples": [
        *COUNT,
        (2, Wrong, "samples = 2; expected an integer from 8"),
    ],
    "Trajectory.regimes.tol": POSITIVE,
    "Trajectory.periodicity.tol": POSITIVE,
    "Observation.column": SYMBOL,
    "Observation.section": SYMBOL,
    "Observation.what": [
        (3, Unknown, "unknown type of observation '3'"),
        ("extrema", Unknown, "'extrema'; did you mean 'extremes'?"),
        ("section", Wrong, 'Observation("section") needs section='),
    ],
    "bifurcation_sweep.settle": COUNT,
    "bifurcation_sweep.strips": [
        *COUNT,
        (0, Wrong, "strips = 0; expected an integer from 1"),
        (2, Wrong, "strips = 2 of 1 values; expected an integer from 1 to 1"),
    ],
    "bifurcation_sweep.values": [
        ([1, 3, 2], Wrong, "values: expected strictly increasing or strictly decreasing numbers"),
        ([], Wrong, "values has shape (0,); expected a non-empty one-dimensional array"),
        ([NAN], Wrong, "values = [nan]; expected finite numbers"),
        ("12", Wrong, "values: expected numbers, received '12'"),
    ],
    "continue_equilibria.marks": [
        ([5], Wrong, "mark p = 5 is outside the range [-1, 1]"),
        ({"LP": "p - 1"}, Wrong, "marks: the name 'LP' of an expression is the code of a fold"),
        ({"level": "omga - 1"}, Unknown, "unknown name in an expression 'omga'"),
        ([NAN], Wrong, "marks[0] = nan; expected a finite number"),
        (3, Wrong, "marks = 3; expected a sequence"),
    ],
    "OrbitBranch.at.value": [
        ({"q": 0.0}, Unknown, "unknown branch parameter 'q'"),
        ({"C": 9.0}, Wrong, "outside this branch's range"),
    ],
    "OrbitBranch.nearest.values": [
        ({}, Wrong, "expected values of some of C, period"),
        ({"omga": 1.0}, Unknown, "unknown column 'omga'"),
        ({"C": NAN}, Wrong, "expected a finite number"),
    ],
    "OrbitBranch.select.code": [*TEXT, ("LQ", Unknown, "unknown special point code 'LQ'")],
    "OrbitBranch.at.itinerary": ROUTE,
    "OrbitBranch.select.itinerary": ROUTE,
    "analyse.model": a("Model or ModelFile"),
    "analyse.t": [
        ((0, 0), Wrong, "t = (0, 0); expected two different finite times"),
        ((1, 0), Wrong, "t = (1, 0); expected start < end"),
        (5, Wrong, "t = 5; expected a pair (start, end)"),
        (None, Wrong, "expected an initial state and t=(start, end)"),
    ],
    "analyse.slow": [
        ("w", Unknown, "unknown state 'w'"),
        (3, Wrong, "expected a name or an expression"),
    ],
    "Model.with_slow.states": [
        (3, Wrong, "states = 3; expected a sequence"),
        (["w"], Unknown, "unknown state 'w'"),
        (["x", "v"], BadModel, "no state is left that is fast"),
    ],
    "overlay.diagram": [
        *a("Diagram or OrbitBranch"),
        ([], Wrong, "expected branches of orbits, received none"),
        ([None], Wrong, "diagram[0]: expected an OrbitBranch, received None"),
    ],
    "overlay.cycles": [
        *a("OrbitBranch"),
        ([3], Wrong, "cycles[0]: expected an OrbitBranch, received an int"),
    ],
    "plot.diagram.cycles": a("OrbitBranch"),
    "plot.response.branch": a("OrbitBranch"),
    "plot.basins.attractors": a("Attractors"),
    "plot.basins.fills": [*MAPPING, ({"A1": "blu"}, Wrong, "'blu'; expected a colour")],
    "plot.multipliers.source": [(3, Wrong, "source: expected an Orbit or OrbitBranch")],
    "continue_orbits.orbit": a("Orbit"),
    "continue_cycles.integration": [
        (3, Wrong, "integration: expected an Integration, received an int"),
    ],
    "continue_cycles.marks": [
        ([NAN], Wrong, "marks[0] = nan; expected a finite number"),
        (3, Wrong, "marks = 3; expected a sequence"),
    ],
    "continue_orbits.integration": [
        (3, Wrong, "integration: expected an Integration, received an int"),
    ],
    "continue_orbits.marks": [
        ([5], Wrong, "mark C = 5 is outside the range [2.442, 2.444]"),
        ([NAN], Wrong, "marks[0] = nan; expected a finite number"),
        (3, Wrong, "marks = 3; expected a sequence"),
    ],
    "continue_orbits.over": [*RANGE, ((0, 1), Wrong, "outside over = (0, 1)")],
    "attractors.over": BOX,
    "attractors.n": [*COUNT, (0, Wrong, "n = 0; expected an integer from 1")],
    "attractors.seed": COUNT,
    "attractors.integration": INTEGRATION,
    "attractors.along": a("Diagram or OrbitBranch")[1:],
    "attractors.samples": [
        (0, Wrong, "samples = 0; expected a sequence"),
        ([3.0], Wrong, "samples: p = 3 is outside the range of the branch, -2 to 2"),
        ([NAN], Wrong, "samples[0] = nan; expected a finite number"),
    ],
    "basins.over": [
        (3, Wrong, "over = 3; expected a mapping"),
        ({"x": (0, 1), "z": (0, 1)}, Unknown, "unknown state 'z'"),
        ({"x": (0, 1)}, Wrong, "give the values of the others as state="),
    ],
    "basins.state": [([0.0], Wrong, "expected 2 values, for x, y")],
    "basins.known": [(3, Wrong, "expected an Attractors, received an int")],
    "basins.integration": INTEGRATION,
    "Attractors.nearest.values": NEAR[:2],
    "find_orbit.guess": [
        ([0.0], Wrong, "the initial state has shape (1,); expected 2 values, for x, v"),
        ({"x": 0, "u": 0}, Unknown, "unknown state 'u'"),
        ("x", Wrong, "the initial state: expected numbers, received 'x'"),
    ],
    "Orbit.__call__.t": MODULO,
    "Orbit.dense_columns.t": MODULO,
    "Orbit.hits.interface": [("omga", Unknown, "unknown interface 'omga'")],
    "find_orbit.integration": [
        (3, Wrong, "integration: expected an Integration, received an int"),
    ],
    "find_orbit.multiple": [*COUNT, (0, Wrong, "multiple = 0; expected an integer from 1")],
    "find_orbit.period": [
        *POSITIVE,
        (1.0, Wrong, "period = 1; expected a whole multiple of the period of the forcing"),
    ],
    "continue_points.over": [
        (3, Wrong, "over = 3; expected a mapping"),
        ({"p": (-1, 1), "q": (1, 1)}, Wrong, "over['q'] = (1, 1); expected two finite numbers"),
        ({"p": (-1, 1)}, Wrong, "over has no range for 'q'"),
        ({"p": (-1, 1), "r": (0, 1)}, Unknown, "unknown parameter in over 'r'"),
        ({"p": (5, 6), "q": (5, 6)}, Wrong, "is outside over="),
    ],
    "continue_points.plane": [
        (("p", "p"), Wrong, "expected two different parameters"),
        (3, Wrong, "plane = 3; expected a sequence"),
        ("p", Wrong, "expected two different parameters"),
        (("p", "omga"), fs.FastSlowError, "omga"),
    ],
    "continue_points.marks": [
        *MAPPING,
        ({"omga": [1.0]}, Unknown, "unknown parameter in marks 'omga'"),
        ({"q": 1.0}, Wrong, "marks['q'] = 1.0; expected a sequence"),
        ({"q": ["1"]}, Wrong, "marks['q'][0] = '1'; expected a finite number"),
        ({"q": [9.0]}, Wrong, "mark q = 9 is outside the range [-1, 2]"),
    ],
    "continue_points.point": a(
        "SpecialPoint or SpecialOrbit or Diagram or RateThreshold or FoldedPoint"
    ),
    "continue_points.window": [
        *WINDOW,
        ({"x": (5, 6)}, Wrong, "is outside the window x in [5, 6]; window= sets other bounds"),
    ],
    "tipping_map.rate": [
        *SYMBOL,
        ("omga", Wrong, "over = r, D; expected the rate omga among them"),
    ],
    "tipping_map.over": [
        (3, Wrong, "over = 3; expected a mapping"),
        ({"r": (0, 1)}, Wrong, "over: expected the ranges of two parameters"),
        ({"r": (0, 1), "omga": (0, 1)}, Unknown, "unknown parameter 'omga'"),
    ],
    "tipping_map.branch": [([1.0], Wrong, "branch: 1 is not on a stable branch at w = 0")],
    "basin_instability.point": [
        (3, Wrong, "point: expected an Equilibrium, received an int"),
        (fs.equilibria(fs.Model({"x": "x - x**3"}))[1], Wrong, "is not stable"),
    ],
    "plot.tipping_map.boundary": a("ThresholdCurve")[1:],
    "plot.tipping_map.result": a("RefinedMap"),
    "ThresholdCurve.at.value": [
        ({}, Wrong, "expected the value of one of r, D, received none"),
        ({"omga": 1.0}, Unknown, "unknown parameter of the curve 'omga'"),
        ({"D": NAN}, Wrong, "D = nan; expected a finite number"),
    ],
    "ThresholdCurve.folds.name": [*SYMBOL, ("omga", Unknown, "unknown parameter of the curve")],
    "beyond_fold.point": [
        (3, Wrong, "point: expected a SpecialPoint or SpecialOrbit, received an int"),
    ],
    "beyond_fold.parameter": [*SYMBOL, ("omga", Unknown, "unknown parameter 'omga'")],
    "beyond_fold.distance": [
        (0.0, Wrong, "distance = 0; expected one beyond the fold, with its sign"),
        (-0.01, Wrong, "the branch exists on this side of LP1; expected the other sign"),
        (NAN, Wrong, "distance = nan; expected a finite number"),
    ],
    "edge_state.a": [
        ([1.0], Wrong, "a and b reach the same attractor"),
        ([1.0, 2.0], Wrong, "the initial state has shape (2,); expected 1 values, for x"),
    ],
    "edge_state.b": [({"y": 0.0}, Unknown, "unknown state 'y'")],
    "minimal_shock.point": [
        (3, Wrong, "point: expected an Equilibrium, received an int"),
        (fs.equilibria(fs.Model({"x": "x - x**3"}))[1], Wrong, "is not stable, and has no basin"),
    ],
    "minimal_shock.states": [
        ([], Wrong, "states = []; expected at least one, each once"),
        (["omga"], Unknown, "unknown state 'omga'"),
        (3, Wrong, "states = 3; expected a sequence"),
    ],
    "minimal_shock.weights": [
        *MAPPING,
        ({"x": 0.0}, Wrong, "weights[x] = 0.0; expected a positive"),
        ({"omga": 1.0}, Unknown, "unknown displaced state 'omga'"),
    ],
    "MinimalShock.nearest.values": NEAR[:2],
    "critical_rate.branch": [
        ([1.0], Wrong, "branch: 1 is not on a stable branch at w = 0; expected a state near"),
        ([0.0, 1.0], Wrong, "the initial state has shape (2,); expected 1 values, for x"),
    ],
    "critical_rate.edge": [
        ([-3.7], Wrong, "is no edge state, which has one unstable direction; expected one of"),
        ({"y": 0.0}, Unknown, "unknown state 'y'"),
    ],
    "critical_rate.rate": [
        *SYMBOL,
        ("omga", Unknown, "unknown parameter 'omga'"),
    ],
    "CriticalRate.gradient.name": [
        *SYMBOL,
        ("omga", Unknown, "unknown parameter 'omga'"),
        ("r", Wrong, "r is the rate itself; expected another parameter"),
    ],
    "RateThreshold.gradient.name": [
        *SYMBOL,
        ("omga", Unknown, "unknown parameter 'omga'"),
    ],
    "CriticalRate.nearest.values": NEAR[:2],
    "delay_scaling.level": LEVEL,
    "delay_scaling.rates": [
        ([1e-3], Wrong, "expected at least two positive speeds"),
        ([1e-3, -1e-3], Wrong, "expected at least two positive speeds"),
        ("12", Wrong, "rates: expected numbers, received '12'"),
    ],
    "delay_scaling.from_value": [*NUMBER, (5, Wrong, "from_value = 5; expected a value")],
    "compare_scalings.one": [*MAPPING, ({"B": 1}, Unknown, "unknown entry 'B'")],
    "compare_scalings.other": MAPPING,
    "equilibria.named": [
        ({"p": NAN}, BadModel, "parameter p: expected a finite number, received nan"),
        ({"P": 1.0}, Unknown, "unknown parameter 'P'; did you mean 'p'?"),
        ({}, BadModel, "'p'"),
    ],
    "export.path": [(3, Wrong, "path = 3; expected the path of a file")],
    "export.state": [*MAPPING, ({"y": 0.0}, Unknown, "unknown state 'y'")],
    "lyapunov.settle": [
        *NUMBER,
        (2.0, Wrong, "settle = 2; expected a number from 0 below the length of the run, 1"),
    ],
    "lyapunov.integration": INTEGRATION,
    "plot.parameter_plane.background": [([1], Wrong, "background: expected a RefinedMap")],
    "plot.parameter_plane.curves": [([None], Wrong, "curves: expected a PointBranch")],
    "plot.axes.layout": [
        (2, Wrong, "layout = 2; expected rows of letters of equal length"),
        ("ab;c", Wrong, "layout = 'ab;c'; expected rows of letters"),
        ("a1", Wrong, "layout = 'a1'; expected rows of letters"),
        ("ab;ba", Wrong, "layout = 'ab;ba'; expected each letter in one rectangle"),
    ],
    "plot.axes.height": [(0, Wrong, "height = 0; expected a number from 20 to 2000")],
    "plot.panel.ax": [
        ("omga", Wrong, "ax = 'omga'; expected a sequence"),
        ([], Wrong, "panel: expected three axes, received 0"),
    ],
    "plot.panel.y": [*SYMBOL, ("y", Unknown, "unknown state 'y'")],
    "plot.phase_portrait.interface_values": SIDES,
    "plot.grid.result": a("Grid"),
    "plot.sobol.indices": a("SobolIndices"),
    "plot.sobol.output": [("summ", Unknown, "unknown output 'summ'; did you mean 'sum'?")],
    "plot.grid.output": [
        ("omga", Unknown, "unknown column 'omga'"),
        (3, Wrong, "output = 3; expected a name or an expression"),
    ],
    "plot.grid.fills": [*MAPPING, ({True: "black"}, Unknown, "unknown label 'True'")],
    "plot.regime_map.curves": [
        *MAPPING,
        ({"line": ([0, 1], [0])}, Wrong, "expected two columns of equal length"),
    ],
    "plot.regime_map.annotate": [
        *MAPPING,
        ({"here": 3}, Wrong, "annotate['here'] = 3; expected a sequence"),
        ({"here": (0, NAN)}, Wrong, "annotate['here'][1] = nan; expected a finite number"),
    ],
    "plot.delay_scaling.scaling": a("DelayScaling"),
    "plot.section.section": a("Section"),
    "plot.spectrum.frequencies": RANGE,
    "plot.time_series.interface_values": SIDES,
    "predict_delay.level": LEVEL,
    "read.without": LEFT_OUT,
    "read_auto.parameter": SYMBOL,
    "read_ode.text": [
        (3, Wrong, "text = 3; expected text"),
        ("x'=y", BadModel, "line 1, column 4: rate of x: 'y' has no definition"),
    ],
    "read_ode.without": LEFT_OUT,
    "reduce_states.rates": MAPPING,
    "reduce_states.conserved": MAPPING,
    "Refinement.cells": [
        ((0, 1), Wrong, "cells = 0; expected an integer from 1"),
        ((1, 1.5), Wrong, "cells = 1.5; expected an integer"),
        (3, Wrong, "cells = 3; expected two integers"),
    ],
    "Refinement.guard": COUNT,
    "Refinement.levels": [
        *COUNT,
        (100, Wrong, "levels = 100; expected an integer from 0 to 60"),
    ],
    "Refinement.resolution": POSITIVE,
    "refined_map.over": PLANE,
    "sobol.function": [
        (3, Wrong, "function = 3; expected a function"),
        (lambda a, b: None, Wrong, "the function returned nothing (None)"),
        (lambda a, b: "free", Wrong, "value is text; Sobol indices are of real numbers"),
        (lambda a, b: a > b, Wrong, "value is a bool; Sobol indices are of real numbers"),
        (lambda a, b: [a, b], Wrong, "an array of numbers of shape (2,); Sobol indices are of"),
        (lambda a, b: a * 1j, Wrong, "value is a complex number; Sobol indices are of"),
    ],
    "sobol.over": [
        (3, Wrong, "over = 3; expected a mapping"),
        ({}, Wrong, "over: expected the range of at least one parameter, received none"),
        ({"a": (1, 0), "b": (0, 1)}, Wrong, "over: a = (1, 0); expected two finite numbers"),
        ({"a": (0, 1), "c": (0, 1)}, Unknown, "unknown argument of the function 'c'"),
    ],
    "sobol.n": [*COUNT, (1, Wrong, "n = 1; expected an integer from 2")],
    "sobol.vectorized": FLAG,
    "sobol.second_order": FLAG,
    "sobol.confidence": [
        (NAN, Wrong, "expected a number from 0.5"),
        (1, Wrong, "confidence = 1; expected a number from 0.5"),
    ],
    "sobol.resamples": COUNT,
    "sobol.seed": COUNT,
    "sweep.function": [
        (3, Wrong, "function = 3; expected a function"),
        (lambda a, b: None, Wrong, "the function returned nothing (None)"),
    ],
    "sweep.values": [
        (3, Wrong, "values = 3; expected a mapping"),
        ({"a": [0], "c": [1]}, Unknown, "unknown argument of the function 'c'"),
        ({"a": [NAN], "b": [1]}, Wrong, "values: a has values that are not finite"),
        ({"a": [0, 0], "b": [1]}, Wrong, "values: a has the value 0 more than once"),
    ],
    "sweep.paired": FLAG,
    "sweep.units": [
        (3, Wrong, "units = 3; expected a mapping"),
        ({"a": 3}, Wrong, "units[a] = 3; expected text"),
        ({"c": "mm"}, Unknown, "unknown axis or output with a unit 'c'"),
    ],
    "sweep.vectorized": FLAG,
    "regime_map.over": PLANE,
    "regime_map.parameters": [
        (3, Wrong, "parameters = 3; expected a mapping"),
        ({"E": "C"}, Unknown, "unknown parameter 'E'"),
        ({"B": "C +"}, Wrong, "'C +' is not an expression"),
        (lambda a, b: 3, Wrong, "what parameters returns = 3; expected a mapping"),
    ],
    "classify_regime.integration": INTEGRATION,
    "classify_regime.max_periods": POSITIVE,
    "classify_regime.periods": POSITIVE,
    "regime_map.max_periods": POSITIVE,
    "regime_map.state": BY_PARAMETER["states"],
    "regime_map.periods": POSITIVE,
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
    "systems.slow_load_criterion.parameters": [
        *MAPPING,
        ({"omga": 1.0}, Unknown, "unknown parameter 'omga'; did you mean 'omega'?"),
        ({"D": [1, 2], "C": [1, 2, 3]}, Wrong, "expected values of one shape"),
    ],
    "systems.slow_load_gap.B": POSITIVES[1:],
    "systems.slow_load_gap.C": POSITIVES[1:],
    "systems.slow_load_gap.damping": POSITIVES,
    "systems.slow_load_gap.omega": POSITIVES,
    "bifurcation_sweep.integration": INTEGRATION,
    "regime_map.integration": INTEGRATION,
    "simulate.integration": INTEGRATION,
    "simulate.t": [
        ((0, 0), Wrong, "t = (0, 0); expected two different finite times"),
        ((0, INF), Wrong, "t = (0, inf); expected two different finite times"),
        (5, Wrong, "t = 5; expected a pair (start, end)"),
    ],
    "simulate.stop": [
        (3, Wrong, "stop = 3; expected a sequence"),
        ([3], Wrong, "stop[0] = 3; expected a name or an expression"),
        (["x > 1 and v > 1"], Wrong, "expected one inequality such as x >= 2, or x - 2"),
        ("omga > 1", Unknown, "unknown column or parameter 'omga'; did you mean 'omega'?"),
    ],
    "simulate_many.integration": INTEGRATION,
}
#: Periods stand beside the t of the good call.
for _name in ("simulate", "simulate_many", "lyapunov"):
    BY_FUNCTION[f"{_name}.periods"] = [(3, Wrong, "or periods=, received both")]
    BY_FUNCTION[f"{_name}.t0"] = [*NUMBER, (2, Wrong, "t0= goes with periods=")]

#: The parameters of ready-made models are numbers, unless said otherwise above.
OF_SYSTEMS = [
    (NAN, fs.FastSlowError, "nan"),
    ("5", fs.FastSlowError, "'5'"),
    (None, fs.FastSlowError, "None"),
    (True, fs.FastSlowError, "True"),
]
SCALING = [("consistnt", Unknown, "unknown scaling 'consistnt'; did you mean 'consistent'?")]
BY_FUNCTION["systems.gear_scales.scaling"] = SCALING
BY_FUNCTION["systems.harmonic_gear_from_physical.scaling"] = SCALING
for _name in ("J_i", "J_o", "N", "xi", "K_HD", "k2"):
    BY_FUNCTION[f"systems.gear_scales.{_name}"] = POSITIVE
BY_FUNCTION["explore.parameter"] = [
    *SYMBOL,
    ("omga", Unknown, "unknown slow quantity or parameter 'omga'; did you mean 'omega'?"),
]
BY_FUNCTION["explore.periods"] = [(2, Wrong, "expected t=(start, end) or periods=, received both")]
# without it there are two periods
BY_FUNCTION["explore.t"] = [row for row in BY_PARAMETER["t"] if row[0] is not None]
for _name in ("__call__", "dense_columns"):
    BY_FUNCTION[f"Trajectory.{_name}.t"] = [
        (-1, Wrong, "time -1 is outside the run, which is [0,"),
        (NAN, Wrong, "time nan is outside the run"),
        ("5", Wrong, "t: expected numbers, received '5'"),
    ]
BY_FUNCTION["explore.state"] = BY_PARAMETER["state"]
BY_FUNCTION["explore.y"] = [*SYMBOL, ("u", Unknown, "unknown state 'u'")]
BY_FUNCTION["pick.result"] = [
    (None, Wrong, "cannot pick in a DiagramDrawing of a NoneType; expected the drawing")
]


def rows_of(function, parameter):
    """The rows of a parameter of a function, None where there are none."""
    own = BY_FUNCTION.get(f"{function}.{parameter}")
    if own is not None:
        return own
    if parameter == "path":
        return (
            FIGURE if function.startswith("plot.") else SAVE if function.endswith("save") else PATH
        )
    if parameter not in BY_PARAMETER and function.startswith("systems."):
        return OF_SYSTEMS
    return BY_PARAMETER.get(parameter)
