"""Izhikevich: regular spiking of a neuron with a reset."""

import fastslow as fs


def model() -> fs.Model:
    """Izhikevich's neuron with the parameters of regular spiking."""
    return fs.systems.izhikevich(I_0=10, a=0.02, b=0.2, c=-65, d=8)


def figure() -> fs.plot.Drawing:
    """Draw voltage and recovery after a step of current, and the overlay on the frozen model."""
    run = fs.simulate(model(), [-65, -13], t=(0, 300))
    upper, lower, right = fs.plot.axes("ac;bc", height=85)
    fs.plot.time_series(run, "v", ax=upper, label=False)
    fs.plot.time_series(run, "u", ax=lower, label=False)
    frozen = fs.continue_equilibria(model().frozen(), "u", over=(-14, 1), window={"v": (-90, 30)})
    drawn = fs.plot.overlay(fs.overlay(frozen, run), "v", ax=right)
    for ax in (upper, lower):
        ax.set(xlabel="$t$ (ms)")
    for ax in (upper, right):
        ax.set(ylabel="$v$ (mV)")
    return drawn


if __name__ == "__main__":
    figure().save("izhikevich2003.png")
