"""Special points deleted from diagrams of random systems, which a certificate finds again.

Cubic polynomials of one or two states over a parameter. One fold or Hopf point is deleted from
the diagram, every second time with its row; the certificate must name it as missing, at the same
place, and its list of points must be that of the whole diagram.
"""

from dataclasses import replace

import numpy as np

import fastslow as fs
from tests.campaigns.deletions import random_diagram, repeated

#: Largest distance between the deleted point and the one found.
NEAR = 1e-7


def without(branch, label, row):
    """A branch without one special point, and without its row."""
    k = [point.label for point in branch.special].index(label)
    at, rows = branch.special_rows[k], list(branch.special_rows)
    del rows[k]
    special = type(branch.special)(p for p in branch.special if p.label != label)
    columns = {}
    if row:
        rows = [r - (r > at) for r in rows]
        names = ("state", "values", "tangent", "eigenvalues", "region")
        columns = {name: np.delete(getattr(branch, name), at, axis=0) for name in names}
    return replace(branch, special=special, special_rows=tuple(rows), **columns)


def one(report, rng, number):
    """Delete a point of one random system."""
    model, window, diagram = random_diagram(rng, 1 + number % 2)
    places = [
        (k, point)
        for k, branch in enumerate(diagram.branches)
        for point in branch.special
        if point.code in ("LP", "HB") and all(a < point[n] < b for n, (a, b) in window.items())
    ]
    if not places:
        return
    k, point = places[int(rng.integers(len(places)))]
    branches = list(diagram.branches)
    branches[k] = without(branches[k], point.label, bool(number % 2))
    found = fs.certify(model, replace(diagram, branches=tuple(branches)), window=window)
    if not found.all_points:
        report.skipped += 1
        return
    report.deleted += 1
    where = f"system {number}, {point.label}"
    codes = sorted(q.code for _, q in places)
    # neutral saddles are not listed completely
    proved = sorted(code for code in found.points["code"].tolist() if code != "NSD")
    if proved != codes:
        report.failures.append(f"{where}: {proved} are proved of {codes}")
    elif [q.code for q in found.missing] != [point.code]:
        report.failures.append(f"{where}: missing are {found.missing}")
    elif max(abs(found.missing[0][n] - point[n]) for n in (*window, "p")) > NEAR:
        report.failures.append(f"{where}: found at {found.missing[0]}")
    elif found.missing[0].enclosure is None:
        report.failures.append(f"{where}: found without an enclosure")
    else:
        report.found += 1


def campaign(count=100, seed=0):
    """Delete so many points."""
    return repeated(one, "points", count, seed)
