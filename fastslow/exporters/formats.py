"""Export of a model to AUTO-07p, XPPAUT or NumPy, one smooth vector field per file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from fastslow.arguments import instance, mapping, path, text, validated
from fastslow.disk import reason, write_text
from fastslow.errors import FileError, refuse_events, refuse_resets, refuse_switches, unknown_name
from fastslow.exporters.auto import to_auto
from fastslow.exporters.numpy_source import to_numpy
from fastslow.exporters.xpp import to_xpp
from fastslow.model.model import Model
from fastslow.results.base.named_mapping import NamedMapping


class Format(NamedTuple):
    """A file format of equations.

    Parameters
    ----------
    write : callable
        Writes one region, or all with None, and returns the files by name.
    hybrid : bool
        Whether it can represent resets, switches and events.
    in_one_file : bool
        Whether all regions are one file, otherwise a file each.
    """

    write: Callable[..., dict[str, str]]
    hybrid: bool = False
    in_one_file: bool = False


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "auto": Format(to_auto),
        "xpp": Format(to_xpp, hybrid=True, in_one_file=True),
        "numpy": Format(to_numpy),
    }
)


@validated(
    model=instance(Model), format=text, path=path, region=text, values=mapping, state=mapping
)
def export(
    model: Model,
    format: str,
    path: str | os.PathLike[str] | None = None,
    *,
    region: str | None = None,
    values: Mapping[Any, float] | None = None,
    state: Mapping[Any, float] | None = None,
) -> NamedMapping[str]:
    """Export the equations as source code for another program.

    An .ode file contains all regions, and `fastslow.read_ode` returns the same model from it if
    that has neither resets nor switches. Other files contain one smooth vector field each.

    Parameters
    ----------
    model : Model
        A frozen model for AUTO-07p. Clocks are exported to XPPAUT and NumPy, resets and
        switches to XPPAUT, as ``global`` events.
    format : str
        ``"auto"`` (Fortran equations and a constants file), ``"xpp"`` (an .ode
        file) or ``"numpy"`` (a Python module).
    path : path, optional
        Folder to write to; without it nothing is written.
    region : str, optional
        A single region; all regions by default, which are one .ode file, ``model.ode``, and
        otherwise a file each.
    values : mapping, optional
        Values of frozen slow quantities, 0 by default.
    state : mapping, optional
        Initial state, 0 by default; for AUTO-07p it must be an equilibrium.

    Returns
    -------
    NamedMapping of str
        The content of each file, by file name.

    Raises
    ------
    UnknownNameError
        For an unknown format, region, state or slow quantity.
    ArgumentError
        If the format cannot represent the model.
    ModelError
        If it cannot represent resets, switches, clocks or tables.

    See Also
    --------
    fastslow.read, fastslow.load

    Examples
    --------
    >>> import sympy as sp
    >>> x, k = sp.symbols("x k")
    >>> decay = Model({x: -k * x}, parameters={k: 2})
    >>> print(export(decay, "xpp")["S1.ode"])
    # x, region S1
    par k=2.0
    x'=-k*x
    init x=0.0
    @ total=100
    done
    <BLANKLINE>
    """
    if format not in FORMATS:
        raise unknown_name("export format", format, FORMATS)
    chosen = FORMATS[format]
    if not chosen.hybrid:
        refuse_resets(model.resets, f"export to {format}")
        refuse_switches(model.switches, f"export to {format}")
        refuse_events(model.events, f"export to {format}")
    names: list[str | None] = [region] if region is not None else [*model.regions]
    if chosen.in_one_file and len(names) > 1:
        names = [None]
    files: dict[str, str] = {}
    for name in names:
        files.update(chosen.write(model, name, values=values, state=state))
    if path is not None:
        folder = Path(path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{folder} cannot be written: {reason(error)}") from error
        for name, text in files.items():
            write_text(folder / name, text)
    return NamedMapping("file", files)
