"""Compiled rates, Jacobian and switching functions, from operations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fastslow.errors import ModelError
from fastslow.kernels.compiler.chains import chosen
from fastslow.kernels.compiler.machine_code import Address
from fastslow.kernels.compiler.model_code import load_function
from fastslow.results.stored.fields import FieldOperations

#: Number of outputs from which zeros are written by a loop instead of single assignments.
LOOPED_ZEROS = 200


class HasParameters(Protocol):
    """Attributes of a model that its compiled code needs."""

    @property
    def parameters(self) -> Mapping[str, float]: ...


@dataclass(frozen=True)
class CompiledField:
    """Address of a generated function and how its arrays are laid out.

    The function fills, for u = (states, varying parameters) of length n + k: F (n),
    the Jacobian (n, n + k) row by row, h (m) and the gradients of h (m, n + k).

    Parameters
    ----------
    address : Address
        Of ``void(int64 region, double* u, double* parameters, double* out)``.
    parameters : tuple of str
        Order of the parameter array.
    n, m, k : int
        Numbers of states, interfaces and varying parameters.
    """

    address: Address
    parameters: tuple[str, ...]
    n: int
    m: int
    k: int = 1

    @property
    def size(self) -> int:
        """Length of the output array."""
        return (self.n + self.m) * (self.n + self.k + 1)


def load_field(bodies: Sequence[FieldOperations], unknowns: int, parameters: int) -> Address:
    """Compile the operations, one list for each region, and return the address."""
    return load_function(_source([_lines(body) for body in bodies], unknowns, parameters), "field")


def load_shared_field(
    rows: Sequence[Sequence[FieldOperations]],
    numbers: Sequence[Sequence[int]],
    n: int,
    unknowns: int,
    parameters: int,
) -> Address:
    """Compile a field of many regions, whose rows are few different ones, and return the address.

    Of k independent conditions 2^k regions follow, in each of which a rate is one of few.

    Parameters
    ----------
    rows : sequence of sequence of FieldOperations
        The different functions at each place, n rates, then the switching functions, with their
        derivatives by the unknowns.
    numbers : sequence of sequence of int
        For each region, which of them is at each place.
    n, unknowns, parameters : int
    """
    count = len(rows)
    table = ", ".join(str(number) for region in numbers for number in region)
    lines = [
        f"CHOSEN = ({table},)",
        "",
        *_start(unknowns, parameters),
        f"    for k in range({count * (unknowns + 1)}):",
        "        out[k] = 0.0",
    ]
    for place, some in enumerate(rows):
        after = place >= n
        # rates, their derivatives, switching functions, their derivatives
        value = place + n * unknowns * after
        slopes = n + (count - n) * after + place * unknowns
        tests = (f"CHOSEN[region * {count} + {place}] == {k}" for k in range(len(some)))
        bodies = [_row_lines(one, value, slopes) for one in some]
        lines += chosen(zip(tests, bodies, strict=True))
    return load_function("\n".join(lines) + "\n", "field")


def _row_lines(row: FieldOperations, value: int, slopes: int) -> list[str]:
    """Assignments of one row, to the place of its value and those of its derivatives."""
    lines = [f"s{k} = {code}" for k, code in enumerate(row.shared)]
    lines += [
        f"out[{slopes + k - 1 if k else value}] = {code}"
        for k, code in row.outputs
        if code != "0.0"
    ]
    return lines or ["pass"]


def _lines(body: FieldOperations) -> list[str]:
    """Assignments that fill the output array for one region."""
    lines = [f"s{k} = {code}" for k, code in enumerate(body.shared)]
    if body.size >= LOOPED_ZEROS:
        lines += [f"for k in range({body.size}):", "    out[k] = 0.0"]
    return [*lines, *(f"out[{k}] = {code}" for k, code in body.outputs)]


def _source(bodies: Sequence[list[str]], unknowns: int, parameters: int) -> str:
    lines = _start(unknowns, parameters)
    # sliding and escaping motion have the same equations
    alike: dict[tuple[str, ...], list[int]] = {}
    for number, body in enumerate(bodies):
        alike.setdefault(tuple(body), []).append(number)
    tests = (" or ".join(f"region == {n}" for n in numbers) for numbers in alike.values())
    lines += chosen(zip(tests, map(list, alike), strict=True))
    return "\n".join(lines) + "\n"


def _start(unknowns: int, parameters: int) -> list[str]:
    return [
        "def field(region, u, p, out):",
        *(f"    u{k} = u[{k}]" for k in range(unknowns)),
        *(f"    p{k} = p[{k}]" for k in range(parameters)),
    ]


def parameter_array(model: HasParameters, names: Sequence[str]) -> np.ndarray:
    """Parameter values in the order of the names.

    Raises
    ------
    ModelError
        If a slow quantity has been given no value.
    """
    for name in names:
        if name not in model.parameters:
            raise ModelError(
                f"the frozen slow quantity '{name}' has no value; "
                f"give one with with_parameters({name}=…)"
            )
    return np.array([model.parameters[n] for n in names], dtype=float)
