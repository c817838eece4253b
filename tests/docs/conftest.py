"""The kernel that runs the code of pages and notebooks."""

import pytest

from .kernels import Kernel


@pytest.fixture(scope="session")
def kernel():
    with Kernel() as started:
        yield started
