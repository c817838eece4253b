"""Base classes of results: immutable, compared by content, saved to files."""

from __future__ import annotations

import os

from fastslow.arguments import path, validated
from fastslow.results.base.immutable import Immutable

#: Metadata of a field that exists only in this process, such as a model: not saved.
LIVE = {"live": True}

#: Metadata of such a field that is saved in another form, its attribute ``stored``.
STORED = {"live": True, "stored": True}


class Saved:
    """Mixin of objects that can be saved to a file."""

    @validated(path=path)
    def save(self, path: str | os.PathLike[str]) -> None:
        """Save to a file, from which `fastslow.load` restores every bit.

        The file is written atomically and ends with a checksum of its content; a symbolic
        link is followed, and an existing file keeps its permission bits. The model of a
        trajectory or a diagram is stored as a `StoredModel`. Objects that exist only in
        this process (the corrector of points between the rows of a diagram) are not saved.

        Parameters
        ----------
        path : str or path
            With the extension ``.npz``, or ``.nc`` for NetCDF (extra ``data``), in lower
            or upper case.

        Raises
        ------
        ArgumentError
            For another extension.
        FileError
            If the file cannot be written.
        MissingPackageError
            For ``.nc`` if the extra ``data`` is not installed.

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
    """A result: immutable, compared by content, and saved by ``save``."""
