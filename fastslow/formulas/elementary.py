"""Elementary functions: one record for each, which all other modules refer to.

A record contains what formulas, generated code, figures and other programs need. SymPy provides
derivatives, from which Taylor recurrences follow. The enclosures of interval arithmetic, which are
compiled, are chosen in `fastslow.kernels.intervals.elementary`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False, kw_only=True)
class Elementary:
    """An elementary function.

    Parameters
    ----------
    name : str
        In SymPy and, if it is evaluated directly, in the C library, in ``math`` and in Fortran.
    values : callable
        Elementwise evaluation on arrays.
    arguments : int
        Number of arguments.
    code : str
        Template of its value in generated code.
    written : str
        Formula in u, and v for a second argument, for programs that lack the function, and for
        interval and ball arithmetic without it.
    domain : str
        Formula in u that is positive inside its domain; empty if it has no edge.
    poles : str
        Formula in u that vanishes at its poles; empty if it has none.
    inverse : str
        Name of the inverse of an injective function, on its range.
    image : str
        Formula in u that is positive inside its range, where that is not the domain of the
        inverse.
    names : mapping
        Its names in other programs, ``"auto"`` and ``"xpp"``, where they differ; empty where the
        program lacks the function.
    in_tex : bool
        Whether its name is a command of TeX.
    bound : str
        Least upper bound of its modulus at real arguments; empty if it is not bounded.
    saturated : float
        Size of its argument beyond which the function, or its reciprocal, differs from a constant
        by rounding.
    """

    name: str
    values: Callable[..., Any]
    arguments: int = 1
    code: str = ""
    written: str = ""
    domain: str = ""
    poles: str = ""
    inverse: str = ""
    image: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    in_tex: bool = False
    bound: str = ""
    saturated: float = math.inf

    @property
    def direct(self) -> bool:
        """Whether generated code calls it by its own name."""
        return not self.code

    @property
    def template(self) -> str:
        """Source of its value in generated code, with a place for each argument."""
        return self.code or f"math.{self.name}({', '.join(['{}'] * self.arguments)})"

    @property
    def in_numpy(self) -> str:
        """Name in NumPy, empty if NumPy lacks the function."""
        return self.values.__name__ if isinstance(self.values, np.ufunc) else ""

    def named(self, program: str) -> str:
        """Name in another program, empty if that lacks the function.

        Functions of the C library that NumPy lacks are called by it element by element.
        """
        own = self.name if self.direct else ""
        if program == "numpy" and self.in_numpy:
            own = f"numpy.{self.in_numpy}"
        return self.names.get(program, own)


def _reciprocal(name: str, base: Elementary, *, poles: str, in_tex: bool = False) -> Elementary:
    """Record of 1/f(u)."""
    return Elementary(
        name=name,
        values=lambda x: 1.0 / base.values(x),
        code=f"1.0 / {base.template}",
        written=f"1/{base.name}(u)",
        poles=poles,
        in_tex=in_tex,
    )


def _of_reciprocal(name: str, base: Elementary, *, domain: str) -> Elementary:
    """Record of f(1/u)."""
    return Elementary(
        name=name,
        values=lambda x: base.values(1.0 / x),
        code=base.template.format("1.0 / ({})"),
        written=f"{base.name}(1/u)",
        domain=domain,
    )


def _by_elements(function: Callable[[float], float]) -> Callable[..., Any]:
    """Elementwise evaluation of a function that NumPy lacks."""
    return np.vectorize(function, otypes=[float])


#: Where exp(−u) and exp(−u²) are 1e-13.
_EXPONENTIAL, _GAUSSIAN = 30.0, 5.5

_SIN = Elementary(name="sin", values=np.sin, in_tex=True, bound="1")
_COS = Elementary(name="cos", values=np.cos, in_tex=True, bound="1")
_TAN = Elementary(name="tan", values=np.tan, poles="cos(u)", in_tex=True)
_ASIN = Elementary(
    name="asin", values=np.arcsin, domain="1 - u**2", inverse="sin", image="pi**2/4 - u**2"
)
_ACOS = Elementary(
    name="acos",
    values=np.arccos,
    written="pi/2 - asin(u)",
    domain="1 - u**2",
    inverse="cos",
    image="u*(pi - u)",
)
_ATAN = Elementary(
    name="atan", values=np.arctan, inverse="tan", image="pi**2/4 - u**2", bound="pi/2"
)
_SINH = Elementary(
    name="sinh", values=np.sinh, inverse="asinh", in_tex=True, saturated=_EXPONENTIAL
)
_COSH = Elementary(name="cosh", values=np.cosh, in_tex=True, saturated=_EXPONENTIAL)
_TANH = Elementary(
    name="tanh", values=np.tanh, inverse="atanh", in_tex=True, bound="1", saturated=_EXPONENTIAL
)
_ASINH = Elementary(
    name="asinh",
    values=np.arcsinh,
    written="sign(u)*log(abs(u) + sqrt(u**2 + 1))",
    inverse="sinh",
    names={"xpp": ""},
)
_ACOSH = Elementary(
    name="acosh",
    values=np.arccosh,
    written="log(u + sqrt(u - 1)*sqrt(u + 1))",
    domain="u - 1",
    inverse="cosh",
    image="u",
    names={"xpp": ""},
)
_ATANH = Elementary(
    name="atanh",
    values=np.arctanh,
    written="log((1 + u)/(1 - u))/2",
    domain="1 - u**2",
    inverse="tanh",
    names={"xpp": ""},
)

_ALL = (
    Elementary(name="exp", values=np.exp, inverse="log", in_tex=True, saturated=_EXPONENTIAL),
    Elementary(
        name="log", values=np.log, domain="u", inverse="exp", names={"xpp": "ln"}, in_tex=True
    ),
    _SIN,
    _COS,
    _TAN,
    _reciprocal("cot", _TAN, poles="sin(u)", in_tex=True),
    _reciprocal("sec", _COS, poles="cos(u)", in_tex=True),
    _reciprocal("csc", _SIN, poles="sin(u)", in_tex=True),
    _ASIN,
    _ACOS,
    _ATAN,
    _of_reciprocal("acot", _ATAN, domain="u"),
    _of_reciprocal("asec", _ACOS, domain="u**2 - 1"),
    _of_reciprocal("acsc", _ASIN, domain="u**2 - 1"),
    Elementary(name="atan2", values=np.arctan2, arguments=2),
    _SINH,
    _COSH,
    _TANH,
    _reciprocal("coth", _TANH, poles="sinh(u)", in_tex=True),
    _reciprocal("sech", _COSH, poles=""),
    _reciprocal("csch", _SINH, poles="sinh(u)"),
    _ASINH,
    _ACOSH,
    _ATANH,
    _of_reciprocal("acoth", _ATANH, domain="u**2 - 1"),
    _of_reciprocal("asech", _ACOSH, domain="u*(1 - u)"),
    _of_reciprocal("acsch", _ASINH, domain="u"),
    Elementary(
        name="erf",
        values=_by_elements(math.erf),
        inverse="erfinv",
        image="1 - u**2",
        bound="1",
        saturated=_GAUSSIAN,
    ),
    Elementary(
        name="erfc",
        values=_by_elements(math.erfc),
        inverse="erfcinv",
        image="u*(2 - u)",
        saturated=_GAUSSIAN,
    ),
)

#: All elementary functions by their names in SymPy.
ELEMENTARY: Mapping[str, Elementary] = {one.name: one for one in _ALL}
