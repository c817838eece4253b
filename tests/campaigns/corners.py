"""Corner collisions of orbits under random rectangular forcings, against SciPy.

Branches of random oscillators and relays are traced, in which crossings, impacts and the ends of
sliding meet the instants of the forcing. At every corner, and at a row on each side of it, one
period is integrated by SciPy, restarted at every instant and every event: the orbit closes, at
the corner an event is at an instant, and the multipliers are those of differences of the return
map.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.results.point_types import CORNER_COLLISION

x, v, w, t = sp.symbols("x v w t")

#: Kinds of models: one or two states; forces that are continuous, jump along an interface of the
#: position, or slide; impacts.
KINDS = ("gap", "jump", "relay", "friction", "impact", "stop")

#: Largest distance of a closed orbit from its start, relative to the largest state, and of the
#: state at an instant from an interface.
CLOSED = 1e-9

#: Step of the differences of the return map, and their largest distance from the multipliers,
#: relative to the largest.
STEP, SAME = 1e-6, 1e-4

#: Outcomes that end a branch for a reason.
KNOWN = ("end of range", "closed loop", "end at a contact", "period doubling")

#: Most events between two instants: a chatter is not completed.
EVENTS = 200

#: Rows beside a corner at which orbits are checked.
BESIDE = 2


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    branches: int = 0
    types: dict[str, int] = field(default_factory=dict)
    compared: int = 0
    closing: float = 0.0
    meeting: float = 0.0
    multipliers: float = 0.0
    ended: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        corners = ", ".join(f"{count} {name}" for name, count in sorted(self.types.items()))
        text = (
            f"seed {self.seed}: {self.branches} branches; corners: {corners}\n"
            f"  {self.compared} orbits compared with SciPy: closed within {self.closing:.1e}, on "
            f"an interface at an instant within {self.meeting:.1e}, multipliers within "
            f"{self.multipliers:.1e}\n  branches that end otherwise: {len(self.ended)}\n"
            f"  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {one}" for one in (*self.ended, *self.failures)[:40])])


@dataclass(frozen=True)
class Case:
    """A model, and its equations in plain Python.

    Parameters
    ----------
    kind : str
    model : Model
    start : list of float
    over : (float, float)
        Range of w.
    period : float
    instants : tuple of float
        In units of the period.
    forcing : callable
        Of the fraction of the period.
    rates : callable
        Of time, state, w, region and the forcing's value.
    levels : (int, tuple of float)
        Number of a state, and its values at the interfaces.
    restitution : float or None
        Of impacts.
    """

    kind: str
    model: fs.Model
    start: list[float]
    over: tuple[float, float]
    period: float
    instants: tuple[float, ...]
    forcing: Callable[[float], float]
    rates: Callable[..., np.ndarray]
    levels: tuple[int, tuple[float, ...]]
    restitution: float | None = None

    @property
    def slides(self) -> bool:
        """Whether the motion may slide."""
        return self.kind in ("relay", "friction")


def rectangular(
    rng: np.random.Generator, period: float, height: float
) -> tuple[sp.Expr, tuple[float, ...], Callable[[float], float]]:
    """A square wave ±height with a random share of the period, its instants and its values."""
    share = round(float(rng.uniform(0.2, 0.8)), 3)
    form, exact = rng.integers(4), sp.Rational(str(share))
    if form == 0:
        law = sp.Piecewise((height, sp.Mod(t, period) < exact * period), (-height, True))
    elif form == 1:
        law = height * (2 * (sp.floor(t / period) - sp.floor(t / period - exact)) - 1)
    elif form == 2:
        share = 0.5
        law = height * sp.sign(sp.sin(2 * sp.pi * t / period))
    else:
        steps = [0.0, share * period, period]
        known = {"interpolation": "previous", "periodic": True}
        law = fs.Tabulated(steps, [height, -height, height], **known)
    return law, (0.0, share), lambda part: height if part < share else -height


def drawn(seed: int, number: int) -> Case:
    """A random case."""
    rng = np.random.default_rng([seed, number])

    def some(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    kind, T, a = KINDS[rng.integers(len(KINDS))], some(1.5, 8), some(0.3, 1.5)
    D, c = some(0.1, 1), some(0.1, 0.6)
    F = sp.Symbol("F")
    law, instants, value = rectangular(rng, T, a)
    b = some(0.1, 0.5) if rng.random() < 0.5 else 0.0
    angle = 2 * sp.pi * t / T
    wave = b * sp.cos(angle + 1)

    def more(time: float) -> float:
        return b * float(np.cos(2 * np.pi * time / T + 1))

    resets, restitution, levels = None, None, (0, (D,))
    if kind == "gap":
        dead = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
        rates = {x: v, v: w - c * v - (1 + sp.Rational(4, 5) / a * F / 2) * dead + wave}
        over, start, levels = (0.02, 1.5), [D + 0.3, 0.0], (0, (-D, D))

        def plain(time: float, z: np.ndarray, p: float, side: int, f: float) -> np.ndarray:
            force = (z[0] + D, 0.0, z[0] - D)[side]
            return np.array([z[1], p - c * z[1] - (1 + 0.4 * f / a) * force + more(time)])

    elif kind == "jump":
        h = some(-1, 1)
        jump = sp.Piecewise((h, x > D), (-h / 2, True))
        rates, over, start = {x: v, v: w - c * v - x - jump + F + wave}, (-1.5, 1.5), [0.0, 0.0]

        def plain(time: float, z: np.ndarray, p: float, side: int, f: float) -> np.ndarray:
            return np.array([z[1], p - c * z[1] - z[0] - (-h / 2, h)[side] + f + more(time)])

    elif kind == "relay":
        h = some(0.1, 1.5)
        rates = {x: w - x - h * sp.sign(x - D) + F + wave}
        over, start = (-1.0, 2.0), [0.0]

        def plain(time: float, z: np.ndarray, p: float, side: int, f: float) -> np.ndarray:
            return np.array([p - z[0] - (-h, h)[side] + f + more(time)])

    elif kind == "friction":
        mu = some(0.05, 0.5)
        rates = {x: v, v: w * sp.cos(angle) - c * v - x - mu * sp.sign(v) + F + wave}
        over, start, levels = (-1.0, 2.0), [0.0, 0.1], (1, (0.0,))

        def plain(time: float, z: np.ndarray, p: float, side: int, f: float) -> np.ndarray:
            force = p * np.cos(2 * np.pi * time / T) - c * z[1] - z[0] - (-mu, mu)[side] + f
            return np.array([z[1], force + more(time)])

    elif kind == "impact":
        restitution = some(0.3, 0.9)
        rates = {x: v, v: w - c * v - x + F + wave}
        resets, over, start = {x >= D: {v: -restitution * v}}, (-1.5, 1.0), [0.0, 0.0]

        def plain(time: float, z: np.ndarray, p: float, side: int, f: float) -> np.ndarray:
            return np.array([z[1], p - c * z[1] - z[0] + f + more(time)])

    else:
        k = some(1.5, 6)
        rates = {x: w - x - sp.Piecewise((k * (x - D), x > D), (0, True)) + F + wave}
        over, start = (-1.0, 2.0), [0.0]

        def plain(time: float, z: np.ndarray, p: float, side: int, f: float) -> np.ndarray:
            return np.array([p - z[0] - (0.0, k * (z[0] - D))[side] + f + more(time)])

    parameters = {w: some(*over)}
    model = fs.Model(rates, forcing={F: law}, parameters=parameters, resets=resets or {})
    return Case(kind, model, start, over, T, instants, value, plain, levels, restitution)


@dataclass
class Flight:
    """One period by SciPy: the last state, and its distance from interfaces at the instants."""

    state: np.ndarray
    nearest: float = np.inf


def integrated(case: Case, state: Any, since: float, value: float) -> Flight:
    """Integrate one period from a time, restarted at every instant and every event."""
    z, until = np.array(state, dtype=float), since + case.period
    first = int(np.floor(since / case.period))
    known = [(k + one) * case.period for k in range(first, first + 3) for one in case.instants]
    nearest, time = np.inf, since
    for end in [*sorted(one for one in known if since < one < until), until]:
        middle = 0.5 * (time + end) / case.period
        z = _between(case, z, time, end, value, case.forcing(float(middle - np.floor(middle))))
        time = end
        if end < until:
            row, levels = case.levels
            nearest = min([nearest, *(abs(float(z[row]) - level) for level in levels)])
    return Flight(z, nearest)


def _between(
    case: Case, z: np.ndarray, time: float, end: float, value: float, f: float
) -> np.ndarray:
    """Integrate between two instants."""
    side = None
    for _ in range(EVENTS):
        if end - time <= 1e-13 * case.period:
            break
        if side is None:
            side = _side(case, z, time, value, f)
        if isinstance(side, float):
            time, z, side = _slid(case, z, (time, end), value, f, int(side))
        else:
            time, z, side = _flown(case, z, (time, end), value, f, side)
    return z


def _slid(
    case: Case, z: np.ndarray, span: tuple[float, float], value: float, f: float, below: int
) -> tuple[float, np.ndarray, int | None]:
    """Slide between two regions until one of their speeds into the interface vanishes."""
    row, levels = case.levels
    z = z.copy()
    z[row] = levels[below]

    def speed(side: int) -> Callable[..., float]:
        def function(time: float, state: np.ndarray) -> float:
            return float(case.rates(time, state, value, side, f)[row])

        function.terminal = True  # type: ignore[attr-defined]
        return function

    def rates(time: float, state: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(state)) == row, 0.0, case.rates(time, state, value, 0, f))

    step = case.period / 200
    speeds = [speed(below), speed(below + 1)]
    found = solve_ivp(
        rates, span, z, "DOP853", rtol=1e-12, atol=1e-13, events=speeds, max_step=step
    )
    # the motion enters the region whose speed vanishes
    side = None if found.status != 1 else below + (1 if len(found.t_events[1]) else 0)
    return float(found.t[-1]), found.y[:, -1].copy(), side


def _flown(
    case: Case, z: np.ndarray, span: tuple[float, float], value: float, f: float, side: int
) -> tuple[float, np.ndarray, int | float | None]:
    """Integrate in a region until its border, where the state may jump."""
    row, levels = case.levels
    if case.restitution is not None:
        bounds = [(levels[0], 1)]
    else:
        bounds = [(levels[side - 1], -1)] if side > 0 else []
        bounds += [(levels[side], 1)] if side < len(levels) else []

    def reaches(level: float, direction: int) -> Callable[..., float]:
        def function(_: float, state: np.ndarray) -> float:
            return float(state[row] - level)

        function.terminal, function.direction = True, direction  # type: ignore[attr-defined]
        return function

    def rates(time: float, state: np.ndarray) -> np.ndarray:
        return case.rates(time, state, value, side, f)

    events = [reaches(*bound) for bound in bounds]
    # a short passage of the border within one step would not be seen
    known = {"rtol": 1e-12, "atol": 1e-13, "max_step": case.period / 100}
    run = solve_ivp(rates, span, z, "DOP853", events=events, **known)
    time, z = float(run.t[-1]), run.y[:, -1].copy()
    if run.status != 1:
        return time, z, side
    level, direction = bounds[next(k for k, at in enumerate(run.t_events) if len(at))]
    z[row] = level
    if case.restitution is not None:
        z[1] *= -case.restitution
        return time, z, side
    beyond = side + direction
    speed = case.rates(time, z, value, beyond, f)[row] * direction
    return time, z, beyond if speed > 0 or not case.slides else float(min(side, beyond))


def _side(case: Case, z: np.ndarray, time: float, value: float, f: float) -> int | float:
    """The region of a state, as a float the interface on which it slides."""
    row, levels = case.levels
    if case.restitution is not None:
        return 0
    for k, level in enumerate(levels):
        if abs(z[row] - level) <= 1e-11:
            below, above = (case.rates(time, z, value, k + j, f)[row] for j in (0, 1))
            if case.slides and below > 0 > above:
                return float(k)
            return k + 1 if above > 0 else k
    return int(np.searchsorted(levels, z[row]))


def compared(report: Report, case: Case, orbit: fs.Orbit, value: float, name: str) -> Flight:
    """Compare an orbit with one period by SciPy."""
    since = orbit.trajectory.span[0]
    start = np.array(orbit(since))[: len(case.start)]
    report.compared += 1
    flight = integrated(case, start, since, value)
    gap = float(np.abs(flight.state - start).max() / max(np.abs(start).max(), 1.0))
    size = max(1.0, float(np.abs(orbit.multipliers[np.isfinite(orbit.multipliers)]).max(initial=1)))
    report.closing = max(report.closing, gap / size)
    if gap > CLOSED * size:
        report.failures.append(f"{name}: SciPy closes to {gap:.1e}")
    return flight


def check_multipliers(report: Report, case: Case, orbit: fs.Orbit, value: float, name: str) -> None:
    """Compare multipliers with differences of the return map by SciPy."""
    since = orbit.trajectory.span[0]
    start = np.array(orbit(since))[: len(case.start)]
    sides = [
        [integrated(case, start + sign * STEP * unit, since, value).state for sign in (1, -1)]
        for unit in np.eye(len(start))
    ]
    found = np.linalg.eigvals(np.array([(one - two) / (2 * STEP) for one, two in sides]).T)
    known = orbit.multipliers
    away = min(np.abs(np.roll(found, k) - known).max() for k in range(len(known)))
    error = float(away / max(1.0, np.abs(known).max()))
    report.multipliers = max(report.multipliers, error)
    if error > SAME:
        report.failures.append(f"{name}: multipliers {known}, by differences {found}")


def check(report: Report, case: Case, number: int, limit: int = 3) -> None:
    """Trace a branch of a case and compare orbits at so many of its corners."""
    orbit = fs.find_orbit(case.model, case.start)
    if not orbit.outcome:
        return
    branch = fs.continue_orbits(orbit, "w", over=case.over)
    report.branches += 1
    name = f"{case.kind} {number}"
    report.ended += [f"{name}: {one.message}" for one in branch.outcomes if one.code not in KNOWN]
    if branch.unexplained:
        report.failures.append(f"{name}: {branch.unexplained[0]}")
    corners = [
        (point, row)
        for point, row in zip(branch.special, branch.special_rows, strict=True)
        if point.code == CORNER_COLLISION
    ]
    for point, row in corners:
        report.types[point.type or "end"] = report.types.get(point.type or "end", 0) + 1
        if limit == 0:
            continue
        limit -= 1
        value, here = point["w"], f"{name} {point.label}"
        flight = compared(report, case, point.orbit, value, here)
        report.meeting = max(report.meeting, flight.nearest)
        if flight.nearest > CLOSED:
            report.failures.append(f"{here}: {flight.nearest:.1e} from the interface at an instant")
        for beside in (row - BESIDE, row + BESIDE):
            if 0 <= beside < len(branch) and branch.special_rows.count(beside) == 0:
                near = branch[beside]
                compared(report, case, near, float(branch.values[beside]), here)
                check_multipliers(report, case, near, float(branch.values[beside]), here)


def campaign(count: int = 100, seed: int = 1) -> Report:
    """Trace so many random branches."""
    report = Report(seed)
    for number in range(count):
        check(report, drawn(seed, number), number)
    return report
