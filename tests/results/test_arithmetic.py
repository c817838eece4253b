"""Arithmetic as text: what may stand in it, and its value."""

import math
import re

import pytest

from fastslow.kernels import special
from fastslow.kernels.compiler import native
from fastslow.model.known_functions import CLOSED, ELEMENTARY, OPEN
from fastslow.quotients import LARGEST_ORDER, QUOTIENTS
from fastslow.results.stored import arithmetic


def test_the_vocabulary_is_that_of_the_compiler():
    known = {**native._LIBRARY, **{n: count for n, (_, count) in native._INTRINSICS.items()}}
    assert arithmetic.MATHEMATICS.items() <= known.items()
    functions = {**special._VALUES, "polygamma": 2, "lambertw": 2}
    assert arithmetic.SPECIAL.items() <= functions.items()
    orders = dict.fromkeys(QUOTIENTS, LARGEST_ORDER + 1)
    assert dict(arithmetic.SEVERAL) == special._SEVERAL | orders
    templates = [*(one.template for one in ELEMENTARY.values()), *CLOSED.values(), *OPEN.values()]
    for template in (*templates, "special.ellipeinc({}, {})"):
        count = len(set(re.findall(r"{\d?}", template))) if "{0}" in template else None
        count = count or template.count("{}")
        arithmetic.check_number(template.format(*("p0", "p1")[:count]), {"p0", "p1"})


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "p0.__class__",
        "[p0]",
        "p0[0]",
        "(lambda: p0)()",
        "p9",
        "9**9**9",
        "math.factorial(p0)",
        "math.sin(p0, p0)",
        "math.sin(*[p0])",
        "special.airy(p0, 7)",
        "special.airy(p0, p0)",
        "open(p0)",
        "p0 < 1.0",
        "1.0 if p0 else 2.0",
        "True",
        "p0; p0",
        "1j",
        "'p0'",
        f"{2**60}",
        "-" * 500 + "p0",
        "abs(" * 95 + "p0" + ")" * 95,
        "",
        None,
        5,
    ],
)
def test_other_text_is_refused(text):
    with pytest.raises(arithmetic.UnknownOperationError):
        arithmetic.check_number(text, {"p0"})


@pytest.mark.parametrize(
    "text",
    [
        "math.sin(p0)/2.0 - abs(p1)*3",
        "max(p0, p1, 0.5) if (p0 < p1) and not (p1 == 2.0) else min(p0, math.pi)",
        "math.pow(p0, 1.5) + math.atan2(p1, -p0)",
        "math.copysign(1, p1)",
        " + ".join(["p0"] * 500),
    ],
)
def test_text_has_the_value_that_python_gives(text):
    arithmetic.check_number(text, {"p0", "p1"})
    values = {"p0": 0.7, "p1": -1.3}
    expected = eval(text, {"math": math, **values})
    assert float(arithmetic.value_of(text, values)) == pytest.approx(expected, rel=1e-15)
    with pytest.raises(arithmetic.UnknownOperationError):
        arithmetic.value_of("special.gamma(p0)", values)
