"""Koper: mixed-mode oscillations by a folded node."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Koper's three variables, of which two are slow."""
    x, y, z = sp.symbols("x y z")
    k, lam, fast, slow = names = sp.symbols("k lambda epsilon_1 epsilon_2")
    return fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / fast},
        slow={y: x - 2 * y + z, z: slow * (y - z)},
        parameters=dict(zip(names, (-10, 7, 0.1, 1), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw the mixed-mode oscillation over time and over the critical manifold."""
    left, right = fs.plot.axes("ab", height=75)
    start = fs.simulate(model(), [-1, -0.9, -0.8], t=(0, 100)).final_state
    run = fs.simulate(model(), start, t=(0, 20))
    manifold = fs.continue_equilibria(model().frozen().with_parameters(z=0), "y", over=(-1, -0.4))
    fs.plot.time_series(run, "x", ax=left, label=False)
    fs.plot.diagram(manifold, "x", ax=right)
    right.plot(-0.9, -1, "ks", markersize=4, zorder=5)
    return fs.plot.phase_portrait(run, "y", "x", ax=right, label=False)


if __name__ == "__main__":
    figure().save("koper1995.png")
