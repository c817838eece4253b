"""Time that derive() takes; measured with --benchmark-enable, else run once without a verdict."""

import pytest

from fastslow.symbolic.derivation import derive
from tests.symbolic.symbolic_models import gear, lorenz


@pytest.mark.parametrize("model", [gear, lorenz])
def test_derive(benchmark, model):
    fast = model().frozen()
    law = benchmark(derive, fast)
    assert law.verified
