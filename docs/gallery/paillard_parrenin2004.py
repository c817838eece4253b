"""Paillard, Parrenin: ice ages by a switch of the deep ocean."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Ice, Antarctic margin and carbon dioxide without insolation; time in thousands of years."""
    V, A, C = sp.symbols("V A C")
    names = sp.symbols("x z beta gamma delta a b d")
    x, z, beta, gamma, delta, a, b, d = names
    stratified = a * V - b * A + d
    carbon = -beta * V + gamma * sp.Heaviside(-stratified) + delta
    return fs.Model(
        {V: (z - x * C - V) / 15, A: (V - A) / 12, C: (carbon - C) / 5},
        parameters=dict(zip(names, (1.3, 0.8, 0.5, 0.5, 0.4, 0.3, 0.7, 0.27), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw the free oscillation over time and in the plane of ice and carbon dioxide."""
    left, right = fs.plot.axes("ab", height=70)
    orbit = fs.find_orbit(model(), [0.3, 0.5, 0.7])
    run = fs.simulate(model(), orbit(0), t=(0, 400))
    for name, place, color in (("V", (38, 0.6), "#0072B2"), ("C", (12, 0.5), "grey")):
        fs.plot.time_series(run, name, ax=left, label=False, color=color)
        left.text(*place, f"${name}$", color=color)
    left.set(xlabel="$t$ (kyr)", ylabel="ice volume $V$, carbon dioxide $C$")
    return fs.plot.phase_portrait(orbit.trajectory, "V", "C", ax=right)


if __name__ == "__main__":
    figure().save("paillard_parrenin2004.png")
