"""Every argument of every public function, given wrongly: the error and the words promised."""

import inspect

import pytest

import fastslow as fs
from fastslow.results.base.table import Table
from tests.errors.subjects import RESULTS, SPECIAL, subjects
from tests.errors.wrong_arguments import BY_FUNCTION, rows_of
from tests.errors.wrong_by_parameter import BY_PARAMETER

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def public_functions():
    """The name in the documentation of everything public that takes an argument."""
    found = set()
    for home, prefix in ((fs, ""), (fs.plot, "plot."), (fs.systems, "systems.")):
        for name in home.__all__:
            thing = getattr(home, name)
            if inspect.isfunction(thing):
                found |= {prefix + name} if inspect.signature(thing).parameters else set()
            elif inspect.isclass(thing) and not issubclass(thing, Exception):
                found |= {f"{prefix}{name}.{m}" for m in methods_of(thing)}
                if thing not in RESULTS and prefix == "":
                    found.add(name)
    # the drawings share one way to save, but for the panel
    saves = {n for n in found if n.endswith("Drawing.save")}
    return found - saves | {"plot.Drawing.save", "plot.PanelDrawing.save"}


def methods_of(kind):
    for name in dir(kind):
        method = inspect.getattr_static(kind, name)
        if not inspect.isfunction(method) or (name.startswith("_") and name not in SPECIAL):
            continue
        if len(inspect.signature(method).parameters) > 1:
            yield name


def test_every_public_function_is_tried():
    assert public_functions() == set(subjects())


def test_every_argument_has_wrong_values():
    lacking = [
        f"{name}.{parameter}"
        for name, subject in subjects().items()
        for parameter in subject.parameters
        if not rows_of(name, parameter)
    ]
    assert lacking == []


def test_no_entry_is_for_nothing():
    used = {(n, p) for n, s in subjects().items() for p in s.parameters}
    names = {f"{n}.{p}" for n, p in used}
    assert set(BY_FUNCTION) <= names
    assert set(BY_PARAMETER) <= {p for n, p in used if f"{n}.{p}" not in BY_FUNCTION}


@pytest.mark.parametrize("name", subjects())
def test_wrong_arguments(name):
    subject = subjects()[name]
    for parameter in subject.parameters:
        for given, error, words in rows_of(name, parameter):
            with pytest.raises(error) as raised:
                subject.call(**{parameter: given})
            text = str(raised.value)
            assert words in text, f"{name}({parameter}={given!r}): {text}"


def test_a_result_that_is_asked_by_name_is_not_gone_through_by_number():
    for kind in RESULTS:
        if issubclass(kind, Table) and "__getitem__" in dir(kind):
            assert "__iter__" in dir(kind), kind
