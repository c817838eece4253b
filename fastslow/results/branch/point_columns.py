"""Tables of special points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fastslow.results.points import SpecialPoint


def columns_of_points(points: Sequence[SpecialPoint]) -> dict[str, NDArray[Any]]:
    """Return columns with one row for each point; missing entries are empty text or NaN."""
    states = tuple(dict.fromkeys(n for p in points for n in p.states))
    parameters = tuple(dict.fromkeys(n for p in points for n in p.parameters))
    columns: dict[str, NDArray[Any]] = {
        "label": np.array([p.label for p in points], dtype=str),
        "code": np.array([p.code for p in points], dtype=str),
        "type": np.array([p.type or p.criticality or "" for p in points], dtype=str),
        "interface": np.array([p.interface or "" for p in points], dtype=str),
        "regions": np.array(["|".join(p.regions) for p in points], dtype=str),
    }
    for name in (*states, *parameters):
        columns[name] = np.array(
            [p[name] if name in (*p.states, *p.parameters) else np.nan for p in points]
        )
    for name in ("coefficient", "frequency", "lyapunov", "residual", "accuracy"):
        values = [getattr(p, name) for p in points]
        columns[name] = np.array([np.nan if v is None else v for v in values], dtype=float)
    columns["admissible"] = np.array([p.admissible for p in points], dtype=bool)
    columns["converged"] = np.array([p.converged for p in points], dtype=bool)
    return columns


def labels_at(points: Sequence[SpecialPoint], rows: Sequence[int], count: int) -> NDArray[np.str_]:
    """Return the labels of the special points on each row of a curve, empty without any."""
    texts: dict[int, str] = {}
    for point, row in zip(points, rows, strict=True):
        texts[row] = f"{texts.get(row, '')} {point.label}".strip()
    labels = np.zeros(count, dtype=f"<U{max([1, *map(len, texts.values())])}")
    labels[list(texts)] = list(texts.values())
    return labels
