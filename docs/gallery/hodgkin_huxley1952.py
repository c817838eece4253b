"""Hodgkin, Huxley: repetitive firing of the giant axon."""

import fastslow as fs


def model() -> fs.Model:
    """The space-clamped axon at 6.3 °C."""
    return fs.systems.hodgkin_huxley(I_0=10)


def figure() -> fs.plot.Drawing:
    """Draw a train of spikes, and the cycles over the current."""
    box = {"V": (-100, 50), "m": (0, 1), "h": (0, 1), "n": (0, 1)}
    run = fs.simulate(model(), [-65, 0.05, 0.6, 0.32], t=(0, 80))
    diagram = fs.continue_equilibria(model(), "I_0", over=(0, 200), window=box)
    cycles = fs.continue_cycles(diagram)
    left, middle, right = fs.plot.axes("abc", height=75)
    fs.plot.time_series(run, "V", ax=left, label=False)
    fs.plot.diagram(diagram, "V", ax=middle, cycles=cycles, label=False, legend=True)
    drawn = fs.plot.diagram(diagram, "V", ax=right, cycles=cycles, legend=False)
    left.set(xlabel="$t$ (ms)", ylabel="$V$ (mV)")
    middle.set(xlabel="$I_0$ (µA/cm²)", ylabel="$V$ (mV)")
    right.set(xlabel="$I_0$ (µA/cm²)", ylabel="$V$ (mV)", xlim=(6, 10), ylim=(-80, 40))
    return drawn


if __name__ == "__main__":
    figure().save("hodgkin_huxley1952.png")
