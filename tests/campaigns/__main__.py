"""Run a campaign: ``python -m tests.campaigns NAME [count] [seed]``.

For ``detection`` a third number is the largest number of states, for ``polynomial_systems`` the
number of states of all systems, or the word cubics; for ``mutations`` a word is the one layer
that is changed, and a third number the seconds of processor time for the tests of each change.
"""

import sys
from importlib import import_module

#: Name of each campaign, and what one of its counts is. A module of the name has
#: ``campaign(count, seed)``, which returns a report with ``failures``, and prints as text.
CAMPAIGNS = {
    "arguments": "calls of each public function with something hostile in one argument",
    "cache": "damaged files of compiled code, each loaded in a process of its own",
    "certificates": "solutions by Newton's method of some systems, against curves and stability",
    "corners": "branches of orbits under random rectangular forcings, against SciPy",
    "critical_rates": "critical rates of random shifts, against bisection of runs by SciPy",
    "crossings": "crossings of random piecewise-linear systems",
    "cycles": "branches of cycles of random systems with interfaces, rows against SciPy",
    "deleted_branches": "branches deleted from diagrams of random systems, found by certificates",
    "deleted_points": "special points deleted from diagrams of random systems, found again",
    "derivations": "random models with trigonometric rates and exponents, derived and located",
    "detection": "special points of random block systems of up to 200 states",
    "enclosures": "interval enclosures of functions and their derivatives, against 250 bits",
    "events": "runs of random oscillators with three events, against restarts of SciPy",
    "figures": "figures of all analyses, compared with those of the pages; no count and no seed",
    "files": "damaged files of every kind of result, and of AUTO-07p; so many of each format",
    "gear_map": "gears over D × C/B in one store, killed twice and resumed; the count is of gears",
    "impacts": "impacts of random linear oscillators",
    "interrupts": "interrupts of a process that computes; needs POSIX signals",
    "nested_pieces": "random models with nested pieces, against their expressions and SciPy",
    "invariants": "invariants of diagrams and cycles of random systems, and missing equilibria",
    "models_in_turn": "different models used one after the other; what the process grows by",
    "overlays": "overlays of known models against SciPy; the counts are numbers of cases",
    "mutations": "single lines changed at random, each met by the tests of its layer",
    "polynomial_systems": "equilibria and diagrams of random polynomial systems",
    "samples": "all parameter sets and examples of tests that run a few; no count, but a folder",
    "sbml_suite": "cases of the SBML Test Suite; the folder of its semantic cases, and a file",
    "stores": "damaged files of stores of sweeps, chunks and metadata, loaded and resumed",
    "suites": "published models of a folder, against SciPy; a folder, and a file for the table",
    "strips": "bifurcation sweeps in strips of random oscillators, against sweeps in order",
    "switches": "changes of relays in random linear systems",
    "sweeps": "sweeps with a store, each killed or interrupted five times and resumed otherwise",
    "text": "texts given to everything that reads formulas and names",
    "windows": "branches of random polynomial diagrams with default windows",
}


def main(arguments):
    """Print the report of a campaign; 1 where something failed."""
    if not arguments or arguments[0] not in CAMPAIGNS:
        names = "\n".join(f"  {name}: {what}" for name, what in CAMPAIGNS.items())
        print(f"{__doc__}\n\n{names}")
        return 2
    module = import_module(f"tests.campaigns.{arguments[0]}")
    report = module.campaign(*(int(a) if a.isdigit() else a for a in arguments[1:]))
    print(report)
    return 1 if report.failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
