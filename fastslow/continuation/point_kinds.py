"""The kinds of special points: one object for a code, which knows what depends on it.

A record (`fastslow.results.point_types`) holds what results and figures need. A kind adds how such
points are found along a curve, located, confirmed and continued; the searches ask it and never
compare its code. Kinds of equilibria and of periodic orbits are subclasses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from fastslow.results.point_types import PointType, kind_of


@dataclass(frozen=True)
class PointKind:
    """What is known of the special points of one code.

    Parameters
    ----------
    record : PointType

    Examples
    --------
    >>> PointKind.of("LP").record.name
    'fold'
    """

    record: PointType

    @classmethod
    def of(cls, code: str) -> PointKind:
        """Return the kind of a code, with its record alone."""
        return cls(kind_of(code))

    def __hash__(self) -> int:
        # kinds are keys of tables
        return hash(self.record.code)

    #: Whether a curve that stays in its region ends at such a point.
    ends_curves: ClassVar[bool] = False

    #: Product of the pair of eigenvalues at such a point, where the kind determines it.
    squared: ClassVar[float | None] = None

    @property
    def code(self) -> str:
        return self.record.code

    @property
    def words(self) -> str:
        """What the test of such points is for, in sentences."""
        return self.code

    def absorbs(self, other: PointKind) -> bool:
        """Return whether a point of another kind at the same place is this one again."""
        return self == other

    def form(self, system: Any, found: Any) -> dict[str, Any]:
        """Return the normal form of a point of a curve, by entries of a special point.

        Parameters
        ----------
        system : System
            The equations of the curve.
        found : CurvePoint
        """
        return {}
