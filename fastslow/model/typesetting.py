"""A model as LaTeX."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import sympy as sp

from fastslow.model.structure import TIME, real

if TYPE_CHECKING:
    from fastslow.model.model import Model

Law = tuple[str, sp.Expr]


@lru_cache(maxsize=64)
def equations_text(
    rates: tuple[Law, ...], forcing: tuple[Law, ...], periodic: tuple[Law, ...] = ()
) -> str:
    """Rates, laws of slow quantities and periods of states, one a line; written once."""
    lines = [f"{name}' = {rate}" for name, rate in rates]
    lines += [f"{name} = {law}" for name, law in forcing]
    return "\n".join([*lines, *(f"{name} modulo {period}" for name, period in periodic)])


def model_latex(model: Model) -> str:
    r"""Typeset the equations of a model region by region, as one aligned display.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x = sp.Symbol("x")
    >>> print(model_latex(Model({x: -x})))
    \begin{align*}
      & \dot{x} = - x
    \end{align*}
    """
    rows = []
    for region in model.regions.values():
        rates = r",\quad ".join(
            rf"\dot{{{sp.latex(real(name))}}} = {sp.latex(rate)}"
            for name, rate in region.rates.items()
        )
        where = r",\ ".join(sp.latex(c) for c in region.conditions)
        rows.append(rates + rf"&&\text{{{region.name}}}:\ {where}" if where else rates)
    for name, law in model.forcing.items():
        rows.append(rf"{sp.latex(real(name))}({sp.latex(TIME)}) = {sp.latex(law)}")
    for name, period in model.structure.periodic.items():
        rows.append(rf"{sp.latex(real(name))} \bmod {sp.latex(period)}")
    body = " \\\\\n".join(f"  & {row}" for row in rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"
