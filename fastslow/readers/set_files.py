"""Values of ``.set`` files, in which XPPAUT saves parameters and initial states."""

from __future__ import annotations

import re

from fastslow.errors import FileError
from fastslow.readers.model_files import ModelFile, ParameterSet
from fastslow.results.base.named_mapping import NamedMapping

#: Settings by their words in a file.
_SETTINGS = {"total": "total", "T0": "t0"}

_ROW = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s+(\S.*?)\s*")


def read_set(written: str, file: ModelFile, name: str) -> ParameterSet:
    """Return the values of a .set file for a model.

    Parameters
    ----------
    written : str
    file : ModelFile
        The model for which the set was saved.
    name : str
        Name of the set file, for errors.

    Raises
    ------
    FileError
        If values of states or parameters are missing, or belong to another model.
    """
    section = ""
    values: dict[str, dict[str, float]] = {"Old ICs": {}, "Parameters": {}, "Numerical stuff": {}}
    for number, line in enumerate(written.splitlines(), start=1):
        if line.startswith("#"):
            section = line.strip("# ")
            continue
        found = _ROW.fullmatch(line)
        if section in values and found:
            values[section][found.group(2)] = float(found.group(1))
        elif section in values and line.strip():
            raise FileError(f"{name}, line {number}: {line.strip()!r} is no value with its name")
    known = {n.lower(): n for n in (*file.model.states, *file.model.parameters, *file.auxiliary)}
    for one in (*values["Old ICs"], *values["Parameters"]):
        if one.lower() not in known:
            raise FileError(f"{name} is a set of another model: {one} is not in the .ode file")
    initial = {known[n.lower()]: v for n, v in values["Old ICs"].items()}
    missing = [n for n in file.model.states if n not in initial]
    if missing or not values["Parameters"]:
        what = f"of {missing[0]}" if missing else "of the parameters"
        raise FileError(f"{name} is cut short: it has no value {what}")
    kept = {_SETTINGS[n]: repr(v) for n, v in values["Numerical stuff"].items() if n in _SETTINGS}
    return ParameterSet(
        NamedMapping("parameter", {known[n.lower()]: v for n, v in values["Parameters"].items()}),
        NamedMapping("state", {n: v for n, v in initial.items() if n in file.model.states}),
        NamedMapping("option", kept),
    )
