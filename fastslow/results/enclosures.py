"""Enclosures of proved points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fastslow.arguments import formula, validated
from fastslow.errors import unknown_name
from fastslow.results.base.result import Result


@dataclass(frozen=True, eq=False, repr=False)
class Enclosure(Result):
    """Bounds between which a point is proved to exist, the only one in a larger box.

    Parameters
    ----------
    low, high : mapping
        States and parameters to floating-point numbers on both sides of their values.
    decimals : mapping
        The values in decimals; the error of each is at most one unit of its last digit.
    digits : int
        Smallest number of digits of the values that are not zero.
    unique_within : float
        There is no other such point within this distance in any unknown of the defining system,
        in units of the modulus of each or of 1 if that is larger.
    regular : str
        The meaning of the regularity of the defining system, which the proof includes.
    """

    low: Mapping[str, float]
    high: Mapping[str, float]
    decimals: Mapping[str, str]
    digits: int
    unique_within: float
    regular: str

    @validated(name=formula)
    def __getitem__(self, name: object) -> str:
        """Return the value of a state or parameter in decimals."""
        if str(name) not in self.decimals:
            raise unknown_name("state or parameter", str(name), self.decimals)
        return self.decimals[str(name)]

    def __repr__(self) -> str:
        values = ", ".join(f"{n} = {v}" for n, v in self.decimals.items())
        return (
            f"Enclosure({values}; {self.digits} digits, unique within {self.unique_within:.2g}; "
            f"{self.regular})"
        )
