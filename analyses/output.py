"""Where the analyses write their figures, and in which formats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from fastslow.plot.layout.style import save

#: Dots per inch of the figures that the pages show.
SHOWN = 150

FORMATS = ("png", "pdf")


@dataclass(frozen=True)
class Output:
    """A folder of figures.

    Parameters
    ----------
    folder : Path
        Made when the first figure is saved.
    formats : tuple of str
        Suffixes of the files.
    """

    folder: Path
    formats: tuple[str, ...] = FORMATS

    def save(self, figure: Figure, name: str, dpi: float = SHOWN) -> None:
        """Write a figure; an interruption leaves the file as it was, never half of one."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for suffix in self.formats:
            part = self.folder / f".{name}.{suffix}"
            try:
                save(figure, part, dpi)
                part.replace(self.folder / f"{name}.{suffix}")
            finally:
                part.unlink(missing_ok=True)
