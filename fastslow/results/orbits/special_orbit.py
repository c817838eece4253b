"""Special points of branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, formula, text, validated, word
from fastslow.results.base.html import Cells
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import ResultTable
from fastslow.results.base.upper_layers import computed
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.point_types import (
    CANDIDATE,
    POINT_TYPES,
    PointType,
    kind_of,
    turns,
)


@dataclass(frozen=True, eq=False, repr=False)
class SpecialOrbit(Result):
    """A located special point of a branch of periodic orbits.

    ``point["W"]`` is a parameter, ``point["max(x)"]`` a number of its orbit.

    Parameters
    ----------
    code : str
        LPC, PD, TR, BPC, GR and the sliding codes, CC, HC, UZ (see
        ``fastslow.results.point_types``).
    label : str
        The code with a number that is unique on the branch, such as ``"LPC1"``.
    parameter : str
        The parameter of the branch.
    orbit : Orbit
        For a contact with an interface, without the touch; for CC with the multipliers of the
        side on which the branch was begun; for HC the homoclinic orbit, of infinite period.
    residual, accuracy : float
        Of the extended system: largest residual, and size of the last Newton correction.
    converged : bool
        Whether the defining equations were solved to rounding.
    angle : float
        Argument θ of the critical multipliers e^{±iθ} of TR, else NaN.
    time : float
        Time of the contact with an interface, or of the corner collision, else NaN.
    state : ndarray, shape (n,) or (0,)
        State at the contact.
    interface : str
        Of a corner collision all that meet there; ``"instant"`` is one of a clock or a table.
    curvature : float
        Second derivative of the interface function along the orbit at the contact.
    exponent : float
        Of the leading singular term of the return map at a contact or a corner: 1/2, 3/2, 1, …; at
        a corner 1 where the multipliers jump, else 2 (or higher); 0 for a map that is
        discontinuous, NaN without contact, and where several events meet.
    type : str
        ``"transition"`` or ``"non-smooth fold"`` for a contact or a corner at which the branch
        continues, or turns back in the parameter; ``"candidate"`` for LPC, PD, TR or BPC that the
        multipliers do not confirm to 10⁻⁶; ``"no change of sign"`` for an extremum of the
        expression of a mark that is zero to rounding.
    saddle : ndarray, shape (n,) or (0,)
        Equilibrium of a homoclinic orbit, HC.
    saddle_quantity : float
        Sum of the real parts of its unstable and its stable eigenvalue nearest to the imaginary
        axis: cycles nearby are stable if it is negative; NaN for other points.
    multipliers_beyond : ndarray of complex, shape (n,) or (0,)
        Of a corner collision the multipliers on the other side of it.
    deviation, rounding : float
        Of a candidate: distance of the nearest multiplier from that of the bifurcation (of the
        logarithms of the moduli), and the largest change of this distance that was measured when
        the orbit was perturbed by rounding. A candidate whose deviation is larger than that is
        unconfirmed for another reason. NaN for other points.
    mark, expression : str
        At a zero of an expression given in ``marks=``, its name, by which the point is labelled,
        and the expression.
    source : optional
        The equations of the point, for `fastslow.continue_points`; not saved to files.
    """

    code: str
    label: str
    parameter: str
    orbit: Orbit
    residual: float
    accuracy: float
    converged: bool
    angle: float = float("nan")
    time: float = float("nan")
    state: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    interface: str = ""
    curvature: float = float("nan")
    exponent: float = float("nan")
    type: str = ""
    saddle: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    saddle_quantity: float = float("nan")
    multipliers_beyond: NDArray[np.complex128] = field(
        default_factory=lambda: np.empty(0, dtype=complex)
    )
    deviation: float = float("nan")
    rounding: float = float("nan")
    mark: str = ""
    expression: str = ""
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers of the orbit."""
        return self.orbit.multipliers

    @property
    def parameters(self) -> Any:
        """All parameter values."""
        return self.orbit.parameters

    @property
    def kind(self) -> PointType:
        """What is common to all points of this code."""
        return kind_of(self.code)

    @property
    def stem(self) -> str:
        """The label without its number: the code, or the name of an expression."""
        return self.mark or self.code

    @property
    def title(self) -> str:
        """What all points of this stem are, for legends."""
        return f"{self.mark} ({self.expression} = 0)" if self.mark else self.kind.title

    @property
    def turns(self) -> bool:
        """True for a fold of cycles and a non-smooth fold, at which the branch turns."""
        return turns(self.code, self.type)

    @property
    def words(self) -> str:
        """Description: name of the code or the expression that vanishes, and the type."""
        name = f"zero of {self.expression}" if self.expression else self.kind.name
        return f"{self.type} ({name})" if self.type else name

    @validated(name=formula)
    def gradient(self, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of the point by another parameter than that of the branch.

        They are those along the curve of such points in the plane of both parameters.

        Parameters
        ----------
        name : str or Symbol

        Returns
        -------
        NamedMapping of float
            Of the parameter of the branch, and of the period of the orbit.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter.
        ArgumentError
            For a point read from a file, of a kind without a curve, or where the curve turns.
        """
        place = "fastslow.orbits.derivatives.orbit_gradients"
        found: NamedMapping[float] = computed(place, "gradient_of_point")(self, name)
        return found

    @validated(name=text)
    def __getitem__(self, name: str) -> Any:
        """Return a parameter by name, or a number of the orbit such as ``"max(x)"``."""
        if name in self.parameters:
            return self.parameters[name]
        return self.orbit[name]

    def __repr__(self) -> str:
        value = self.parameters[self.parameter]
        words = f"SpecialOrbit({self.label} {self.words}: {self.parameter} = {value:.10g}"
        if self.interface:
            met = "met" if self.kind.exchanging else "touched"
            words += f", {self.interface} {met} at t = {self.time:.6g}"
        if np.isfinite(self.saddle_quantity):
            words += f", saddle quantity {self.saddle_quantity:.6g}"
        if not self.converged:
            words += ", not converged"
        if self.type == CANDIDATE:
            words += (
                f", multiplier off by {self.deviation:.2g}, changed by {self.rounding:.2g} by "
                "rounding"
            )
        return words + f", period {self.orbit.period:.6g})"


class SpecialOrbits(ResultTable[SpecialOrbit]):
    """Special points in order along a branch of orbits; ``points("PD")`` selects a code."""

    def __call__(self, code: str | None = None) -> SpecialOrbits:
        """Select the points of one code, or of one name in ``marks=``; by default all.

        Raises
        ------
        UnknownNameError
            For an unknown code or name.
        """
        if code is None:
            return self
        self.check_code(code)
        return SpecialOrbits(point for point in self if code in (point.code, point.mark))

    def check_code(self, code: str) -> None:
        """Raise UnknownNameError for text that is neither a code nor a name of these points."""
        named = dict.fromkeys(point.mark for point in self if point.mark)
        word("special point code", [*POINT_TYPES, *named])("code", code)

    def _labelled(self) -> dict[str, SpecialOrbit]:
        return {point.label: point for point in self}

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"code": POINT_TYPES}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return label, code, mark, type, parameter, period, interface, time and accuracy."""
        name = self[0].parameter if len(self) else "parameter"
        columns: dict[str, NDArray[Any]] = {
            "label": np.array([p.label for p in self], dtype=str),
            "code": np.array([p.code for p in self], dtype=str),
            "mark": np.array([p.mark for p in self], dtype=str),
            "expression": np.array([p.expression for p in self], dtype=str),
            "type": np.array([p.type for p in self], dtype=str),
            name: np.array([p.parameters[p.parameter] for p in self], dtype=float),
            "period": np.array([p.orbit.period for p in self], dtype=float),
            "interface": np.array([p.interface for p in self], dtype=str),
            "time": np.array([p.time for p in self], dtype=float),
            "residual": np.array([p.residual for p in self], dtype=float),
            "accuracy": np.array([p.accuracy for p in self], dtype=float),
        }
        return columns

    def _cells(self) -> Cells:
        rows = [
            [
                p.label,
                p.words,
                f"{p.parameters[p.parameter]:.10g}",
                f"{p.orbit.period:.6g}",
                p.interface,
            ]
            for p in self
        ]
        name = self[0].parameter if len(self) else "parameter"
        return Cells(["point", "kind", name, "period", "interface"], rows)
