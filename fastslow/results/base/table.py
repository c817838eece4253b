"""Results as tables: plain arrays, data frames, labelled arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import MissingPackageError

if TYPE_CHECKING:
    import pandas
    import xarray


def extra(name: str, group: str = "data") -> Any:
    """A package of an extra, imported late.

    Raises
    ------
    MissingPackageError
        When it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError(
            f"this needs {name}, of the extra '{group}': pip install 'fastslow[{group}]'"
        ) from None


class Table(ABC):
    """A result that reads as columns of equal length."""

    #: What one row is, and the columns that say where it is.
    _row: ClassVar[str] = "row"
    _places: tuple[str, ...] = ()

    @abstractmethod
    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Every column as a plain (read-only) array, by name, all of one length."""

    def to_frame(self) -> pandas.DataFrame:
        """A copy of the columns of `to_dict` as a pandas data frame (extra ``data``).

        Raises
        ------
        MissingPackageError
            When pandas is not installed.
        """
        frame = extra("pandas").DataFrame(self._copied())
        frame.attrs = self._about()
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """A copy of the columns of `to_dict` as an xarray dataset (extra ``data``).

        Raises
        ------
        MissingPackageError
            When xarray is not installed.
        """
        columns = {name: (self._row, values) for name, values in self._copied().items()}
        places = {name: columns.pop(name) for name in self._places if name in columns}
        return extra("xarray").Dataset(columns, places, self._about())

    def _copied(self) -> dict[str, NDArray[Any]]:
        """The columns, the reader's own to change."""
        return {name: np.array(values) for name, values in self.to_dict().items()}

    def _about(self) -> dict[str, Any]:
        """What holds for all rows: the equations, and the values of parameters."""
        about: dict[str, Any] = {"result": type(self).__name__}
        if getattr(self, "equations", ""):
            about["equations"] = self.equations  # type: ignore[attr-defined]
        values = getattr(self, "parameters", {})
        if isinstance(values, Mapping):
            about |= {k: float(v) for k, v in values.items() if np.ndim(v) == 0}
        return about


def numbered(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Name an array's columns name_1, name_2 and so on, for shape (N, k)."""
    return {f"{name}_{k + 1}": values[:, k] for k in range(values.shape[1])}
