"""The points at which bursts of the cells begin, as stated on the page of the gallery."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import fastslow as fs
from analyses import cells
from tests.docs.kernels import DOCS

pytestmark = pytest.mark.slow


def gate(v, middle, width):
    return 1 / (1 + np.exp((middle - v) / width))


def equilibrium(v):
    """The slow gate s of the frozen beta cell at an equilibrium."""
    return -(3.6 * gate(v, -20, 12) * (v - 25) + 10 * gate(v, -17, 5.6) * (v + 75)) / (4 * (v + 75))


POINTS = {
    "hindmarsh_rose1984": ("z", (1.3, 2.5), "LP", "z", 3 - 32 / 27),
    "rinzel1987": ("y", (-0.14, 0.14), "HB", "v", -np.sqrt(1 - 0.08 * 0.8)),
    "sherman_rinzel1992": (
        "s", (0.157, 0.194), "LP", "s", minimize_scalar(equilibrium, (-65, -60, -50), tol=1e-9).fun
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", cells.CELLS)
def test_a_burst_begins_at_the_point_of_the_page(name):
    slow, over, code, quantity, expected = POINTS[name]
    frozen = fs.read(cells.FILES / f"{name}.ode").model.with_slow([slow]).frozen()
    (point,) = fs.continue_equilibria(frozen, slow, over=over).special(code)
    assert point[quantity] == pytest.approx(expected, rel=1e-10)
    shown = f"| {point[quantity]:.9f} |".replace("-", "−")
    assert shown in (DOCS / "gallery" / "cells.md").read_text("utf-8")
