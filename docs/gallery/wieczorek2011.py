"""Wieczorek, Ashwin, Luke, Cox: the compost bomb, tipping by a rate."""

import numpy as np
import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Temperature and carbon of a soil under air that warms at a constant rate."""
    t, T, C, T_a, v, r, alpha, k, P, eps = sp.symbols("t T C T_a v r_0 alpha k Pi epsilon")
    decay = C * r * sp.exp(alpha * T)
    values = {r: 0.01, alpha: np.log(2.5) / 10, k: 5.049 / 39, P: 1.055, eps: 0.064, v: 0.09}
    rates = {T: (decay - k * (T - T_a)) / eps}
    return fs.Model(rates, slow={C: P - decay}, forcing={T_a: v * t}, parameters=values)


def figure() -> fs.plot.Drawing:
    """Draw runs below and above the critical rate over the equilibria."""
    diagram = fs.continue_equilibria(model().frozen(fast=["C"]), "T_a", over=(0, 9))
    left, right = fs.plot.axes("ab", height=70)
    drawn = fs.plot.diagram(diagram, "T", ax=left)
    for v, gap, side, end in ((0.088, -2, "right", "bottom"), (0.09, 2, "left", "top")):
        ramp = model().with_parameters(v=v)
        run = fs.simulate(ramp, diagram.at(T_a=0)[0].state, t=(0, 100), stop="T - 60")
        fs.plot.phase_portrait(run, "T_a", "T", ax=left)
        fs.plot.time_series(run, "T", ax=right)
        last = run.t[-1] + gap, run["T"][-1] + 1
        right.text(*last, f"{v:g} °C/yr", ha=side, va=end, fontsize=8)
    left.set(xlabel="$T_a$ (°C)", ylabel="$T$ (°C)")
    right.set(xlabel="$t$ (yr)", ylabel="$T$ (°C)")
    return drawn


if __name__ == "__main__":
    figure().save("wieczorek2011.png")
