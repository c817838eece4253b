"""Welander: a self-sustained oscillation of ocean convection."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Welander's temperature and salinity with an abrupt onset of convection."""
    T, S, threshold = sp.symbols("T S epsilon")
    alpha, beta, k_0, k_1 = sp.symbols("alpha beta k_0 k_1")
    k = sp.Piecewise((k_1, S - alpha * T > threshold), (k_0, True))
    return fs.Model(
        {T: 1 - T - k * T, S: beta * (1 - S) - k * S},
        parameters={alpha: 0.8, beta: 0.5, k_0: 0, k_1: 5, threshold: -0.01},
    )


def figure() -> fs.plot.Drawing:
    """Draw the bifurcation diagram with the oscillation, and one phase portrait."""
    diagram = fs.continue_equilibria(model().with_free("epsilon"), "epsilon", over=(-0.1, 0.3))
    orbit = fs.find_orbit(model(), [0.75, 0.62])
    cycles = fs.continue_orbits(orbit, "epsilon", over=(-0.1, -1e-4))
    left, right = fs.plot.axes("ab", height=75)
    fs.plot.phase_portrait(orbit.trajectory, "T", "S - alpha*T", ax=right)
    return fs.plot.diagram(diagram, "T", ax=left, cycles=cycles)


if __name__ == "__main__":
    figure().save("welander1982.png")
