"""The kinds of codimension-two points on curves of special points of periodic orbits.

On curves of multipliers these are degenerate normal forms (CPC, GPD, CH), strong resonances (R1 to
R4) and further critical multipliers (LPPD, LPNS, PDNS, NSNS; Kuznetsov 2004, chapter 9). A contact
with an interface on them is the grazing of a nonhyperbolic orbit (LPGR, PDGR, NSGR), also found on
the curve of contacts; a second contact is GRGR, and h'' = 0 at the touch a degenerate grazing DGR
(types II, III and I of Kowalczyk et al. 2006). Which of them are watched for on a curve is in
`fastslow.orbits.points.kinds`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastslow.continuation.point_kinds import PointKind
from fastslow.orbits.points import normal_forms
from fastslow.orbits.points.normal_forms import ReturnMap
from fastslow.results.point_types import (
    CHENCINER,
    CUSP_OF_CYCLES,
    DEGENERATE_GRAZING,
    DOUBLE_TORUS,
    FLIP_TORUS,
    FOLD_FLIP,
    FOLD_TORUS,
    GENERALIZED_DOUBLING,
    GRAZING_DOUBLING,
    GRAZING_FOLD,
    GRAZING_TORUS,
    RESONANCE_1,
    RESONANCE_2,
    RESONANCE_3,
    RESONANCE_4,
    TWO_CONTACTS,
    kind_of,
)


@dataclass(frozen=True)
class OrbitCodimensionTwo(PointKind):
    """A kind of codimension-two points.

    Parameters
    ----------
    record : PointType
    coefficients : callable, optional
        Computes the coefficients of the normal form from the return map.
    missing : str
        Coefficients that decide on the unfolding and are not computed.
    beyond : str
        What there is beyond a point at which a curve ends.
    """

    coefficients: Callable[[ReturnMap], dict[str, float]] | None = None
    missing: str = ""
    beyond: str = "beyond it the itinerary is another."

    def form(self, system: Any, found: Any) -> dict[str, Any]:
        """Return the finite coefficients of the normal form, and which ones are not computed.

        Parameters
        ----------
        system : Tests
            Of the curve.
        found : CurvePoint
        """
        coefficients, missing = self._coefficients(system.at(found.z))
        return {"normal_form": coefficients, "degeneracy": missing}

    def _coefficients(self, at: ReturnMap) -> tuple[dict[str, float], str]:
        found: dict[str, float] = {}
        note = self.missing
        if self.coefficients is not None:
            with np.errstate(all="ignore"):
                found = self.coefficients(at)
            lost = [name for name, value in found.items() if not np.isfinite(value)]
            if lost:
                note = f"{', '.join(lost)} undefined because a denominator vanishes"
        return {name: value for name, value in found.items() if np.isfinite(value)}, note


_SADDLES = "beyond it there are neutral saddles."
_NO_FORM, _NO_UNFOLDING = "normal form not computed", "unfolding not computed"

CUSP = OrbitCodimensionTwo(kind_of(CUSP_OF_CYCLES), normal_forms.cusp_form)
DEGENERATE_DOUBLING = OrbitCodimensionTwo(
    kind_of(GENERALIZED_DOUBLING), missing="coefficient of fifth order not computed"
)
DEGENERATE_TORUS = OrbitCodimensionTwo(
    kind_of(CHENCINER), missing="second Lyapunov coefficient not computed"
)
ONE_TO_ONE = OrbitCodimensionTwo(
    kind_of(RESONANCE_1), normal_forms.first_resonance, beyond=_SADDLES
)
ONE_TO_TWO = OrbitCodimensionTwo(
    kind_of(RESONANCE_2), normal_forms.second_resonance, beyond=_SADDLES
)
ONE_TO_THREE = OrbitCodimensionTwo(
    kind_of(RESONANCE_3), normal_forms.third_resonance, missing="cubic coefficient not computed"
)
ONE_TO_FOUR = OrbitCodimensionTwo(kind_of(RESONANCE_4), normal_forms.fourth_resonance)
FOLD_AND_FLIP = OrbitCodimensionTwo(
    kind_of(FOLD_FLIP), normal_forms.fold_flip_form, missing="cubic coefficients not computed"
)
FOLD_AND_PAIR = OrbitCodimensionTwo(kind_of(FOLD_TORUS), missing=_NO_FORM)
FLIP_AND_PAIR = OrbitCodimensionTwo(kind_of(FLIP_TORUS), missing=_NO_FORM)
TWO_PAIRS = OrbitCodimensionTwo(kind_of(DOUBLE_TORUS), missing=_NO_FORM)
FOLD_IN_CONTACT = OrbitCodimensionTwo(kind_of(GRAZING_FOLD), missing=_NO_UNFOLDING)
DOUBLING_IN_CONTACT = OrbitCodimensionTwo(kind_of(GRAZING_DOUBLING), missing=_NO_UNFOLDING)
TORUS_IN_CONTACT = OrbitCodimensionTwo(kind_of(GRAZING_TORUS), missing=_NO_UNFOLDING)
SECOND_CONTACT = OrbitCodimensionTwo(kind_of(TWO_CONTACTS), missing=_NO_UNFOLDING)
DEGENERATE_CONTACT = OrbitCodimensionTwo(
    kind_of(DEGENERATE_GRAZING), beyond="the touch meets a crossing."
)
