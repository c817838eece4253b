"""Random oscillators with events, as models and as the functions of an independent program."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

import fastslow as fs
from tests.simulation.event_reference import MOST, ReferenceEvent, run

NAMES = ("c", "a0", "a1", "a2", "a3", "b0", "b1", "d0", "d1", "d2", "p0", "p1", "T")

#: Persistence, conditions at the start, and times of values of the events of each shape.
SHAPES = (
    ((True, True, "trigger"), (True, True, "trigger"), (True, True, "trigger")),
    ((False, True, "execution"), (True, False, "trigger"), (False, True, "trigger")),
    ((True, False, "execution"), (False, True, "execution"), (True, True, "execution")),
)


def model_of(shape: int) -> fs.Model:
    """Return a damped oscillator with three events, whose numbers are parameters."""

    def event(k, when, then, **given):
        persistent, initially, values = SHAPES[shape][k]
        return fs.Event(
            when, then, persistent=persistent, initially=initially, values=values, **given
        )

    events = {
        "kick": event(0, "x > a0", {"v": "b0*v - k"}, delay="d0", priority="p0"),
        "brake": event(1, "((v < a1) & (x < a2)) | (t > T)", {"k": "b1*k", "x": "x/2"}, delay="d1"),
        "load": event(2, "~(v < a3)", {"k": "k + x"}, delay="d2", priority="p1*x"),
    }
    return fs.Model(
        {"x": "v", "v": "k - x - c*v"},
        parameters=dict.fromkeys(("k", *NAMES), 1.0),
        events=events,
    )


def numbers_of(random: np.random.Generator) -> dict[str, float]:
    """Return random values of the parameters."""
    values = dict(zip(NAMES, random.uniform(-1, 1, len(NAMES)).tolist(), strict=True))
    for name in ("d0", "d1", "d2"):
        values[name] = max(0.0, values[name])
    values["c"], values["T"] = 0.1 + 0.2 * values["c"] ** 2, 4.0 + 3.0 * values["T"]
    values["k"] = float(random.uniform(-1, 1))
    return values


def reference(
    shape: int, p: dict[str, float], start: Sequence[float], end: float
) -> tuple[np.ndarray, list[tuple[float, int]]]:
    """Run the same system by the independent program."""
    events = [
        ReferenceEvent(
            [lambda t, y: y[0] - p["a0"]],
            lambda above: above,
            lambda t, y: {1: p["b0"] * y[1] - y[2]},
            delay=p["d0"],
        ),
        ReferenceEvent(
            [lambda t, y: y[1] - p["a1"], lambda t, y: y[0] - p["a2"], lambda t, y: t - p["T"]],
            lambda fast, right, late: (not fast and not right) or late,
            lambda t, y: {2: p["b1"] * y[2], 0: y[0] / 2},
            delay=p["d1"],
        ),
        ReferenceEvent(
            [lambda t, y: y[1] - p["a3"]],
            lambda above: above,
            lambda t, y: {2: y[2] + y[0]},
            delay=p["d2"],
        ),
    ]
    for one, (persistent, initially, values) in zip(events, SHAPES[shape], strict=True):
        one.persistent, one.initially = persistent, initially
        one.at_trigger = values == "trigger"

    def rates(t, y):
        return [y[1], y[2] - y[0] - p["c"] * y[1], 0.0]

    def priority(k, y):
        return (p["p0"], -math.inf, p["p1"] * y[0])[k]

    return run(rates, [*start, p["k"]], end, events, priority)


def compared(shape: int, seed: int, model: fs.Model, end: float = 8.0) -> str:
    """Compare a random run with the reference; return what differs, empty if nothing does."""
    random = np.random.default_rng([shape, seed])
    values, start = numbers_of(random), random.uniform(-1, 1, 2).tolist()
    own = fs.simulate(
        model.with_parameters(values), start, t=(0, end), integration=fs.Integration(rtol=1e-12)
    )
    try:
        state, executed = reference(shape, values, start, end)
    except OverflowError:
        return "" if own.outcome.code == "endless events" else f"endless, but {own.outcome}"
    if not own.outcome:
        return str(own.outcome)
    mine = [(one.time, [*model.events].index(one.event)) for one in own.events]
    if cut := len(executed) > MOST:
        # what was followed; the executions accumulate rounding errors
        mine = mine[: len(executed)]
    if [k for _, k in mine] != [k for _, k in executed]:
        return f"{mine} instead of {executed}"
    times = np.array([s for s, _ in mine]) - np.array([s for s, _ in executed])
    size = 1.0 + np.abs(state).max()
    left = 0.0 if cut else np.abs(own.end[1:] - state).max() / size
    error = max(np.abs(times).max(initial=0.0), left)
    return "" if error < 1e-6 else f"differs by {error:.2g}"
