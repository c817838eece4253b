"""Equilibria and special points."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import Name, formula, validated, word
from fastslow.errors import unknown_name
from fastslow.results.base.html import Cells
from fastslow.results.base.immutable import Immutable
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.table import ResultTable
from fastslow.results.base.upper_layers import computed
from fastslow.results.enclosures import Enclosure
from fastslow.results.point_types import POINT_TYPES, PointType, kind_of, turns
from fastslow.results.stored.operations import AT_REST, AT_TWO_FOLD
from fastslow.results.stored.switch_state_names import CHANGES

#: Where derivatives of points are computed.
GRADIENTS = "fastslow.diagrams.curves.point_gradients"

#: A real part below this fraction of the largest modulus counts as zero.
NEUTRAL_REAL_PART = 1e-10

#: Stability and type with an eigenvalue that is not known.
UNDECIDED = "undecided"

#: The words for the stability of equilibria.
STABILITIES = ("stable", "unstable", "neutral", UNDECIDED)


def stability_of(eigenvalues: NDArray[np.complex128]) -> NDArray[np.str_]:
    """Return the linear stability for eigenvalues of shape (..., n).

    Neutral means that no real part is positive and at least one vanishes to
    rounding, so that the linearisation does not decide. An infinite eigenvalue
    (transverse to the interface at a pseudo-equilibrium) counts by its sign. With NaN, as at
    an intersection of interfaces whose attraction is not decided, the stability is undecided
    unless another real part is positive.

    Examples
    --------
    >>> stability_of(np.array([[-1.0, -2.0], [0.0, -1.0], [1.0, -1.0]])).tolist()
    ['stable', 'neutral', 'unstable']
    >>> stability_of(np.array([[-1.0, -np.inf], [-1.0, np.inf]])).tolist()
    ['stable', 'unstable']
    >>> stability_of(np.array([[-1.0, np.nan], [1.0, np.nan]])).tolist()
    ['undecided', 'unstable']
    """
    values = np.asarray(eigenvalues)
    size = np.where(np.isinf(values.real), 0.0, np.abs(values))
    small = NEUTRAL_REAL_PART * np.fmax.reduce(size, axis=-1)
    known, largest = np.fmax.reduce(values.real, axis=-1), values.real.max(axis=-1)
    otherwise = np.where(np.isnan(largest), UNDECIDED, "neutral")
    return np.where(largest < -small, "stable", np.where(known > small, "unstable", otherwise))


def type_of(eigenvalues: ArrayLike) -> str:
    """Return the type of an equilibrium: node, focus, saddle, saddle-focus or non-hyperbolic.

    It is undecided if an eigenvalue is NaN (see `stability_of`). For n > 2 the leading
    eigenvalue, the one nearest to the imaginary axis, decides between node and focus. With an
    infinite eigenvalue, which counts by its sign, the type is pseudo-node and so on (Kuznetsov,
    Rinaldi and Gragnani 2003).

    Examples
    --------
    >>> type_of([-1, -2]), type_of([-1 + 2j, -1 - 2j]), type_of([1, -1])
    ('node', 'focus', 'saddle')
    >>> type_of([-1, -np.inf]), type_of([1, -np.inf]), type_of([-np.inf])
    ('pseudo-node', 'pseudo-saddle', 'pseudo-node')
    """
    values = np.asarray(eigenvalues, dtype=complex)
    if np.isnan(values).any():
        return UNDECIDED
    infinite = np.isinf(values.real)
    scale = float(np.abs(values[~infinite]).max(initial=0.0))
    if np.any(np.abs(values.real) <= NEUTRAL_REAL_PART * scale):
        return "non-hyperbolic"
    if np.count_nonzero(infinite & (values.real > 0)) > 1:
        return "pseudo-equilibrium"
    pseudo = "pseudo-" if infinite.any() else ""
    complex_pairs = np.abs(values.imag) > 1e-8 * scale
    if np.any(values.real > 0) and np.any(values.real < 0):
        return f"{pseudo}saddle-focus" if complex_pairs.any() else f"{pseudo}saddle"
    leading = int(np.argmin(np.abs(values.real)))
    return f"{pseudo}focus" if complex_pairs[leading] else f"{pseudo}node"


def linear_words(stability: str, kind: str) -> str:
    """Return stability and type of an equilibrium as text, without what follows from the other.

    Examples
    --------
    >>> linear_words("stable", "focus"), linear_words("neutral", "non-hyperbolic")
    ('stable focus', 'non-hyperbolic')
    """
    if kind == "non-hyperbolic":
        return kind
    return stability if kind in ("unknown", UNDECIDED) else f"{stability} {kind}"


class _Point(Result):
    """Base class of points, with access to states and parameters by name."""

    states: tuple[str, ...]
    state: NDArray[np.float64]
    parameters: Mapping[str, float]

    def __getitem__(self, name: object) -> float:
        key = str(name)
        if key in self.states:
            return float(self.state[self.states.index(key)])
        if key in self.parameters:
            return self.parameters[key]
        raise unknown_name("state or parameter", key, [*self.states, *self.parameters])

    def _values(self) -> str:
        return ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.states, self.state, strict=True))


def coordinates(points: Sequence[_Point]) -> dict[str, NDArray[np.float64]]:
    """Return states, then parameters, of points as columns; NaN where a point has none."""
    names = dict.fromkeys(n for p in points for n in p.states)
    names |= dict.fromkeys(n for p in points for n in p.parameters)
    return {
        n: np.array([p[n] if n in p.states or n in p.parameters else np.nan for p in points])
        for n in names
    }


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(_Point):
    """An equilibrium of a frozen model in one region.

    Parameters
    ----------
    states : tuple of str
        State names.
    state : ndarray, shape (n,)
        The equilibrium.
    parameters : mapping
        All parameter values.
    region : str
        The region whose vector field vanishes; ``"S1|S2"`` for the sliding field
        between two (a pseudo-equilibrium), ``"S1|S2 (escaping)"`` if both vector
        fields point away from the interface, ``"S1 at rest on x = sigma"`` held against
        the wall of a reset.
    admissible : bool
        True for a point in the closure of that region, False for a virtual one. Held against
        a wall, true if the contact force is not negative.
    eigenvalues : ndarray of complex, shape (n,)
        Of the Jacobian in the region. For a pseudo-equilibrium those of the sliding
        field along the interface, followed by −∞ (+∞ in an escaping region). Held against
        walls those of the constrained motion, followed by −∞ twice for every wall, for impacts
        that dissipate.
    residual : float
        Largest modulus of the rates at the point.
    continuum : bool
        True for a point of a continuum of equilibria, which is not isolated.
    interpolated : bool
        True for a point interpolated between rows instead of solved for.
    known_stability : str, optional
        The stability where the eigenvalues are unknown, as in files of AUTO-07p.
    contact_forces : mapping
        Of an equilibrium held against walls, each wall to λ ≥ 0 in f + Wλ = 0, where ∇h'·W = −1
        if h > 0 is beyond the wall: the acceleration into the wall without this contact.
    source : object, optional
        The frozen model, for `gradient`; not saved to files.
    """

    states: tuple[str, ...]
    state: NDArray[np.float64]
    parameters: Mapping[str, float]
    region: str
    admissible: bool
    eigenvalues: NDArray[np.complex128]
    residual: float = 0.0
    continuum: bool = False
    interpolated: bool = False
    known_stability: str | None = None
    contact_forces: Mapping[str, float] = field(default_factory=dict)
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @validated(name=formula)
    def gradient(self, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of the states with respect to a parameter, du/dp = −F_u⁻¹ F_p.

        Parameters
        ----------
        name : str or Symbol
            A parameter of the frozen model.

        Returns
        -------
        NamedMapping of float

        Raises
        ------
        UnknownNameError
            For a name that is no parameter.
        ArgumentError
            For a point read from a file, or where the Jacobian is singular.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, p, q = sp.symbols("x p q")
        >>> model = fs.Model({x: p - q * x}, parameters={p: 1, q: 2})
        >>> fs.equilibria(model)[0].gradient("q")["x"]
        -0.25
        """
        found: NamedMapping[float] = computed(GRADIENTS, "gradient_of")(self, name)
        return found

    @property
    def stability(self) -> str:
        """``"stable"``, ``"unstable"``, ``"neutral"`` or ``"undecided"``."""
        return self.known_stability or str(stability_of(self.eigenvalues))

    @property
    def stable(self) -> bool:
        return self.stability == "stable"

    @property
    def pseudo(self) -> bool:
        """True for a pseudo-equilibrium, an equilibrium of a sliding field or at a two-fold."""
        return self.at_two_fold or (not self.held and bool(np.isinf(self.eigenvalues.real).any()))

    @property
    def at_two_fold(self) -> bool:
        """True at the two-fold of an interface that is crossed at equal normal speeds.

        A convex combination of both fields is zero there, without a sliding motion nearby.
        """
        return self.region.endswith(AT_TWO_FOLD)

    @property
    def held(self) -> bool:
        """True for an equilibrium held against the walls of resets."""
        return AT_REST in self.region

    @property
    def type(self) -> str:
        """Node, focus, saddle, saddle-focus (pseudo-node, …), non-hyperbolic or undecided.

        At a two-fold, fused focus (Kuznetsov, Rinaldi and Gragnani 2003) or pseudo-saddle. It is
        unknown with eigenvalues that are not in a file. Held against walls, the type is
        that of the constrained motion.
        """
        if self.known_stability is not None and np.isnan(self.eigenvalues).any():
            return "unknown"
        found = type_of(self.eigenvalues)
        if self.at_two_fold:
            # motions turn around it, faster and faster
            found = {"node": "fused focus"}.get(found, found)
        return found.removeprefix("pseudo-") if self.held else found

    def __repr__(self) -> str:
        kind = linear_words(self.stability, self.type)
        location = "in" if self.admissible else "virtual, of"
        more = ", one of a continuum" if self.continuum else ""
        more += ", interpolated" if self.interpolated else ""
        return f"Equilibrium({self._values()}; {location} {self.region}; {kind}{more})"


class Corrector(Protocol):
    """Solves for equilibria near given states, at values of the parameter of a diagram."""

    def __call__(
        self, region: str, state: NDArray[np.float64], value: float, /
    ) -> Equilibrium | None:
        """Return the equilibrium of a region near a state, None without convergence."""

    def many(
        self, region: str, states: NDArray[np.float64], values: NDArray[np.float64], /
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Return equilibria and their eigenvalues, each (N, n), NaN without convergence."""


@dataclass(frozen=True, eq=False, repr=False)
class ClarkePath(Immutable):
    """The convex path q J₁ + (1 − q) J₂ between the Jacobians at a boundary equilibrium.

    The eigenvalues along this path determine the bifurcation of a continuous
    piecewise-smooth system at the interface (Leine and Nijmeijer 2004).

    Parameters
    ----------
    regions : tuple of str
        ``q = 1`` is ``regions[0]``, the region where the interface function is positive; the
        nonsingular region if the other one is singular.
    jacobians : ndarray, shape (2, n, n)
        J₁ and J₂.

    Examples
    --------
    >>> path = ClarkePath(("S1", "S2"), np.array([[[1.0]], [[-3.0]]]))
    >>> round(path.q_zero, 12)
    0.75
    """

    regions: tuple[str, str]
    jacobians: NDArray[np.float64]

    @property
    def determinants(self) -> tuple[float, float]:
        first, second = np.linalg.det(self.jacobians)
        return float(first), float(second)

    @property
    def q_zero(self) -> float | None:
        """The q in (0, 1) at which the determinant changes sign, None if there is none."""
        first, second = self.determinants
        if first * second >= 0:
            return None
        return second / (second - first)

    @property
    def q_hopf(self) -> float | None:
        """The q in (0, 1) with zero trace and positive determinant, for planar systems."""
        if self.jacobians.shape[-1] != 2:
            return None
        first, second = np.trace(self.jacobians, axis1=1, axis2=2)
        if first * second >= 0:
            return None
        q = float(second / (second - first))
        return q if float(np.linalg.det(self._matrix(q))) > 0 else None

    def _matrix(self, q: ArrayLike) -> NDArray[np.float64]:
        weight = np.asarray(q, dtype=float)[..., None, None]
        return weight * self.jacobians[0] + (1.0 - weight) * self.jacobians[1]

    def path(self, q: ArrayLike) -> NDArray[np.complex128]:
        """Return the eigenvalues along the path, shape (..., n) for q of shape (...)."""
        return np.linalg.eigvals(self._matrix(q)).astype(complex)


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint(_Point):
    """A located special point of a branch: its type, its properties and its accuracy.

    Parameters
    ----------
    code : str
        LP, HB, BP, NSD, BE, TF, UZ or EP; on a curve of such points CP, BT, GH, ZH,
        HH, BF or BH, of periodic orbits CPC, GPD, … (see ``fastslow.results.point_types``).
    label : str
        The code with a number that is unique in the diagram, such as ``"BE2"``.
    states, state, parameters
        As for an equilibrium.
    regions : tuple of str
        The region of the point; for a boundary equilibrium the two adjacent regions.
    eigenvalues : ndarray of complex, shape (n,)
        Of the Jacobian in ``regions[0]``.
    tangent : ndarray, shape (n + 1,)
        Unit tangent of the branch, (states, parameter), in the direction of tracing;
        on a curve of points (states, two parameters), shape (n + 2,).
    residual : float
        Largest residual of the defining equations.
    converged : bool
        Whether the defining equations were solved to rounding.
    interface : str, optional
        The interface of a boundary equilibrium.
    type : str, optional
        For a boundary equilibrium ``"persistence"``, ``"non-smooth fold"`` or
        ``"degenerate"``; ``"candidate"`` for a branch point that is not decided: within rounding
        two curves may intersect or pass each other; for ZH and HH the case of the normal form;
        for an end point the code of an unsuccessful outcome of the branch.
    clarke : ClarkePath, optional
        For boundary equilibria of a continuous vector field.
    coefficient : float, optional
        Normal-form coefficient: for a fold a in y' = β + a y² (Kuznetsov 2004, eq.
        5.26), for a cusp c in y' = β₁ + β₂ y + c y³ (eq. 8.131), both with a null
        vector of length one.
    frequency : float, optional
        Angular frequency at a Hopf point; at a double Hopf point that of the second
        pair, which does not define the curve.
    lyapunov : float, optional
        First Lyapunov coefficient l₁ of a Hopf point (Kuznetsov 2004, eq. 5.34),
        with an eigenvector of length one.
    normal_form : mapping
        Coefficients on the center manifold of a codimension-two point, for eigenvectors
        of length one (Kuznetsov 2004, sections 8.3 to 8.7): a and b of BT, l2 of GH, s,
        theta and E of ZH, p11, p12, p21, p22, theta and delta of HH. Of the return map of
        periodic orbits: c of CPC, a, b and e of LPPD, a and b of R1, C and D of R2, b of R3,
        A_re and A_im of R4. Undefined ones are omitted and listed in ``degeneracy``.
    degeneracy : str
        The undefined coefficients of the normal form, with the reason.
    switch : ndarray, shape (n + 1,), optional
        At a branch point, the unit tangent of the other branch.
    accuracy : float, optional
        Last Newton correction in units of the branch's scales, an estimate of the error.
    admissible : bool
        False for a virtual point, outside its region.
    note : str
        Further information, e.g. the reason for an end point.
    enclosure : Enclosure, optional
        Bounds between which `prove` has proved the point to exist.
    mark, expression : str
        At a zero of an expression given in ``marks=``, its name, by which the point is labelled,
        and the expression.
    source : object, optional
        The frozen model and units of its states, for `continue_points`; not saved to files.
    """

    code: str
    label: str
    states: tuple[str, ...]
    state: NDArray[np.float64]
    parameters: Mapping[str, float]
    regions: tuple[str, ...]
    eigenvalues: NDArray[np.complex128]
    tangent: NDArray[np.float64]
    residual: float
    converged: bool
    interface: str | None = None
    type: str | None = None
    clarke: ClarkePath | None = field(default=None, repr=False)
    coefficient: float | None = None
    frequency: float | None = None
    lyapunov: float | None = None
    normal_form: Mapping[str, float] = field(default_factory=dict)
    degeneracy: str = ""
    switch: NDArray[np.float64] | None = field(default=None, repr=False)
    accuracy: float | None = None
    admissible: bool = True
    note: str = ""
    enclosure: Enclosure | None = None
    mark: str = ""
    expression: str = ""
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @validated(name=formula)
    def gradient(self, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of the point by another parameter than that of the diagram.

        They are those along the curve of such points in the plane of both parameters: for a fold
        in p, with left null vector ψ, dp/dq = −(ψᵀF_q)/(ψᵀF_p).

        Parameters
        ----------
        name : str or Symbol

        Returns
        -------
        NamedMapping of float
            Of the states, and of the parameter of the diagram.

        Raises
        ------
        UnknownNameError
            For a name that is no parameter.
        ArgumentError
            For a point read from a file, of a kind that has no curve (a codimension-two point,
            an end), or where the curve turns.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, p, q = sp.symbols("x p q")
        >>> model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 3})
        >>> fold = fs.continue_equilibria(model, "p", (-3, 3)).folds[0]
        >>> [round(abs(v), 8) for v in fold.gradient("q").values()]  # p = 2 (q/3)^(3/2)
        [0.16666667, 1.0]
        """
        found: NamedMapping[float] = computed(GRADIENTS, "gradient_of")(self, name)
        return found

    @property
    def kind(self) -> PointType:
        """What is common to all points of this code."""
        return kind_of(self.code)

    @property
    def stem(self) -> str:
        """The label without its number: the code, or the name of an expression."""
        return self.mark or self.code

    @property
    def curves(self) -> tuple[str, ...]:
        """Codes of the curves that can be continued from the point, the usual one first."""
        return (self.code,) if self.expression else self.kind.curves

    @property
    def title(self) -> str:
        """What all points of this stem are, for legends."""
        return f"{self.mark} ({self.expression} = 0)" if self.mark else self.kind.title

    @property
    def turns(self) -> bool:
        """True for a fold and a non-smooth fold, at which a branch turns in its parameter."""
        return turns(self.code, self.type)

    @property
    def at_wall(self) -> bool:
        """True for a boundary equilibrium at the wall of a reset."""
        return self.interface is not None and " = " in self.interface and not self.at_switch

    @property
    def at_switch(self) -> bool:
        """True for a boundary equilibrium at the threshold of a switch, where its branch ends."""
        return self.interface is not None and CHANGES in self.interface

    @property
    def criticality(self) -> str | None:
        """``"supercritical"`` (l₁ < 0), ``"subcritical"`` or ``"degenerate"``; for Hopf points."""
        if self.lyapunov is None:
            return None
        if self.lyapunov == 0:
            return "degenerate"
        return "supercritical" if self.lyapunov < 0 else "subcritical"

    @property
    def words(self) -> str:
        """The type of the point as text."""
        kind = f"zero of {self.expression}" if self.expression else self.kind.name
        if self.type or self.criticality:
            kind += f", {self.type or self.criticality}"
        if self.clarke is not None and self.clarke.q_hopf is not None:
            kind += " with Clarke-Hopf"
        if not self.converged:
            kind += ", not converged"
        return kind if self.admissible else f"virtual {kind}"

    @property
    def description(self) -> str:
        """The type and the coordinates of the point as text."""
        on = f" on {self.interface}" if self.interface else ""
        degenerate = f"; degenerate: {self.degeneracy}" if self.degeneracy else ""
        return f"{self.words}{on}; {self._values()}{degenerate}"

    def __repr__(self) -> str:
        return f"SpecialPoint({self.label}: {self.description})"


def by_title(points: Iterable[SpecialPoint]) -> dict[str, list[SpecialPoint]]:
    """Return points by their entry in a legend, in the order of legends.

    Points of a code that this version does not know are left out.
    """
    listed = list(points)
    found: dict[str, list[SpecialPoint]] = {}
    for code in POINT_TYPES:
        for point in listed:
            if point.code == code:
                found.setdefault(point.title, []).append(point)
    return found


class SpecialPoints(ResultTable[SpecialPoint]):
    """Special points in order along a branch or diagram, as a table.

    ``points("LP")`` selects one code, ``points["w"]`` is the column of a state or
    parameter, ``points[0]`` a point, and ``points["LP1"]`` the point with this label.

    Examples
    --------
    >>> SpecialPoints()("LP")
    0 special points
    """

    _row = "point"
    _entry = "special point"

    def __call__(self, code: str | None = None) -> SpecialPoints:
        """Select the points of one code, or of one name in ``marks=``; by default all.

        Raises
        ------
        UnknownNameError
            For an unknown code or name.
        """
        if code is None:
            return self
        self._check_code(code)
        return SpecialPoints(point for point in self if code in (point.code, point.mark))

    def _check_code(self, code: str) -> None:
        """Raise UnknownNameError for text that is neither a code nor a name of these points."""
        named = dict.fromkeys(point.mark for point in self if point.mark)
        word("special point code", [*POINT_TYPES, *named])("code", code)

    def _labelled(self) -> Mapping[str, SpecialPoint]:
        found: dict[str, SpecialPoint] = {}
        for point in self:
            found.setdefault(point.label, point)
        return found

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"code": POINT_TYPES}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return label, code, mark, type, interface, regions, states, parameters and accuracy."""
        columns: dict[str, NDArray[Any]] = {
            "label": np.array([p.label for p in self], dtype=str),
            "code": np.array([p.code for p in self], dtype=str),
            "mark": np.array([p.mark for p in self], dtype=str),
            "expression": np.array([p.expression for p in self], dtype=str),
            "type": np.array([p.type or p.criticality or "" for p in self], dtype=str),
            "interface": np.array([p.interface or "" for p in self], dtype=str),
            "regions": np.array(["|".join(p.regions) for p in self], dtype=str),
        }
        columns |= coordinates(self)
        for name in ("coefficient", "frequency", "lyapunov", "residual", "accuracy"):
            values = [getattr(p, name) for p in self]
            columns[name] = np.array([np.nan if v is None else v for v in values], dtype=float)
        columns["admissible"] = np.array([p.admissible for p in self], dtype=bool)
        columns["converged"] = np.array([p.converged for p in self], dtype=bool)
        return columns

    def _heading(self) -> str:
        return f"{len(self)} special point{'' if len(self) == 1 else 's'}"

    def _cells(self, varied: tuple[str, ...] = ()) -> Cells:
        """Return the table of type, coordinates and region.

        Without ``varied``, the parameters shown are those that differ between the points.
        """
        states = tuple(dict.fromkeys(n for p in self for n in p.states))
        values = [p.parameters for p in self]
        varied = varied or tuple(
            n
            for n in dict.fromkeys(n for v in values for n in v)
            if len({v.get(n) for v in values}) > 1 or len(values) == 1
        )
        rows = [
            [
                p.label,
                p.words,
                *(f"{p.parameters[n]:.6g}" if n in p.parameters else "" for n in varied),
                *(f"{p[n]:.6g}" if n in p.states else "" for n in states),
                " | ".join(p.regions),
                p.interface or "",
            ]
            for p in self
        ]
        return Cells(["point", "kind", *varied, *states, "region", "interface"], rows)
