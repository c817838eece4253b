"""Branches deleted from diagrams of random systems, which a certificate finds again.

Cubic polynomials of one or two states over a parameter, whose diagrams have several branches.
One branch or the half of one is deleted; the certificate of what is left must be complete, name
the missing curve, and return a diagram with as many equilibria as proved, at values of the
parameter between the special points.
"""

from dataclasses import replace

import numpy as np

import fastslow as fs
from tests.campaigns.deletions import random_diagram, repeated

#: Values of the parameter at which equilibria are counted.
VALUES = np.linspace(-1.937, 1.961, 12)


def counted(diagram, window, value):
    """Number of equilibria of a diagram inside a window, at a value of the parameter."""
    return sum(
        all(low <= e[name] <= high for name, (low, high) in window.items())
        for e in diagram.at(p=value)
    )


def one(report, rng, number):
    """Delete a branch of one random system."""
    model, window, diagram = random_diagram(rng, 1 + number % 2)
    if not len(diagram):
        return
    k = int(rng.integers(len(diagram)))
    branches, branch = list(diagram.branches), diagram[k]
    half = number % 4 == 3 and len(branch) > 20
    branches[k : k + 1] = [branch[: len(branch) // 2]] if half else []
    found = fs.certify(model, replace(diagram, branches=tuple(branches)), window=window)
    if not found.complete:
        report.skipped += 1
        return
    report.deleted += 1
    failures = len(report.failures)
    where = f"system {number}, branch {k}{' cut' * half}"
    if not found.missing:
        report.failures.append(f"{where}: nothing is missing")
    for value in VALUES:
        try:
            proved = found.count(p=value)
        except fs.ArgumentError:
            continue
        again = counted(found.diagram, window, value)
        if again != proved:
            report.failures.append(f"{where}: {again} of {proved} equilibria at p = {value:.6g}")
    report.found += failures == len(report.failures)


def campaign(count=100, seed=0):
    """Delete so many branches."""
    return repeated(one, "branches", count, seed)
