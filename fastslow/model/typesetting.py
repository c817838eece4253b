"""Typesetting of models in LaTeX."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.printing.latex import LatexPrinter

from fastslow.model.regions_by_signs import RegionsBySigns
from fastslow.model.resets import Reset
from fastslow.model.structure import TIME, Partition, Structure, real
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


class _AsInPapers(LatexPrinter):
    """Prints positive terms before negative ones, in ascending powers, and those with t last.

    As in 1 − T − k₀T and B + C sin ωt.

    Parameters
    ----------
    names : dict
        LaTeX of the symbols.
    time : Symbol
        That stands for t.
    """

    def __init__(self, names: dict[Any, str], time: sp.Symbol) -> None:
        super().__init__({"symbol_names": names})
        self._time = time

    def _as_ordered_terms(self, expr: sp.Add, order: str | None = None) -> list[sp.Expr]:
        terms = super()._as_ordered_terms(expr, order="rev-lex")
        return sorted(
            terms,
            key=lambda term: (bool(term.as_coeff_Mul()[0] < 0), self._time in term.free_symbols),
        )


class _Typesetter:
    """LaTeX of the expressions of a model: coefficients before states in a product.

    SymPy orders factors by name. They are therefore printed with names in the order of the
    parameters, the forcing and the states of the model; not as dummies, whose powers come first.
    """

    def __init__(self, structure: Structure) -> None:
        last = (*structure.forcing, TIME.name, *structure.states)
        self._place = {name: place for place, name in enumerate(last)}

    def __call__(self, expression: Any) -> str:
        symbols: set[Any] = getattr(expression, "free_symbols", set())
        order = sorted(symbols, key=lambda s: (self._place.get(s.name, -1), s.name))
        places = {s: sp.Symbol(f"s{place:04d}", **s.assumptions0) for place, s in enumerate(order)}
        names = {place: latex(s) for s, place in places.items()}
        shown = expression.xreplace(places) if places else expression
        return str(_AsInPapers(names, places.get(TIME, TIME)).doprint(shown))


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
    tex = _Typesetter(partition.structure)
    whole = partition.structure.rates
    if isinstance(partition.regions, RegionsBySigns):
        rows += [rf"\dot{{{latex(real(name))}}} = {tex(rate)}" for name, rate in whole.items()]
    for region in () if rows else partition.regions.values():
        rates = [
            rf"\dot{{{latex(real(name))}}} = {tex(rate)}" for name, rate in region.rates.items()
        ]
        if sum(map(len, rates)) < ONE_ROW:
            rates = [r",\quad ".join(rates)]
        if region.conditions:
            where = r",\ ".join(tex(c) for c in region.conditions)
            rates[0] += rf"&&\text{{{latex_text(region.name)}}}:\ {where}"
        rows += rates
    for name, law in partition.structure.forcing.items():
        rows.append(rf"{latex(real(name))}({latex(TIME)}) = {tex(law)}")
    for name, period in partition.structure.periodic.items():
        rows.append(rf"{latex(real(name))} \bmod {tex(period)}")
    for reset in partition.structure.resets:
        jump = r",\ ".join(
            rf"{latex(real(name))} \mapsto {tex(value)}" for name, value in reset.jump.items()
        )
        rows.append(rf"{jump}&&\text{{when}}\ {_becomes_true(reset.function, reset.clock, tex)}")
    for switch in partition.structure.switches:
        name = latex(real(switch.name))
        for value, function, clock in zip((1, 0), switch.functions, switch.clocks, strict=True):
            rows.append(
                rf"{name} \mapsto {value}&&\text{{when}}\ {_becomes_true(function, clock, tex)}"
            )
    body = " \\\\\n".join(f"  & {row}" for row in rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def _becomes_true(function: sp.Expr, clock: Any, tex: _Typesetter) -> str:
    """Return the relation of an event."""
    relation = sp.Ge if clock is None else sp.Eq
    return tex(relation(function, 0, evaluate=False))
