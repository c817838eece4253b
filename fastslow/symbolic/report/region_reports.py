"""What derivations have in common: one part for each region, and formulas in LaTeX."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, TypeVar

from fastslow.results.base.display import Summarized
from fastslow.results.base.html import formulas
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.report.typesetting import Block, displayed, paragraphs

Part = TypeVar("Part")


class RegionReport(Summarized, Generic[Part]):
    """Closed forms by region, which are found by its name, with their LaTeX."""

    regions: NamedMapping[Part]

    def __getitem__(self, region: object) -> Part:
        return self.regions[region]

    def __iter__(self) -> Iterator[str]:
        return iter(self.regions)

    def __len__(self) -> int:
        return len(self.regions)

    def to_latex(self) -> str:
        """Return the closed forms as LaTeX paragraphs with displayed formulas."""
        return paragraphs(self._blocks())

    def _repr_latex_(self) -> str:
        return displayed(self._blocks())

    def _repr_html_(self) -> str:
        return formulas(self._caption(), self._repr_latex_())

    def _blocks(self) -> list[Block]:
        """Return headings with typeset formulas."""
        raise NotImplementedError
