"""Kuznetsov, Rinaldi, Gragnani: harvesting a predator above a threshold."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Prey and predator of Rosenzweig and MacArthur; the predator is harvested above P."""
    x, y = sp.symbols("x y")
    a, b, d, E, P = names = sp.symbols("a b d E P")
    eaten = a * x / (b + x) * y
    harvest = sp.Piecewise((E * y, y > P), (0, True))
    return fs.Model(
        {x: x * (1 - x) - eaten, y: eaten - d * y - harvest},
        parameters=dict(zip(names, (0.3556, 0.33, 0.0444, 0.2067, 1.5), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw equilibria and cycles over the threshold, and a sliding cycle."""
    left, right = fs.plot.axes("ab", height=85)
    left.set_ylim(-0.05, 1.05)
    diagram = fs.continue_equilibria(model().with_free("P"), "P", over=(0.4, 3))
    orbit = fs.find_orbit(model(), [0.3, 1])
    cycles = fs.continue_orbits(orbit, "P", over=(1.1, 3))
    fs.plot.phase_portrait(orbit.trajectory, "x", "y", ax=right)
    return fs.plot.diagram(diagram, "x", ax=left, cycles=cycles)


if __name__ == "__main__":
    figure().save("kuznetsov_rinaldi_gragnani2003.png")
