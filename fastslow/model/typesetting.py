"""Typesetting of models in LaTeX."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import sympy as sp

from fastslow.model.regions_by_signs import RegionsBySigns
from fastslow.model.resets import Reset
from fastslow.model.structure import TIME, Partition, real
from fastslow.model.switches import Switch

Law = tuple[str, sp.Expr]


@lru_cache(maxsize=64)
def equations_text(
    rates: tuple[Law, ...],
    forcing: tuple[Law, ...],
    periodic: tuple[Law, ...] = (),
    jumps: tuple[Reset | Switch, ...] = (),
    events: tuple[str, ...] = (),
) -> str:
    """Return rates, laws, periods of states, resets, switches and events as lines of text."""
    lines = [f"{name}' = {rate}" for name, rate in rates]
    lines += [f"{name} = {law}" for name, law in forcing]
    lines += [f"{name} modulo {period}" for name, period in periodic]
    return "\n".join([*lines, *map(str, jumps), *events])


#: Escape sequences of characters that are special in LaTeX.
_ESCAPED = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "|": r"\textbar{}",
    # a notebook reads LaTeX within HTML
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    **{c: f"\\{c}" for c in "{}$&#%_"},
}

#: Rates that are shorter in LaTeX, all together, are written in one row.
ONE_ROW = 160


def latex(expression: Any) -> str:
    r"""Return an expression in LaTeX; a symbol whose name is not an identifier is set as text.

    Examples
    --------
    >>> latex(sp.Symbol("omega_0") / sp.Symbol("m%"))
    '\\frac{\\omega_{0}}{\\text{m\\%}}'
    """
    symbols = getattr(expression, "free_symbols", ())
    odd = {s: rf"\text{{{latex_text(s.name)}}}" for s in symbols if not s.name.isidentifier()}
    return str(sp.latex(expression, symbol_names=odd))


def latex_text(name: str) -> str:
    r"""Return a name as LaTeX text, on one line.

    Examples
    --------
    >>> latex_text("x^{2} & y")
    'x\\textasciicircum{}\\{2\\} \\& y'
    """
    return "".join(_ESCAPED.get(c, c) for c in " ".join(name.split()))


def model_latex(partition: Partition) -> str:
    r"""Typeset the equations of a model region by region, as one aligned display.

    Those of very many regions are typeset as they are written.

    Examples
    --------
    >>> from fastslow.model.model import Model
    >>> x = sp.Symbol("x")
    >>> print(model_latex(Model({x: -x}).partition))
    \begin{align*}
      & \dot{x} = - x
    \end{align*}
    """
    rows = []
    whole = partition.structure.rates
    if isinstance(partition.regions, RegionsBySigns):
        rows += [rf"\dot{{{latex(real(name))}}} = {latex(rate)}" for name, rate in whole.items()]
    for region in () if rows else partition.regions.values():
        rates = [
            rf"\dot{{{latex(real(name))}}} = {latex(rate)}" for name, rate in region.rates.items()
        ]
        if sum(map(len, rates)) < ONE_ROW:
            rates = [r",\quad ".join(rates)]
        if region.conditions:
            where = r",\ ".join(latex(c) for c in region.conditions)
            rates[0] += rf"&&\text{{{latex_text(region.name)}}}:\ {where}"
        rows += rates
    for name, law in partition.structure.forcing.items():
        rows.append(rf"{latex(real(name))}({latex(TIME)}) = {latex(law)}")
    for name, period in partition.structure.periodic.items():
        rows.append(rf"{latex(real(name))} \bmod {latex(period)}")
    for reset in partition.structure.resets:
        jump = r",\ ".join(
            rf"{latex(real(name))} \mapsto {latex(value)}" for name, value in reset.jump.items()
        )
        rows.append(rf"{jump}&&\text{{when}}\ {_becomes_true(reset.function, reset.clock)}")
    for switch in partition.structure.switches:
        name = latex(real(switch.name))
        for value, *event in zip((1, 0), switch.functions, switch.clocks, strict=True):
            rows.append(rf"{name} \mapsto {value}&&\text{{when}}\ {_becomes_true(*event)}")
    body = " \\\\\n".join(f"  & {row}" for row in rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def _becomes_true(function: sp.Expr, clock: Any) -> str:
    """Return the relation of an event."""
    relation = sp.Ge if clock is None else sp.Eq
    return latex(relation(function, 0, evaluate=False))
