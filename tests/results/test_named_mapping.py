"""Names as keys, and errors that suggest one."""

import pickle

import pytest
import sympy as sp

import fastslow as fs
from fastslow.errors import unknown_name
from fastslow.results.base.named_mapping import NamedMapping


@pytest.fixture
def values():
    return NamedMapping("parameter", {"A": 1.0, "omega": 0.1})


def test_symbols_are_names(values):
    omega = sp.Symbol("omega", real=True)
    assert values[omega] == values["omega"] == 0.1
    assert omega in values
    assert values.index(omega) == 1


def test_it_is_a_mapping(values):
    assert dict(values) == {"A": 1.0, "omega": 0.1}
    assert values == {"A": 1.0, "omega": 0.1}
    assert len(values) == 2
    assert values.get("none") is None
    assert hash(values) == hash(NamedMapping("other", values))
    assert repr(values) == "{A: 1.0, omega: 0.1}"
    assert pickle.loads(pickle.dumps(values)) == values


def test_nothing_can_be_put_in(values):
    with pytest.raises(TypeError):
        values["A"] = 2


def test_the_nearest_name(values):
    message = r"^unknown parameter 'omga'; did you mean 'omega'\? \(known: A, omega\)$"
    with pytest.raises(fs.UnknownNameError, match=message):
        values["omga"]
    assert str(unknown_name("state", "zzz", [])) == "unknown state 'zzz' (known: none)"
