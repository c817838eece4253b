"""The parameter values for which the stored form of a model is valid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import sympy as sp

from fastslow.model.clocks import ClockFunction
from fastslow.model.periods import frequencies
from fastslow.model.structure import TIME, Partition, real
from fastslow.model.traits import first_slope, text_of
from fastslow.results.stored.model import Validity


def validity_of(
    partition: Partition, values: Mapping[str, float], period: float | None
) -> Validity:
    """Return the parameter values for which the operations of a model are valid.

    Parameters
    ----------
    partition : Partition
        The regions of the model.
    values : mapping
        Its parameter values.
    period : float or None
        The common period of its forcing.
    """
    structure = partition.structure
    names = tuple(sorted({*values, *structure.free}))
    new = {real(n): f"p{k}" for k, n in enumerate(names)}
    loose = [z for z in structure.moving if z.name not in values or z == TIME]
    steady: set[str] = set()

    def texts(expressions: Iterable[sp.Expr]) -> tuple[str, ...]:
        """Texts of expressions, or none: then the values of their parameters are fixed."""
        written = tuple(expressions)
        found = tuple(text_of(e, new) for e in written)
        if all(found):
            return found
        steady.update(s.name for e in written for s in e.free_symbols)
        return ()

    rows: list[tuple[str, ...]] = []
    # which regions exist at other values is unknown of a model with some of them
    for interface in () if structure.formed else structure.interfaces:
        h = interface.function
        slopes = [h.diff(z) for z in loose]
        inside = set().union(*(slope.free_symbols for slope in slopes))
        if inside & set(loose) or h.has(ClockFunction):
            # it may be affine at other values of the symbols in its slopes
            steady |= {s.name for s in inside | (h.free_symbols & set(loose))}
            rows.append(())
        else:
            rows.append(texts([*slopes, h.subs(dict.fromkeys(loose, 0))]))
    scales = tuple(texts([scale]) for scale in structure.scales)
    moving = [first_slope(structure, i.function) for i in partition.interfaces.values()]
    found = frequencies(structure.written, TIME)
    common = None if found is None else texts(found)
    deciding = {*structure.deciding, *structure.sloping, *structure.timed}
    validity = Validity(
        names=names,
        values={n: values[n] for n in names if n in values and n in deciding | steady},
        steady=(),
        loose=tuple(z.name if z.name in names else "" for z in loose),
        rows=tuple(rows),
        patterns=((),)
        if structure.formed
        else structure.patterns({real(n): v for n, v in values.items()}),
        scales=tuple(text for (text,) in filter(None, scales)),
        signs=(),
        slopes=tuple(
            "" if s is None or set(loose) & s.free_symbols else text_of(s, new) for s in moving
        ),
        period=period,
        frequencies=common,
    )
    if structure.formed or validity.patterns_at(values) != validity.patterns:
        steady |= deciding
    signs = validity.signs_at(values)
    return replace(validity, steady=tuple(sorted(steady & set(names))), signs=signs)
