"""Callbacks of loops that few runs need, loaded or compiled on first use.

Otherwise they would be compiled into every loop, and optimised again with each. A loop that
needs one pauses; the callback is compiled outside, where errors and interrupts are handled
normally, and the loop resumes with its address.
"""

from __future__ import annotations

from dataclasses import dataclass

from fastslow.kernels.loops import Entry

_ENTRY = '''"""Entry to {function} of {module}."""
from {module} import {record}, {function} as called
from fastslow.kernels.compiler.pointers import loader

load = loader({record})


def {function}(pointer):
    return called(load(pointer))
'''


@dataclass(frozen=True, eq=False)
class LazyCallback(Entry):
    """A function of one record, called by `fastslow.kernels.compiler.pointers.call_with`.

    Parameters
    ----------
    module, function, record : str
        Module, function and type of its argument, e.g.
        ``"fastslow.simulation.stepper.radau"``, ``"radau_step"`` and ``"RadauStep"``.
    """

    record: str

    @property
    def source(self) -> str:
        return _ENTRY.format(module=self.module, function=self.function, record=self.record)
