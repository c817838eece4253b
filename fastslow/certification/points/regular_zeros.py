"""Regular zeros of square systems, proved by Krawczyk's operator in ball arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fastslow.certification.points.balls import ball_function, flint
from fastslow.certification.points.defining import Defined
from fastslow.model.differentiation import derivative

#: Iterations of Newton's method at the midpoints, and enlargements of the box in a proof.
ZERO_ITERATIONS, ENLARGED = 60, 12

#: Distance of the starting values from the zero, in units of 1 or of the modulus of each unknown
#: if that is larger: it is due to rounding, and the largest one within the box of uniqueness.
START_ROUNDING, FARTHEST_START = 2.0**-40, 1e-6


class UnprovedError(Exception):
    """There is no proved zero near the starting values; the message is the reason."""


@dataclass(frozen=True, eq=False)
class ProvedZero:
    """A proved zero.

    Parameters
    ----------
    position : list of arb
        States and parameters.
    unknowns : list of arb
        All unknowns of the system.
    unique : float
        The zero is the only one within this distance in every unknown, in units of 1 or of the
        modulus of the unknown if that is larger; 0 if this is not decided.
    """

    position: list[Any]
    unknowns: list[Any]
    unique: float


def proved_zero(defined: Defined) -> ProvedZero:
    """Prove that a system has a regular zero near its starting values, and only one.

    Raises
    ------
    UnprovedError
    """
    arb, matrix = flint().arb, flint().arb_mat
    precision = flint().ctx.prec
    whole = defined.whole
    unknowns, rows = whole.unknowns, whole.rows
    size = len(unknowns)
    values = ball_function(rows, unknowns)
    slopes = ball_function([derivative(r, u) for r in rows for u in unknowns], unknowns)
    tolerance = arb(2) ** (8 - precision)

    def inverse(at: Sequence[Any]) -> Any:
        return matrix(
            size, size, [a.mid() for a in matrix(size, size, slopes(at)).mid().inv().entries()]
        )

    middle = _solution(defined, values, inverse, tolerance)
    first = inverse(middle)
    start = matrix(size, 1, middle) - first * matrix(size, 1, values(middle))
    identity = matrix(size, size, [int(i == j) for i in range(size) for j in range(size)])

    def image(radii: Sequence[Any]) -> tuple[bool, list[Any]]:
        box = [m + arb(0, r.abs_upper()) for m, r in zip(middle, radii, strict=True)]
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
        raise _singular(defined)
    if any(b.contains(0) for s, b in zip(unknowns, balls, strict=True) if s in whole.nonzero):
        raise _singular(defined)
    unique = 0.0
    for exponent in range(-precision // 3, 3):
        scale = arb(2) ** exponent
        try:
            inside, _ = image([scale * max(arb(1), abs(m), key=float) for m in middle])
        except ZeroDivisionError:
            break
        if not inside:
            break
        unique = 2.0**exponent
    found = ProvedZero(ball_function(defined.position, unknowns)(balls), balls, unique)
    _require_near(defined, found)
    return found


def _singular(defined: Defined) -> UnprovedError:
    return UnprovedError(f"its defining system is singular or nearly so: {defined.singular()}")


def _solution(defined: Defined, values: Any, inverse: Any, tolerance: Any) -> list[Any]:
    """Solve by Newton's method at midpoints."""
    matrix = flint().arb_mat
    middle = [flint().arb(float(s)) for s in defined.whole.start]
    for _ in range(ZERO_ITERATIONS):
        try:
            step = (inverse(middle) * matrix(len(middle), 1, values(middle))).entries()
        except ZeroDivisionError:
            raise _singular(defined) from None
        middle = [(m - s).mid() for m, s in zip(middle, step, strict=True)]
        if not all(m.is_finite() for m in middle):
            break
        if all(abs(s).mid() < tolerance * (1 + abs(m)) for m, s in zip(middle, step, strict=True)):
            return middle
    raise UnprovedError(
        "Newton's method for its defining system does not converge from it: the point is not "
        f"accurate, or {_singular(defined)}"
    )


def _require_near(defined: Defined, found: ProvedZero) -> None:
    """Raise UnprovedError for a zero that is not the one near the starting values."""
    whole = defined.whole
    located = set().union(*(e.free_symbols for e in defined.position))
    reach = max(min(found.unique, FARTHEST_START), START_ROUNDING)
    for symbol, start, ball in zip(whole.unknowns, whole.start, found.unknowns, strict=True):
        if symbol in located:
            value = float(ball.mid())
            if abs(value - start) > reach * max(1.0, abs(value)):
                raise UnprovedError(
                    f"the proved solution next to it has {symbol} = {value:.6g} instead of "
                    f"{start:.6g}: the point is not accurate, or of another model"
                )
