"""The record of a model that was read from a file."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp

from fastslow.arguments import text, validated
from fastslow.errors import unknown_name
from fastslow.model.model import Model
from fastslow.results.base.display import Displayed, Summarized, value_text
from fastslow.results.base.named_mapping import NamedMapping


@dataclass(frozen=True, repr=False)
class ParameterSet(Displayed):
    """Values that a file gives together under a name.

    Parameters
    ----------
    parameters, initial : NamedMapping of float
        Only those that the set gives.
    options : NamedMapping of str
        Everything else, as written.
    """

    parameters: NamedMapping[float]
    initial: NamedMapping[float]
    options: NamedMapping[str]


@dataclass(frozen=True, repr=False, kw_only=True)
class ModelFile(Summarized):
    """A model read from a file, with everything else that the file says.

    Attributes
    ----------
    model : Model
    initial : NamedMapping of float
        The initial state; states without one begin at 0, as in XPPAUT.
    t : (float, float)
        Start and end of the time that the file asks for.
    sets : NamedMapping of ParameterSet
        Named sets of values; `with_set` applies one.
    plots : tuple of tuple of str
        Quantities on the axes of each plot that the file asks for.
    auxiliary : NamedMapping of sympy.Expr
        Quantities that the file defines for plots, in states, parameters and t.
    stops : tuple of str
        Conditions at which the file ends a run: ``stop=file.stops`` of `fastslow.simulate`.
    options : NamedMapping of str
        Options of the program, as written.
    notes : tuple of str
        What was not read as written, or is worth knowing, with its line.
    renamed : NamedMapping of str
        Names in the file to the names in the model, where they differ by more than case.
    comments : tuple of str
    units, labels : NamedMapping of str
        Unit, and name for readers, of the states and parameters, and of t, of which a file of SBML
        gives them. The numbers are those of the file: no unit is converted.
    """

    model: Model
    initial: NamedMapping[float]
    t: tuple[float, float]
    sets: NamedMapping[ParameterSet] = field(default_factory=lambda: NamedMapping("set"))
    plots: tuple[tuple[str, ...], ...] = ()
    auxiliary: NamedMapping[sp.Expr] = field(default_factory=lambda: NamedMapping("quantity"))
    stops: tuple[str, ...] = ()
    options: NamedMapping[str] = field(default_factory=lambda: NamedMapping("option"))
    notes: tuple[str, ...] = ()
    renamed: NamedMapping[str] = field(default_factory=lambda: NamedMapping("name"))
    comments: tuple[str, ...] = ()
    units: NamedMapping[str] = field(default_factory=lambda: NamedMapping("name"))
    labels: NamedMapping[str] = field(default_factory=lambda: NamedMapping("name"))

    @validated(name=text)
    def with_set(self, name: str) -> ModelFile:
        r"""Return the record with the values of one of its sets.

        Parameters
        ----------
        name : str

        Raises
        ------
        UnknownNameError
            For a name that is no set of the file.

        Examples
        --------
        >>> import fastslow as fs
        >>> file = fs.read_ode("x'=a-x\npar a=1\nset high {a=3,x=2}\ndone")
        >>> high = file.with_set("high")
        >>> high.model.parameters["a"], high.initial["x"]
        (3.0, 2.0)
        """
        if name not in self.sets:
            raise unknown_name("set", name, self.sets)
        return with_values(self, self.sets[name])

    def _groups(self) -> list[list[str]]:
        model = self.model
        head = f"Model of {value_text(model.states)}"
        head += f" with {len(model.parameters)} parameters, for {self.t[0]:g} ≤ t ≤ {self.t[1]:g}"
        entries: dict[str, Any] = {
            "initial state": self.initial,
            "sets": tuple(self.sets),
            "plots": tuple(" against ".join(reversed(p)) for p in self.plots),
            "auxiliary": tuple(self.auxiliary),
            "stops": self.stops,
            "renamed": self.renamed,
            "units": self.units,
            "labels": self.labels,
        }
        lines = [f"  {what}: {value_text(value)}" for what, value in entries.items() if value]
        notes = [f"  note: {note}" for note in self.notes]
        return [[head], lines, notes]


def with_values(file: ModelFile, values: ParameterSet) -> ModelFile:
    """Return a record with the values of a set."""
    first, last = file.t
    start = float(values.options.get("t0") or first)
    length = float(values.options.get("total") or last - first)
    return replace(
        file,
        model=file.model.with_parameters(values.parameters),
        initial=NamedMapping("state", {**file.initial, **values.initial}),
        t=(start, start + length),
        options=NamedMapping("option", {**file.options, **values.options}),
    )
