"""Åström, Hägglund: the oscillation of relay feedback."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Three equal lags with an ideal relay."""
    x, y, z = sp.symbols("x y z")
    return fs.Model({x: -x - sp.sign(z), y: x - y, z: y - z})


def figure() -> fs.plot.Drawing:
    """Draw the output, the periodic orbit and its multipliers."""
    left, middle, right = fs.plot.axes("abc", height=60)
    run = fs.simulate(model(), [1, 1, 1], t=(0, 25))
    orbit = fs.find_orbit(model(), [0.7, 0.3, 0.01])
    fs.plot.time_series(run, "z", ax=left, label=False)
    fs.plot.phase_portrait(orbit.trajectory, "z", "y", ax=middle, label=False)
    return fs.plot.multipliers(orbit, ax=right, legend=False)


if __name__ == "__main__":
    figure().save("astrom_hagglund1984.png")
