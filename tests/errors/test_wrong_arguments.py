"""Every argument of every public function, given wrongly: the error and the words promised."""

import pytest

from fastslow.results.base.table import Table
from tests.errors.subjects import RESULTS, public_functions, subjects
from tests.errors.wrong_arguments import BY_FUNCTION, rows_of
from tests.errors.wrong_by_parameter import BY_PARAMETER

pytestmark = pytest.mark.slow


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


def test_a_result_that_is_asked_by_name_is_not_gone_through_by_number():
    for kind in RESULTS:
        if issubclass(kind, Table) and "__getitem__" in dir(kind):
            assert "__iter__" in dir(kind), kind
