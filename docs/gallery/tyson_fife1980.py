"""Tyson, Fife: relaxation oscillations of the Oregonator."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """The Oregonator with the bromide in equilibrium."""
    x, z = sp.symbols("x z")
    f, q, epsilon = sp.symbols("f q epsilon")
    return fs.Model(
        {x: (x * (1 - x) - f * z * (x - q) / (x + q)) / epsilon},
        slow={z: x - z},
        parameters={f: 1, q: 0.0008, epsilon: 0.04},
    )


def figure() -> fs.plot.Drawing:
    """Draw the oscillation over time and over the frozen equilibria."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model(), [0.5, 0.1], t=(0, 20))
    diagram = fs.continue_equilibria(model().frozen(), "z", over=(0, 0.5), window={"x": (1e-4, 1)})
    for name, color in (("x", "#0072B2"), ("z", "grey")):
        fs.plot.time_series(run, name, ax=left, label=False, color=color)
        left.text(13.0, {"x": 0.6, "z": 0.2}[name], f"${name}$", color=color)
    left.set_ylabel("concentration")
    right.set(yscale="log", ylim=(4e-4, 2))
    return fs.plot.overlay(fs.overlay(diagram, run), "x", ax=right)


if __name__ == "__main__":
    figure().save("tyson_fife1980.png")
