"""The key of compiled code: every module that is compiled into it, found from the imports."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fastslow
from fastslow.kernels import loops
from fastslow.kernels.compiler import digest as closures
from fastslow.kernels.compiler import model_code

pytestmark = pytest.mark.slow

ROOT = Path(fastslow.__file__).parent


def name_of(path):
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {name_of(path): path for path in sorted(ROOT.rglob("*.py"))}

# every module with code for Numba, or whose names generated code imports
KERNELS = sorted(
    name
    for name, path in FILES.items()
    if re.search(r"^@((inlined_|unfused_)?kernel|(literal_)?instructions)$", path.read_text(), re.M)
)


LAYERS = (["kernels"], ["continuation"], ["simulation"])


def source(kernel):
    return f"from {kernel} import anything"


def test_the_kernels_are_found():
    loops = {
        "fastslow.kernels.compiler.pointers",
        "fastslow.continuation.engine",
        "fastslow.continuation.evaluation",
        "fastslow.continuation.isolation",
        "fastslow.simulation.stepper.collocation",
        "fastslow.simulation.stepper.driver",
        "fastslow.simulation.stepper.lanes",
        "fastslow.simulation.stepper.radau",
    }
    assert loops <= set(KERNELS)


def forget():
    for remembered in (closures._imports, closures._digest, closures._read):
        remembered.cache_clear()


@pytest.fixture
def copied(tmp_path, monkeypatch):
    """A copy of the package, from which the keys are taken."""
    shutil.copytree(ROOT, tmp_path / "fastslow", ignore=shutil.ignore_patterns("__pycache__"))

    def read_again():
        found = dict(closures._sources(str(tmp_path / "fastslow"), "fastslow"))
        monkeypatch.setattr(closures, "_SOURCES", found)
        forget()

    read_again()
    yield tmp_path, read_again
    forget()


def keys():
    return {kernel: closures.digest_of_imports(source(kernel)) for kernel in KERNELS}


def test_the_key_changes_with_every_file_of_the_closure_and_with_no_other(copied):
    folder, read_again = copied
    before = keys()
    assert len(set(before.values())) == len(KERNELS)
    members = {kernel: closures.import_closure(source(kernel)) for kernel in KERNELS}
    for module in sorted(set().union(*members.values()) | {"fastslow.diagrams.trace.tracing"}):
        path = folder / FILES[module].relative_to(ROOT.parent)
        whole = path.read_bytes()
        path.write_bytes(whole + b"\n")
        read_again()
        changed = {kernel for kernel, key in keys().items() if key != before[kernel]}
        assert changed == {kernel for kernel in KERNELS if module in members[kernel]}, module
        path.write_bytes(whole)
    read_again()
    assert keys() == before


def test_two_numbers_exchanged_in_a_module_without_code_change_the_key(copied):
    folder, read_again = copied
    before = keys()
    path = folder / "fastslow" / "continuation" / "spaces.py"
    text = path.read_text(encoding="utf-8")
    assert text.count("SMALL_STEP, WINDOW") == 1
    path.write_text(text.replace("SMALL_STEP, WINDOW", "WINDOW, SMALL_STEP"), encoding="utf-8")
    read_again()
    assert keys()["fastslow.continuation.engine"] != before["fastslow.continuation.engine"]


def test_code_of_a_file_that_changed_after_its_import_has_a_key_of_its_own(copied):
    folder, _ = copied
    path = folder / "fastslow" / "continuation" / "spaces.py"
    os.utime(path, (0, 0))
    first = closures.digest_of_imports(source("fastslow.continuation.engine"))
    forget()
    assert closures.digest_of_imports(source("fastslow.continuation.engine")) != first


def test_what_is_imported_when_a_kernel_is_imported_is_in_its_closure():
    program = f"""
import sys, numba
for kernel in {KERNELS}:
    for name in [name for name in sys.modules if name.split(".")[0] == "fastslow"]:
        del sys.modules[name]
    __import__(kernel)
    print(kernel, *(name for name in sys.modules if name.split(".")[0] == "fastslow"))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120
    )
    lines = [line.split() for line in done.stdout.splitlines()]
    assert [kernel for kernel, *_ in lines] == KERNELS
    left_out = set()
    for kernel, *loaded in lines:
        left_out |= set(loaded) - closures.import_closure(source(kernel))
    # only packages above a module are left out, and they hold no code
    for name in left_out - {"fastslow"}:
        assert FILES[name].name == "__init__.py"
        body = ast.parse(FILES[name].read_text(encoding="utf-8")).body
        assert all(isinstance(node, ast.Expr) for node in body), name


def parsed(tree):
    """Modules of this package that are imported, by the parser."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif not (isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"):
            yield from parsed(node)


def test_the_imports_that_are_found_are_those_of_the_parser():
    for path in (path for name, path in FILES.items() if name.split(".")[1:2] in LAYERS):
        text = path.read_text(encoding="utf-8")
        wanted = {name for name in parsed(ast.parse(text)) if name in FILES}
        assert wanted <= set(closures.imported(text)), path


def test_closures_of_kernels_hold_no_model_and_no_result():
    for kernel in KERNELS:
        closure = closures.import_closure(source(kernel))
        others = {name for name in closure if name.split(".")[1:2] not in LAYERS}
        # functions that stored arithmetic and formulas have too
        shared = {"fastslow.formulas.elementary", "fastslow.quotients"}
        shared |= {"fastslow.results.stored.conditions"}
        assert others <= {*KERNELS, kernel.rpartition(".")[0], *shared}, kernel


def test_a_module_that_is_not_there_is_an_error():
    with pytest.raises(ModuleNotFoundError, match=r"no source of fastslow\.nothing"):
        closures.import_closure("from fastslow.nothing import anything")


def test_the_key_of_loops_holds_the_compiler():
    held = closures.import_closure(loops._MAKER)
    assert {
        f"fastslow.kernels.compiler.{name}" for name in ("loop_compiler", "loop_target")
    } <= held


def test_the_key_of_models_holds_all_that_their_code_is_made_by():
    makers = {f"compiler.{name}" for name in ("model_code", "machine_code", "native", "store")}
    makers |= {"special"}
    makers |= {"simd.functions", "simd.lane_steps", "simd.lanes"}
    held = closures.import_closure(model_code._MAKERS)
    assert {f"fastslow.kernels.{name}" for name in makers} <= held
    assert not any(name.startswith("fastslow.simulation") for name in held)
