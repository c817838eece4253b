"""A sample of the campaign of hostile arguments, and the calls that it spoils."""

import copy

import pytest

import fastslow as fs
from tests.campaigns.arguments import drawn, outcomes_of
from tests.errors.subjects import public_functions, subjects

pytestmark = pytest.mark.slow

#: Calls of one function; `python -m tests.campaigns arguments` makes thousands.
SAMPLE = 12


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """What is written by a call that is served goes with the test."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", sorted(public_functions()))
def test_hostile_arguments(name):
    subject = subjects()[name]
    found = drawn(subject, SAMPLE, 1)
    escaped, refused = outcomes_of(subject, found)
    assert not escaped, f"{len(escaped)} of {len(found)} escaped:\n" + "\n".join(escaped[:20])
    assert not found or refused


@pytest.mark.parametrize("name", sorted(public_functions()))
def test_the_good_call_is_good(name):
    subject = subjects()[name]
    if name in ("load", "read", "read_auto", "read_sbml"):
        with pytest.raises(fs.FileError, match="No such file"):
            subject.call()
        return
    subject.call()
    if subject.more:
        subject.call(**copy.copy(subject.more))
