"""What each check lets through, what it returns, and what it refuses."""

import math
from pathlib import Path

import numpy as np
import pytest

from fastslow import arguments
from fastslow.arguments import validated
from fastslow.errors import ArgumentError, OutOfRangeError, UnknownNameError, unknown_name

LET_THROUGH = [
    (arguments.finite, np.float32(0.5), 0.5),
    (arguments.finite, -(10**30), -1e30),
    (arguments.positive, 5e-324, 5e-324),
    (arguments.within(1, 2), 1, 1.0),
    (arguments.within(1, 2), 2, 2.0),
    (arguments.whole(3, 5), 3, 3),
    (arguments.whole(3, 5), np.int8(5), 5),
    (arguments.tolerance, 1e-16, 1e-16),
    (arguments.tolerance, 0.1, 0.1),
    (arguments.among(-1, 1, None), None, None),
    (arguments.among(-1, 1, None), -1, -1),
    (arguments.flag, np.True_, True),
    (arguments.text, "", ""),
    (arguments.word("code", ["LP", "HB"]), "HB", "HB"),
    (arguments.interval, [1, 2], (1.0, 2.0)),
    (arguments.interval, (-1e100, 1e100), (-1e100, 1e100)),
    (arguments.mapping, {}, {}),
    (arguments.path, Path("a.npz"), Path("a.npz")),
    (arguments.path, "a.npz", "a.npz"),
    (arguments.function, len, len),
    (arguments.instance(int, str), "x", "x"),
    (arguments.items(), [1, "a"], (1, "a")),
    (arguments.items(arguments.positive), iter([1, 2]), (1.0, 2.0)),
    (arguments.items(), np.arange(2), (0, 1)),
    (arguments.either(arguments.flag, arguments.positive), 2, 2.0),
    (arguments.either(arguments.flag, arguments.positive), True, True),
]

REFUSED = [
    (arguments.finite, math.inf, "n = inf; expected a finite number"),
    (arguments.finite, "1", "n = '1'; expected a finite number"),
    (arguments.finite, True, "n = True; expected a finite number"),
    (arguments.finite, np.ones(1), "expected a finite number"),
    (arguments.positive, 0, "n = 0; expected a positive number"),
    (arguments.within(1, 2), 2.01, "n = 2.01; expected a number from 1 to 2"),
    (arguments.within(1, 2), 0.99, "n = 0.99; expected a number from 1 to 2"),
    (arguments.whole(3, 5), 2, "n = 2; expected an integer from 3 to 5"),
    (arguments.whole(3, 5), 6, "n = 6; expected an integer from 3 to 5"),
    (arguments.whole(0, 10**6), -1, "n = -1; expected an integer from 0$"),
    (arguments.whole(0, 10**6), 10**7, "expected an integer from 0 to 1000000"),
    (arguments.whole(0), 1.0, "n = 1.0; expected an integer"),
    (arguments.whole(0), True, "n = True; expected an integer"),
    (arguments.tolerance, 0.11, "n = 0.11; expected a number from 1e-16 to 0.1"),
    (arguments.tolerance, 9e-17, "n = 9e-17; expected a number from 1e-16 to 0.1"),
    (arguments.among(-1, 1), None, "n = None; expected -1 or 1"),
    (arguments.among(-1, 1), True, "n = True; expected -1 or 1"),
    (arguments.among(-1, 1), 0, "n = 0; expected -1 or 1"),
    (arguments.flag, 1, "n = 1; expected True or False"),
    (arguments.text, b"a", "n = b'a'; expected text"),
    (arguments.formula, 5, "n = 5; expected a name or an expression"),
    (arguments.interval, "12", "n = '12'; expected two finite numbers, the lower one first"),
    (arguments.interval, (1, 2, 3), "expected two finite numbers"),
    (arguments.interval, (0, math.inf), "expected two finite numbers"),
    (arguments.interval, (2, 1), r"the lower one first; did you mean \(1, 2\)\?"),
    (arguments.interval, (1, 1), "the lower one first$"),
    (arguments.interval, (0, 1.01e100), r"expected two numbers of at most 1e\+100 in size"),
    (arguments.interval, (-1.01e100, 0), r"expected two numbers of at most 1e\+100 in size"),
    (arguments.numbers, [1, "a"], "n: expected numbers, received"),
    (arguments.numbers, np.array([1, True], dtype=object), "n: expected numbers"),
    (arguments.finite_numbers, [1, math.nan], "expected finite numbers"),
    (arguments.mapping, [("a", 1)], "expected a mapping, such as"),
    (arguments.function, 1, "n = 1; expected a function"),
    (arguments.path, "", "n = ''; expected the path of a file"),
    (arguments.path, "a\0b", "expected the path of a file"),
    (arguments.path, 3, "n = 3; expected the path of a file"),
    (arguments.instance(str, dict), 1.5, "n: expected a str or dict, received a float"),
    (arguments.instance(dict), None, "n: expected a dict, received None"),
    (arguments.items(), "ab", "n = 'ab'; expected a sequence"),
    (arguments.items(), np.array(1.0), "expected a sequence"),
    (arguments.items(arguments.positive), [1, -1], r"n\[1\] = -1; expected a positive number"),
    (arguments.either(arguments.flag, arguments.positive), -1, "n = -1; expected a positive"),
]


@pytest.mark.parametrize(("check", "value", "expected"), LET_THROUGH)
def test_what_is_let_through(check, value, expected):
    found = check("n", value)
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize(("check", "value", "message"), REFUSED)
def test_what_is_refused(check, value, message):
    with pytest.raises(ArgumentError, match=message):
        check("n", value)


def test_arrays_come_back_as_floats_of_the_same_shape():
    for check in (arguments.numbers, arguments.finite_numbers):
        found = check("n", [[1, 2], [3, 4]])
        assert found.dtype == float
        assert found.tolist() == [[1, 2], [3, 4]]
    assert np.isnan(arguments.numbers("n", [math.nan])).all()


def test_a_word_that_is_none_suggests_the_nearest():
    with pytest.raises(UnknownNameError, match=r"unknown code 'LPP'; did you mean 'LP'\? \(known"):
        arguments.word("code", ["LP", "HB"])("n", "LPP")
    assert str(unknown_name("code", "Q", [])) == "unknown code 'Q' (known: none)"
    assert str(unknown_name("code", "Q", ["A"])) == "unknown code 'Q' (known: A)"
    # half of the letters suffice, and none where only their size differs
    assert "did you mean 'omega'?" in str(unknown_name("name", "omg", ["A", "omega"]))
    assert "did you mean 'AB'?" in str(unknown_name("name", "ab", ["AB", "CD"]))


def test_places_are_counted_from_both_ends():
    assert [arguments.position(k, 3, "row") for k in (0, 2, -1, -3)] == [0, 2, 2, 0]
    for k in (3, -4):
        with pytest.raises(OutOfRangeError, match=f"no row {k}; the last of 3 is 2"):
            arguments.position(k, 3, "row")
    with pytest.raises(OutOfRangeError, match="no row 0; there is none"):
        arguments.position(0, 0, "row")


def test_long_values_are_not_quoted():
    assert arguments.shown("a" * 58) == "'" + "a" * 58 + "'"
    assert arguments.shown("a" * 300) == "'" + "a" * 30 + "…' (300 characters)"
    assert arguments.shown(["a" * 57]) == "a list"
    assert arguments.shown(np.zeros(4)) == "array([0., 0., 0., 0.])"
    assert arguments.shown(np.zeros(5)) == "an ndarray of shape (5,)"


def all_as_floats(name, values):
    return {key: arguments.finite(f"{name}[{key}]", value) for key, value in values.items()}


@validated(eps=arguments.positive, rows=arguments.whole(0), others=all_as_floats)
def asked(eps, size=2, *, rows=None, **others):
    """An example."""
    return eps, size, rows, others


@validated(several=arguments.positive, rows=arguments.whole(0))
def listed(*several, rows=None):
    return several, rows


def test_checks_are_applied_wherever_an_argument_stands():
    assert asked(1) == (1.0, 2, None, {})
    assert asked(1, 5, rows=7, a=1) == (1.0, 5, 7, {"a": 1.0})
    assert asked(eps=1, rows=None) == (1.0, 2, None, {})
    assert listed(1, 2, rows=3) == ((1.0, 2.0), 3)
    assert asked.__name__ == "asked"
    assert asked.__doc__ == "An example."
    for wrong, message in (
        (lambda: asked(0), "eps = 0;"),
        (lambda: asked(eps=0), "eps = 0;"),
        (lambda: asked(None), "eps = None;"),
        (lambda: listed(1, -1), "several = -1;"),
        (lambda: listed(rows=-1), "rows = -1;"),
        (lambda: asked(1, rows=-1), "rows = -1;"),
        (lambda: asked(1, b="c"), r"others\[b\] = 'c';"),
    ):
        with pytest.raises(ArgumentError, match=message):
            wrong()
