"""Resultants of polynomials in one unknown, over integer polynomials in a parameter.

Integer determinants of the Bézout matrix by Kronecker substitution: the parameter is a power of two
larger than twice any coefficient of the result, whose coefficients are the digits in that base
(Kronecker 1882; von zur Gathen & Gerhard 2013, section 8.4).
"""

from __future__ import annotations

from fastslow.continuation.polynomial_systems import IntegerTerms


def resultant(one: IntegerTerms, other: IntegerTerms) -> list[int]:
    """Return the coefficients in the parameter, highest first, of a resultant by the unknown.

    Up to its sign.

    Parameters
    ----------
    one, other : mapping
        Exponents of the unknown and of the parameter to a coefficient; both contain the
        unknown.

    Examples
    --------
    For x² − p and x − 2, which have a common root if 4 − p = 0:

    >>> resultant({(2, 0): 1, (0, 1): -1}, {(1, 0): 1, (0, 0): -2})
    [1, -4]
    """
    first, second = sorted((one, other), key=_degree, reverse=True)
    bits = _bits(first, second)
    above, below = _at_base(first, bits), _at_base(second, bits)
    whole = _determinant(_bezout(above, below))
    return _digits(whole // above[-1] ** (len(above) - len(below)), bits)


def discriminant(polynomial: IntegerTerms) -> list[int]:
    """Return the coefficients of a discriminant, for a degree of at least two.

    Examples
    --------
    For x² + p x + 1:

    >>> discriminant({(2, 0): 1, (1, 1): 1, (0, 0): 1})
    [1, 0, -4]
    """
    slope: IntegerTerms = {(i - 1, k): i * c for (i, k), c in polynomial.items() if i}
    bits = _bits(polynomial, slope)
    coefficients = _at_base(polynomial, bits)
    matrix = _bezout(coefficients, _at_base(slope, bits))
    return _digits(_determinant(matrix) // coefficients[-1] ** 2, bits)


def _degree(terms: IntegerTerms) -> int:
    return max(i for i, _ in terms)


def _bits(one: IntegerTerms, other: IntegerTerms) -> int:
    """Return the bits of twice a bound on the coefficients of the resultant.

    Each row of the Sylvester matrix has the coefficients of one of the polynomials.
    """
    first, second = (sum(map(abs, terms.values())) for terms in (one, other))
    bound = first ** _degree(other) * second ** _degree(one)
    return int(bound.bit_length()) + 1


def _at_base(terms: IntegerTerms, bits: int) -> list[int]:
    """Return coefficients in the unknown, lowest first, with a power of two as parameter."""
    found = [0] * (_degree(terms) + 1)
    for (i, k), c in terms.items():
        found[i] += c << bits * k
    return found


def _digits(number: int, bits: int) -> list[int]:
    """Return the signed digits of a number, highest first."""
    found, base = [], 1 << bits
    while number:
        digit = number & (base - 1)
        digit -= base if digit >= base >> 1 else 0
        found.append(digit)
        number = (number - digit) >> bits
    return found[::-1]


def _bezout(f: list[int], g: list[int]) -> list[list[int]]:
    """Return coefficients of (f(x) g(y) − f(y) g(x)) / (x − y), with deg g ≤ deg f."""
    n = len(f) - 1
    g = [*g, *[0] * (len(f) - len(g))]
    matrix = [[0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i, n):
            known = matrix[i - 1][j + 1] if i and j + 1 < n else 0
            matrix[i][j] = matrix[j][i] = known + f[j + 1] * g[i] - f[i] * g[j + 1]
    return matrix


def _determinant(matrix: list[list[int]]) -> int:
    """Compute a determinant by fraction-free elimination (Bareiss 1968)."""
    size, sign, last = len(matrix), 1, 1
    for k in range(size - 1):
        row = next((i for i in range(k, size) if matrix[i][k]), None)
        if row is None:
            return 0
        if row != k:
            matrix[k], matrix[row], sign = matrix[row], matrix[k], -sign
        top = matrix[k]
        pivot = top[k]
        for lower in matrix[k + 1 :]:
            factor = lower[k]
            for j in range(k + 1, size):
                lower[j] = (lower[j] * pivot - factor * top[j]) // last
        last = pivot
    return sign * matrix[-1][-1]
