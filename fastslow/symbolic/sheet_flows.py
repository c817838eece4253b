"""The desingularised slow flow on each sheet of a critical manifold: of regions, and of sliding."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.model import Model
from fastslow.model.rational import exact
from fastslow.model.structure import TIME, real

Array = NDArray[np.float64]

#: Time of the desingularised flow, in slow time, and its unit.
ELAPSED, FLOW_UNIT = sp.symbols("elapsed_0 unit_0", real=True)


@dataclass(frozen=True, eq=False)
class SheetFlow:
    """The slow flow where f vanishes, in one region or sliding along one interface.

    The sliding rates are multiplied by a positive factor, and a rate towards the interface is
    added, so that f has n independent components in both.

    Parameters
    ----------
    name : str
        Of the region; of the interface, for sliding.
    fast, slow : tuple of str
        States and slow variables; ``"t"`` for the phase of a forcing.
    f, g : sympy.Matrix, shape (n, 1) and (m, 1)
        Rates of both; those of the fast states may have another positive factor.
    walls : mapping of str to sympy.Expr
        By interface, or by region which is entered from sliding: positive on the sheet.
    parameters : tuple of str
    sliding : bool
    """

    name: str
    fast: tuple[str, ...]
    slow: tuple[str, ...]
    f: sp.ImmutableDenseMatrix
    g: sp.ImmutableDenseMatrix
    walls: Mapping[str, sp.Expr]
    parameters: tuple[str, ...]
    sliding: bool = False

    @cached_property
    def x(self) -> list[sp.Symbol]:
        """The fast states."""
        return [real(n) for n in self.fast]

    @cached_property
    def y(self) -> list[sp.Symbol]:
        """The slow variables."""
        return [real(n) for n in self.slow]

    @cached_property
    def orientation(self) -> sp.Expr:
        """(−1)ⁿ det f_x, positive on attracting sheets."""
        determinant = self.f.jacobian(self.x).det(method="berkowitz")
        return sp.sympify((-1) ** len(self.x) * determinant)

    @cached_property
    def desingularised(self) -> list[sp.Expr]:
        """Rates of x and y, in which time is multiplied by the orientation."""
        pushed = self.f.jacobian(self.x).adjugate() * self.f.jacobian(self.y) * self.g
        side = (-1) ** (len(self.x) + 1)
        return [*(side * e for e in pushed), *(self.orientation * e for e in self.g)]

    @cached_property
    def oscillation(self) -> sp.Expr | None:
        """The Hurwitz determinant that vanishes at Hopf points of the fast rates, if n > 1."""
        n = len(self.x)
        if n == 1:
            return None
        a = self.f.jacobian(self.x).charpoly(sp.Dummy("lam")).all_coeffs()

        def entry(i: int, j: int) -> sp.Expr:
            return a[2 * j - i + 1] if 0 <= 2 * j - i + 1 <= n else sp.S.Zero

        return sp.sympify(sp.Matrix(n - 1, n - 1, entry).det(method="berkowitz"))

    @cached_property
    def over_time(self) -> Model:
        """The desingularised flow as a model, with the slow time that has elapsed."""
        phase = {TIME: real(f"{TIME.name}_0")}
        names = [*self.fast, *(f"{n}_0" if n == TIME.name else n for n in self.slow)]
        rates = [FLOW_UNIT * e.xreplace(phase) for e in self.desingularised]
        rates.append(FLOW_UNIT * self.orientation.xreplace(phase))
        return Model(
            dict(zip([*names, ELAPSED.name], rates, strict=True)),
            parameters=dict.fromkeys((*self.parameters, FLOW_UNIT.name), 1.0),
        )

    def stops(self) -> dict[str, str]:
        """Return expressions that are positive on the attracting sheet, by what ends it, as text.

        Without those that are the same everywhere.
        """
        phase = {TIME: real(f"{TIME.name}_0")}
        found = {"fold": self.orientation, **self.walls}
        if self.oscillation is not None:
            found["Hopf"] = self.oscillation
        moving = {*self.x, *self.y}
        return {
            name: str(e.xreplace(phase)) for name, e in found.items() if moving & e.free_symbols
        }

    @cached_property
    def _function(self) -> Callable[..., Any]:
        """All numbers of a place, flat: f, f_x, f_y, g, flow, orientation with gradient, walls."""
        z = [*self.x, *self.y]
        rows = [
            *self.f,
            *self.f.jacobian(z),
            *self.g,
            *self.desingularised,
            self.orientation,
            *(self.orientation.diff(s) for s in z),
            *self.walls.values(),
        ]
        known = [real(n) for n in self.parameters]
        made: Callable[..., Any] = sp.lambdify([*z, *known], rows, "numpy", cse=True)
        return made

    def at(self, place: Array, values: Mapping[str, float]) -> SheetNumbers:
        """Return f, its derivatives, the slow flow and the walls at a place (x, y)."""
        n, m = len(self.x), len(self.y)
        flat = self._computed(self._function, place, values)
        sizes = [n, n * (n + m), m, n + m, 1, n + m, len(self.walls)]
        f, jacobian, g, flow, height, slope, walls = np.split(flat, np.cumsum(sizes)[:-1])
        return SheetNumbers(f, jacobian.reshape(n, n + m), g, flow, float(height[0]), slope, walls)

    @cached_property
    def _bending(self) -> Callable[..., Any]:
        rows = [e.diff(a).diff(b) for e in self.f for a in self.x for b in self.x]
        known = [real(n) for n in self.parameters]
        made: Callable[..., Any] = sp.lambdify([*self.x, *self.y, *known], rows, "numpy")
        return made

    def bending(self, place: Array, values: Mapping[str, float]) -> Array:
        """Second derivatives of f in x, shape (n, n, n)."""
        n = len(self.x)
        return self._computed(self._bending, place, values).reshape(n, n, n)

    def _computed(
        self, function: Callable[..., Any], place: Array, values: Mapping[str, float]
    ) -> Array:
        """Numbers at a place, NaN where a function is not defined there."""
        # NumPy's numbers: a power or a quotient of Python's would be complex, or raise
        known = np.array([values[p] for p in self.parameters])
        with np.errstate(all="ignore"):
            return np.array(function(*place, *known), dtype=float)


@dataclass(frozen=True, eq=False)
class SheetNumbers:
    """The slow flow at one place.

    Parameters
    ----------
    f : ndarray, shape (n,)
    jacobian : ndarray, shape (n, n + m)
    g : ndarray, shape (m,)
    flow : ndarray, shape (n + m,)
        Desingularised.
    orientation : float
    slope : ndarray, shape (n + m,)
        Gradient of the orientation.
    walls : ndarray, shape (k,)
    """

    f: Array
    jacobian: Array
    g: Array
    flow: Array
    orientation: float
    slope: Array
    walls: Array

    @property
    def inner(self) -> Array:
        """f_x, shape (n, n)."""
        return self.jacobian[:, : len(self.f)]

    @property
    def attracting(self) -> bool:
        """Whether all eigenvalues of f_x have negative real part."""
        if not np.isfinite(self.inner).all():
            return False
        return bool((np.linalg.eigvals(self.inner).real < 0.0).all())


def flows_of_sheets(model: Model, slow: tuple[str, ...]) -> dict[str, SheetFlow]:
    """Return the slow flow of all regions, and of sliding along interfaces with jumps.

    Parameters
    ----------
    model : Model
    slow : tuple of str
        The slow variables.
    """
    fast, names = model.states, (*model.states, *model.slow_states)
    made: dict[str, SheetFlow] = {}
    rates = {}
    for key, region in model.regions.items():
        laws = {real(n): exact(law) for n, law in region.forcing.items()}
        each = {n: sp.sympify(exact(region.rates[n])).xreplace(laws) for n in names}
        f = sp.ImmutableDenseMatrix([each[n] for n in fast])
        g = sp.ImmutableDenseMatrix([each.get(n, sp.S.One) for n in slow])
        walls = {
            name: region.signs[name] * sp.sympify(exact(one.function)).xreplace(laws)
            for name, one in model.interfaces.items()
        }
        rates[key] = f, g
        made[key] = SheetFlow(key, fast, slow, f, g, walls, tuple(model.parameters))
    x = [real(n) for n in fast]
    for name in model.interfaces:
        if model.continuous[name]:
            continue
        for key, region in model.regions.items():
            other = across(model, key, name)
            if region.signs[name] < 0 or other is None:
                continue
            h = made[key].walls[name]
            gradient = sp.Matrix([h]).jacobian(x)
            if gradient.is_zero_matrix:
                continue
            (above, gain), (below, loss) = rates[key], rates[other]
            up, down = (gradient * below)[0], (gradient * above)[0]
            # towards the interface on both sides: up > 0 > down
            tangent = up * above - down * below
            mean = (up * gain - down * loss) / (up - down)
            walls = {n: w for n, w in made[key].walls.items() if n != name}
            walls |= {other: up, key: -down}
            made[f"{key}|{other}"] = SheetFlow(
                f"{key}|{other}",
                fast,
                slow,
                sp.ImmutableDenseMatrix(tangent - h * gradient.T),
                sp.ImmutableDenseMatrix(mean),
                walls,
                tuple(model.parameters),
                sliding=True,
            )
    return made


def across(model: Model, region: str, interface: str) -> str | None:
    """Return the region on the other side of an interface, None if there is none."""
    signs = dict(model.regions[region].signs)
    signs[interface] = -signs[interface]
    return next((n for n, one in model.regions.items() if dict(one.signs) == signs), None)
