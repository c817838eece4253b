"""Models whose runs go on from a state on the way."""

from __future__ import annotations

from dataclasses import replace

from fastslow.model.model import Model
from fastslow.model.structure import interned
from fastslow.results.base.named_mapping import NamedMapping


def continuing(model: Model) -> Model:
    """Return the model with conditions that count as true before the start of a run.

    A run that begins within a motion triggers no event whose condition has been true for a while.

    Parameters
    ----------
    model : Model

    Examples
    --------
    >>> import fastslow as fs
    >>> event = fs.Event("x < 1", {"x": 0}, initially=False)
    >>> continuing(fs.Model({"x": 1}, events={"begin": event})).events["begin"].initially
    True
    """
    events = model.structure.events
    if all(event.initially for event in events.values()):
        return model
    changed = {name: replace(event, initially=True) for name, event in events.items()}
    structure = replace(model.structure, events=NamedMapping("event", changed))
    return Model._from(interned(structure), model.parameters)
