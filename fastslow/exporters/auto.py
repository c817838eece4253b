"""AUTO-07p equations files and constants files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef

from fastslow.errors import ArgumentError
from fastslow.exporters.common import Helpers, comment_text, region_values, supported
from fastslow.model.differentiation import derivative
from fastslow.model.known_functions import ELEMENTARY
from fastslow.model.model import Model
from fastslow.model.recurrences import CODES_KEPT
from fastslow.model.resets import refuse_clocks
from fastslow.model.structure import real
from fastslow.symbolic.closed_forms.stability import jacobian

#: Indices of PAR reserved by AUTO-07p: the period and related quantities.
AUTO_RESERVED = range(10, 15)


def to_auto(
    model: Model,
    region: str,
    *,
    values: Mapping[Any, float] | None = None,
    state: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """Write AUTO-07p equations (.f90) with derivatives, and constants (c.), for one region.

    Parameters and errors as for `export`. PAR(1), the continuation parameter of the
    constants file, is the first slow quantity, or the first parameter if there is none.
    """
    moving = [*model.forcing, *model.slow_states]
    if moving:
        raise ArgumentError(
            f"AUTO-07p continues autonomous systems, but {', '.join(moving)} depend on time; "
            "export(model.frozen(), 'auto')"
        )
    refuse_clocks([i.function for i in model.interfaces.values()], "export to auto")
    smooth, parameters, initial = region_values(model, region, values, state)
    parameters = {**{n: parameters[n] for n in model.free}, **parameters}
    places = [k for k in range(1, 37) if k not in AUTO_RESERVED][: len(parameters)]
    if len(places) < len(parameters):
        raise ArgumentError(f"AUTO-07p accepts at most 31 parameters, received {len(parameters)}")
    index = dict(zip(parameters, places, strict=True))
    names = {n: f"U({k + 1})" for k, n in enumerate(model.states)}
    names |= {n: f"PAR({k})" for n, k in index.items()}
    place = tuple((real(n), sp.Symbol(name, real=True)) for n, name in names.items())

    helpers = Helpers()

    def assign(target: str, expression: sp.Expr) -> str:
        written, called = _code(target, expression, place)
        helpers.used.update(called)
        return written

    size = len(model.states)
    matrix = jacobian(smooth.rates, model.states)
    body = [assign(f"F({k + 1})", smooth.rates[n]) for k, n in enumerate(model.states)]
    body.append("  IF (IJAC == 0) RETURN")
    body += [
        assign(f"DFDU({i + 1},{j + 1})", matrix[i, j]) for i in range(size) for j in range(size)
    ]
    body.append("  IF (IJAC == 1) RETURN")
    body += [
        assign(f"DFDP({i + 1},{k})", derivative(smooth.rates[n], real(p)))
        for i, n in enumerate(model.states)
        for p, k in index.items()
    ]
    declared = "  DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)"
    text = [
        f"! {comment_text(', '.join(model.states))}, region {comment_text(region)}",
        "SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)",
        "  IMPLICIT NONE",
        "  INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC",
        declared,
        *(f"  DOUBLE PRECISION, EXTERNAL :: {name}" for name in helpers.used),
        "  DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)",
        "  DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM,NDIM), DFDP(NDIM,*)",
        *body,
        "END SUBROUTINE FUNC",
        "SUBROUTINE STPNT(NDIM,U,PAR,T)",
        "  IMPLICIT NONE",
        "  INTEGER, INTENT(IN) :: NDIM",
        "  DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM), PAR(*)",
        "  DOUBLE PRECISION, INTENT(IN) :: T",
        *(f"  PAR({index[n]}) = {_double(v)} ! {comment_text(n)}" for n, v in parameters.items()),
        *(
            f"  U({k + 1}) = {_double(v)} ! {comment_text(n)}"
            for k, (n, v) in enumerate(initial.items())
        ),
        "END SUBROUTINE STPNT",
        *(f"SUBROUTINE {name}\nEND SUBROUTINE {name}" for name in ("BCND", "ICND", "FOPT", "PVLS")),
        *(line for name, pieces in helpers.used.items() for line in _function(name, pieces)),
    ]
    constants = [
        f"parnames = {{{', '.join(f'{k}: {n!r}' for n, k in index.items())}}}",
        f"unames = {{{', '.join(f'{k + 1}: {n!r}' for k, n in enumerate(model.states))}}}",
        f"NDIM = {size}, IPS = 1, ILP = 1, ISP = 2, ISW = 1, JAC = 1",
        "ICP = [1], NTST = 15, NCOL = 4, IAD = 3, MXBF = 5, IID = 2, ITMX = 8, ITNW = 5, NWTN = 3",
        "DS = 0.01, DSMIN = 1e-06, DSMAX = 0.1, IADS = 1, NPR = 100, NMX = 1000",
        "EPSL = 1e-08, EPSU = 1e-08, EPSS = 1e-06, RL0 = -10.0, RL1 = 10.0",
        f"NPAR = {max(36, *places)}" if places else "NPAR = 36",
    ]
    return {f"{region}.f90": "\n".join(text) + "\n", f"c.{region}": "\n".join(constants) + "\n"}


@lru_cache(CODES_KEPT)
def _code(
    target: str, expression: sp.Expr, place: tuple[tuple[sp.Symbol, sp.Symbol], ...]
) -> tuple[str, dict[str, sp.Piecewise]]:
    """Assignment of an expression, which many regions share, and the quotients in it."""
    helpers = Helpers()
    written = helpers.called(supported(expression, "auto").xreplace(dict(place)))
    return _assignment(target, written), helpers.used


def _assignment(target: str, expression: sp.Expr) -> str:
    names = {f.func.__name__: f.func.__name__ for f in expression.atoms(AppliedUndef)}
    names |= {f.__name__: one.named("auto") for f, one in ELEMENTARY.items()}
    # SymPy would declare each constant in front of its assignment, which is no Fortran
    numbers = {n: sp.Float(n, 17) for n in expression.atoms(sp.NumberSymbol)}
    code = sp.fcode(
        expression.xreplace(numbers),
        assign_to=target,
        standard=95,
        source_format="free",
        user_functions=names,
    )
    return "\n".join("  " + line for line in code.splitlines())


def _function(name: str, pieces: sp.Piecewise) -> list[str]:
    """Lines of a function of Y."""
    return [
        f"DOUBLE PRECISION FUNCTION {name}(Y)",
        "  IMPLICIT NONE",
        "  DOUBLE PRECISION, INTENT(IN) :: Y",
        _assignment(name, pieces),
        f"END FUNCTION {name}",
    ]


def _double(value: float) -> str:
    return repr(float(value)).replace("e", "d") if "e" in repr(float(value)) else f"{value!r}d0"
