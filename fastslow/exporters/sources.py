"""The model as a source file for AUTO-07p, XPPAUT or NumPy, one file for each region."""

from __future__ import annotations

import keyword
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import sympy as sp
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.str import StrPrinter

from fastslow.arguments import instance, mapping, path, takes, text
from fastslow.disk import reason, write_text
from fastslow.errors import ArgumentError, FileError, unknown_name
from fastslow.model.interfaces import Region
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real
from fastslow.results.base.named_mapping import Named
from fastslow.results.stored.model import finite_number
from fastslow.symbolic.closed_forms.stability import jacobian

#: Places of PAR that AUTO-07p keeps for itself: the period and what belongs to it.
AUTO_RESERVED = range(10, 15)

#: Words of XPPAUT, in lower case.
XPP_WORDS = frozenset(
    [
        "t",
        "pi",
        "exp",
        "ln",
        "log",
        "sin",
        "cos",
        "tan",
        "abs",
        "max",
        "min",
        "if",
        "then",
        "else",
        "par",
        "init",
        "aux",
        "done",
        "heav",
        "sign",
        "mod",
        "ran",
        "flr",
    ]
)

#: Functions that every target knows by the name given here.
FUNCTIONS = (
    sp.exp,
    sp.log,
    sp.sin,
    sp.cos,
    sp.tan,
    sp.asin,
    sp.acos,
    sp.atan,
    sp.sinh,
    sp.cosh,
    sp.tanh,
)


@takes(model=instance(Model), format=text, path=path, region=text, values=mapping, start=mapping)
def export(
    model: Model,
    format: str,
    path: str | os.PathLike[str] | None = None,
    *,
    region: str | None = None,
    values: Mapping[Any, float] | None = None,
    start: Mapping[Any, float] | None = None,
) -> Named[str]:
    """Write the smooth model of each region as a source file of another program.

    Parameters
    ----------
    model : Model
        For AUTO-07p a frozen model.
    format : str
        ``"auto"`` (Fortran equations and a constants file), ``"xpp"`` (an .ode
        file) or ``"numpy"`` (a Python module).
    path : path, optional
        Folder to write into; nothing is written without it.
    region : str, optional
        One region only; all of them by default.
    values : mapping, optional
        Values of frozen slow quantities, 0 by default.
    start : mapping, optional
        Start state, 0 by default. AUTO-07p wants an equilibrium.

    Returns
    -------
    Named of str
        File name to text.

    Raises
    ------
    UnknownNameError
        For an unknown format, region, state or slow quantity.
    ArgumentError
        If the format cannot hold the model.

    Examples
    --------
    >>> x, k = sp.symbols("x k")
    >>> decay = Model({x: -k * x}, parameters={k: 2})
    >>> print(export(decay, "xpp")["S1.ode"])
    # x, region S1
    par k=2.0
    x'=-k*x
    init x=0.0
    @ total=100
    done
    <BLANKLINE>
    """
    writers: dict[str, Callable[..., dict[str, str]]] = {
        "auto": to_auto,
        "xpp": to_xpp,
        "numpy": to_numpy,
    }
    if format not in writers:
        raise unknown_name("export format", format, writers)
    names = [region] if region is not None else list(model.regions)
    files: dict[str, str] = {}
    for name in names:
        files.update(writers[format](model, name, values=values, start=start))
    if path is not None:
        folder = Path(path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{folder} cannot be written: {reason(error)}") from error
        for name, text in files.items():
            write_text(folder / name, text)
    return Named("file", files)


def to_numpy(
    model: Model,
    region: str,
    *,
    values: Mapping[Any, float] | None = None,
    start: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """Give a Python module with rates, Jacobian and interface functions of one region.

    Parameters and errors as for `export`. The module holds ``STATES``,
    ``START``, ``PARAMETERS``, ``rates(t, state, parameters)`` of shape (n,),
    ``jacobian`` of shape (n, n) and ``interfaces`` of shape (m,), positive or
    negative as the region has them.
    """
    part, numbers, first = _parts(model, region, values, start)
    names = [*model.states, *model.slow_states]
    inside = _names([*names, *numbers, *part.forcing], keyword.iskeyword, lambda n: n)
    place = {real(n): sp.Symbol(safe, real=True) for n, safe in inside.items()}
    printer = NumPyPrinter({"fully_qualified_modules": True})

    def code(expression: sp.Expr) -> str:
        return str(printer.doprint(_supported(expression).xreplace(place)))

    unpack = [f"    {inside[n]} = parameters[{n!r}]" for n in numbers]
    unpack += [f"    {inside[n]} = state[{k}]" for k, n in enumerate(names)]
    unpack += [f"    {inside[n]} = {code(law)}" for n, law in part.forcing.items()]
    rows = [f"            {code(part.rates[n])}," for n in names]
    matrix = jacobian(part.rates, names)
    entries = [f"            [{', '.join(map(code, matrix.row(k)))}]," for k in range(len(names))]
    functions = [f"            {code(i.function)}," for i in model.interfaces.values()]
    blocks = [
        f'"""{_comment(", ".join(names))}, region {_comment(region)}."""',
        "import numpy",
        f"STATES = {tuple(names)!r}\nSTART = {tuple(first.values())!r}\nPARAMETERS = {numbers!r}\n"
        f"SIGNS = {dict(part.signs)!r}",
        *(
            _function(name, doc, unpack, body)
            for name, doc, body in (
                ("rates", "Rates, shape (n,).", rows),
                ("jacobian", "Derivatives of the rates, shape (n, n).", entries),
                ("interfaces", "Interface functions, shape (m,).", functions),
            )
        ),
    ]
    text = "\n\n".join(blocks[:3]) + "\n\n\n" + "\n\n\n".join(blocks[3:]) + "\n"
    return {f"{region}.py": text}


def _function(name: str, doc: str, unpack: list[str], rows: list[str]) -> str:
    head = [f"def {name}(t, state, parameters=PARAMETERS):", f'    """{doc}"""', *unpack]
    body = ["    return numpy.array(", "        [", *rows, "        ],"]
    return "\n".join([*head, *body, "        dtype=float,", "    )"])


def to_xpp(
    model: Model,
    region: str,
    *,
    values: Mapping[Any, float] | None = None,
    start: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """Give an XPPAUT .ode file of one region. Parameters and errors as for `export`."""
    part, numbers, first = _parts(model, region, values, start)
    names = [*model.states, *model.slow_states]
    # XPPAUT ignores case, keeps nine letters apart and has names of its own
    inside = _names([*names, *numbers, *part.forcing], XPP_WORDS.__contains__, str.lower, 9)
    place = {real(n): sp.Symbol(safe, real=True) for n, safe in inside.items()}
    printer = _XppPrinter()

    def code(expression: sp.Expr) -> str:
        return str(printer.doprint(_supported(expression).xreplace(place)))

    lines = [f"# {_comment(', '.join(names))}, region {_comment(region)}"]
    where = ", ".join(map(str, part.conditions))
    lines += [f"# where {_comment(where)}"] if where else []
    lines += [f"par {inside[n]}={value!r}" for n, value in numbers.items()]
    lines += [f"{inside[n]}={code(law)}" for n, law in part.forcing.items()]
    lines += [f"{inside[n]}'={code(part.rates[n])}" for n in names]
    lines += [f"init {inside[n]}={value!r}" for n, value in first.items()]
    return {f"{region}.ode": "\n".join([*lines, "@ total=100", "done"]) + "\n"}


class _XppPrinter(StrPrinter):
    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        if expr.exp == sp.Rational(1, 2):
            return f"sqrt({self._print(expr.base)})"
        if expr.exp.is_number and expr.exp.is_negative:
            return f"(1/({self._print(sp.Pow(expr.base, -expr.exp))}))"
        return f"({self._print(expr.base)})^({self._print(expr.exp)})"

    def _print_log(self, expr: sp.log) -> str:
        return f"ln({self._print(expr.args[0])})"

    def _print_exp(self, expr: sp.exp) -> str:
        return f"exp({self._print(expr.args[0])})"


def to_auto(
    model: Model,
    region: str,
    *,
    values: Mapping[Any, float] | None = None,
    start: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """AUTO-07p equations (.f90) with derivatives, and constants (c.), of one region.

    Parameters and errors as for `export`. The first slow quantity, else the
    first parameter, is PAR(1), the one that the constants file continues in.
    """
    moving = [*model.forcing, *model.slow_states]
    if moving:
        raise ArgumentError(
            f"AUTO-07p continues autonomous systems, but {', '.join(moving)} depend on time; "
            "export(model.frozen(), 'auto')"
        )
    part, numbers, first = _parts(model, region, values, start)
    numbers = {**{n: numbers[n] for n in model.free}, **numbers}
    places = [k for k in range(1, 37) if k not in AUTO_RESERVED][: len(numbers)]
    if len(places) < len(numbers):
        raise ArgumentError(f"AUTO-07p holds 31 parameters, received {len(numbers)}")
    index = dict(zip(numbers, places, strict=True))
    place = {real(n): sp.Symbol(f"U({k + 1})", real=True) for k, n in enumerate(model.states)}
    place |= {real(n): sp.Symbol(f"PAR({k})", real=True) for n, k in index.items()}

    def assign(target: str, expression: sp.Expr) -> str:
        written = _supported(expression).xreplace(place)
        code = sp.fcode(written, assign_to=target, standard=95, source_format="free")
        return "\n".join("  " + line for line in code.splitlines())

    size = len(model.states)
    matrix = jacobian(part.rates, model.states)
    body = [assign(f"F({k + 1})", part.rates[n]) for k, n in enumerate(model.states)]
    body.append("  IF (IJAC == 0) RETURN")
    body += [
        assign(f"DFDU({i + 1},{j + 1})", matrix[i, j]) for i in range(size) for j in range(size)
    ]
    body.append("  IF (IJAC == 1) RETURN")
    body += [
        assign(f"DFDP({i + 1},{k})", part.rates[n].diff(real(p)))
        for i, n in enumerate(model.states)
        for p, k in index.items()
    ]
    declared = "  DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)"
    text = [
        f"! {_comment(', '.join(model.states))}, region {_comment(region)}",
        "SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)",
        "  IMPLICIT NONE",
        "  INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC",
        declared,
        "  DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)",
        "  DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM,NDIM), DFDP(NDIM,*)",
        *body,
        "END SUBROUTINE FUNC",
        "SUBROUTINE STPNT(NDIM,U,PAR,T)",
        "  IMPLICIT NONE",
        "  INTEGER, INTENT(IN) :: NDIM",
        "  DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM), PAR(*)",
        "  DOUBLE PRECISION, INTENT(IN) :: T",
        *(f"  PAR({index[n]}) = {_double(v)} ! {_comment(n)}" for n, v in numbers.items()),
        *(f"  U({k + 1}) = {_double(v)} ! {_comment(n)}" for k, (n, v) in enumerate(first.items())),
        "END SUBROUTINE STPNT",
        *(f"SUBROUTINE {name}\nEND SUBROUTINE {name}" for name in ("BCND", "ICND", "FOPT", "PVLS")),
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


def _double(value: float) -> str:
    return repr(float(value)).replace("e", "d") if "e" in repr(float(value)) else f"{value!r}d0"


def _parts(
    model: Model,
    region: str,
    values: Mapping[Any, float] | None,
    start: Mapping[Any, float] | None,
) -> tuple[Region, dict[str, float], dict[str, float]]:
    """Give the region, all parameter values, and the start state."""
    numbers = dict.fromkeys(model.free, 0.0) | dict(model.parameters)
    first = dict.fromkeys((*model.states, *model.slow_states), 0.0)
    for given, known, kind in ((values, numbers, "parameter"), (start, first, "state")):
        for name, value in (given or {}).items():
            if str(name) not in known:
                raise unknown_name(kind, name, known)
            known[str(name)] = finite_number(f"{kind} {name}", value)
    return model.regions[region], numbers, first


def _supported(expression: sp.Expr) -> sp.Expr:
    """Give the expression, if all its functions have a name everywhere."""
    wrong = [f for f in expression.atoms(sp.Function) if not isinstance(f, FUNCTIONS)]
    if wrong:
        names = ", ".join(sorted({f.func.__name__ for f in wrong}))
        raise ArgumentError(
            f"cannot export {names}; expected {', '.join(f.__name__ for f in FUNCTIONS)}"
        )
    return expression


def _comment(text: str) -> str:
    """A text that stays within a comment or a docstring: one line without quotes."""
    line = "".join(c if c.isprintable() else " " for c in text)
    return line.replace("\\", "/").replace('"', "'")


def _names(
    wanted: Iterable[str],
    taken: Callable[[str], bool],
    fold: Callable[[str], str],
    length: int = 60,
) -> dict[str, str]:
    """Give every name an identifier, distinct after folding and not a word of the target."""
    result: dict[str, str] = {}
    used: set[str] = {TIME.name, "state", "parameters", "numpy"}
    for name in wanted:
        plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
        plain = plain if plain[0].isalpha() else f"p{plain}"
        safe, count = plain[:length], 1
        while fold(safe) in used or taken(fold(safe)):
            count += 1
            safe = f"{plain[: length - 3]}_{count}"
        used.add(fold(safe))
        result[name] = safe
    return result
