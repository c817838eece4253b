"""What every result can do: be pickled and saved, without what lives only in this process."""

from __future__ import annotations

import os

from fastslow.arguments import path, validated
from fastslow.results.base.immutable import Immutable

#: Metadata of a field that lives only in this process, such as a model: dropped when kept.
LIVE = {"live": True}

#: The same of one that files keep in another form, its own attribute ``stored``.
STORED = {"live": True, "stored": True}


class Saved:
    """What can be kept in a file."""

    @validated(path=path)
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write this to a file that `fastslow.load` reads back bit for bit.

        The file is written whole or not at all; a symbolic link is followed, and a
        file that exists keeps its permission bits. A checksum of the content is at
        its end. The model of a trajectory or a diagram is kept as a `StoredModel`. What
        lives only in this process (what corrects points between the rows of a diagram) is
        not kept.

        Parameters
        ----------
        path : str or path
            Ends in ``.npz``, or in ``.nc`` for NetCDF (extra ``data``), in small or
            capital letters.

        Raises
        ------
        ArgumentError
            For another ending.
        FileError
            When the file cannot be written.
        MissingPackageError
            For ``.nc`` without the extra ``data``.

        Examples
        --------
        >>> import tempfile, fastslow as fs
        >>> diagram = fs.continue_equilibria(fs.systems.harmonic_gear().frozen(), "w", (-2, 6))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     diagram.save(f"{folder}/gear.npz")
        ...     again = fs.load(f"{folder}/gear.npz")
        >>> bool((again["x"] == diagram["x"]).all())
        True
        """
        from fastslow.results.io.files import write

        write(self, path)


class Result(Immutable, Saved):
    """A result: it cannot be changed, is equal to others with its content, and can be saved."""
