"""The direction of imports, the lightness of the package, and names that would hide each other."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import fastslow

pytestmark = pytest.mark.slow

ROOT = Path(fastslow.__file__).parent
#: Run by what builds wheels, and by nothing of this package.
HOOK = ROOT / "kernels" / "compiler" / "build.py"
FILES = sorted(path for path in ROOT.rglob("*.py") if path != HOOK)
PACKAGE_INIT = ROOT / "__init__.py"

# from the top down: a layer may import those that follow it, and itself
LAYERS = [
    "systems",
    "interactive",
    "analysing",
    "plot",
    "precompilation",
    "wheel",
    "passage",
    "sweeps",
    "orbits",
    "certification",
    "diagrams",
    "continuation",
    "simulation",
    "kernels",
    "readers",
    "exporters",
    "symbolic",
    "model",
    "results",
    "disk",
    "formulas",
    "quotients",
    "arguments",
    "errors",
]


def layer_of(path: Path) -> str:
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def type_checking(node: ast.AST) -> bool:
    test = node.test if isinstance(node, ast.If) else None
    return getattr(test, "id", getattr(test, "attr", "")) == "TYPE_CHECKING"


def imports(tree: ast.AST, late: bool = True) -> set[str]:
    """Dotted names of every module imported, without TYPE_CHECKING blocks."""
    found: set[str] = set()
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            module = node.module or ""
            inside = {f"{module}.{alias.name}" for alias in node.names}
            found |= inside if module == "fastslow" else {module}
        elif type_checking(node):
            found |= {name for part in node.orelse for name in imports(part, late)}
        elif not isinstance(node, ast.expr) and (
            late or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        ):
            found |= imports(node, late)
    return found


def from_imports(tree: ast.AST) -> Iterator[ast.ImportFrom]:
    """Every ``from … import``, also inside functions and for annotations."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ImportFrom):
            yield node
        elif not isinstance(node, ast.expr):
            yield from from_imports(node)


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def modules_of(path: Path, late: bool = True) -> set[str]:
    return imports(tree(path), late)


def parents(names: set[str]) -> set[str]:
    return {name.split(".")[0] for name in names}


def inside(names: set[str]) -> set[str]:
    """Layers among the modules imported."""
    return {name.split(".")[1] for name in names if name.startswith("fastslow.")}


#: What the package may import of others at all.
FOREIGN = {
    "libsbml",
    "llvmlite",
    "matplotlib",
    "mpmath",
    "numba",
    "numpy",
    "scipy",
    "sympy",
    "tqdm",
}
BELOW_PLOT = {"arguments", "disk", "errors", "formulas", "plot", "quotients", "results"}


def test_imports_point_down():
    upward = []
    for path in FILES:
        if path != PACKAGE_INIT:
            layer = layer_of(path)
            assert layer in LAYERS, f"{layer} is not one of the layers"
            above = inside(modules_of(path)) - {*LAYERS[LAYERS.index(layer) :]}
            upward += [f"{path.relative_to(ROOT)} imports from {other}" for other in above]
    assert upward == []


def import_graph() -> dict[str, set[str]]:
    """Every module with the modules that it imports, also inside functions and for annotations."""
    files = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in FILES}
    graph: dict[str, set[str]] = {name: set() for name in files}
    for name, path in files.items():
        for node in from_imports(tree(path)):
            module = node.module or ""
            full = [module, *(f"{module}.{alias.name}" for alias in node.names)]
            graph[name] |= {one.removeprefix("fastslow.") for one in full} & graph.keys()
        plain = (node for node in ast.walk(tree(path)) if isinstance(node, ast.Import))
        whole = {alias.name.removeprefix("fastslow.") for node in plain for alias in node.names}
        graph[name] |= whole & graph.keys()
    return graph


def circles(graph: dict[str, set[str]]) -> set[tuple[str, ...]]:
    """Strongly connected components of more than one module."""
    reached = {name: set(graph[name]) for name in graph}
    for middle in graph:
        for name in graph:
            if middle in reached[name]:
                reached[name] |= reached[middle]
    return {
        tuple(sorted(other for other in reached[name] if name in reached[other]))
        for name in graph
        if name in reached[name]
    }


def test_no_circle_of_imports():
    assert circles(import_graph()) == set()


def both_ways(graph: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Folders, neither inside the other, each of which imports from the other one."""

    def folder(name: str) -> str:
        return name.rpartition(".")[0]

    arrows = {
        (folder(name), folder(other))
        for name, others in graph.items()
        for other in others
        if not name.endswith("__init__") and not other.endswith("__init__")
    }
    found = {tuple(sorted(arrow)) for arrow in arrows if arrow[::-1] in arrows}
    return {(one, two) for one, two in found if one and not f"{two}.".startswith(f"{one}.")}


def test_folders_import_in_one_direction():
    # results are displayed as they are saved
    assert both_ways(import_graph()) <= {("results.base", "results.io")}


def third_parties(path: Path) -> set[str]:
    """Imports of a file that its layer does not allow."""
    layer, names = layer_of(path), modules_of(path)
    own = {"fastslow", *sys.stdlib_module_names}
    foreign = parents(names) - own
    wrong = foreign - FOREIGN
    if layer == "results":
        wrong |= parents(modules_of(path, late=False)) - own - {"numpy"}
    if layer == "formulas" and path.name != "symbolic.py":
        wrong |= foreign - {"numpy"}
    if layer in {"results", "plot"}:
        wrong |= names & {"fastslow.formulas.symbolic"}
    if layer == "plot":
        wrong |= foreign - {"matplotlib", "numpy"} | inside(names) - BELOW_PLOT
    if layer == "continuation":
        wrong |= inside(names) & {"model"}
    if layer not in {"plot", "interactive"}:
        wrong |= foreign & {"matplotlib"}
    return wrong


def test_third_parties_stay_in_their_layers():
    found = {str(path.relative_to(ROOT)): third_parties(path) for path in FILES}
    assert {path: names for path, names in found.items() if names} == {}


def test_no_module_bears_the_name_of_a_public_function():
    functions = set()
    for path in FILES:
        for node in tree(path).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                functions.add((path.parent, node.name))
    functions |= {(ROOT, name) for name in fastslow.__all__ if name not in {"plot", "systems"}}
    modules = {(path.parent, path.stem) for path in FILES if path.stem != "__init__"}
    modules |= {(path.parent.parent, path.parent.name) for path in FILES if path.stem == "__init__"}
    assert sorted(str(folder / name) for folder, name in functions & modules) == []


def run(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    return done.stdout.strip()


STEPS = """
import sys
heavy = {"sympy", "numba", "scipy"}
import fastslow
print("the package", sorted((heavy | {"matplotlib", "numpy"}) & set(sys.modules)))
fastslow.Diagram
print("results", sorted((heavy | {"matplotlib"}) & set(sys.modules)))
fastslow.plot
print("plots", sorted((heavy | {"matplotlib.pyplot"}) & set(sys.modules)))
"""


def test_the_package_imports_nothing_heavy_results_numpy_and_plots_matplotlib():
    assert run(STEPS) == "the package []\nresults []\nplots []"


RUN = """
import sys, sympy as sp, fastslow as fs
x, v, t, w = sp.symbols("x v t w")
model = fs.Model({x: v, v: w - v - x - sp.Abs(x) / 2}, forcing={w: sp.sin(t)})
heavy = {"numba", "scipy.linalg", "scipy.optimize", "matplotlib", "numpy.f2py"}
fs.simulate(model, [0, 0], periods=1)
print(sorted(heavy & set(sys.modules)))
fs.continue_equilibria(model.frozen(), w, (-1, 1))
print(sorted(heavy & set(sys.modules)))
"""


#: What a run of the gear and of the cusp needs of roots and exponentials is here.
OVERLAYS = """
import sys, fastslow as fs
heavy = {"scipy.optimize", "scipy.integrate", "scipy.ndimage"}
for model, slow, start in (
    (fs.systems.harmonic_gear(), "w", [0, 0]), (fs.systems.cusp(omega=0.002), "p", [-1.0])
):
    diagram = fs.continue_equilibria(model.frozen(), slow, over=(-2, 6))
    fs.overlay(diagram, fs.simulate(model, start, periods=1)).summary()
print(sorted(heavy & set(sys.modules)))
"""


def test_a_run_whose_code_is_at_hand_imports_nothing_that_compiles_and_an_overlay_no_optimisation():
    exec(RUN, {})  # compiles
    assert run(RUN + OVERLAYS) == "[]\n[]\n[]"


def test_every_public_name_is_there():
    for name in fastslow.__all__:
        assert getattr(fastslow, name) is not None
        assert name in dir(fastslow)


def test_an_unknown_name_suggests_the_nearest():
    with pytest.raises(AttributeError, match="unknown name 'simulat'; did you mean 'simulate'"):
        fastslow.simulat  # noqa: B018
    with pytest.raises(AttributeError, match="no attribute '__nothing__'"):
        fastslow.__nothing__  # noqa: B018


def test_every_public_name_has_a_home():
    assert {*fastslow._HOME, "__version__"} == set(fastslow.__all__)
