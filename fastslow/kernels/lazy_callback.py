"""Code that few runs need: loaded, or compiled, when the first of them does.

It would otherwise be compiled into every loop, and optimised again with each of them. A
loop that comes to it pauses; what it needs is compiled outside, where an error or an
interrupt is as any other, and the loop goes on with its address.
"""

from __future__ import annotations

from dataclasses import dataclass

from fastslow.kernels.loops import Entry

_ENTRY = '''"""Entry to {function} of {module}."""
from {module} import {record}, {function} as called
from fastslow.kernels.pointers import loader

load = loader({record})


def {function}(pointer):
    return called(load(pointer))
'''


@dataclass(frozen=True, eq=False)
class LazyCallback(Entry):
    """A function of one record, which `fastslow.kernels.pointers.call_with` calls.

    Parameters
    ----------
    module, function, record : str
        Where the function and the type of its argument are, e.g.
        ``"fastslow.simulation.stepper.radau"``, ``"radau_step"`` and ``"RadauStep"``.
    """

    record: str

    @property
    def source(self) -> str:
        return _ENTRY.format(module=self.module, function=self.function, record=self.record)
