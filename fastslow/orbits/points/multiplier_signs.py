"""Multipliers along a branch of orbits, and what of them changes at special points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.flows import after_jumps, fields
from fastslow.orbits.flow.multipliers import Multipliers, orbit_multipliers
from fastslow.orbits.flow.shooting import Linearised, Shooting
from fastslow.results.orbits.orbit_arrays import OrbitArrays

Array = NDArray[np.float64]

#: A multiplier within this distance of the unit circle is on it.
ON_CIRCLE = 1e-9

#: A multiplier within this distance of 1 is that of a family of orbits, or of a point.
FAMILY_MULTIPLIER = 1e-7

#: A slope of the parameter below this one is rounding: along a family at one value of the
#: parameter, as around a linear centre, or in a canard explosion.
LEVEL_SLOPE = 1e-9

#: Imaginary part of a real multiplier, as a fraction of its modulus.
REAL = 1e-9


class MultiplierSigns(NamedTuple):
    """What changes at special points: nontrivial multipliers and the parameter's direction.

    Of one orbit, or with an axis more of several.

    Parameters
    ----------
    slope : float or ndarray
        Component of the tangent of the branch along the parameter.
    values : ndarray of complex128
    logs : ndarray
        Logarithms of their moduli.
    """

    slope: Any
    values: NDArray[np.complex128]
    logs: Array

    @classmethod
    def of(cls, found: Multipliers | OrbitArrays, slope: float) -> MultiplierSigns:
        """The signs of multipliers, without that of the orbit's own tangent."""
        values, logs = (
            (found.multipliers, found.log_multipliers)
            if isinstance(found, OrbitArrays)
            else (found.values, found.logs)
        )
        if found.trivial is not None:
            values, logs = np.delete(values, found.trivial), np.delete(logs, found.trivial)
        return cls(slope, values, logs)

    @classmethod
    def of_rows(cls, rows: Sequence[tuple[OrbitArrays, float]]) -> MultiplierSigns:
        """The signs of several orbits, each as `of` returns it; zeros fill shorter rows."""
        count = max(len(found.multipliers) for found, _ in rows)
        slopes = np.array([slope for _, slope in rows])
        values = np.zeros((len(rows), count), dtype=complex)
        logs = np.full((len(rows), count), -np.inf)
        for k, row in enumerate(rows):
            one = cls.of(*row)
            values[k, : len(one.values)], logs[k, : len(one.logs)] = one.values, one.logs
        return cls(slopes, values, logs)

    @property
    def real(self) -> NDArray[np.bool_]:
        return np.asarray(np.abs(self.values.imag) <= REAL * np.abs(self.values))

    @property
    def outside(self) -> Any:
        """Number of multipliers outside the unit circle."""
        return (self.logs > ON_CIRCLE).sum(axis=-1)

    @property
    def neutral(self) -> NDArray[np.bool_]:
        """True for multipliers whose side of 1 is unknown."""
        return np.asarray(np.abs(self.values - 1.0) <= FAMILY_MULTIPLIER)

    @property
    def grown(self) -> Any:
        """Number of real multipliers above 1."""
        above = self.real & (self.values.real > 0) & (self.logs > 0)
        return (above & ~self.neutral).sum(axis=-1)

    @property
    def flipped(self) -> Any:
        """Number of real multipliers below -1."""
        return (self.real & (self.values.real < 0) & (self.logs > 0)).sum(axis=-1)

    @property
    def pair(self) -> tuple[float, float] | None:
        """Logarithm of the modulus and angle of the complex pair nearest to the unit circle."""
        pairs = np.flatnonzero(~self.real & (self.values.imag > 0))
        if not len(pairs):
            return None
        nearest = pairs[np.argmin(np.abs(self.logs[pairs]))]
        return float(self.logs[nearest]), float(np.angle(self.values[nearest]))

    @property
    def nearest_unit(self) -> float:
        """Logarithm of the positive multiplier nearest to 1, NaN without one."""
        positive = self.logs[self.real & (self.values.real > 0)]
        return float(positive[np.argmin(np.abs(positive))]) if len(positive) else np.nan

    @property
    def nearest_flip(self) -> float:
        """Logarithm of the modulus of the negative multiplier nearest to -1, NaN without one."""
        negative = self.logs[self.real & (self.values.real < 0)]
        return float(negative[np.argmin(np.abs(negative))]) if len(negative) else np.nan


def multipliers_at(shooting: Shooting, u: Array, last: Linearised) -> Multipliers:
    """Multipliers of an orbit from its linearisation."""
    form, _ = shooting.unpack(u)
    points = np.vstack([form.states[1:], form.states[:1] + shooting.winding])
    following = fields(
        shooting.variations,
        np.roll(form.modes, -1),
        points,
        form.times[1:],
        shooting.parameters_at(u),
        np.roll(form.constants, -1, axis=0),
    )
    _, jumps = after_jumps(
        shooting.variations,
        form.jumps,
        last.flows.ends,
        form.times[1:],
        shooting.parameters_at(u),
        form.constants,
    )
    return orbit_multipliers(
        shooting.variations,
        form.modes,
        form.ends,
        last.flows,
        last.fields,
        following,
        jumps,
        autonomous=shooting.forcing is None,
    )


def changes(signs: MultiplierSigns) -> NDArray[np.bool_]:
    """Whether anything changes between rows next to each other, as at a special point.

    Parameters
    ----------
    signs : MultiplierSigns
        Of N rows.

    Returns
    -------
    ndarray of bool, shape (N - 1,)
    """
    turns = signs.slope[1:] * signs.slope[:-1] < 0
    counts = signs.outside, signs.grown, signs.flipped, signs.neutral.sum(axis=-1)
    return np.asarray(turns | np.any([np.diff(count) != 0 for count in counts], axis=0))


@dataclass(frozen=True, eq=False)
class MultiplierChange:
    """What changes between two orbits next to each other on a branch.

    In a family of neutral orbits, and in a canard explosion, the direction of the parameter
    changes by rounding. Two points of one kind between both orbits are not seen.

    Parameters
    ----------
    one, two : MultiplierSigns
    """

    one: MultiplierSigns
    two: MultiplierSigns

    @cached_property
    def flat(self) -> bool:
        """Whether the parameter is constant to rounding."""
        return all(abs(row.slope) <= LEVEL_SLOPE for row in (self.one, self.two))

    @cached_property
    def family(self) -> bool:
        """Whether both orbits are in a family of neutral orbits at one value of the parameter."""
        return self.flat and all(row.neutral.any() for row in (self.one, self.two))

    @cached_property
    def turns(self) -> bool:
        """Whether the direction of the parameter changes."""
        return bool(self.one.slope * self.two.slope < 0) and not self.family

    @cached_property
    def known(self) -> bool:
        """Whether the change of the sign of det(M - I) is known."""
        return bool(self.one.neutral.sum() == self.two.neutral.sum())

    @cached_property
    def crosses(self) -> bool:
        """Whether the sign of det(M - I) changes."""
        return self.known and bool((self.one.grown - self.two.grown) % 2 == 1)

    @cached_property
    def doubles(self) -> bool:
        """Whether the sign of det(M + I) changes."""
        return bool((self.one.flipped - self.two.flipped) % 2 == 1)

    @cached_property
    def folds(self) -> bool:
        """Whether both the direction and det(M - I) change, or the one that is known."""
        unexplained = self.flat and not self.family
        return (self.turns and not self.known) or (self.crosses and (self.turns or unexplained))

    @cached_property
    def pairs(self) -> bool:
        """Whether a complex pair crosses the unit circle.

        A pair outside the circle may meet on the real axis and separate.
        """
        complex_ = self.one.pair is not None or self.two.pair is not None
        least = 2 + self.crosses + self.doubles
        return complex_ and bool(abs(self.one.outside - self.two.outside) >= least)
