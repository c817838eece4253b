"""Fossas, Olivar: chaos of a buck converter."""

import numpy as np

import fastslow as fs


def model() -> fs.Model:
    """The converter in SI units, switched by comparison with a sawtooth of 2.5 kHz."""
    return fs.systems.buck_converter(V_in=24)


def figure() -> fs.plot.Drawing:
    """Draw the output at whole periods over the input voltage, and a chaotic motion."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model().with_parameters(V_in=33), [12, 0.5], periods=100)
    fs.plot.phase_portrait(run, "v", "i", ax=right, label=False, crossings=False, linewidth=0.4)
    voltages = np.linspace(22, 34, 200)
    sweep = fs.bifurcation_sweep(model(), "V_in", voltages, [12, 0.5], settle=150, keep=30)
    drawn = fs.plot.sweep(sweep, ax=left)
    left.set(xlabel=r"$V_\mathrm{in}$ (V)", ylabel="$v$ (V), stroboscopic")
    right.set(xlabel="$v$ (V)", ylabel="$i$ (A)")
    return drawn


if __name__ == "__main__":
    figure().save("fossas_olivar1996.png")
