"""Izhikevich: regular spiking of a neuron with a reset."""

import fastslow as fs


def model() -> fs.Model:
    """Izhikevich's neuron with the parameters of regular spiking."""
    return fs.systems.izhikevich(I_0=10, a=0.02, b=0.2, c=-65, d=8)


def figure() -> fs.plot.Drawing:
    """Draw the voltage and the recovery after a step of current."""
    run = fs.simulate(model(), [-65, -13], t=(0, 300))
    left, right = fs.plot.axes("ab", height=60)
    fs.plot.time_series(run, "v", ax=left, label=False)
    drawn = fs.plot.time_series(run, "u", ax=right, label=False)
    left.set(xlabel="$t$ (ms)", ylabel="$v$ (mV)")
    right.set(xlabel="$t$ (ms)")
    return drawn


if __name__ == "__main__":
    figure().save("izhikevich2003.png")
