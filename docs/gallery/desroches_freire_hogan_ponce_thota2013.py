"""Desroches, Freire, Hogan, Ponce, Thota: canards in piecewise-linear systems."""

import numpy as np
import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """An oscillator with two corners, at x = 0 and x = 1."""
    x, y, a, s, epsilon = sp.symbols("x y a s epsilon")
    slopes = sp.Piecewise((-x, x < 0), (s * x, x < 1), (s - (x - 1), True))
    return fs.Model(
        {x: (y + slopes) / epsilon}, slow={y: a - x}, parameters={a: 0.001, s: 0.5, epsilon: 0.01}
    )


def figure() -> fs.plot.Drawing:
    """Draw the cycle that appears at once, and the extent of cycles over the parameter."""
    left, right = fs.plot.axes("ab", height=75)
    right.set(xlabel="$a$", ylabel="extent in $x$", xscale="log", yscale="log")
    over = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
    for s, look in ((0.5, "ko"), (0.1, "k^")):
        reach = []
        for a in over:
            run = fs.simulate(model().with_parameters(a=a, s=s), [0, 0], t=(0, 60))
            reach.append(np.ptp(run["x"][run.t > 30]))
        right.plot(over, reach, look, markersize=4, label=f"$s = {s}$")
    right.legend(loc="lower right", fontsize="small")
    run = fs.simulate(model(), [0, 0], t=(0, 20))
    fs.plot.phase_portrait(run, "x", "y", ax=left, label=False, linewidth=0.8)
    manifold = fs.continue_equilibria(model().frozen(), "y", over=(-0.8, 0.4))
    return fs.plot.diagram(manifold, "y", x="x", ax=left, legend=False)


if __name__ == "__main__":
    figure().save("desroches_freire_hogan_ponce_thota2013.png")
