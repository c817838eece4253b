"""The registry of special points: complete, consistent, and the only one."""

import pytest

from fastslow.plot.layout import style
from fastslow.results.point_types import POINT_TYPES, point_name


def test_each_record_stands_under_its_own_code():
    assert all(code == known.code for code, known in POINT_TYPES.items())


@pytest.mark.parametrize("entry", ["name", "marker", "summary"])
def test_no_two_codes_share_what_tells_them_apart(entry):
    values = [getattr(known, entry) for known in POINT_TYPES.values()]
    assert len(set(values)) == len(values)


def test_no_two_codes_share_a_number_of_auto():
    numbers = [number for known in POINT_TYPES.values() for number in known.auto]
    assert len(set(numbers)) == len(numbers)


def test_curves_and_colours_refer_to_what_there_is():
    for known in POINT_TYPES.values():
        assert known.colour in style.COLOURS
        assert all(POINT_TYPES[code].line is not None for code in known.curves)
        assert known.codimension in (0, 1, 2)


@pytest.mark.parametrize(
    ("code", "change", "changes"),
    [("LP", 1, True), ("BP", 1, True), ("HB", 2, True), ("NSD", 0, False), ("BE", None, True)],
)
def test_how_the_number_of_unstable_eigenvalues_changes(code, change, changes):
    assert POINT_TYPES[code].unstable == change
    assert POINT_TYPES[code].changes_stability is changes


def test_a_code_of_a_later_version_is_its_own_name():
    assert point_name("LP") == "fold"
    assert point_name("XYZ") == "XYZ"


def test_the_registry_cannot_be_changed():
    with pytest.raises(TypeError):
        POINT_TYPES["LP"] = POINT_TYPES["HB"]
    with pytest.raises(AttributeError):
        POINT_TYPES["LP"].name = "other"
