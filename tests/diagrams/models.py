"""Models of any size whose special points are known by construction."""

import numpy as np
import sympy as sp

import fastslow as fs

P = sp.Symbol("p")

#: The parameter of the Brusselator.
LENGTH = "L"


def crossing_model(size, seed):
    """x' = J(p) x − |r| x³ with eigenvalues of J that cross the imaginary axis where they should.

    J is a block-diagonal matrix with rates from 10⁻³ to 10³, turned by random
    orthogonal matrices within groups of at most six states (three, where there are
    many). Some blocks cross in one or the other direction, the rest stay stable.

    Returns
    -------
    model : Model
        With the parameter p, for a range from −1 to 1.
    hopf, zero : list of float
        Where a complex pair and a single eigenvalue cross, in order.
    """
    rng = np.random.default_rng(seed)
    matrix = sp.zeros(size, size)
    hopf, zero, k = [], [], 0
    while k < size:
        rate = float(10.0 ** rng.uniform(-3, 3))
        width = min(int(rng.integers(1, 3)), size - k)
        crossing = rng.random() < (0.3 if size < 30 else 0.1)
        place = sp.Float(rng.uniform(-0.9, 0.9))
        sense = 1 if rng.random() < 0.7 else -1
        level = sense * (P - place) if crossing else -sp.Float(rng.uniform(0.2, 3))
        matrix[k, k] = rate * level
        if width == 2:
            turn = rate * float(rng.uniform(0.1, 3))
            matrix[k + 1, k + 1] = rate * level
            matrix[k, k + 1], matrix[k + 1, k] = -turn, turn
        if crossing:
            (hopf if width == 2 else zero).append(float(place))
        k += width
    order = rng.permutation(size)
    matrix = matrix.extract(order.tolist(), order.tolist())
    constant = np.array(matrix.subs(P, 0), dtype=float)
    slope = np.array(matrix.diff(P), dtype=float)
    turn = np.zeros((size, size))
    most = 6 if size < 30 else 3
    for start in range(0, size, most):
        group = slice(start, min(start + most, size))
        width = group.stop - group.start
        turn[group, group] = np.linalg.qr(rng.normal(size=(width, width)))[0]
    constant, slope = turn @ constant @ turn.T, turn @ slope @ turn.T
    states = sp.symbols(f"x1:{size + 1}")
    rates = {}
    for i, x in enumerate(states):
        terms = [
            (sp.Float(constant[i, j]) + sp.Float(slope[i, j]) * P) * other
            for j, other in enumerate(states)
            if constant[i, j] or slope[i, j]
        ]
        rates[x] = sp.Add(*terms) - x**3
    return fs.Model(rates, parameters={P: 0}), sorted(hopf), sorted(zero)


def brusselator(cells, feed=2.0):
    """The Brusselator on a line of length L with fixed ends, two states for each cell.

    Returns
    -------
    model : Model
        With the parameter `LENGTH`.
    hopf : list of float
        Its Hopf points: where B − 1 − A² = (D₁ + D₂) μ/L² for an eigenvalue μ of the
        discrete Laplacian, and the determinant is positive.
    """
    length = sp.Symbol(LENGTH)
    first, second, ratio = 0.008, 0.004, 5.45
    x, y = sp.symbols(f"x1:{cells + 1}"), sp.symbols(f"y1:{cells + 1}")
    step = 1.0 / (cells + 1)

    def spread(states, end, k):
        left = states[k - 1] if k else end
        right = states[k + 1] if k < cells - 1 else end
        return (left - 2 * states[k] + right) / (step * length) ** 2

    rates = {
        x[k]: first * spread(x, feed, k) + x[k] ** 2 * y[k] - (ratio + 1) * x[k] + feed
        for k in range(cells)
    }
    for k in range(cells):
        rates[y[k]] = second * spread(y, ratio / feed, k) - x[k] ** 2 * y[k] + ratio * x[k]
    modes = 4 / step**2 * np.sin(np.arange(1, cells + 1) * np.pi * step / 2) ** 2
    squares = (first + second) * modes / (ratio - 1 - feed**2)
    determinant = (ratio - 1 - first * modes / squares) * (
        -(feed**2) - second * modes / squares
    ) + feed**2 * ratio
    return fs.Model(rates, parameters={length: 1}), np.sqrt(squares[determinant > 0]).tolist()


def chafee_infante(points):
    """u' = u_xx + p (u − u³) on (0, 1) with u = 0 at both ends, by central differences.

    Returns
    -------
    model : Model
    zero : list of float
        Branch points of u = 0: the eigenvalues of the discrete Laplacian.
    """
    u = sp.symbols(f"u1:{points + 1}")
    step = 1.0 / (points + 1)
    rates = {}
    for k, here in enumerate(u):
        left, right = (u[k - 1] if k else 0), (u[k + 1] if k < points - 1 else 0)
        rates[here] = (left - 2 * here + right) / step**2 + P * (here - here**3)
    modes = 4 / step**2 * np.sin(np.arange(1, points + 1) * np.pi * step / 2) ** 2
    return fs.Model(rates, parameters={P: 2}), modes.tolist()
