"""Random text at every place that takes a formula or a name: an answer or one of our errors.

Texts are written by a grammar, by changes to good formulas, and taken from a list of hostile
ones. Every text goes to some entry points. A call fails where another error comes out, where it
takes more than `SECONDS` of processor time, where memory runs out, and where code was run.
"""

from __future__ import annotations

import contextlib
import os
import random
import resource
import signal
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import sympy as sp

import fastslow as fs
from fastslow.plot.layout.typesetting import typeset, written

#: Processor time that one call may take.
SECONDS = 1.0

#: After so many seconds a call is broken off.
BROKEN_OFF = 20.0

#: Memory that all calls together may take beyond what they began with, in bytes.
MEMORY = 2**30

#: Entry points for each text.
EACH = 4

NAMES = ("x", "v", "w", "D", "A", "t", "omega", "theta")
FUNCTIONS = ("sin", "cos", "exp", "sqrt", "Abs", "sign", "tanh", "log", "Heaviside", "floor")

GOOD = (
    "x**2 + 2*v - D",
    "Piecewise((x - D, x > D), (x + D, x < -D), (0, True))",
    "sqrt(x**2 + v**2)/2",
    "-A*x - Max(x - D, 0)*sin(omega*t)",
    "(x > D) & (v < 0)",
    "0 < x <= D",
    "Abs(x)*sign(v) + Heaviside(x - D)",
    "2*pi",
    "x - 0.5",
    "w*exp(-x)/(1 + x**4)",
)

#: What is put into good formulas.
CHARACTERS = "()+-*/<>=&|~,.^%$_'\"\\ 019eExvwDjℌω²\n\0[]{}:;#@!"

HOSTILE = (
    "open('CANARY', 'w')",
    "__import__('os').system('touch CANARY')",
    "().__class__.__bases__[0].__subclasses__()",
    "exec(\"open('CANARY', 'w')\")",
    "eval('1')",
    "[open('CANARY', 'w') for i in (1,)]",
    "(lambda: open('CANARY', 'w'))()",
    "x.__class__",
    "x if open('CANARY', 'w') else v",
    'f\'{open("CANARY", "w")}\'',
    "(y := x)",
    "*x",
    "x; import os",
    "x\nimport os",
    "10**10**10",
    "10**10**10**10",
    "9**9**9**9*x",
    "(x**8)**8",
    "((x**64)**64)**64",
    "(x + v)**1000",
    "1e400*x",
    "1e-400",
    "1" * 5000,
    "1e" + "9" * 50,
    "0x10",
    "1_000",
    "1j*x",
    "'x'",
    "True",
    "False",
    "None",
    "x == x",
    "lambda",
    "lambda: x",
    "x[0]",
    "x.real",
    "x and v",
    "not x",
    "x @ v",
    "x // v",
    "x % v",
    "x ^ 2",
    "x²",
    "x−1",
    "ω*x",
    "ℌ",
    "µ",
    "x\0",
    "\ud800",
    "x" + "\ud800",
    "🦉",
    "x\u202e",
    "(" * 300 + "x" + ")" * 300,
    "(" * 60 + "x" + ")" * 60,
    "-" * 3000 + "x",
    "sin(" * 60 + "x" + ")" * 90,
    "x" + "**x" * 200,
    "not " * 200 + "(x > 0)",
    "+".join(["x"] * 991),
    "+".join(["x"] * 20000),
    "x*" * 400 + "x",
    "x" * 100_000,
    "max(x)",
    "max()",
    "sin(x, v)",
    "sin(x=1)",
    "max(*x)",
    "gamma(10**9)",
    "factorial(1e6)*x",
    "zeta(100000)",
    "uppergamma(100000, x)",
    "exp(exp(exp(100)))",
    "exp(1000)*x",
    "x/0",
    "0**-1",
    "log(0)",
    "sqrt(-1)*x",
    "sqrt(-2 - x**2) > 0",
    "Piecewise((x, x > 0))",
    "Piecewise(x, x > 0)",
    "Piecewise()",
    "(x, v)",
    "x,",
    "x > v > w",
    "x > 0 & v > 0",
    "Mod(x, 0)",
    "Mod(x, 2)",
    "nan",
    "oo*x",
    "zoo",
    "I*x",
    "S(1)",
    "Symbol('x')",
    "Function('f')(x)",
    "Integral(x, x)",
    "",
    " ",
    "#",
    "\\",
    "{",
    "}",
    "$",
    "$x",
    "%",
    "m%",
    "a'b\"c",
    "x^2",
    "a&b",
    "\\frac{",
    "$\\foo$",
    "_",
    "_x",
    "x_",
    "x__y",
    "\n",
    "<script>",
    "x - D",
)

Entry = Callable[[str], object]


@dataclass
class Report:
    """What was seen."""

    texts: int = 0
    calls: int = 0
    answered: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    slowest_call: str = ""
    growth: int = 0
    faults: list[str] = field(default_factory=list)

    @property
    def failures(self) -> bool:
        """Whether anything but an answer or one of our errors came out."""
        return bool(self.faults)

    def __str__(self) -> str:
        refused = ", ".join(f"{count} {name}" for name, count in self.refused.most_common())
        lines = [
            f"{self.texts} texts, {self.calls} calls of {len(entries())} entry points: "
            f"{self.answered} answered, refused: {refused}; the slowest took {self.slowest:.2f} s "
            f"({self.slowest_call}), memory grew by {self.growth / 2**20:.0f} MB; "
            f"{len(self.faults)} failed"
        ]
        return "\n".join([*lines, *(f"    {fault}" for fault in self.faults[:50])])


def texts(count: int, generator: random.Random) -> Iterator[str]:
    """Texts of all three kinds."""
    for _ in range(count):
        kind = generator.random()
        if kind < 0.4:
            yield _formula(generator, 4)
        elif kind < 0.45:
            yield _condition(generator, 3)
        elif kind < 0.9:
            source = generator.choice((*GOOD, *HOSTILE, _formula(generator, 3)))[:300]
            yield _changed(source, generator)
        elif kind < 0.95:
            yield generator.choice(HOSTILE)
        else:
            yield "".join(map(_any_character, [generator] * generator.randrange(1, 30)))


def _any_character(generator: random.Random) -> str:
    return chr(generator.choice((generator.randrange(128), generator.randrange(0x3000))))


def _formula(generator: random.Random, depth: int) -> str:
    kind = generator.random() if depth else generator.random() * 0.3
    below = partial(_formula, generator, depth - 1)
    if kind < 0.2:
        return generator.choice(NAMES)
    if kind < 0.3:
        return generator.choice(("2", "0.5", "1e-3", "3.0", "0", "7/3", "pi", "E"))
    if kind < 0.6:
        return f"{below()} {generator.choice('+-*/')} {below()}"
    if kind < 0.68:
        return f"({below()})**{generator.choice(('2', '3', '-1', '0.5', 'A', '8', '(1/3)'))}"
    if kind < 0.72:
        return f"-{below()}"
    if kind < 0.8:
        return f"({below()})"
    if kind < 0.92:
        return f"{generator.choice(FUNCTIONS)}({below()})"
    if kind < 0.96:
        return f"{generator.choice(('Max', 'Min', 'max', 'atan2'))}({below()}, {below()})"
    return f"Piecewise(({below()}, {_condition(generator, depth - 1)}), ({below()}, True))"


def _condition(generator: random.Random, depth: int) -> str:
    sides = [_formula(generator, max(depth - 1, 0)) for _ in range(2)]
    one = f"{sides[0]} {generator.choice(('<', '<=', '>', '>=', '=='))} {sides[1]}"
    if depth < 1 or generator.random() < 0.6:
        return one
    return (
        f"({one}) {generator.choice(('&', '|', 'and', 'or'))} ({_condition(generator, depth - 1)})"
    )


def _changed(text: str, generator: random.Random) -> str:
    """A text with some characters taken away, put in, or moved."""
    letters = list(text)
    for _ in range(generator.randrange(1, 4)):
        place = generator.randrange(len(letters) + 1)
        change = generator.random()
        if change < 0.35:
            del letters[place : place + generator.randrange(1, 4)]
        elif change < 0.75:
            letters.insert(place, generator.choice(CHARACTERS))
        elif change < 0.9:
            letters[place:place] = letters[: generator.randrange(10)]
        else:
            letters.insert(place, generator.choice(("**", "sin(", "1e400", "lambda", " if ", "==")))
    return "".join(letters)


@cache
def entries() -> dict[str, Entry]:
    """Everything that takes text, by name; the results that are queried are small."""
    x, v, D, k = sp.symbols("x v D k")
    model = fs.systems.harmonic_gear(omega=0.1, C=2.443)
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-1, 1))
    run = fs.simulate(model, [0.0, 0.0], periods=2)
    overlay = fs.overlay(diagram, run)
    path = fs.continue_equilibria(model.frozen(slow={"w": "g"}), "g", over=(-1, 1))
    section = run.section("v")
    fold = fs.continue_equilibria(fs.systems.cusp().frozen(), "p", over=(-1, 1)).folds[0]
    curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    auto = (Path(__file__).parents[1] / "results/data/b.fhn").read_text()

    def rates(text: str) -> object:
        return fs.Model({"x": text, "v": "-v"}, parameters={"D": 0.5, "A": 1.0, "omega": 2.0})

    def written_model(**parts: object) -> object:
        given = {"parameters": {"D": 0.5, "A": 1.0}, **parts}
        return fs.Model({"x": "v - x", "v": "-Abs(x)"}, **given)

    def named(text: str) -> object:
        made = fs.Model({text: -sp.Symbol(text) + k, "y": -sp.Symbol("y")}, parameters={k: 1.0})
        return repr(made), made.to_latex(), made.equations, typeset(text)

    def read_auto(names: str) -> object:
        Path("b.text").write_text(auto.replace("'w'", names, 3), errors="replace")
        return fs.read_auto("b.text")

    def along(text: str) -> object:
        return fs.overlay(replace(path, path={"w": text}), run)

    def derived(text: str) -> object:
        return fs.derive(fs.Model({x: D - k * x}, parameters={D: 1, k: 1}), assume=text)

    def axis(text: str) -> object:
        drawn = fs.plot.time_series(run, text)
        return drawn.ax.get_ylabel()

    gear = fs.Model({x: D - k * x}, parameters={D: 1, k: 1})
    logistic = fs.Model({x: D * x - k * x**2}, parameters={D: 1, k: 1})
    return {
        "Model rate": rates,
        "Model law": lambda s: written_model(forcing={"w": s}),
        "Model slow rate": lambda s: written_model(slow={"w": s}),
        "Model interface": lambda s: written_model(interfaces={"edge": s}),
        "Model region": lambda s: written_model(regions={"inside": s}),
        "Model period": lambda s: fs.Model({"x": "sin(x)"}, periodic={"x": s}),
        "Model name": named,
        "Model parameter": lambda s: fs.Model({"x": "-x"}, parameters={s: 1.0}),
        "frozen path": lambda s: model.frozen(slow={"w": s}),
        "with_free": model.with_free,
        "with_ramp": lambda s: model.with_ramp(s, 0.1),
        "with_parameters": lambda s: model.with_parameters({s: 2.0}),
        "diagram": diagram.__getitem__,
        "branch": diagram[0].__getitem__,
        "run": run.__getitem__,
        "overlay": overlay.__getitem__,
        "section": section.__getitem__,
        "curve": curve.__getitem__,
        "run.section": run.section,
        "run.section interface": lambda s: run.section(interface=s),
        "run.hits": run.hits,
        "run.at": lambda s: run.at(**{s: 0.1}),
        "run.extremes": run.extremes,
        "run.spectrum": run.spectrum,
        "diagram.at": lambda s: diagram.at(**{s: 0.1}),
        "overlay path": along,
        "plot axis": axis,
        "plot label": written,
        "plot name": typeset,
        "derive assume": derived,
        "derive parameter": lambda s: fs.derive(gear, parameter=s),
        "continue parameter": lambda s: fs.continue_equilibria(gear, s, over=(0, 2)),
        "scale": lambda s: fs.nondimensionalise(logistic, [("x", s), ("x", "x**2")]),
        "reduce": lambda s: fs.reduce_states({x: s, v: -v}, {"u": x + v}),
        "combine": lambda s: fs.reduce_states({x: -x, v: -v}, {"u": s}),
        "compare": lambda s: fs.compare_scalings({"A": D * k}, {"A": s}),
        "drift": lambda s: fs.Drift(0.1, law=s),
        "map parameters": lambda s: fs.regime_map(
            model,
            {"a": (0, 1), "b": (0, 1)},
            [0.0, 0.0],
            parameters={"A": s},
            refinement=fs.Refinement(cells=(1, 1), levels=0),
            periods=1,
            max_periods=1,
        ),
        "sweep section": lambda s: fs.bifurcation_sweep(
            model,
            "C",
            [2.443],
            [0.0, 0.0],
            observe=fs.Observation("section", section=s),
            settle=0,
            keep=1,
        ),
        "read_auto": read_auto,
        "read_auto names": lambda s: fs.read_auto(
            Path(__file__).parents[1] / "results/data/b.fhn", names={"w": s}
        )[s],
    }


class _TooLongError(BaseException):
    """A call that was broken off."""


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """Bounded memory, a clock for every call, and a folder of its own."""

    def stop(*_: object) -> None:
        raise _TooLongError

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    old, handler = Path.cwd(), signal.signal(signal.SIGALRM, stop)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
            signal.signal(signal.SIGALRM, handler)
            os.chdir(old)


def campaign(count: int = 5000, seed: int = 0, everywhere: int = 1) -> Report:
    """Give texts to entry points, each to some of them.

    Parameters
    ----------
    count : int
        Number of texts.
    seed : int
    everywhere : int
        Whether every hostile text is given to every entry point before.
    """
    generator, report = random.Random(seed), Report()
    known = entries()
    started = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with _limited(), warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for text in HOSTILE if everywhere else ():
            report.texts += 1
            for name, entry in known.items():
                _tried(name, entry, text, report)
        for text in texts(count, generator):
            report.texts += 1
            for name in generator.sample([*known], EACH):
                _tried(name, known[name], text, report)
    report.growth = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - started)
    return report


def _tried(name: str, entry: Entry, text: str, report: Report) -> None:
    report.calls += 1
    shown = f"{name}: {text[:200]!a}"
    signal.setitimer(signal.ITIMER_REAL, BROKEN_OFF)
    begun = time.process_time()
    try:
        entry(text)
        report.answered += 1
    except fs.FastSlowError as error:
        report.refused[type(error).__name__] += 1
        try:
            str(error).encode()
        except UnicodeEncodeError:
            report.faults.append(f"{shown}: an error that cannot be printed")
        if not str(error) or len(str(error)) > 4000:
            report.faults.append(f"{shown}: an error of {len(str(error))} characters")
    except _TooLongError:
        report.faults.append(f"{shown}: broken off")
    except BaseException as error:
        report.faults.append(f"{shown}: {type(error).__name__}: {ascii(str(error))[:200]}")
        if isinstance(error, KeyboardInterrupt):
            raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    took = time.process_time() - begun
    if took > SECONDS:
        report.faults.append(f"{shown}: {took:.1f} s")
    if took > report.slowest:
        report.slowest, report.slowest_call = took, shown
    if Path("CANARY").exists():
        Path("CANARY").unlink()
        report.faults.append(f"{shown}: ran code")
