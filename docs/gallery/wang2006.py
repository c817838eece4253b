"""Wang: an epidemic with limited capacity of treatment."""

import sympy as sp

import fastslow as fs


def model() -> fs.Model:
    """Susceptible and infected; treatment is proportional up to a capacity."""
    S, I = sp.symbols("S I")  # noqa: E741
    A, d, lam, gamma, epsilon, r, I_0 = names = sp.symbols("A d lambda gamma epsilon r I_0")
    treated = sp.Min(r * I, r * I_0)
    return fs.Model(
        {S: A - d * S - lam * S * I, I: lam * S * I - (d + gamma + epsilon) * I - treated},
        parameters=dict(zip(names, (1, 0.1, 0.2, 0.1, 0.1, 0.8, 0.4), strict=True)),
    )


def figure() -> fs.plot.Drawing:
    """Draw the infected over the contact rate at two capacities."""
    large, small = fs.plot.axes("ab", height=80)
    large.set_ylim(-0.2, 2.6)
    small.set_ylim(-0.2, 2.6)
    free = model().with_free("lambda")
    diagram = fs.continue_equilibria(free, "lambda", over=(0.05, 0.25))
    fs.plot.diagram(diagram, "I", ax=large, interfaces=False)
    scarce = free.with_parameters(I_0=0.1)
    diagram = fs.continue_equilibria(scarce, "lambda", over=(0.04, 0.16))
    return fs.plot.diagram(diagram, "I", ax=small, interfaces=False)


if __name__ == "__main__":
    figure().save("wang2006.png")
