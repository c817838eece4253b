"""What `derive` takes, beside SymPy's own solution of the equations of one region."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

import fastslow as fs
from tests.benchmarks.measuring import Line, against, medians
from tests.symbolic.symbolic_models import gear, lorenz


def lines() -> Iterator[Line]:
    """Equilibria with their stability and special points, and the solution of the rates alone."""
    for name, model in (("gear", gear()), ("Lorenz", lorenz())):
        fast = model.frozen()
        region = next(iter(fast.regions.values()))
        states = [sp.Symbol(n, real=True) for n in fast.states]

        def solved(rates: tuple[sp.Expr, ...] = tuple(region.rates.values())) -> list[object]:
            sp.core.cache.clear_cache()
            return sp.solve(rates, states)  # noqa: B023  called at once

        def ours(fast: fs.Model = fast) -> fs.Derivation:
            sp.core.cache.clear_cache()
            return fs.derive(fast)

        times = medians({"fastslow, derive": ours, "sympy.solve, one region": solved}, repeats=3)
        yield from against(f"the closed forms of the {name} system", "fastslow, derive", times)
