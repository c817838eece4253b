"""Results as tables: conversion to arrays, data frames and labelled arrays."""

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
    """Import a package of an optional extra.

    Raises
    ------
    MissingPackageError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError(
            f"this needs {name}, of the extra '{group}': pip install 'fastslow[{group}]'"
        ) from None


class Table(ABC):
    """A result with columns of equal length."""

    #: The name of one row, and the columns that are its coordinates.
    _row: ClassVar[str] = "row"
    _places: tuple[str, ...] = ()

    @abstractmethod
    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return every column by name as a read-only array, all of equal length."""

    def to_frame(self) -> pandas.DataFrame:
        """Return a copy of the columns of `to_dict` as a pandas data frame (extra ``data``).

        Raises
        ------
        MissingPackageError
            When pandas is not installed.
        """
        frame = extra("pandas").DataFrame(self._copied())
        frame.attrs = self._about()
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """Return a copy of the columns of `to_dict` as an xarray dataset (extra ``data``).

        Raises
        ------
        MissingPackageError
            When xarray is not installed.
        """
        columns = {name: (self._row, values) for name, values in self._copied().items()}
        places = {name: columns.pop(name) for name in self._places if name in columns}
        return extra("xarray").Dataset(columns, places, self._about())

    def _copied(self) -> dict[str, NDArray[Any]]:
        """Return writable copies of the columns."""
        return {name: np.array(values) for name, values in self.to_dict().items()}

    def _about(self) -> dict[str, Any]:
        """Return metadata common to all rows: the equations and the parameter values."""
        about: dict[str, Any] = {"result": type(self).__name__}
        if getattr(self, "equations", ""):
            about["equations"] = self.equations  # type: ignore[attr-defined]
        values = getattr(self, "parameters", {})
        if isinstance(values, Mapping):
            about |= {k: float(v) for k, v in values.items() if np.ndim(v) == 0}
        return about


def numbered(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the columns of an array of shape (N, k) named name_1, name_2 and so on."""
    return {f"{name}_{k + 1}": values[:, k] for k in range(values.shape[1])}
