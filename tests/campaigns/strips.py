"""Bifurcation sweeps in strips of random forced oscillators, compared with sweeps in order.

All values are compared up to the first at which either motion does not repeat: behind chaos
rounding decides which of several attractors a sweep reaches. Behind transient chaos too: a
difference counts unless sweeps in order with other tolerances differ there as well.
"""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp

import fastslow as fs

x, v, t, a, b, d, w = sp.symbols("x v t a b d w")

#: Largest difference of points, as sets.
AGREEMENT = 1e-9

#: Tolerance of the sweeps, and others; where these differ by more than DECIDED, rounding decides.
RTOL, TOLERANCES, DECIDED = 1e-11, (1e-12, 3e-12, 1.1e-11, 2e-11, 3e-11, 5e-11), 1e-6

#: Models with the swept parameter, its range, and ranges of other parameters.
DUFFING = fs.Model(
    {x: v, v: a * sp.cos(w * t) - d * v - b * x - x**3}, parameters={a: 0.3, b: 1, d: 0.1, w: 1}
)
CASES = (
    (DUFFING, "w", (0.8, 2.6), {"a": (0.2, 1.5), "d": (0.05, 0.3)}),
    (DUFFING.with_parameters(b=-1), "a", (0.05, 0.6), {"d": (0.15, 0.5), "w": (0.8, 1.4)}),
    (fs.systems.gear_pair(), "Omega", (0.3, 1.2), {"Fa": (0.02, 0.2)}),
    (fs.systems.bilinear_oscillator(zeta=0.05), "omega", (0.5, 2.5), {"f": (0.3, 1.0)}),
    (fs.systems.impact_oscillator(), "omega", (0.6, 3.0), {"f": (0.3, 1.0)}),
)


@dataclass
class Report:
    """Numbers of sweeps, of compared and of irregular values, and what differs."""

    sweeps: int = 0
    compared: int = 0
    irregular: int = 0
    hysteretic: int = 0
    undecided: int = 0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        lines = [
            f"{self.sweeps} sweeps, {self.hysteretic} with hysteresis: {self.compared} values "
            f"compared, {self.irregular} irregular, {self.undecided} differ where rounding decides"
        ]
        return "\n".join([*lines, *self.failures, f"{len(self.failures)} failures"])


def repeats(points):
    """Return whether points repeat after at most half their number."""
    shifts = range(1, len(points) // 2 + 1)
    return any(np.abs(points[k:] - points[:-k]).max() < 1e-8 for k in shifts)


def apart(one, other, value):
    """Largest distance of the points of two passes, as sets."""
    gaps = np.abs(one.points_at(value)[:, None] - other.points_at(value))
    return max(gaps.min(axis=0).max(), gaps.min(axis=1).max())


def campaign(count=20, seed=0):
    """Compare so many sweeps, each in a random number of strips."""
    report, chance = Report(), np.random.default_rng(seed)
    for k in range(int(count)):
        model, name, ends, others = CASES[k % len(CASES)]
        given = {key: chance.uniform(*between) for key, between in others.items()}
        size = int(chance.integers(12, 50))
        values = np.linspace(*np.sort(chance.uniform(*ends, 2)), size)
        settings = {
            "settle": int(chance.integers(80, 200)),
            "keep": int(chance.integers(4, 12)),
            "observe": fs.Observation(str(chance.choice(["stroboscopic", "extremes"]))),
        }
        strips, begin = int(chance.integers(2, size + 1)), [chance.uniform(-1, 0.5), 0.0]

        here = model.with_parameters(given)

        def swept(n, rtol=RTOL, fixed=(here, name, values, begin, settings)):
            *what, more = fixed
            return fs.bifurcation_sweep(
                *what, strips=n, integration=fs.Integration(rtol=rtol), **more
            )

        plain, divided = swept(1), swept(strips)
        report.sweeps += 1
        report.hysteretic += len(plain.hysteresis()) > 0
        report.irregular += int(sum(p.irregular.sum() for p in divided.passes))
        regular = True
        for way, (one, other) in enumerate(zip(plain.passes, divided.passes, strict=True)):
            for value, irregular in zip(one.values, other.irregular, strict=True):
                regular = regular and not irregular and repeats(one.points_at(value))
                if not regular:
                    break
                report.compared += 1
                if apart(one, other, value) > AGREEMENT:
                    regular = False
                    again = [swept(1, rtol).passes[way] for rtol in TOLERANCES]
                    if max(apart(one, p, value) for p in again) > DECIDED:
                        report.undecided += 1
                    else:
                        report.failures.append(
                            f"{given}, {name} = {value!r} of {size} values in {strips} strips"
                        )
    return report
