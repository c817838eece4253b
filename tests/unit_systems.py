"""Models of several fields, and the same models in other units."""

from dataclasses import dataclass

import numpy as np
import sympy as sp

import fastslow as fs

#: Names of the factors: of the state x it is unit_x; of time and the parameter the two below.
TIME, PARAMETER = "unit_time", "unit_parameter"


@dataclass(frozen=True)
class System:
    """A model with the parameter that varies and its range."""

    name: str
    model: fs.Model
    parameter: str
    over: tuple[float, float]

    def factors(self):
        return [*(f"unit_{s}" for s in self.model.states), PARAMETER, TIME]

    def measured(self, units=None):
        """The model with x = unit_x X, p = unit_parameter P, t = unit_time T; factors by name."""
        numbers = dict.fromkeys(self.factors(), 1.0) | dict(units or {})
        unit = {n: sp.Symbol(f"unit_{n}") for n in self.model.states}
        unit[self.parameter] = sp.Symbol(PARAMETER)
        real = {n: sp.Symbol(n, real=True) for n in unit}
        new = {real[n]: real[n] * unit[n] for n in unit}
        structure = self.model.structure
        rates = {
            n: structure.rates[n].subs(new, simultaneous=True) * sp.Symbol(TIME) / unit[n]
            for n in self.model.states
        }
        interfaces = {i.name: i.function.subs(new, simultaneous=True) for i in structure.interfaces}
        parameters = {n: v for n, v in self.model.parameters.items() if n != self.parameter}
        return fs.Model(
            rates,
            interfaces=interfaces,
            parameters={**parameters, **numbers, self.parameter: 0.0},
        )

    def range(self, units=None):
        factor = dict(units or {}).get(PARAMETER, 1.0)
        return tuple(v / factor for v in self.over)


def _models():
    x, y, z, w, v, p, s = sp.symbols("x y z w v p s")
    yield System("folded gear", fs.systems.harmonic_gear(A=-0.6).frozen(), "w", (-2.0, 6.0))
    yield System("van der Pol", fs.systems.van_der_pol().frozen(), "w", (-2.0, 2.0))

    flow = sp.Abs(x - s)
    stommel = fs.Model({x: 3 - x * (1 + flow), s: p - s * (0.3 + flow)}, parameters={p: 1})
    yield System("Stommel", stommel, "p", (0.2, 2.0))

    rosenzweig = fs.Model(
        {x: x * (1 - x / p) - x * y / (2 + x), y: y * (x / (2 + x) / 2 - sp.Rational(1, 5))},
        parameters={p: 1},
    )
    yield System("Rosenzweig-MacArthur", rosenzweig, "p", (1.0, 12.0))

    lorenz = fs.Model(
        {
            x: -(y**2) - z**2 - x / 4 + p / 4,
            y: x * y - 4 * x * z - y + sp.Rational(1, 4),
            z: 4 * x * y + x * z - z,
        },
        parameters={p: 1},
    )
    yield System("Lorenz-84", lorenz, "p", (0.2, 3.0))

    k1, k3 = 0.1631021, 0.046875
    first, third = k1 * w * x * y, k3 * w * x * z
    peroxidase = fs.Model(
        {
            w: -first - third + 4.235 - 0.1175 * w,
            x: -first - third + p,
            y: first - 2500 * y**2 + 2 * third - 20 * y + 0.001,
            z: -third + 2500 * y**2 - 1.104 * z,
        },
        parameters={p: 0.5},
    )
    yield System("peroxidase-oxidase", peroxidase, "p", (0.2, 1.5))

    fast = (1 + sp.tanh((v + sp.Rational(6, 5)) / 18)) / 2
    slow = (1 + sp.tanh((v - 2) / 30)) / 2
    morris_lecar = fs.Model(
        {
            v: (p - 2 * (v + 60) - 8 * w * (v + 84) - 4.4 * fast * (v - 120)) / 20,
            w: 0.04 * sp.cosh((v - 2) / 60) * (slow - w),
        },
        parameters={p: 0},
    )
    yield System("Morris-Lecar", morris_lecar, "p", (0.0, 300.0))

    harvest = sp.Heaviside(y - sp.Rational(1, 2))
    threshold = fs.Model(
        {x: x * (1 - x / 3) - x * y / (1 + x), y: x * y / (1 + x) - y / 4 - p * y * harvest},
        parameters={p: 0.1},
    )
    yield System("threshold harvesting", threshold, "p", (0.05, 1.0))

    brusselator = fs.Model({x: 1 - (p + 1) * x + x**2 * y, y: p * x - x**2 * y}, parameters={p: 1})
    yield System("Brusselator", brusselator, "p", (0.5, 4.0))

    burning = p * (1 - x) * sp.exp(y / (1 + y / 20))
    reactor = fs.Model({x: burning - x, y: 14 * burning - 3 * y}, parameters={p: 0.1})
    yield System("stirred tank", reactor, "p", (0.02, 0.3))

    neuron = fs.systems.fitzhugh_nagumo().frozen()
    yield System("FitzHugh-Nagumo", neuron, neuron.free[0], (-1.0, 2.5))


SYSTEMS = tuple(_models())


def drawn(system, seed, decades=6):
    """A unit for every factor, log-uniform over so many decades to each side."""
    generator = np.random.default_rng(seed)
    return {n: float(10.0 ** generator.uniform(-decades, decades)) for n in system.factors()}


def single(system, decades=6):
    """Each factor alone, at both ends of the decades."""
    return [{n: 10.0**e} for n in system.factors() for e in (-decades, decades)]
