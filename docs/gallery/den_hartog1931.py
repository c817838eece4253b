"""Den Hartog: forced vibrations with Coulomb friction."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """An oscillator with unit mass, stiffness and force."""
    t, x, v, r, f = sp.symbols("t x v r f")
    return fs.Model({x: v, v: sp.cos(r * t) - x - f * sp.sign(v)}, parameters={r: 2, f: 0.3})


def figure() -> fs.plot.Drawing:
    """Draw the amplitude over the frequency, and a motion with stops."""
    left, right = fs.plot.axes("ab", height=75)
    left.set_ylim(0, 5)
    for f, colour in ((0.2, "#0072b2"), (0.4, "#009e73"), (0.6, "#d55e00")):
        for r, over in ((0.7, (0.52, 0.94)), (1.5, (1.05, 2.5))):
            orbit = fs.find_orbit(model().with_parameters(r=r, f=f), [0, 0])
            branch = fs.continue_orbits(orbit, "r", over=over)
            drawn = fs.plot.response(branch, "max(x)", ax=left, label=False, color=colour)
        drawn.lines[0].set_label(f"$f = {f}$")
    named = [line for line in left.lines if "$f" in str(line.get_label())]
    left.legend(handles=[*named, *drawn.markers], fontsize="x-small")
    stops = fs.find_orbit(model().with_parameters(r=0.6, f=0.6), [0, 0])
    fs.plot.time_series(stops.trajectory, "v", ax=right)
    return drawn


if __name__ == "__main__":
    figure().save("den_hartog1931.png")
