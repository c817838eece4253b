"""The base class of the objects that plot functions return: axes, artists and data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from fastslow.arguments import path, validated, within
from fastslow.plot.layout.style import SCREEN_DPI, rendered, root, save
from fastslow.results.base.immutable import fixed


@dataclass(frozen=True, eq=False, repr=False)
class Drawing:
    """Axes and the artists drawn into them.

    Parameters
    ----------
    ax : Axes
        The axes drawn into.
    """

    ax: Axes

    @property
    def figure(self) -> Figure:
        """The figure of the axes."""
        return root(self.ax)

    @property
    def artists(self) -> tuple[Artist, ...]:
        """Every artist of the drawing: lines, markers, labels, the legend."""
        return tuple(dict.fromkeys(_artists(self)))

    @property
    def data(self) -> dict[str, tuple[NDArray[np.float64], ...]]:
        """The plotted points by legend entry.

        For each entry one read-only array for each curve, shape (N, 2), or (N, 3) in space.

        Examples
        --------
        >>> import numpy as np
        >>> import fastslow as fs
        >>> from fastslow.results.trajectory.long_time.spectrum import Spectrum
        >>> lines = Spectrum("x", "hann", (0.0, 1.0), np.arange(4.0), np.array([0, 1, 0.5, 0]))
        >>> fs.plot.spectrum(lines).data["amplitude"][0][:2].tolist()
        [[1.0, 1.0], [2.0, 0.5]]
        """
        found: dict[str, list[NDArray[np.float64]]] = {}
        for artist in self.artists:
            curves = _curves(artist)
            # auxiliary artists (interfaces, triangles) have no name
            if curves and not str(artist.get_label()).startswith("_"):
                found.setdefault(str(artist.get_label()), []).extend(curves)
        return {kind: fixed(kind, curves) for kind, curves in found.items()}

    @validated(path=path, dpi=within(10.0, 10_000.0))
    def save(self, path: str | Path, *, dpi: float = 300) -> Path:
        """Write the figure in the format of the suffix.

        PDF files embed fonts as Type 42 (TrueType); SVG files keep text as text.

        Parameters
        ----------
        path : str or Path
            Destination, e.g. ``"overlay.pdf"``, in an existing folder.
        dpi : float
            Dots per inch of raster formats.

        Returns
        -------
        Path
        """
        return save(self.figure, path, dpi)

    def __repr__(self) -> str:
        # the artists with their addresses would fill a page
        x, y = (label.replace("$", "") for label in (self.ax.get_xlabel(), self.ax.get_ylabel()))
        return f"{type(self).__name__}({y} over {x})"

    def _repr_png_(self) -> bytes:
        return rendered(self.figure, "png", SCREEN_DPI)


def _artists(value: Any) -> Iterator[Artist]:
    """Yield the artists in the fields of a drawing, including nested ones."""
    if isinstance(value, Axes):
        return
    if isinstance(value, Artist):
        yield value
    elif isinstance(value, Mapping):
        for part in value.values():
            yield from _artists(part)
    elif isinstance(value, tuple | list):
        for part in value:
            yield from _artists(part)
    elif hasattr(value, "__dataclass_fields__"):
        for field in fields(value):
            yield from _artists(getattr(value, field.name))


def _curves(artist: Artist) -> list[NDArray[np.float64]]:
    """Return the data of one artist, empty unless it is a curve."""
    if isinstance(artist, Line2D):
        if hasattr(artist, "get_data_3d"):
            return [np.column_stack([np.asarray(d, dtype=float) for d in artist.get_data_3d()])]
        return [np.asarray(artist.get_xydata(), dtype=float)]
    if isinstance(artist, LineCollection):
        return [np.asarray(segment, dtype=float) for segment in artist.get_segments()]
    if isinstance(artist, PolyCollection):
        return [np.asarray(path.vertices, dtype=float) for path in artist.get_paths()]
    return []
