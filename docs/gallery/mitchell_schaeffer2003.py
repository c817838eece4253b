"""Mitchell, Schaeffer: an action potential of the heart."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Voltage with an inward and an outward current, and a gate that switches."""
    v, h = sp.symbols("v h")
    names = sp.symbols("tau_in tau_out tau_open tau_close v_gate")
    inward, outward, opening, closing, switch = names
    gate = sp.Piecewise(((1 - h) / opening, v < switch), (-h / closing, True))
    return fs.Model(
        {v: h * v**2 * (1 - v) / inward - v / outward},
        slow={h: gate},
        parameters=dict(zip(names, (0.3, 6, 120, 150, 0.13), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw an action potential over time, and over the frozen equilibria."""
    left, right = fs.plot.axes("ab", height=75)
    run = fs.simulate(model(), [0.3, 1], t=(0, 600))
    diagram = fs.continue_equilibria(model().frozen(), "h", over=(0, 1))
    for name, color in (("v", "#0072B2"), ("h", "grey")):
        fs.plot.time_series(run, name, ax=left, label=False, color=color)
        left.text(100, {"v": 0.95, "h": 0.55}[name], f"${name}$", color=color)
    left.set(xlabel="$t$ (ms)", ylabel="voltage $v$, gate $h$")
    return fs.plot.overlay(fs.overlay(diagram, run), "v", ax=right)


if __name__ == "__main__":
    figure().save("mitchell_schaeffer2003.png")
