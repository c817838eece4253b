"""An epidemic with limited treatment: a continuous model with a backward bifurcation."""

from __future__ import annotations

from functools import cache

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Wang: an epidemic with limited capacity of treatment",
    why="Hospitals treat a limited number of patients at a time. Can a disease then persist at "
    "contact rates at which it cannot invade?",
    source="W. Wang, Backward bifurcation of an epidemic model with treatment, Mathematical "
    "Biosciences 201, 58-71, 2006, equations (1.1) and (1.2)",
    field="epidemiology",
    phenomena=(
        "backward bifurcation",
        "non-smooth fold",
        "boundary equilibrium",
        "bistability",
        "Hopf bifurcation",
        "continuous piecewise-smooth model",
    ),
    slow="Nothing in the model; the contact rate $\\lambda$ is varied, for two capacities $I_0$.",
    caption="Infected over the contact rate; treatment is limited to $r I_0$. (a) Large capacity, "
    "$I_0 = 0.4$: bistable beyond the threshold BP1 of infection. (b) Small capacity, $I_0 = 0.1$: "
    "bistable below the threshold too, a backward bifurcation.",
    compared="The source draws the infected over the basic reproduction number $R_0 = \\lambda "
    "A/(d (d + \\gamma + \\epsilon + r))$, which is here $\\lambda/0.11$, for other values of the "
    "parameters, which are not known here.",
    unsaid=(
        "The values of the parameters; those here are chosen so that both cases occur.",
        "The Hopf bifurcation of the upper branch, and that the boundary equilibrium is a "
        "non-smooth fold with a Clarke-Hopf point.",
    ),
)


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


@cache
def claims() -> tuple[Claim, ...]:
    """Threshold, boundary equilibria, folds and Hopf points."""
    free = model().with_free("lambda")
    large = fs.continue_equilibria(free, "lambda", over=(0.05, 0.25))
    small = fs.continue_equilibria(free.with_parameters(I_0=0.1), "lambda", over=(0.04, 0.16))
    threshold = large.special("BP")[0]
    (corner,), (fold,), (hopf,) = large.boundary_equilibria, large.folds, large.special("HB")
    (low_corner,), (low_fold,) = small.boundary_equilibria, small.folds
    saddle = next(point for point in small.special("NSD") if point["I"] > 0.3)
    closed, solved = "closed form", "closed form and mpmath"
    product = saddle.eigenvalues.prod().real
    return (
        Claim(
            "1",
            "With a large capacity the endemic state appears forward at the threshold; beyond it "
            "there is a second, bistable endemic state.",
            "Equilibria over the contact rate at $I_0 = 0.4$.",
            (
                Finding(
                    "either",
                    "holds",
                    "The boundary equilibrium is a {corner}; the upper branch loses stability at a "
                    "{hopf} Hopf point.",
                    {"corner": corner.type, "hopf": hopf.criticality},
                ),
            ),
            quantities=(
                Quantity(r"threshold, $\lambda$", threshold["lambda"], "0.11000000000000", closed),
                Quantity("its $R_0$", threshold["lambda"] / 0.11, "1.0000000000000", closed, "1"),
                Quantity(
                    r"boundary equilibrium, $\lambda$",
                    corner["lambda"],
                    "0.196428571428571",
                    closed,
                ),
                Quantity(r"fold, $\lambda$", fold["lambda"], "0.159042226420749", solved),
                Quantity("fold, $I$", fold["I"], "0.8189514164975", solved),
                Quantity(r"Hopf point, $\lambda$", hopf["lambda"], "0.169550173010381", solved),
                Quantity("Hopf point, $I$", hopf["I"], "1.11020408163265", solved),
            ),
        ),
        Claim(
            "2",
            "With a small capacity there is a backward bifurcation: endemic states below the "
            "threshold.",
            "Equilibria over the contact rate at $I_0 = 0.1$.",
            (
                Finding(
                    "either",
                    "holds",
                    "The fold is {below:.4f} below the threshold. Near it the trace of the "
                    "Jacobian vanishes, but at a saddle, with the product {product:.1e} of its "
                    "eigenvalues: a neutral saddle and no Hopf point.",
                    {"below": threshold["lambda"] - low_fold["lambda"], "product": product},
                ),
            ),
            quantities=(
                Quantity(
                    r"boundary equilibrium, $\lambda$",
                    low_corner["lambda"],
                    "0.123595505617978",
                    closed,
                ),
                Quantity(r"fold, $\lambda$", low_fold["lambda"], "0.0583300599580307", solved),
                Quantity(
                    r"neutral saddle, $\lambda$", saddle["lambda"], "0.058601134215501", solved
                ),
            ),
        ),
    )
