"""Shared by all tests: the reference models, built once."""

import contextlib
import gc
import os
import shutil
from importlib import import_module

import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers

# the processes share the processors already: a waiting thread of BLAS takes time from another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import fastslow as fs
from tests.invariants import checked
from tests.samples import WHOLE, examples, left_out

# SymPy's first use of a function is slow: the time of one example says nothing. In CI the
# examples are the same at every run, so that a failure is the change's own.
EXAMPLES = examples(100)
settings.register_profile("random", deadline=None, max_examples=EXAMPLES)
settings.register_profile("fixed", deadline=None, derandomize=True, max_examples=EXAMPLES)
settings.load_profile("fixed" if os.environ.get("CI") else "random")
if not WHOLE:
    # the constants in all sources as examples: three seconds in each process of a fresh clone
    providers._get_local_constants = lambda: providers._local_constants


#: A browser that opens pages, and its options.
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)

#: Folders whose files share what takes long: one process runs them all.
TOGETHER = ("tests/analyses", "tests/docs", "tests/errors", "tests/symbolic")

#: What takes long begins first: no process waits for another one's at the end.
FIRST = ("tests/docs", "tests/test_types.py", "tests/symbolic")

#: What SymPy does not import; their sources are as long as its own.
IN_ADVANCE = ("matplotlib.pyplot", "scipy.integrate", "pandas", "xarray", "zarr", "numba")


#: Functions whose results are examined, in the order in which their modules import each other.
EXAMINED = (
    ("fastslow.diagrams.trace.tracing", "continue_equilibria"),
    ("fastslow.diagrams.curves.point_curves", "continue_points"),
    ("fastslow.orbits.trace.branches", "continue_orbits"),
    ("fastslow.orbits.trace.frozen_branches", "continue_cycles"),
)


def pytest_configure():
    """Look for garbage seldom, and examine every branch that a test computes."""
    # SymPy and the rewriting of assertions make many objects
    gc.set_threshold(50_000, 20, 20)
    for module, name in EXAMINED:
        home = import_module(module)
        setattr(home, name, checked(getattr(home, name)))


def pytest_collection(session):
    """Import packages in another order, and tests from the last on, in every other process.

    Each process then finds half of them compiled, with assertions rewritten, by another one.
    """
    if int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]) % 2 == 0:
        return
    for package in IN_ADVANCE:
        with contextlib.suppress(ImportError):
            import_module(package)
    root = session.config.rootpath
    for folder in session.config.args:
        for path in sorted((root / folder).rglob("test_*.py"), reverse=True):
            # what fails is reported where it is collected
            with contextlib.suppress(Exception, pytest.skip.Exception):
                import_module(".".join(path.relative_to(root).with_suffix("").parts))


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Look for examples in the docstrings of tests only where there are any."""
    collectors = yield
    if not file_path.match("test_*.py") or ">>>" in file_path.read_text("utf-8"):
        return collectors
    return [collector for collector in collectors if type(collector) is pytest.Module]


def pytest_collection_finish():
    """Look for no garbage among the modules and tests."""
    gc.freeze()


def pytest_collection_modifyitems(config, items):
    unused = left_out(items)
    if unused:
        config.hook.pytest_deselected(items=[item for item in items if item in unused])
        items[:] = [item for item in items if item not in unused]
    items.sort(key=lambda item: not item.nodeid.startswith(FIRST))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Spread the tests over processes file by file, but for some folders."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file = super()._split_scope(nodeid)
            return next((folder for folder in TOGETHER if file.startswith(folder)), file)

    return Scheduling(config, log) if config.getvalue("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def gear():
    """The harmonic gear at the values of the reference trajectory P1."""
    return fs.systems.harmonic_gear()


@pytest.fixture(scope="session")
def folded_gear():
    """The harmonic gear with negative stiffness: A < −D², two folds."""
    return fs.systems.harmonic_gear(A=-0.6)


@pytest.fixture(scope="module")
def browser_page():
    """A page of a real browser, without a window and a network; another one would take long.

    Its event loop runs until the end of the module, and no other can beside it.
    """
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        message = f"no browser: none of {', '.join(BROWSERS)} is installed"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=list(QUIET))
        yield browser.new_context(offline=True).new_page()
        browser.close()
