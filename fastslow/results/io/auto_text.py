"""The text of files of AUTO-07p: diagrams (b., fort.7), solutions (s.), diagnostics (d.).

The layout is that of the manual (Doedel and Oldeman 2012, AUTO-07P: continuation and
bifurcation software for ordinary differential equations, chapter 4).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.disk import read_file
from fastslow.errors import FileError, quoted

Array = NDArray[np.float64]

#: Widths of branch, point, type and label, and of each number.
NUMBER_WIDTHS = 19

#: The start of a row: branch, point, type and label.
LEADING_NUMBERS = 4

#: Maximal number of parameters in a file; AUTO has 36 by default.
MOST_PARAMETERS = 10_000


#: An entry of ``parnames`` or ``unames``: a number and the name in quotes.
_NAMED = re.compile(r"(\d{1,9})\s*:\s*(['\"])(.*?)\2")

#: A number in Fortran format.
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf\w*)", re.I | re.A)


@dataclass(frozen=True, eq=False)
class AutoCurve:
    """One curve of a diagram file.

    Parameters
    ----------
    constants : mapping
        AUTO's constants that its header shows, such as ``"IPS"``, and ``"parnames"``
        and ``"unames"``.
    columns : tuple of str
        Names of the numbers.
    branches, points, types, labels : ndarray of int, shape (N,)
        Of a stable point the number is negative.
    numbers : ndarray, shape (N, len(columns))
    line : int
        Where in the file its rows begin.
    """

    constants: Mapping[str, Any]
    columns: tuple[str, ...]
    branches: NDArray[np.int64]
    points: NDArray[np.int64]
    types: NDArray[np.int64]
    labels: NDArray[np.int64]
    numbers: Array
    line: int


@dataclass
class _Reading:
    """State of the parser of a diagram file."""

    constants: dict[str, Any] = field(default_factory=dict)
    header: str = ""
    line: int = 0
    rows: list[list[str]] = field(default_factory=list)


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file.

    Raises
    ------
    FileError
        When it cannot be read.
    """
    return read_file(path).decode("utf-8", "replace").splitlines()


def sections_of(path: Path) -> list[AutoCurve]:
    """Return the curves of a diagram file, in order.

    Raises
    ------
    FileError
        For a file that is none, with the line.
    """
    now = _Reading()
    found: list[AutoCurve] = []
    for number, line in enumerate(lines_of(path), start=1):
        words = line.split()
        if not words:
            continue
        if words[0] == "0":
            found += _finished(path, now)
            _header(now, line)
        else:
            now.line = now.line or number
            now.rows.append(words)
    found += _finished(path, now)
    return found


def _header(now: _Reading, line: str) -> None:
    """Parse one line of a header."""
    text = line.strip()[1:].strip()
    if text.startswith("PT"):
        now.header = line
        return
    if re.fullmatch(r"[-+.\dE\s]+", text):
        # the plot window is the first line of the header of a new run
        now.constants = {}
        return
    for name, value in re.findall(r"\b(\w+)\s*=\s*(-?\d{1,9})(?![\d.E])", text):
        now.constants[name] = int(value)
    named = re.match(r"(parnames|unames)\s*=\s*\{(.*)\}", text)
    if named:
        names = {int(k): name for k, _, name in _NAMED.findall(named[2])}
        if all(0 < k <= MOST_PARAMETERS for k in names):
            now.constants[named[1]] = names


def _finished(path: Path, now: _Reading) -> Iterator[AutoCurve]:
    """Return the section of the collected rows, if there are any."""
    if not now.rows:
        return
    where = f"{path}, line {now.line}"
    if not now.header:
        raise FileError(f"{where}: numbers without a header; expected a diagram file of AUTO-07p")
    count = len(now.rows[0])
    columns = _columns(now.header, count - LEADING_NUMBERS)
    if count <= LEADING_NUMBERS + 1 or len(columns) != count - LEADING_NUMBERS:
        raise FileError(
            f"{where}: {count} numbers under the header {quoted(now.header.strip())}; expected a "
            "diagram file of AUTO-07p"
        )
    values = []
    for k, row in enumerate(now.rows):
        if len(row) != count:
            raise FileError(
                f"{path}, row {k + 1} after line {now.line - 1}: {len(row)} numbers, expected "
                f"{count}; the file is cut short or damaged"
            )
        values.append([real(word, path) for word in row])
    table = np.array(values)
    if not (np.abs(table[:, :LEADING_NUMBERS]) < 2**31).all():
        raise FileError(
            f"{where}: a branch, point, type or label is no number of AUTO-07p; the file is damaged"
        )
    if not np.isfinite(table).all():
        first = int(np.nonzero(~np.isfinite(table).all(axis=1))[0][0])
        raise FileError(
            f"{path}, row {first + 1} after line {now.line - 1}: a number is not finite; AUTO-07p "
            "lost the curve there, or the file is damaged; remove that row to read the others"
        )
    whole = table[:, :LEADING_NUMBERS].astype(np.int64)
    yield AutoCurve(
        dict(now.constants),
        columns,
        whole[:, 0],
        whole[:, 1],
        whole[:, 2],
        whole[:, 3],
        table[:, LEADING_NUMBERS:],
        now.line,
    )
    now.rows, now.line = [], 0


def _columns(header: str, count: int) -> tuple[str, ...]:
    """Return the names of the numbers, each centred in the width of its number."""
    text = header.expandtabs()
    names = tuple(
        text[NUMBER_WIDTHS * (k + 1) : NUMBER_WIDTHS * (k + 2)].strip() for k in range(count)
    )
    if all(names) and not text[NUMBER_WIDTHS * (count + 1) :].strip():
        return names
    return tuple(re.split(r"\s{2,}", header.strip())[LEADING_NUMBERS:])


def real(word: str, path: Path) -> float:
    """Parse a number in Fortran format, including ``1.5D-3`` and ``-1.7976+308``.

    Examples
    --------
    >>> real("1.5D-3", Path("b.x")), real("-1.7976+308", Path("b.x"))
    (0.0015, -1.7976e+308)
    """
    text = re.sub(r"(?<=[\d.])[dD]?([+-]\d+)$", r"e\1", word)
    if not _NUMBER.fullmatch(text):
        raise FileError(f"{path}: {quoted(word)} is no number; the file is cut short or damaged")
    return float(text)


def parameters_of(path: Path) -> dict[int, Array]:
    """Return all parameters of the labelled equilibria of a solutions file, by label.

    Periodic solutions are passed over.

    Raises
    ------
    FileError
        For a file that is none, or cut short.
    """
    lines = lines_of(path)
    found: dict[int, Array] = {}
    at = 0
    while at < len(lines):
        words = lines[at].split()
        if not words:
            at += 1
            continue
        try:
            head = [int(word) for word in words]
            label, parts, rows, count = head[3], head[6], head[8], head[11]
        except (ValueError, IndexError):
            head, rows, count = [], 0, 0
        if rows < 1 or not 0 <= count <= MOST_PARAMETERS:
            raise FileError(f"{path}, line {at + 1}: expected the header of a solution of AUTO-07p")
        block = [word for line in lines[at + 1 : at + 1 + rows] for word in line.split()]
        if at + rows >= len(lines) or len(block) < count:
            raise FileError(f"{path} is cut short: the solution with label {label} is not whole")
        at += 1 + rows
        if parts == 1:
            # the parameters are last
            found[label] = np.array([real(word, path) for word in block[len(block) - count :]])
    return found


#: A line of diagnostics with an eigenvalue: its number and its two parts.
_EIGENVALUE = re.compile(r"\s*-?\d+\s+-?\d+\s+Eigenvalue\s+(\d{1,9}):\s+(\S+)\s+(\S+)")

#: A line of diagnostics that repeats a row of the diagram: branch and point.
_ROW = re.compile(r"\s*(-?\d{1,15})\s+(-?\d{1,15})\s+(?:[A-Z]{2}\s+)?\d+(?:\s+-?\d\.\d+\S*){3}")


def eigenvalues_of(path: Path, curves: Sequence[AutoCurve], n: int) -> list[NDArray[np.complex128]]:
    """Return the eigenvalues at the points of curves, from the diagnostics file of the run.

    Both files go through the curves in the same order; a row of the diagram follows
    the eigenvalues found at it, the last ones for a point that was looked for.

    Returns
    -------
    list of ndarray, shape (N, n) for each curve
        NaN where the file shows none.
    """
    rows: list[tuple[int, int, list[complex]]] = []
    shown: list[complex] = []
    for line in lines_of(path):
        one, row = _EIGENVALUE.match(line), _ROW.match(line)
        if one is not None:
            if int(one[1]) == 1:
                shown = []
            shown.append(complex(real(one[2], path), real(one[3], path)))
        elif row is not None:
            rows.append((abs(int(row[1])), abs(int(row[2])), shown))
            shown = []
    tables = []
    at = 0
    for curve in curves:
        table = np.full((len(curve.points), n), np.nan + 0j)
        for k, place in enumerate(zip(abs(curve.branches), abs(curve.points), strict=True)):
            there = next((j for j in range(at, len(rows)) if rows[j][:2] == place), None)
            if there is not None:
                at = there + 1
                if len(rows[there][2]) == n:
                    table[k] = rows[there][2]
        tables.append(table)
    return tables
