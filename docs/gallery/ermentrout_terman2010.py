"""Ermentrout, Terman: square-wave bursting, from an .ode file to the overlay."""

import fastslow as fs

FILE = "ermentrout_terman2010.ode"


def model() -> fs.Model:
    """Read the model, with calcium as slow state."""
    return fs.read(FILE).model.with_slow(["ca"])


def figure() -> fs.plot.Drawing:
    """Read the file, analyse it, and draw the bursts over time and over the frozen model."""
    found = fs.analyse(fs.read(FILE))
    time, plane = fs.plot.axes("ab", height=84)
    fs.plot.time_series(found.run, "v", ax=time, label=False)
    time.set(xlabel="$t$ (ms)", ylabel="$v$ (mV)")
    drawn = found.plot("v", ax=plane)
    plane.set(xlabel="$ca$", ylabel="$v$ (mV)")
    return drawn


if __name__ == "__main__":
    figure().save("ermentrout_terman2010.png")
