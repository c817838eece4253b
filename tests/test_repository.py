"""The layout of the repository, by the checks of the Scientific Python guide (sp-repo-review)."""

import tomllib
from pathlib import Path

import pytest
from repo_review.processor import process

import fastslow

ROOT = Path(fastslow.__file__).parent.parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
IGNORED = SETTINGS["tool"]["repo-review"]["ignore"]

RESULTS = {r.name: r for r in process(ROOT).results}


@pytest.mark.parametrize("name", RESULTS)
def test_the_checks_of_the_guide(name):
    assert RESULTS[name].result in (True, None), RESULTS[name].err_msg


def test_every_exception_is_needed():
    without = process(ROOT, extend_select={"*"}, ignore={"none of them"})
    failed = {r.name for r in without.results if r.result is False}
    assert failed == set(IGNORED)


def test_every_exception_has_its_reason():
    lines = (ROOT / "pyproject.toml").read_text(encoding="utf-8").splitlines()
    for name in IGNORED:
        (line,) = (one for one in lines if f'"{name}"' in one)
        assert "#" in line
