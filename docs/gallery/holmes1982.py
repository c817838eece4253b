"""Holmes: a ball that bounces on a vibrating table."""

import numpy as np

import fastslow as fs


def model() -> fs.Model:
    """The ball over an exact table, with the coefficient of restitution 0.8."""
    return fs.systems.bouncing_ball(g=1, A=0.8, omega=1, r=0.8)


def figure() -> fs.plot.Drawing:
    """Draw the orbits of one and two bounces over the amplitude, and the ball over time."""
    left, right = fs.plot.axes("ab", height=75)
    one = fs.continue_orbits(fs.find_orbit(model(), [3.6, -2]), "A", over=(0.3, 1.25))
    doubled = fs.find_orbit(model(), one["PD1"])
    two = fs.continue_orbits(doubled, "A", over=(1, 1.25))
    ball = model().with_parameters(A=1.15)
    run = fs.simulate(ball, two.at(A=1.15)[0](0), t=(0, 25))
    fs.plot.time_series(run, "x", ax=right, label=False)
    right.set_xlim(0, 25)
    right.plot(run.t, 1.15 * np.sin(run.t), color="grey", linewidth=0.8)
    fs.plot.response(two, "max(x)", ax=left, label=False, color="#009E73")
    return fs.plot.response(one, "max(x)", ax=left)


if __name__ == "__main__":
    figure().save("holmes1982.png")
