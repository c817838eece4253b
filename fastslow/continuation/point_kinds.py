"""The kinds of special points: one object for a code, which knows what depends on it.

A record (`fastslow.results.point_types`) holds what results and figures need. A kind adds how such
points are found along a curve, located, confirmed and continued; the searches ask it and never
compare its code. Kinds of equilibria and of periodic orbits are subclasses.
"""

from __future__ import annotations

from dataclasses import dataclass

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

    @property
    def code(self) -> str:
        return self.record.code
