"""Butera, Rinzel, Smith: bursting of a respiratory pacemaker neuron."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Model 1: fast and persistent sodium, potassium and leak currents."""
    V, n, h = sp.symbols("V n h")
    names = sp.symbols("C g_NaP g_Na g_K g_L E_Na E_K E_L")
    C, g_NaP, g_Na, g_K, g_L, E_Na, E_K, E_L = names

    def gate(half: float, slope: float) -> sp.Expr:
        return 1 / (1 + sp.exp((V - half) / slope))

    sodium = g_Na * gate(-34, -5) ** 3 * (1 - n) + g_NaP * gate(-40, -6) * h
    current = sodium * (V - E_Na) + g_K * n**4 * (V - E_K) + g_L * (V - E_L)
    return fs.Model(
        {V: -current / C, n: (gate(-29, -4) - n) * sp.cosh((V + 29) / 8) / 10},
        slow={h: (gate(-48, 6) - h) * sp.cosh((V + 48) / 12) / 10000},
        parameters=dict(zip(names, (21, 2.8, 28, 11.2, 2.8, 50, -85, -57.5), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw silence, beating and bursting, and the bursts over the frozen model."""
    silent, bursting, beating, plane = fs.plot.axes("ad;bd;cd", height=85)
    for ax, potential in ((silent, -62), (beating, -52), (bursting, -57.5)):
        leak = model().with_parameters(E_L=potential)
        run = fs.simulate(leak, [-52, 0.004, 0.45], t=(0, 5000))
        fs.plot.time_series(run, "V", ax=ax, label=False)
        ax.set(ylim=(-65, 15), xlabel="$t$ (ms)", ylabel="$V$ (mV)")
    diagram = fs.continue_equilibria(model().frozen(), "h", over=(0.445, 0.48))
    cycle = fs.find_orbit(model().frozen().with_parameters(h=0.48), [-30, 0.5])
    cycles = fs.continue_orbits(cycle, "h", over=(0.445, 0.48))
    drawn = fs.plot.overlay(fs.overlay(diagram, run, cycles=cycles), "V", ax=plane)
    plane.set_ylabel("$V$ (mV)")
    return drawn


if __name__ == "__main__":
    figure().save("butera_rinzel_smith1999.png")
