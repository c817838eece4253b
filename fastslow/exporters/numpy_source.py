"""Python modules with NumPy functions for the rates of one region."""

from __future__ import annotations

import keyword
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.printing.numpy import NumPyPrinter

from fastslow.exporters.common import (
    Helpers,
    comment_text,
    identifiers,
    region_values,
    supported,
)
from fastslow.model.known_functions import ELEMENTARY
from fastslow.model.model import Model
from fastslow.model.recurrences import CODES_KEPT
from fastslow.model.structure import real
from fastslow.symbolic.closed_forms.stability import jacobian

#: Functions that NumPy lacks; the exported module applies those of `math` element by element.
_LACKING = {f: one.name for f, one in ELEMENTARY.items() if one.named("numpy") == one.name}


def to_numpy(
    model: Model,
    region: str,
    *,
    values: Mapping[Any, float] | None = None,
    state: Mapping[Any, float] | None = None,
) -> dict[str, str]:
    """Write a Python module with rates, Jacobian and interface functions of one region.

    Parameters and errors as for `export`. The module defines ``STATES``,
    ``START``, ``PARAMETERS``, ``rates(t, state, parameters)`` of shape (n,),
    ``jacobian`` of shape (n, n) and ``interfaces`` of shape (m,), whose signs
    in the region are ``SIGNS``.
    """
    smooth, parameters, initial = region_values(model, region, values, state)
    names = [*model.states, *model.slow_states]
    helpers = Helpers()
    used: set[str] = set()
    inside = identifiers(
        [*names, *parameters, *smooth.forcing],
        lambda n: keyword.iskeyword(n) or n in _LACKING.values() or helpers.reserved(n),
        lambda n: n,
    )
    place = tuple((real(n), sp.Symbol(safe, real=True)) for n, safe in inside.items())

    def code(expression: sp.Expr) -> str:
        written, lacking, called = _code(expression, place)
        used.update(lacking)
        helpers.used.update(called)
        return written

    unpack = [f"    {inside[n]} = parameters[{n!r}]" for n in parameters]
    unpack += [f"    {inside[n]} = state[{k}]" for k, n in enumerate(names)]
    unpack += [f"    {inside[n]} = {code(law)}" for n, law in smooth.forcing.items()]
    rows = [f"            {code(smooth.rates[n])}," for n in names]
    matrix = jacobian(smooth.rates, names)
    entries = [f"            [{', '.join(map(code, matrix.row(k)))}]," for k in range(len(names))]
    functions = [f"            {code(i.function)}," for i in model.interfaces.values()]
    blocks = [
        f'"""{comment_text(", ".join(names))}, region {comment_text(region)}."""',
        "import math\n\nimport numpy" if used else "import numpy",
        f"STATES = {tuple(names)!r}\nSTART = {tuple(initial.values())!r}\n"
        f"PARAMETERS = {parameters!r}\nSIGNS = {dict(smooth.signs)!r}",
        *(f"{name} = numpy.vectorize(math.{name}, otypes=[float])" for name in sorted(used)),
        *(_helper(name, str(_printer().doprint(e))) for name, e in helpers.used.items()),
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


def _printer() -> NumPyPrinter:
    return NumPyPrinter(
        {
            "fully_qualified_modules": True,
            "allow_unknown_functions": True,
            "user_functions": {f.__name__: one.named("numpy") for f, one in ELEMENTARY.items()},
        }
    )


@lru_cache(CODES_KEPT)
def _code(
    expression: sp.Expr, place: tuple[tuple[sp.Symbol, sp.Symbol], ...]
) -> tuple[str, frozenset[str], dict[str, sp.Piecewise]]:
    """Code of an expression, which many regions share, with the functions that it needs.

    These are the names of functions that NumPy lacks, and the quotients that the module defines.
    """
    written, helpers = supported(expression, "numpy", clocks=True).xreplace(dict(place)), Helpers()
    lacking = frozenset(f.func.__name__ for f in written.atoms(*_LACKING))
    return str(_printer().doprint(helpers.called(written))), lacking, helpers.used


def _helper(name: str, code: str) -> str:
    return "\n".join(
        [
            f"def {name}(y):",
            '    """A quotient with a removable singularity, by its series near there."""',
            '    with numpy.errstate(all="ignore"):',
            f"        return {code}",
        ]
    )


def _function(name: str, doc: str, unpack: list[str], rows: list[str]) -> str:
    head = [f"def {name}(t, state, parameters=PARAMETERS):", f'    """{doc}"""', *unpack]
    body = ["    return numpy.array(", "        [", *rows, "        ],"]
    return "\n".join([*head, *body, "        dtype=float,", "    )"])
