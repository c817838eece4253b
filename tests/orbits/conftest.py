"""Every branch of orbits that a test traces is searched for rows that it repeats."""

import pytest

from fastslow.orbits import branches
from tests.orbits.repetitions import repetitions


@pytest.fixture(scope="package", autouse=True)
def no_branch_repeats_its_rows():
    trace = branches.branch_of

    def checked(*arguments):
        branch = trace(*arguments)
        assert not repetitions(branch)
        return branch

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(branches, "branch_of", checked)
        yield
