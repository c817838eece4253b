"""Settings of a certificate."""

from __future__ import annotations

from dataclasses import dataclass

from fastslow.arguments import settings, whole, within
from fastslow.results.base.display import Displayed


@settings(max_boxes=whole(1, 10**9), width=within(1e-12, 1e-2))
@dataclass(frozen=True, kw_only=True)
class Certification(Displayed):
    """Settings of the search of a window for all equilibria.

    Parameters
    ----------
    max_boxes : int
        Maximum number of boxes searched in each region; the rest is reported as not searched.
        A million boxes of a model with four states take five to ten seconds.
    width : float
        Width of the smallest boxes, in units of the window. Boxes of this width in which nothing
        is proved are left: at branch points, poles, and degenerate equilibria.

    Raises
    ------
    ArgumentError
        For a number of boxes below 1, or a width that is not from 1e-12 to 0.01.
    """

    max_boxes: int = 2_000_000
    width: float = 1e-8


#: What is used where nothing is given.
CERTIFICATION = Certification()
