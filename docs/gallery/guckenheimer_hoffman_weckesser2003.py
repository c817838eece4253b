"""Guckenheimer, Hoffman, Weckesser: the slow flow of the forced van der Pol equation."""

import numpy as np
import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Van der Pol's oscillator with a slow harmonic load."""
    x, y, t, a, omega, epsilon = sp.symbols("x y t a omega epsilon")
    return fs.Model(
        {x: (y - x**3 / 3 + x) / epsilon},
        slow={y: a * sp.sin(omega * t) - x},
        parameters={a: 2, omega: 1, epsilon: 0.01},
    )


def figure() -> fs.plot.Drawing:
    """Draw the folded singularities over the amplitude, and the ratio of the folded nodes."""
    left, right = fs.plot.axes("ab", height=75)
    right.set(xlabel="$a$", ylabel="$\\mu$", xlim=(1, 1.8), ylim=(0, 1.12))
    fine = fs.Continuation(step=0.001, max_step=0.005)
    for omega in (0.1, 0.2, 0.5):
        points = fs.slow_flow(model().with_parameters(omega=omega, a=1.001)).points
        (node,) = (p for p in points if p.code == "FN" and p.values["x"] > 0)
        last = np.sqrt(1 + 1 / (8 * omega) ** 2)
        curve = fs.continue_points(node, "a", (0.99, 1.002 * last), continuation=fine)
        right.plot(curve["a"], curve.coefficient, color="#D55E00")
        right.plot(last, 1, "ko", markersize=3.5)
        words = f"$\\omega = {omega}$"
        right.annotate(words, (last, 1), (0, 5), textcoords="offset points", fontsize="small")
    saddle, _ = (p for p in fs.slow_flow(model()).points if p.values["x"] > 0)
    # through FSN1 to the node and the focus
    curve = fs.continue_points(saddle, "a", (0.5, 4))
    return fs.plot.parameter_plane(curve, y="t", ax=left, legend=True)


if __name__ == "__main__":
    figure().save("guckenheimer_hoffman_weckesser2003.png")
