"""Models of files, by the kind of a file."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from fastslow.arguments import path, validated
from fastslow.errors import FileError
from fastslow.readers.lines import text_of_file
from fastslow.readers.model_files import ModelFile, with_values
from fastslow.readers.ode_files import kinds_left_out, read_ode_file
from fastslow.readers.sbml_files import read_sbml
from fastslow.readers.set_files import read_set

#: Endings of SBML files.
SBML = (".xml", ".sbml")


@validated(path=path, without=kinds_left_out)
def read(path: str | os.PathLike[str], *, without: Sequence[str] = ()) -> ModelFile:
    """Read a model from a file of another program.

    Parameters
    ----------
    path : str or path
        An ``.ode`` file of XPPAUT, or a ``.set`` file beside the ``.ode`` file that it names, whose
        values are then those of the set; or an SBML file, ``.xml`` or ``.sbml``, for which see
        `fastslow.read_sbml`.
    without : sequence of str
        What to leave out of the file; see `fastslow.read_ode`.

    Returns
    -------
    ModelFile

    Raises
    ------
    FileError
        For a file that cannot be read, is no text, or has another ending.
    ModelError
        For a file that is no model, with line and column.

    See Also
    --------
    fastslow.read_ode, fastslow.read_sbml, fastslow.analyse

    Examples
    --------
    >>> read("nothing.ode")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nothing.ode cannot be read: No such file or directory
    """
    source = Path(path)
    if source.suffix.lower() == ".set":
        written, _ = text_of_file(source)
        found = re.match(r"#+\s*Set file for (\S+)", written)
        if found is None:
            raise FileError(f"{source} is no .set file of XPPAUT: it names no .ode file")
        file = read_ode_file(source.parent / found.group(1), without)
        return with_values(file, read_set(written, file, source.name))
    if source.suffix.lower() in SBML:
        return read_sbml(source)
    if source.suffix.lower() != ".ode":
        raise FileError(
            f"{source} has the ending {source.suffix or 'none'}; expected .ode or .set, .xml or "
            ".sbml; files of AUTO-07p are read by fs.read_auto, saved results by fs.load"
        )
    return read_ode_file(source, without)
