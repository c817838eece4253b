"""Rules that the signatures of all public functions follow, and their table in the reference.

``python tests/docs/test_signatures.py`` writes the table.
"""

import inspect
import re
from collections import defaultdict
from pathlib import Path

import fastslow as fs
from fastslow.results.base.result import Result

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "signatures.md"

MOST = 12

#: Positions before the keywords: the object, and what is computed.
POSITIONS = 4

#: Arguments that are always passed by keyword.
BY_KEYWORD = {
    "ax", "continuation", "dpi", "direction", "execution", "integration", "label", "legend",
    "level", "observe", "phase", "progress", "refinement", "since", "threads", "tol", "until",
    "virtual", "width", "window",
}  # fmt: skip

#: Names with another meaning elsewhere, or replaced by the name given.
REPLACED = {
    "at_least": "min_…", "discard": "settle", "kind": "type or code", "kinds": "types",
    "lay": "overlay", "law": "derivation", "least": "min_…", "longest": "max_…",
    "most": "max_…", "ones": "unit_coefficients", "parameter_name": "parameter",
    "residence": "time_fractions", "settings": "integration, continuation, …",
    "start": "t0, from_value or state", "subtype": "type", "times": "t", "word": "itinerary",
}  # fmt: skip

#: Attributes of results: the properties that follow from the code of a point, the description of a
#: law, and what was recorded of the settings.
OF_RESULTS = {"kind", "law", "settings"}

#: Keywords whose values have several forms, with the reason.
SEVERAL = {
    "ax": "a panel has three axes",
    "level": "a jump ends at a level of one state, which it names",
    "marks": "in one parameter, or in two by name",
    "parameters": "values by name; a map also takes a function",
    "period": "an array for many trajectories",
    "samples": "a number, or times",
    "settle": "a whole number of periods in a sweep",
    "state": "a map also takes several; an exported file names them",
    "t": "an explorer takes any sequence",
    "y": "an expression on an axis, a column elsewhere",
}


#: Keywords whose default differs between functions, with the reason.
DEFAULTS = {
    "from_value": "a ramp begins at 0; the measured ones at a distance from the point",
    "integration": "exponents and measured delays need smaller errors than a trajectory; orbits "
    "have the tolerance of their equations unless given",
    "legend": "a spectrum has one line",
    "level": "a section is where an expression vanishes; a jump has no level unless given",
    "marks": "values of one parameter, or of two by name",
    "n": "lines of a spectrum, or tried starts",
    "periods": "a span is given by t= or periods=; regimes are decided by runs that are extended",
    "refinement": "a regime costs many trajectories, so that its map has one level less",
    "settle": "nothing is left out of an ensemble; a fifth of a run of exponents; a sweep settles "
    "before the periods that it keeps",
    "size": "of the points of a section; a sweep has a size by their number",
    "virtual": "virtual equilibria are computed on request, and drawn where they were; a curve of "
    "points goes on beyond an interface",
    "width": "a page for several axes, else a column",
    "samples": "states of an ensemble are kept if asked for; a branch always has values",
}


def functions():
    """The public functions and methods: owner, name and function."""
    for module, prefix in ((fs, "fs"), (fs.plot, "fs.plot"), (fs.systems, "fs.systems")):
        for name in module.__all__:
            thing = getattr(module, name)
            if inspect.isfunction(thing):
                yield prefix, name, thing
            elif inspect.isclass(thing) and not issubclass(thing, Exception):
                for method in dir(thing):
                    function = inspect.getattr_static(thing, method)
                    if inspect.isfunction(function) and not method.startswith("_"):
                        yield name, method, function


def parameters_of(function):
    """Parameters without ``self``, ``*args`` and ``**kwargs``."""
    found = inspect.signature(function).parameters.values()
    return [
        p for p in found if p.name != "self" and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
    ]


FUNCTIONS = {f"{owner}.{name}": function for owner, name, function in functions()}


def offenders(check):
    """Lines with the parameters that fail a check."""
    return [
        f"{name}: {p.name}"
        for name, function in FUNCTIONS.items()
        for p in parameters_of(function)
        if not check(p)
    ]


def test_number_of_arguments():
    counts = {name: len(parameters_of(function)) for name, function in FUNCTIONS.items()}
    assert {name: n for name, n in counts.items() if n > MOST} == {}


def test_number_of_positions():
    """Ready-made models take their parameters in the order of their equations."""
    counts = {
        name: sum(p.kind is not p.KEYWORD_ONLY for p in parameters_of(function))
        for name, function in FUNCTIONS.items()
        if not name.startswith("fs.systems.")
    }
    assert {name: n for name, n in counts.items() if n > POSITIONS} == {}


def test_keywords():
    assert offenders(lambda p: p.name not in BY_KEYWORD or p.kind is p.KEYWORD_ONLY) == []


def test_replaced_names():
    assert offenders(lambda p: p.name not in REPLACED) == []


def test_attributes_of_results():
    """Attributes of results do not have names that were replaced."""
    found = {
        f"{name}.{attribute}"
        for name in fs.__all__
        if inspect.isclass(thing := getattr(fs, name)) and issubclass(thing, Result)
        for attribute in REPLACED.keys() - OF_RESULTS
        if attribute in {*dir(thing), *getattr(thing, "__dataclass_fields__", {})}
    }
    assert found == set()


def test_since_and_until_come_together():
    names = [
        name
        for name, function in FUNCTIONS.items()
        if len({"since", "until"} & {p.name for p in parameters_of(function)}) == 1
    ]
    assert names == []


def test_annotations():
    vague = re.compile(r"\bobject\b|^Any( \| None)?$")
    missing = offenders(lambda p: p.annotation is not p.empty)
    assert missing + offenders(lambda p: not vague.search(str(p.annotation))) == []


def test_a_keyword_means_the_same_everywhere():
    found = defaultdict(set)
    for function in FUNCTIONS.values():
        for p in parameters_of(function):
            if p.kind is p.KEYWORD_ONLY:
                found[p.name].add(str(p.annotation).removesuffix(" | None"))
    several = {name for name, annotations in found.items() if len(annotations) > 1}
    assert several == SEVERAL.keys()


def test_a_keyword_has_the_same_default_everywhere():
    found = defaultdict(set)
    for name, function in FUNCTIONS.items():
        for p in parameters_of(function):
            if p.default is not p.empty and not name.startswith("fs.systems."):
                found[p.name].add(repr(p.default))
    assert {name for name, defaults in found.items() if len(defaults) > 1} == DEFAULTS.keys()


def table():
    """The page with the table of all public functions."""
    lines = [
        "# Table of signatures",
        "",
        "All public functions: first the object, then what is computed, then keywords. A keyword",
        "means the same in every function. The table is generated from the signatures.",
    ]
    titles = {"fs": "Functions", "fs.plot": "Plots", "fs.systems": "Ready-made models"}
    owners = defaultdict(list)
    for owner, name, function in functions():
        owners[owner].append((name, function))
    for owner in [*titles, *sorted(owners.keys() - titles.keys())]:
        lines += ["", f"## {titles.get(owner, owner)}", ""]
        lines += ["| function | object | what | keywords |", "|---|---|---|---|"]
        for name, function in owners[owner]:
            lines.append(_row(owner, name, function, owner in titles))
    return "\n".join(lines) + "\n"


def _row(owner, name, function, plain):
    parameters = [p for p in inspect.signature(function).parameters.values() if p.name != "self"]
    words = {kind: [] for kind in ("positions", "keywords")}
    for p in parameters:
        star = {p.VAR_POSITIONAL: "\\*", p.VAR_KEYWORD: "\\*\\*"}.get(p.kind, "")
        by_keyword = p.kind in (p.KEYWORD_ONLY, p.VAR_KEYWORD)
        words["keywords" if by_keyword else "positions"].append(f"{star}`{p.name}`")
    first = [] if owner == "fs.systems" else words["positions"][:1] if plain else [f"`{owner}`"]
    what = words["positions"][len(first) if plain else 0 :]
    shown = f"`{owner}.{name}`" if plain else f"`{name}`"
    return f"| {shown} | {', '.join(first)} | {', '.join(what)} | {', '.join(words['keywords'])} |"


def test_the_table_of_the_reference():
    assert PAGE.read_text("utf-8") == table(), "run python tests/docs/test_signatures.py"


if __name__ == "__main__":
    PAGE.write_text(table(), "utf-8")
