"""Krupa, Szmolyan: the canard explosion."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Van der Pol's oscillator with a constant force a."""
    x, y, a, epsilon = sp.symbols("x y a epsilon")
    return fs.Model(
        {x: (y - x**3 / 3 + x) / epsilon}, slow={y: a - x}, parameters={a: 1, epsilon: 0.01}
    )


def figure() -> fs.plot.Drawing:
    """Draw canard cycles over the critical manifold, and their periods."""
    left, right = fs.plot.axes("ab", height=75)
    (point,) = fs.slow_flow(model()).points
    canard = fs.find_canard(model(), point, "a")
    heads = [{"x": -1, "y": y} for y in (0.5, 0, -0.4)]
    points = [{"y": y} for y in (-0.6, -0.4, 0, 0.4)] + heads
    cycles = [fs.find_orbit(model(), canard, at=at) for at in points]
    right.plot([c["min(x)"] for c in cycles], [c.period for c in cycles], "o", color="#009E73")
    right.set(xlabel="smallest $x$", ylabel="period")
    for cycle in cycles:
        fs.plot.phase_portrait(cycle.trajectory, "x", "y", ax=left, label=False, linewidth=0.8)
    manifold = fs.continue_equilibria(model().frozen(), "y", over=(-0.8, 1))
    return fs.plot.diagram(manifold, "y", x="x", ax=left)


if __name__ == "__main__":
    figure().save("krupa_szmolyan2001.png")
