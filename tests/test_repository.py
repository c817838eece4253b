"""The layout of the repository, by the checks of the Scientific Python guide (sp-repo-review)."""

import subprocess
import tomllib
from pathlib import Path

import pytest
from repo_review.processor import process

import fastslow
from tests.floor import declared, floors

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


def test_the_source_distribution_holds_everything():
    """What tests need of the checkout is in the archive too."""
    included = SETTINGS["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    names = {name.removeprefix("/") for name in included} | {"pyproject.toml"}
    git = ["git", "ls-files", "--cached"]
    if not (ROOT / ".git").exists():
        pytest.skip("this is no checkout, but what was made of one")
    tracked = subprocess.run(git, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    there = {line.split("/")[0] for line in tracked.splitlines()}
    # which hatchling adds itself
    assert there - {".gitignore"} <= names


def test_every_requirement_has_one_lower_bound():
    found = floors(SETTINGS)
    assert len(found) == len(declared(SETTINGS)) >= 25
    assert found["numpy"] == "1.26"
    with pytest.raises(ValueError, match="numpy<3: expected name>=version"):
        floors(
            {
                "project": {"dependencies": ["numpy<3"], "optional-dependencies": {}},
                "dependency-groups": {"test": []},
            }
        )
