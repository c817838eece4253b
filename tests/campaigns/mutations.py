"""Single lines changed at random, and whether the tests of the same layer notice.

A copy of the project is changed, never the checkout, and compiles into a directory of its own.
Each change is met by the tests of its layer in `tests`, the most closely related first:
``test_<module>.py``, the files that mention what the module defines, the others. What the
package as a whole is tested by, and the examples in docstrings, do not count.

First come those of ``mutations.toml`` that once passed every test near them, each with the test
that fails since. The same file lists equivalent changes, with the reason: they are not counted.
"""

from __future__ import annotations

import ast
import multiprocessing
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from tests.campaigns.single_changes import Change, changes_of, takes_effect

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_suffix(".toml")

#: What modules outside of a layer are tested by.
TESTS = {
    "__init__": "tests/test_imports.py",
    "arguments": "tests/errors",
    "errors": "tests/errors",
    "disk": "tests/test_disk.py",
    "precompilation": "tests/test_precompilation.py",
}

#: Processor time that no test takes, in seconds, the compilation of every loop included.
LIMIT = 150

#: Processor time after which the tests of a layer are stopped, in seconds.
SECONDS = 600

#: Time after which the tests of a layer hang, in seconds, however busy the machine is.
LONGEST = 3000

#: Stands before the name of each test that begins.
BEGINS = "begins: "

#: Status of a process that could not import the changed module.
NOT_IMPORTED = 77

#: What is imported once, for every process that runs tests.
HEAVY = ("matplotlib.backends.backend_agg", "matplotlib.figure", "mpmath", "numba", "numpy")
HEAVY += ("pandas", "pytest", "scipy.integrate", "scipy.optimize", "scipy.special", "sympy")


@dataclass(frozen=True)
class Mutant:
    """A changed line.

    Parameters
    ----------
    file : str
        From the root of the project.
    line : int
    original, mutated : str
        The line before and after, without indentation.
    source : str
        The whole file after the change.
    test : str
        What is expected to notice; the layer's tests where empty.
    """

    file: str
    line: int
    original: str
    mutated: str
    source: str
    test: str = ""

    @property
    def layer(self) -> str:
        return layer_of(self.file)

    def __str__(self) -> str:
        return f"{self.file}:{self.line}\n        {self.original}\n     -> {self.mutated}"


@dataclass
class Report:
    """How many changes were noticed in each layer, and which were not."""

    caught: Counter[str] = field(default_factory=Counter)
    hung: Counter[str] = field(default_factory=Counter)
    not_imported: Counter[str] = field(default_factory=Counter)
    survived: Counter[str] = field(default_factory=Counter)
    stopped: Counter[str] = field(default_factory=Counter)
    equivalent: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    @property
    def failures(self) -> bool:
        """Whether less than nine of ten were noticed, or one of the list was not."""
        named = any("of the list" in fault for fault in self.faults)
        caught = self.caught.total() + self.hung.total()
        return named or caught < 9 * (self.survived.total() + self.stopped.total())

    def __str__(self) -> str:
        columns = (self.caught, self.hung, self.survived, self.stopped)
        columns += (self.not_imported, self.equivalent)
        lines = [f"{'':14}  caught  hung  survived  stopped  not importable  equivalent"]
        for layer in sorted({name for column in columns for name in column}):
            counts = [column[layer] for column in columns]
            lines.append(_row(layer, counts))
        lines.append(_row("all", [column.total() for column in columns]))
        return "\n".join(lines + [f"    {fault}" for fault in self.faults])


def _row(name: str, counts: list[int]) -> str:
    widths = (6, 6, 10, 9, 16, 12)
    return f"{name:14}  " + "".join(f"{n:{w}}" for n, w in zip(counts, widths, strict=True))


def layer_of(file: str) -> str:
    """The folder of a module in the package, or its own name."""
    return Path(file).parts[1].removesuffix(".py")


def layers() -> tuple[str, ...]:
    """All folders and single modules of the package that hold code."""
    found = sorted({layer_of(str(p.relative_to(ROOT))) for p in ROOT.glob("fastslow/**/*.py")})
    return tuple(name for name in found if _test_folder(name).exists())


def _test_folder(layer: str, root: Path = ROOT) -> Path:
    return root / TESTS.get(layer, f"tests/{layer}")


def listed() -> dict[str, list[dict[str, str]]]:
    """The changes of ``mutations.toml``, under ``named`` and ``equivalent``."""
    return tomllib.loads(LIST.read_text(encoding="utf-8"))


def named_mutants() -> list[Mutant]:
    """Those that have a test of their own."""
    found = []
    for entry in listed()["named"]:
        source = (ROOT / entry["file"]).read_text(encoding="utf-8")
        line = source[: source.index(entry["original"])].count("\n") + 1
        changed = source.replace(entry["original"], entry["mutated"])
        texts = entry["original"], entry["mutated"]
        found.append(Mutant(entry["file"], line, *texts, changed, entry["test"]))
    return found


def random_mutants(layer: str, count: int, seed: int) -> list[Mutant]:
    """Changes of a layer's modules, every line that can be changed as likely as any other."""
    generator = random.Random(f"{layer} {seed}")
    by_line: dict[tuple[Path, int], list[Change]] = {}
    sources = {}
    inside, alone = ROOT.glob(f"fastslow/{layer}/**/*.py"), ROOT.glob(f"fastslow/{layer}.py")
    for path in sorted([*inside, *alone]):
        sources[path] = path.read_text(encoding="utf-8")
        for change in changes_of(sources[path]):
            by_line.setdefault((path, change.line), []).append(change)
    places = list(by_line)
    generator.shuffle(places)
    found: list[Mutant] = []
    for path, line in places:
        if len(found) == count:
            break
        source = sources[path]
        change = generator.choice(by_line[path, line])
        if takes_effect(change, source):
            file = path.relative_to(ROOT).as_posix()
            found.append(Mutant(file, line, *change.lines(source), change.applied(source)))
    return found


class Tree:
    """A copy of the project, in which one module at a time is changed."""

    def __init__(self, folder: Path, seconds: int = SECONDS) -> None:
        # some tests run as another user, who has to read the copy
        folder.chmod(0o755)
        self.seconds = seconds
        self.root = folder / "project"
        self.cache = folder / "cache"
        self.log = folder / "log"
        unwanted = shutil.ignore_patterns("__pycache__", ".*", "build", "figures", "notebooks")
        for name in ("fastslow", "tests", "analyses", "docs"):
            shutil.copytree(ROOT / name, self.root / name, ignore=unwanted)
        for name in ("pyproject.toml", "README.md", "LICENSE"):
            shutil.copy2(ROOT / name, self.root / name)
        self.warm = Path(os.environ.get("FASTSLOW_CACHE", folder / "warm"))
        self.sound: dict[str, bool] = {}

    def tests(self, mutant: Mutant) -> list[str]:
        """Files of the layer's tests, the most closely related first."""
        folder = _test_folder(mutant.layer, self.root)
        if mutant.test:
            return [mutant.test]
        stem = Path(mutant.file).stem
        every = [folder] if folder.is_file() else sorted(folder.glob("test_*.py"))
        words = re.compile(rf"\b({'|'.join([*_names(mutant.source), stem])})\b")
        mentions = {path: len(words.findall(path.read_text(encoding="utf-8"))) for path in every}
        ordered = sorted(every, key=lambda p: (p.stem != f"test_{stem}", -mentions[p], p))
        return [str(p.relative_to(self.root)) for p in ordered]

    def meet(self, mutant: Mutant) -> tuple[str, str]:
        """Change a module, run tests until one fails, and restore it: what happened, and where."""
        path = self.root / mutant.file
        original = path.read_text(encoding="utf-8")
        path.write_text(mutant.source, encoding="utf-8")
        try:
            return self._run(self.tests(mutant), mutant.file)
        finally:
            path.write_text(original, encoding="utf-8")

    def passes(self, test: str) -> bool:
        """Whether a test passes without any change."""
        if test not in self.sound:
            self.sound[test] = self._run([test], "fastslow/__init__.py")[0] == "survived"
        return self.sound[test]

    def _run(self, tests: list[str], changed: str) -> tuple[str, str]:
        shutil.rmtree(self.cache, ignore_errors=True)
        if self.warm.is_dir():
            shutil.copytree(self.warm, self.cache)
        module = ".".join(Path(changed).with_suffix("").parts).removesuffix(".__init__")
        process = multiprocessing.get_context("fork").Process(
            target=_pytest, args=(self.root, self.cache, self.log, module, tests, self.seconds)
        )
        process.start()
        assert process.pid is not None
        process.join(LONGEST)
        hangs = process.is_alive() or process.exitcode == -signal.SIGPROF
        with suppress(ProcessLookupError):
            # what tests have started as well
            os.killpg(process.pid, signal.SIGKILL)
        process.join()
        if process.exitcode == NOT_IMPORTED:
            return "not importable", ""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        began = re.findall(rf"^{BEGINS}(.*)$", text, re.MULTILINE)
        where = began[-1] if began else tests[0]
        if hangs:
            return "hung", where
        if process.exitcode == -signal.SIGXCPU:
            return "stopped", where
        if process.exitcode == 0:
            return "survived", ""
        return "caught", where


def _names(source: str) -> list[str]:
    """What a module defines for others."""
    names = [getattr(node, "name", "") for node in ast.parse(source).body]
    return [name for name in names if name and not name.startswith("_")]


class _Limited:
    """Ends a process in which a test takes too long."""

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        print(f"\n{BEGINS}{nodeid}", flush=True)
        signal.setitimer(signal.ITIMER_PROF, LIMIT)


def _pytest(
    root: Path, cache: Path, log: Path, module: str, tests: list[str], seconds: int
) -> None:
    """Run tests in a copy of the project, in a process of its own."""
    os.setsid()
    with log.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.RLIM_INFINITY))
    os.chdir(root)
    here = {str(ROOT), ""}
    sys.path[:] = [str(root), *(entry for entry in sys.path if entry not in here)]
    for name in [n for n in sys.modules if n.split(".")[0] in ("tests", "fastslow")]:
        del sys.modules[name]
    # examples of hypothesis are the same at every run
    os.environ |= {"PYTHONPATH": str(root), "FASTSLOW_CACHE": str(cache), "CI": "true"}
    try:
        import_module(module)
    except BaseException:
        os._exit(NOT_IMPORTED)
    import pytest

    options = ["-x", "-q", "--tb=line", "-p", "no:cacheprovider", "--rootdir", str(root)]
    status = pytest.main([*options, *tests], plugins=[_Limited()])
    sys.stdout.flush()
    os._exit(int(status))


def check(tree: Tree, mutant: Mutant, report: Report) -> None:
    """Have a change met by tests, and count what happened."""
    began = time.monotonic()
    found, where = tree.meet(mutant)
    if found == "caught" and not tree.passes(where):
        raise RuntimeError(f"{where} fails without any change")
    columns: dict[str, Any] = {
        "caught": report.caught,
        "hung": report.hung,
        "not importable": report.not_imported,
        "survived": report.survived,
        "stopped": report.stopped,
    }
    columns[found][mutant.layer] += 1
    if found in ("survived", "stopped") or (mutant.test and found != "caught"):
        report.faults.append(f"{'of the list, ' if mutant.test else ''}{found} {mutant}")
    seconds = time.monotonic() - began
    print(f"{found}, {seconds:.0f} s, {where}: {mutant}", file=sys.stderr, flush=True)


def campaign(count: int = 100, seed: int = 1, layer: str = "", seconds: int = SECONDS) -> Report:
    """The listed changes and random ones, of one layer or spread evenly over all.

    The tests of a change that none of them has noticed after ``seconds`` of processor time are
    stopped; that counts as one that nothing noticed.
    """
    if layer and layer not in layers():
        raise ValueError(f"{layer} is no layer; those with tests are {', '.join(layers())}")
    for name in HEAVY:
        import_module(name)
    report = Report()
    chosen = (layer,) if layer else layers()
    equivalent = {(e["file"], e["original"], e["mutated"]) for e in listed()["equivalent"]}
    mutants = [mutant for mutant in named_mutants() if mutant.layer in chosen]
    for k, name in enumerate(chosen):
        mutants += random_mutants(name, len(range(k, count, len(chosen))), seed)
    with tempfile.TemporaryDirectory(prefix="mutations-") as folder:
        tree = Tree(Path(folder), seconds)
        for mutant in mutants:
            if (mutant.file, mutant.original, mutant.mutated) in equivalent:
                report.equivalent[mutant.layer] += 1
            else:
                check(tree, mutant, report)
    return report
