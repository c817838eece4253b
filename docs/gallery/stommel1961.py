"""Stommel: two boxes of the ocean under a pulse of fresh water."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Difference of salinity of both boxes, with the temperatures fixed."""
    y, F, r, D, t = sp.symbols("y F r D t")
    flow = 1 + sp.Rational(31, 5) * (1 - y) ** 2
    pulse = sp.Rational(11, 10) + D / sp.cosh(r * t)
    return fs.Model({y: F - y * flow}, forcing={F: pulse}, parameters={r: 0.5, D: 0.3})


def figure() -> fs.plot.Drawing:
    """Draw track, return and tip over rate and height, with the boundary as a curve."""
    over, on = {"r": (0.4, 1.4), "D": (0.2, 0.4)}, {"y": 0.24}
    cells = fs.Refinement(cells=(10, 10), levels=3)
    plane = fs.tipping_map(model(), "r", over, branch=on, refinement=cells)
    found = fs.critical_rate(model(), "r", over["r"], branch=on)
    steps = fs.Continuation(step=0.05, max_step=0.1, max_turn=0.5)
    boundary = fs.continue_points(found[0], ("r", "D"), over, continuation=steps)
    return fs.plot.tipping_map(plane, boundary, width=110)


if __name__ == "__main__":
    figure().save("stommel1961.png")
