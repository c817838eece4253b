"""Results with named columns, handed on as data frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.extras import extra

if TYPE_CHECKING:
    import pandas


class Framed(ABC):
    """Mixin of results that have columns."""

    @abstractmethod
    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return the columns by name."""

    def to_frame(self) -> pandas.DataFrame:
        """Return a copy of the columns of `to_dict` as a pandas data frame (extra ``data``).

        Raises
        ------
        MissingPackageError
            When pandas is not installed.
        """
        frame = extra("pandas").DataFrame({n: np.array(a) for n, a in self.to_dict().items()})
        frame.attrs = self._about()
        return frame

    def _about(self) -> dict[str, Any]:
        """Return metadata common to all rows: the equations and the parameter values."""
        about: dict[str, Any] = {"result": type(self).__name__}
        if getattr(self, "equations", ""):
            about["equations"] = self.equations  # type: ignore[attr-defined]
        values = getattr(self, "parameters", {})
        if isinstance(values, Mapping):
            about |= {k: float(v) for k, v in values.items() if np.ndim(v) == 0}
        return about
