"""All equilibria of a window by branch and prune, beside the numbers of an earlier prototype.

The search alone, from a program of interval arithmetic to proved pieces of curves; joining the
pieces to curves; everything from equations to curves, with the program written anew, as for a new
model; then the stability along the curves with all folds and Hopf points. Loops that serve every
model are compiled before. A certificate with points proved by python-flint contains all of it. Last
two new models in a new process.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import sympy as sp

import fastslow as fs
from fastslow.certification.boxes.linking import IntervalProblem, curves_of
from fastslow.certification.boxes.pruning import prune_window
from fastslow.certification.equations import ExactEquations
from fastslow.certification.spectra.linearisations import linearisation
from fastslow.certification.spectra.stability import Examined, examined
from fastslow.kernels.intervals.printer import interval_program
from tests.benchmarks.measuring import Line, medians
from tests.certification.systems import SYSTEMS, hodgkin_huxley, window_of

#: Boxes and pieces of the prototype, and the largest acceptable processor time in ms.
PROTOTYPE = {
    "Morris-Lecar": (390, 42, 50),
    "Hodgkin-Huxley": (1422, 102, 100),
    "cubic n = 3": (52_000, 1685, 300),
    "Brusselator pair": (72_000, 1143, 300),
    "cubic n = 4": (412_000, 2488, 4000),
}

#: Processor time in ms of the certificates of models that no earlier process has had.
NEW_MODELS = """
import time
import sympy as sp, fastslow as fs

v, w, current = sp.symbols("v w I")
for _ in range(2):
    rate = sp.Rational(time.time_ns() % 10**9, 10**10) + sp.Rational(1, 10)
    rates = {v: v - v**3 / 3 - w + current, w: rate * (v + sp.Rational(7, 10) - w / 2)}
    model = fs.Model(rates, parameters={current: 0})
    diagram = fs.continue_equilibria(model, "I", (-1, 2))
    begin = time.process_time()
    proof = fs.certify(model, diagram, window={v: (-3, 3), w: (-9, 9)})
    print(1e3 * (time.process_time() - begin))
    assert proof.complete
"""

OPTIONS = {"max_boxes": 3_000_000, "width": 1e-6}

#: Largest acceptable processor time of a certificate with points and stability, in ms.
WITH_POINTS = 10_000


def lines() -> Iterator[Line]:
    """Search, curves, and the whole from equations, for every system; the gear by its regions."""
    for name, (boxes, pieces, limit) in PROTOTYPE.items():
        rates, unknowns, ranges = SYSTEMS[name]()
        low, high = window_of(ranges)
        program = interval_program(rates, unknowns)
        found = prune_window(program, low, high, **OPTIONS)
        problem = IntervalProblem(program, None, (), low, high)

        def whole(rates=rates, unknowns=unknowns, low=low, high=high) -> None:
            sp.core.cache.clear_cache()
            written = interval_program(rates, unknowns)
            pruned = prune_window(written, low, high, **OPTIONS)
            curves_of(IntervalProblem(written, None, (), low, high), pruned)

        curves = curves_of(problem, found)

        def stable(rates=rates, unknowns=unknowns, problem=problem, curves=curves) -> Examined:
            sp.core.cache.clear_cache()
            equations = ExactEquations("S1", tuple(unknowns), tuple(rates), (), (), ())
            return examined(problem, linearisation(equations), (), curves)

        times = medians(
            {
                "search": lambda p=program, a=low, b=high: prune_window(p, a, b, **OPTIONS),
                "curves": lambda p=problem, f=found: curves_of(p, f),
                "from equations to curves": whole,
                "stability and points": stable,
            },
            repeats=3,
        )
        work = f"all equilibria of a window, {name}"
        note = (
            f"{found.searched} boxes, {len(found.free)} pieces; prototype: {boxes} and {pieces}, "
            f"at most {limit} ms"
        )
        points = stable()
        codes = [crossing.code for crossing in points.crossings]
        notes = {
            "search": note,
            "stability and points": f"{codes.count('LP')} folds, {codes.count('HB')} Hopf points, "
            f"{len(points.undecided)} undecided",
        }
        for tool, value in times.items():
            yield Line(work, f"fastslow, {tool}", value, "ms", note=notes.get(tool, ""))
    yield _with_points()
    gear = fs.systems.harmonic_gear().frozen()
    diagram = fs.continue_equilibria(gear, "w", (-2, 6))
    window = {"x": (-2, 2), "v": (-3, 8)}
    times = medians({"": lambda: fs.certify(gear, diagram, window=window)}, repeats=3)
    note = "three regions; at most 100 ms"
    yield Line("the certificate of the gear", "fastslow, certify", times[""], "ms", note=note)
    yield from _of_new_models()


def _of_new_models() -> Iterator[Line]:
    """Certificates in a new process, with the loops that serve every model compiled before."""
    command = [sys.executable, "-c", NEW_MODELS]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    for which, value, note in zip(("first", "second"), found, ("", "at most 2000 ms"), strict=True):
        work = f"certificate of the {which} model of a process"
        yield Line(work, "fastslow, certify", float(value), "ms", note=note)


def _with_points() -> Line:
    """The certificate of the Hodgkin-Huxley equations with points in ball arithmetic."""
    rates, (*states, current), (*ranges, over) = hodgkin_huxley()
    model = fs.Model(dict(zip(states, rates, strict=True)), parameters={current: 0})
    window = {s.name: tuple(map(float, r)) for s, r in zip(states, ranges, strict=True)}
    diagram = fs.continue_equilibria(model, current.name, over, window=window)
    proof = fs.certify(model, diagram, window=window)
    times = medians({"": lambda: fs.certify(model, diagram, window=window)}, repeats=3)
    note = (
        f"{len(proof.points)} points, complete list: {proof.all_points}; at most {WITH_POINTS} ms"
    )
    work = "the certificate of Hodgkin-Huxley with points and stability"
    return Line(work, "fastslow, certify", times[""], "ms", note=note)
