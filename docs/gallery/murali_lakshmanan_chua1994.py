"""Murali, Lakshmanan, Chua: period doubling in a driven circuit."""

import numpy as np
import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Chua's diode in a driven series circuit, dimensionless."""
    x, y, t = sp.symbols("x y t")
    a, b, beta, nu, omega, F = names = sp.symbols("a b beta nu omega F")
    diode = b * x + (a - b) / 2 * (sp.Abs(x + 1) - sp.Abs(x - 1))
    return fs.Model(
        {x: y - diode, y: F * sp.sin(omega * t) - beta * (1 + nu) * y - beta * x},
        parameters=dict(zip(names, (-1.02, -0.55, 1, 0.015, 0.72, 0.065), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw states at whole periods over the amplitude, and the double-band attractor."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model().with_parameters(F=0.15), [-1, 1], periods=60)
    fs.plot.phase_portrait(run, "x", "y", ax=right, label=False, crossings=False, linewidth=0.4)
    amplitudes = np.linspace(0.05, 0.15, 200)
    sweep = fs.bifurcation_sweep(model(), "F", amplitudes, [-1, 1], settle=150, keep=40)
    return fs.plot.sweep(sweep, ax=left)


if __name__ == "__main__":
    figure().save("murali_lakshmanan_chua1994.png")
