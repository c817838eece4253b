"""Dobson, Chiang: voltage collapse of a power system."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Angles of generator and load, and the voltage of the load."""
    V, d, dm, w, Q = sp.symbols("V delta delta_m omega Q_1")
    power = 16.66667 * sp.sin(d - dm + 0.08727) * V - 0.16667 * w + 1.88074
    generator, network = sp.cos(d - dm - 0.08727) * V, sp.cos(d - 0.20944) * V
    angle = 496.87181 * V**2 - 166.66667 * generator - 666.66667 * network - 93.33333 * V
    near, far = sp.cos(d - dm - 0.01241) * V, sp.cos(d - 0.13458) * V
    voltage = -78.76384 * V**2 + 26.21722 * near + 104.86887 * far + 14.52288 * V
    return fs.Model(
        {
            dm: w,
            w: power,
            d: angle + 33.33333 * Q + 43.33333,
            V: voltage - 5.22876 * Q - 7.03268,
        },
        parameters={Q: 11.3},
        periodic={d: 2 * sp.pi, dm: 2 * sp.pi},
    )


def figure() -> fs.plot.Drawing:
    """Draw equilibria over the demand, and the cycles from one Hopf point to the other."""
    free, window = model().with_free("Q_1"), {"V": (0.5, 1.5)}
    diagram = fs.continue_equilibria(free, "Q_1", over=(10.5, 11.5), window=window)
    return fs.plot.diagram(diagram, "V", cycles=fs.continue_cycles(diagram), width=130)


if __name__ == "__main__":
    figure().save("dobson_chiang1989.png")
