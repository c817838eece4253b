"""The linearised equations of multiple shooting as blocks, one for each segment.

With the time t_k at the beginning of segment k beside its first state z_k and its duration d_k, its
n + 1 equations contain only y_k = (z_k, t_k, d_k), what belongs to the next segment, the period and
the parameters. Of very many unknowns the Jacobian would mostly consist of zeros.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.orbits.flow.equations import NODE, ShootingEquations
from fastslow.orbits.flow.flows import Fields, Flows, after_jumps, fields, flow
from fastslow.orbits.flow.forcing import Forcing
from fastslow.orbits.flow.segments import Segments
from fastslow.orbits.flow.variations import Variations

Array = NDArray[np.float64]

#: Number of unknowns from which the equations are kept as blocks.
BLOCKS_FROM = 400


@dataclass(frozen=True, eq=False)
class Blocks:
    """Coefficients of the equations of K segments: n for the states and one for the end.

    Parameters
    ----------
    own, following : ndarray, shape (K, n + 1, n + 2)
        By the state, time and duration of the segment, and of the next one.
    border : ndarray, shape (K, n + 1, 1 + P)
        By the period and the chosen parameters.
    last : ndarray, shape (n + 1 + P,)
        Of the last equation, by the first state, the period and the parameters.
    """

    own: Array
    following: Array
    border: Array
    last: Array

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Numbers of segments, states and chosen parameters."""
        K, rows, columns = self.border.shape
        return K, rows - 1, columns - 1

    def in_order(self, values: Array, last: float) -> Array:
        """Values of the equations of all segments, shape (K, n + 1), in the order of residuals."""
        return np.concatenate([values[:, :-1].reshape(-1), values[:, -1], [last]])

    def by_segment(self, values: Array) -> Array:
        """Values in the order of residuals, or of unknowns, by segment, shape (K, n + 1)."""
        K, n, _ = self.sizes
        return np.column_stack([values[: K * n].reshape(K, n), values[K * n : K * (n + 1)]])

    def scaled(self, scale: Array) -> Blocks:
        """The equations in units of the unknowns, and of their rows; see `row_sizes`."""
        K, n, P = self.sizes
        length = scale[K * (n + 1)]
        sizes = np.column_stack([self.by_segment(scale)[:, :n], np.full((K, 2), length)])
        border = scale[K * (n + 1) :]
        return Blocks(
            self.own * sizes[:, None, :],
            self.following * np.roll(sizes, -1, axis=0)[:, None, :],
            self.border * border[: P + 1],
            self.last * np.concatenate([sizes[0, :n], border[: P + 1]]),
        )

    def row_sizes(self) -> tuple[Array, float]:
        """Largest coefficient of every equation."""
        tables = self.own, self.following, self.border
        rows = np.max([np.abs(table).max(axis=2) for table in tables], axis=0)
        return rows, float(np.abs(self.last).max())

    def over(self, rows: Array, last: float) -> Blocks:
        """The equations divided by the sizes of their rows."""
        part = rows[:, :, None]
        return Blocks(self.own / part, self.following / part, self.border / part, self.last / last)

    def without_parameters(self) -> Blocks:
        """The equations at fixed parameters."""
        _, n, _ = self.sizes
        return replace(self, border=self.border[:, :, :1], last=self.last[: n + 1])

    def dense(self) -> Array:
        """The Jacobian, with the unknowns of `fastslow.orbits.flow.shooting`."""
        K, n, P = self.sizes
        N = K * (n + 1) + 1
        found = np.zeros((N, N + P))
        for k in range(K):
            beyond = (k + 1) % K
            states = slice(k * n, (k + 1) * n)
            rows = [*range(k * n, (k + 1) * n), K * n + k]
            found[rows, states] += self.own[k, :, :n]
            found[rows, beyond * n : (beyond + 1) * n] += self.following[k, :, :n]
            found[rows, K * n : K * n + k] += self.own[k, :, n, None]
            found[rows, K * n + k] += self.own[k, :, n + 1]
            found[rows, K * n + beyond] += self.following[k, :, n + 1]
            found[rows, N - 1 :] = self.border[k]
        found[-1, :n], found[-1, N - 1 :] = self.last[:n], self.last[n:]
        return found


def assembled(
    variations: Variations,
    equations: ShootingEquations,
    segments: Segments,
    period: float,
    parameters: Array,
    forcing: Forcing | None,
) -> tuple[Array, Blocks, Flows, Fields]:
    """Residual and blocks of the equations, with the flow and the fields they are made of.

    As `fastslow.orbits.flow.equations.assemble`, which fills in the Jacobian.
    """
    K, n, P = len(segments), variations.n, len(variations.places)
    flows = flow(
        *(variations, segments.modes, segments.states, segments.times[:-1], segments.durations),
        *(parameters, segments.constants),
    )
    points = np.roll(segments.states, -1, axis=0)
    points[-1] += equations.winding
    ends = np.where(equations.numbers[:, None] >= 0, flows.ends, points)
    here = ends, segments.times[1:], parameters, segments.constants
    known = fields(variations, segments.modes, *here)
    values = np.zeros((K, n + 1))
    own, following = np.zeros((2, K, n + 1, n + 2))
    border = np.zeros((K, n + 1, 1 + P))
    values[:, :n] = flows.ends - points
    values[flows.reached != segments.durations] = np.nan
    own[:, :n, : n + 1] = flows.slopes[:, :, : n + 1]
    own[:, :n, n + 1] = known.f
    following[:, range(n), range(n)] = -1.0
    border[:, :n, 1:] = flows.slopes[:, :, n + 1 :]
    at_events = np.flatnonzero(equations.ends >= 0)
    g_u = known.g_u[at_events, equations.ends[at_events]]
    values[at_events, n] = known.g[at_events, equations.ends[at_events]]
    own[at_events, n, n:] = g_u[:, n, None]
    border[at_events, n, 1:] = g_u[:, n + 1 :]
    following[at_events, n, :n] = g_u[:, :n]
    jumping = np.flatnonzero(equations.numbers >= 0)
    if len(jumping):
        after, after_u = after_jumps(variations, equations.numbers, *here)
        values[jumping, :n] = (after - points)[jumping]
        following[jumping, n] = 0.0
        for k in jumping.tolist():
            # by the state at the end of the flow, time and parameters
            by_end = np.vstack([after_u[k], known.g_u[k, equations.ends[k]]])
            along = own[k, :n].copy()
            own[k] = by_end[:, :n] @ along
            own[k, :, n:] += by_end[:, n, None]
            border[k, :, 1:] = by_end[:, :n] @ border[k, :n, 1:] + by_end[:, n + 1 :]
    for k in np.flatnonzero(equations.ends == NODE).tolist():
        lengths = equations.durations[k : k + 2]
        first, second = lengths / (0.5 * lengths.sum())
        values[k, n] = second * segments.durations[k] - first * segments.durations[k + 1]
        own[k, n, n + 1], following[k, n, n + 1] = second, -first
    if equations.ends[-1] < 0:
        values[-1, n] = segments.durations.sum() - period
        own[-1, n, n:], border[-1, n, 0] = 1.0, -1.0
    held, across = equations.held, equations.across
    values[-1, :n] += across @ known.g[-1, held]
    by_held = across @ known.g_u[-1, held]
    following[-1, :n, :n] += by_held[:, :n]
    own[-1, :n, n:] += by_held[:, n, None]
    border[-1, :n, 1:] += by_held[:, n + 1 :]
    last = np.zeros(n + 1 + P)
    if forcing is None:
        last[:n] = equations.direction
        rest = float(equations.direction @ (segments.states[0] - equations.reference))
    else:
        length, slopes = forcing.period(parameters)
        last[n], last[n + 1 :] = 1.0, -equations.multiple * slopes
        rest = period - equations.multiple * length
    blocks = Blocks(own, following, border, last)
    return blocks.in_order(values, rest), blocks, flows, known
