"""Equilibria and special points, proved in ball arithmetic of any precision."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import instance, validated, whole
from fastslow.certification.balls import ball_function, flint
from fastslow.certification.equations import ExactEquations, exact_equations
from fastslow.errors import ArgumentError, MissingPackageError, ModelError
from fastslow.model.model import Model
from fastslow.results.branch.diagram import Diagram
from fastslow.results.enclosures import Enclosure
from fastslow.results.point_types import BOUNDARY_EQUILIBRIUM, FOLD, HOPF
from fastslow.results.points import SpecialPoint, SpecialPoints

#: Bits beyond the digits, for rounding, and of one digit.
MORE, PER_DIGIT = 32, math.log2(10)

#: The frequency of a Hopf point; not a valid symbol name.
OMEGA = sp.Symbol("(omega)", real=True)

#: Iterations of Newton's method at the midpoints, and enlargements of the box in a proof.
NEWTON, ENLARGED = 60, 12


@dataclass(frozen=True, eq=False)
class Defined:
    """A square system of equations that defines a point.

    Parameters
    ----------
    unknowns : tuple of Symbol
        States, then parameter, then others.
    rows : tuple of Expr
    start : ndarray
        Approximate solution.
    regular : str
        What the regularity of the system means.
    singular : str
        What a singular system means.
    """

    unknowns: tuple[sp.Symbol, ...]
    rows: tuple[sp.Expr, ...]
    start: NDArray[np.float64]
    regular: str
    singular: str


@validated(model=instance(Model), point=instance(SpecialPoint), digits=whole(1, 10_000))
def prove(model: Model, point: SpecialPoint, *, digits: int = 15) -> SpecialPoint:
    """Prove that a fold, a Hopf point or a boundary equilibrium exists, to any number of digits.

    The Krawczyk operator of the defining system in ball arithmetic (python-flint, extra
    ``certified``) maps a box around the point into its interior: the point exists, it is the only
    one in the box, and its defining system is regular. Folds solve F = 0, F_x v = 0, c·v = 1;
    Hopf points F = 0, F_x (a + ib) = iω (a + ib), c·a = 1, c·b = 0; boundary equilibria F = 0,
    h = 0 (Kuznetsov 2004, section 10.2). Parameter values are those of their binary numbers.

    Parameters
    ----------
    model : Model
        The frozen model of the point.
    point : SpecialPoint
        Of code LP, HB or BE.
    digits : int
        Number of digits of states and parameter.

    Returns
    -------
    SpecialPoint
        The point with its ``enclosure``.

    Raises
    ------
    ArgumentError
        For a point of another code, or one that is not regular.
    ModelError
        For functions without ball arithmetic.
    MissingPackageError
        If python-flint is not installed.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, p = sp.symbols("x p")
    >>> model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    >>> fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    >>> fs.prove(model, fold, digits=30).enclosure["p"]
    '0.384900179459750509672765853668'
    """
    name = _parameter_of(model, point)
    defined = _defined(_equations(model, point, name), point, name)
    module = flint()
    with module.ctx.workprec(int(digits * PER_DIGIT) + MORE):
        balls, unique = _proved(defined, digits, f"{point.label or point.code}")
        names = (*point.states, name)
        enclosure = _enclosure(names, balls[: len(names)], digits, unique, defined.regular)
    return replace(point, enclosure=enclosure)


def _parameter_of(model: Model, point: SpecialPoint) -> str:
    """The parameter of the diagram of a point: the one without a value in its model."""
    if point.states != model.states:
        raise ArgumentError(
            f"the point has the states {', '.join(point.states)} and the model "
            f"{', '.join(model.states)}; expected a point of this model"
        )
    source = getattr(point.source, "model", None)
    known = model.parameters if source is None else source.parameters
    free = [n for n, value in point.parameters.items() if known.get(n) != value]
    if len(free) != 1:
        raise ArgumentError(
            f"the parameters {', '.join(free) or '(none)'} of the point differ from those of the "
            "model; expected a point of a diagram over one parameter"
        )
    for name, value in point.parameters.items():
        if name not in free and model.parameters.get(name) != value:
            raise ArgumentError(
                f"the point has {name} = {value!r} and the model {model.parameters.get(name)!r}; "
                "expected a point of this model"
            )
    return free[0]


def with_enclosures(
    model: Model, diagram: Diagram
) -> tuple[Diagram, SpecialPoints, tuple[str, ...]]:
    """Return a diagram with proved special points, these, and what was not proved, with reasons."""
    wanted = [point for point in diagram.special() if point.code in _SYSTEMS]
    try:
        flint()
    except MissingPackageError as error:
        notes = (f"no special points are proved: {error}",) if wanted else ()
        return diagram, SpecialPoints(), notes
    branches, failed = [], []
    for branch in diagram.branches:
        points = []
        for point in branch.special:
            if point.code in _SYSTEMS:
                try:
                    point = prove(model, point)
                except (ArgumentError, ModelError) as error:
                    failed.append(f"{point.label} is not proved: {error}")
            points.append(point)
        branches.append(replace(branch, special=SpecialPoints(points)))
    proved = replace(diagram, branches=tuple(branches))
    found = SpecialPoints(p for p in proved.special if p.enclosure is not None)
    return proved, found, tuple(failed)


def _equations(model: Model, point: SpecialPoint, name: str) -> ExactEquations:
    """The exact equations of the region of a point."""
    region = point.regions[0].partition(" (")[0]
    for equations in exact_equations(model, name):
        if equations.region == region and not equations.slides:
            return equations
    raise ArgumentError(
        f"{point.label} is a point of {point.regions[0]}; expected a point of a region, whose "
        "equilibria are not on an interface"
    )


def _defined(equations: ExactEquations, point: SpecialPoint, name: str) -> Defined:
    """The defining system of a point."""
    build = _SYSTEMS.get(point.code)
    if build is None:
        raise ArgumentError(
            f"{point.label or 'the point'} has the code {point.code}; expected a point of code "
            f"{', '.join(_SYSTEMS)}"
        )
    return build(equations, point, np.append(point.state, point.parameters[name]))


def _jacobian(equations: ExactEquations, u: NDArray[np.float64]) -> Any:
    states = equations.unknowns[:-1]
    symbolic = sp.Matrix(equations.rows).jacobian(states)
    ball = ball_function(list(symbolic), equations.unknowns)([flint().arb(float(v)) for v in u])
    numbers = np.array([float(b.mid()) for b in ball]).reshape(symbolic.shape)
    return symbolic, numbers


def _vector(name: str, n: int) -> sp.Matrix:
    return sp.Matrix([sp.Symbol(f"({name}{k})", real=True) for k in range(n)])


def _fold(equations: ExactEquations, point: SpecialPoint, u: NDArray[np.float64]) -> Defined:
    symbolic, numbers = _jacobian(equations, u)
    n = len(numbers)
    sizes = np.linalg.norm(numbers, axis=1)
    right = np.linalg.svd(numbers / np.where(sizes > 0, sizes, 1.0)[:, None])[2][-1]
    v = _vector("v", n)
    length = sum(sp.Rational(float(c)) * v[k] for k, c in enumerate(right)) - 1
    return Defined(
        (*equations.unknowns, *v),
        (*equations.rows, *(symbolic * v), length),
        np.concatenate([u, right / (right @ right)]),
        "a quadratic fold",
        "the quadratic coefficient or the derivative by the parameter vanishes, as at a cusp or a "
        "branch point",
    )


def _hopf(equations: ExactEquations, point: SpecialPoint, u: NDArray[np.float64]) -> Defined:
    symbolic, numbers = _jacobian(equations, u)
    values, vectors = np.linalg.eig(numbers)
    upper = np.where(values.imag > 0, np.abs(values.real), np.inf)
    k = int(np.argmin(upper))
    vector = vectors[:, k]
    largest = int(np.argmax(np.abs(vector)))
    vector = vector / vector[largest]
    n = len(numbers)
    a, b = _vector("a", n), _vector("b", n)
    return Defined(
        (*equations.unknowns, *a, *b, OMEGA),
        (
            *equations.rows,
            *(symbolic * a + OMEGA * b),
            *(symbolic * b - OMEGA * a),
            a[largest] - 1,
            b[largest],
        ),
        np.concatenate([u, vector.real, vector.imag, [values[k].imag]]),
        "a simple pair of imaginary eigenvalues, which crosses the axis with non-zero speed",
        "the frequency vanishes, or the eigenvalues do not cross the imaginary axis transversally",
    )


def _boundary(equations: ExactEquations, point: SpecialPoint, u: NDArray[np.float64]) -> Defined:
    if point.interface not in equations.interfaces:
        raise ArgumentError(f"{point.label} has no interface '{point.interface}' in this model")
    height = equations.heights[equations.interfaces.index(point.interface)]
    return Defined(
        equations.unknowns,
        (*equations.rows, height),
        u,
        "the branch crosses the interface transversally",
        "the branch is tangent to the interface, or the equilibrium is not isolated",
    )


_System = Callable[[ExactEquations, SpecialPoint, NDArray[np.float64]], Defined]
_SYSTEMS: dict[str, _System] = {FOLD: _fold, HOPF: _hopf, BOUNDARY_EQUILIBRIUM: _boundary}


def _proved(defined: Defined, digits: int, label: str) -> tuple[list[Any], float]:
    """Return balls around the solution, and the size of a box in which it is unique."""
    module = flint()
    arb, matrix = module.arb, module.arb_mat
    unknowns = defined.unknowns
    size = len(unknowns)
    values = ball_function(defined.rows, unknowns)
    slopes = ball_function([r.diff(u) for r in defined.rows for u in unknowns], unknowns)
    wrong = ArgumentError(
        f"{label} cannot be proved: its defining system is singular or nearly so: "
        f"{defined.singular}"
    )

    def inverse(at: Sequence[Any]) -> Any:
        return matrix(
            size, size, [a.mid() for a in matrix(size, size, slopes(at)).mid().inv().entries()]
        )

    middle = [arb(float(s)) for s in defined.start]
    tolerance = arb(2) ** (8 - module.ctx.prec)
    try:
        for _ in range(NEWTON):
            step = (inverse(middle) * matrix(size, 1, values(middle))).entries()
            middle = [(m - s).mid() for m, s in zip(middle, step, strict=True)]
            if all(
                abs(s).mid() < tolerance * (1 + abs(m)) for m, s in zip(middle, step, strict=True)
            ):
                break
        first = inverse(middle)
    except ZeroDivisionError:
        raise wrong from None
    start = matrix(size, 1, middle) - first * matrix(size, 1, values(middle))

    def image(radii: Sequence[Any]) -> tuple[bool, list[Any]]:
        box = [m + arb(0, r.abs_upper()) for m, r in zip(middle, radii, strict=True)]
        identity = matrix(size, size, [int(i == j) for i in range(size) for j in range(size)])
        off = matrix(size, 1, [b - m for b, m in zip(box, middle, strict=True)])
        found = (start + (identity - first * matrix(size, size, slopes(box))) * off).entries()
        return all(b.contains_interior(k) for b, k in zip(box, found, strict=True)), found

    radii = [tolerance * (1 + abs(m)) for m in middle]
    for _ in range(ENLARGED):
        inside, balls = image(radii)
        if inside:
            break
        radii = [
            2 * abs(b - m) + tolerance * (1 + abs(m)) for b, m in zip(balls, middle, strict=True)
        ]
    else:
        raise wrong
    if unknowns[-1] == OMEGA and balls[-1].contains(0):
        raise wrong
    unique = 0.0
    for exponent in range(-module.ctx.prec // 3, 3):
        scale = arb(2) ** exponent
        try:
            inside, _ = image([scale * max(arb(1), abs(m), key=float) for m in middle])
        except ZeroDivisionError:
            break
        if not inside:
            break
        unique = 2.0**exponent
    return balls, unique


def _enclosure(
    names: Sequence[str], balls: Sequence[Any], digits: int, unique: float, regular: str
) -> Enclosure:
    low, high, decimals, accurate = {}, {}, {}, []
    for name, ball in zip(names, balls, strict=True):
        low[name] = _outside(ball, float(ball.lower()), -math.inf)
        high[name] = _outside(ball, float(ball.upper()), math.inf)
        zero = ball.contains(0)
        decimals[name] = "0" if zero else ball.str(digits, radius=False)
        if not zero:
            accurate.append(int(ball.rel_accuracy_bits() / PER_DIGIT))
    return Enclosure(low, high, decimals, min([digits, *accurate]), unique, regular)


def _outside(ball: Any, value: float, towards: float) -> float:
    """The floating-point number nearest to a value that is not inside a ball."""
    arb = flint().arb
    while not (arb(value) <= ball if towards < 0 else arb(value) >= ball):
        value = math.nextafter(value, towards)
    return value
