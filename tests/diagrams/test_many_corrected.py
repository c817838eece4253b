"""Equilibria that are solved for at many values at once are those solved for one by one."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, w = sp.symbols("x w")


@pytest.mark.parametrize(
    ("model", "name", "over"),
    [
        (fs.systems.fitzhugh_nagumo(), "I", (-0.2, 2)),
        (fs.systems.harmonic_gear(), "w", (-2, 6)),
        (fs.Model({x: w - x - 2 * sp.sign(x)}, parameters={w: 1}), "w", (-3, 3)),
    ],
)
def test_many_equilibria_are_those_of_each_bit_by_bit(model, name, over):
    fast = model.frozen() if model.forcing else model
    diagram = fs.continue_equilibria(fast, name, over=over)
    branch = diagram.branches[0]
    for region in np.unique(branch.region):
        rows = np.flatnonzero(branch.region == region)
        # off the branch, and as far off as nothing is found
        states = branch.state[rows] + np.linspace(-1e-3, 1e-3, len(rows))[:, None]
        states[-1] = 1e200
        values = branch.values[rows]
        solved, spectra = diagram.corrector.many(str(region), states, values)
        for k in range(len(rows)):
            alone = diagram.corrector(str(region), states[k], float(values[k]))
            if alone is None:
                assert np.isnan(solved[k]).all()
                assert np.isnan(spectra[k]).all()
            else:
                assert (solved[k] == alone.state).all()
                assert (spectra[k] == alone.eigenvalues).all()
