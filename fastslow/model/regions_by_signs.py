"""Regions that are too many to form them all: each is formed when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NoReturn

from fastslow.errors import ModelError, UnknownNameError
from fastslow.formulas.grammar import normalised
from fastslow.model.interfaces import Region
from fastslow.results.base.html import Cells
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.sign_names import signs_of_name
from fastslow.results.stored.sign_patterns import MOST_REGIONS, Pattern


class RegionsBySigns(NamedMapping[Region]):
    """Regions by their names, such as ``"+-+"``: the sign of every interface in order.

    Whatever walks over all of them raises a ModelError that tells their number.

    Parameters
    ----------
    form : callable
        Returns the region of some signs, None if it is empty.
    length : int
        Number of interfaces.
    count : int
        Number of regions, or one that it exceeds.
    exact : bool
        Whether it is their number.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x = sp.symbols("x:60")
    >>> regions = fs.Model({one: sp.Max(one, 0) - one for one in x}).regions
    >>> regions
    {1.2e18 regions, named by the signs of 60 interfaces}
    >>> print(regions["+" * 30 + "-" * 30].rates["x1"], regions["+" * 30 + "-" * 30].rates["x31"])
    0 -x31
    >>> list(regions)
    Traceback (most recent call last):
    ...
    fastslow.errors.ModelError: 60 interfaces bound 1.2e18 regions, of which not more than 1024 \
are formed at once; name some of them by regions=, such as the motions of a run, run.modes
    """

    __slots__ = ("_exact", "_form", "_formed", "_length", "count")

    count: int
    _form: Callable[[Pattern], Region | None]
    _formed: dict[str, Region]
    _length: int
    _exact: bool

    def __init__(
        self, form: Callable[[Pattern], Region | None], length: int, count: int, *, exact: bool
    ) -> None:
        super().__init__("region")
        known = vars(RegionsBySigns)
        for name, value in (
            ("_form", form),
            ("_formed", {}),
            ("_length", length),
            ("count", count),
            ("_exact", exact),
        ):
            known[name].__set__(self, value)

    @property
    def how_many(self) -> str:
        """Their number in words."""
        number = str(self.count) if self.count < 10**6 else f"{self.count:.2g}".replace("e+", "e")
        return number if self._exact else f"more than {number}"

    @property
    def too_many(self) -> str:
        """Why they are not all formed, and what to do."""
        return (
            f"{self._length} interfaces bound {self.how_many} regions, of which not more than "
            f"{MOST_REGIONS} are formed at once; name some of them by regions=, such as the "
            "motions of a run, run.modes"
        )

    def _refuse(self) -> NoReturn:
        raise ModelError(self.too_many)

    def __getitem__(self, key: object) -> Region:
        name = normalised(str(key))
        if name not in self._formed:
            signs = signs_of_name(name, self._length)
            region = None if signs is None or 0 in signs else self._form(signs)
            if region is None:
                raise UnknownNameError(
                    f"unknown region {key!r}; expected {self._length} signs, such as "
                    f"'{'+' * self._length}', of interfaces that have them at the same place"
                )
            self._formed[name] = region
        return self._formed[name]

    def get(self, key: object, default: Region | None = None) -> Region | None:  # type: ignore[override]
        """Return the region of a name, or the default."""
        try:
            return self[key]
        except UnknownNameError:
            return default

    def __contains__(self, key: object) -> bool:
        return self.get(key) is not None

    def __iter__(self) -> Iterator[str]:
        self._refuse()

    def __len__(self) -> int:
        self._refuse()

    def __bool__(self) -> bool:
        return True

    def items(self) -> Any:
        """Raise ModelError: not all of them are formed."""
        self._refuse()

    def __repr__(self) -> str:
        return f"{{{self.how_many} regions, named by the signs of {self._length} interfaces}}"

    def _cells(self) -> Cells:
        return Cells((self.type, "value"), [("number", self.how_many)])

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)
