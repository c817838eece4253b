"""Every argument of every public function, given wrongly: the error and the words promised."""

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.base.table import Table
from tests.errors.subjects import RESULTS, public_functions, subjects
from tests.errors.wrong_arguments import BY_FUNCTION, rows_of
from tests.errors.wrong_by_parameter import BY_PARAMETER

pytestmark = pytest.mark.slow

MASKED = np.ma.masked_array([1.0, 2.0], [False, True])
MASKED_LOAD = np.ma.masked_array([0.0, 1e6, 2.0], [False, True, False])


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


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


@pytest.mark.parametrize("name", sorted(public_functions()))
def test_wrong_arguments(name):
    subject = subjects()[name]
    for parameter in subject.parameters:
        for given, error, words in rows_of(name, parameter):
            with pytest.raises(error) as raised:
                subject.call(**{parameter: given})
            text = str(raised.value)
            assert words in text, f"{name}({parameter}={given!r}): {text}"


@pytest.mark.parametrize("name", sorted(public_functions()))
def test_masked_values_are_refused_in_every_argument(name):
    subject = subjects()[name]
    kinds = {n: p.kind for n, p in subject.signature.parameters.items()}
    for parameter, kind in kinds.items():
        for given in (MASKED, [1.0, MASKED[1]], {"D": MASKED}):
            several = {kind.VAR_POSITIONAL: [given], kind.VAR_KEYWORD: {"D": given}}
            with pytest.raises(fs.FastSlowError):
                print(parameter, subject.call(**{parameter: several.get(kind, given)}))


def test_the_refusal_of_masked_values():
    model = fs.Model({"x": "a - x"}, parameters={"a": 1})
    for call in (
        lambda: fs.Tabulated([0, 1, 2], MASKED_LOAD),
        lambda: fs.simulate(model, np.ma.masked_array([1.0], [True]), t=(0, 1)),
        lambda: fs.simulate_many(model, [[0.0]], parameters={"a": MASKED_LOAD}, t=(0, 1)),
        lambda: fs.sweep(lambda a: a, {"a": MASKED_LOAD}),
    ):
        with pytest.raises(fs.ArgumentError, match=r"1 of \d values? of an array is masked; expec"):
            call()
    whole = np.ma.masked_array([0.0, 1.0, 2.0], [False, False, False])
    assert fs.Tabulated([0, 1, 2], whole) == fs.Tabulated([0, 1, 2], [0, 1, 2])


def test_a_result_that_is_asked_by_name_is_not_gone_through_by_number():
    for kind in RESULTS:
        if issubclass(kind, Table) and "__getitem__" in dir(kind):
            assert "__iter__" in dir(kind), kind
