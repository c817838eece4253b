"""What the source states, what is computed for it, and the verdict, as one record."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any, Literal, get_args

import numpy as np

Verdict = Literal["holds", "does not hold", "holds conditionally", "beyond the paper", "not yet"]
VERDICTS: tuple[str, ...] = get_args(Verdict)

#: Whether a claim holds at the values of the parameters that the source states it for.
AtPaper = Literal["yes", "no", "in part", "–"]

#: What the verdict alone decides; a claim that holds conditionally says it itself.
DECIDED: Mapping[str, AtPaper] = {
    "holds": "yes",
    "does not hold": "no",
    "beyond the paper": "–",
    "not yet": "–",
}

#: The hyphen in front of a number that is no exponent.
MINUS = re.compile(r"(?<!\w)-(?=\d)")

#: A change by less than a half counts as little.
LITTLE = 1.5


@dataclass(frozen=True)
class Finding:
    """What was found about a claim.

    Parameters
    ----------
    scaling : str
        ``"consistent"``, ``"printed"``, or ``"either"`` for what does not depend on it.
    verdict : {"holds", "does not hold", "holds conditionally", "beyond the paper", "not yet"}
        Conditionally: at other values of the parameters, at some of the source's, or one half
        of the sentence only. Not yet: it needs what the package does not compute.
    template : str
        The evidence in words, with the numbers in braces.
    numbers : mapping
        Name to value, a number or a word; every one is used in the template.
    conditional : {"no", "in part"}, optional
        What a verdict "holds conditionally" means: the claim holds at none of the source's own
        values, or at some of them or in one half.

    Raises
    ------
    ValueError
        If `conditional` is missing where the claim holds conditionally.

    Examples
    --------
    >>> Finding("either", "holds", "{n:.0f} of {m:.0f} runs", {"n": 3, "m": 3}).words
    '3 of 3 runs'
    >>> Finding("either", "holds", "yes").at_paper
    'yes'
    """

    scaling: str
    verdict: Verdict
    template: str
    numbers: Mapping[str, Any] = field(default_factory=dict)
    conditional: Literal["no", "in part"] | None = None

    def __post_init__(self) -> None:
        if self.verdict == "holds conditionally" and self.conditional is None:
            raise ValueError(
                "conditional is missing; a claim that holds conditionally says whether it holds "
                'at the source\'s own values: "no" or "in part"'
            )

    @property
    def at_paper(self) -> AtPaper:
        """Whether the claim holds at the source's own values."""
        if self.verdict in DECIDED or self.conditional is None:
            return DECIDED[self.verdict]
        return self.conditional

    @property
    def words(self) -> str:
        """The evidence, with U+2212 as minus sign in front of numbers."""
        return MINUS.sub("−", self.template.format(**self.numbers))


@dataclass(frozen=True)
class Quantity:
    """A computed value beside an independent reference and what the source prints.

    Parameters
    ----------
    name : str
    computed : float or str
        By the package; a word for what is no number, such as an itinerary.
    reference : str
        Decimal number with the digits that are certain, or the word.
    how : str
        Source of the reference.
    published : str, optional
        Decimal number as the source prints it, or its words.

    Examples
    --------
    >>> fold = Quantity("fold", 0.4683264473667, "0.46832645", "mpmath", "0.468")
    >>> fold.agrees, fold.as_published
    (True, True)
    >>> fold.rounded
    '0.46832645'
    """

    name: str
    computed: float | str
    reference: str
    how: str
    published: str = ""

    @property
    def agrees(self) -> bool:
        """Whether the computed value is the reference, within one unit of its last digit."""
        return matches(self.computed, self.reference)

    @property
    def as_published(self) -> bool | None:
        """Whether it is what the source prints; None where the source prints no number."""
        try:
            Decimal(self.published)
        except ArithmeticError:
            return None
        return matches(self.computed, self.published)

    @property
    def rounded(self) -> str:
        """The computed value with as many decimals as the reference."""
        if isinstance(self.computed, str):
            return self.computed
        return f"{Decimal(self.computed).quantize(Decimal(self.reference)):f}"


def matches(value: float | str, digits: str) -> bool:
    """Whether a value is a decimal number within one unit of its last digit and rounding.

    Examples
    --------
    >>> matches(24.5166, "24.5"), matches(24.5166, "24.51"), matches("1^2", "1^2")
    (True, True, True)
    >>> matches(24.5166, "24.4")
    False
    """
    if isinstance(value, str):
        return value == digits
    exact = Decimal(digits)
    unit = Decimal(1).scaleb(int(exact.as_tuple().exponent))
    rounding = Decimal(8 * float(np.spacing(abs(float(exact)))))
    return abs(Decimal(value) - exact) <= unit + rounding


@dataclass(frozen=True)
class Claim:
    """One sentence of the source, or one result beyond it, with its findings.

    Parameters
    ----------
    number : str
    sentence : str
        In own words, with a short quotation.
    computed : str
        What is computed to test it.
    findings : tuple of Finding
        One for each scaling, or one for both.
    figures : tuple of str
        Names of the figures that show it.
    quantities : tuple of Quantity
        What is computed beside independent references.
    """

    number: str
    sentence: str
    computed: str
    findings: tuple[Finding, ...]
    figures: tuple[str, ...] = ()
    quantities: tuple[Quantity, ...] = ()

    @property
    def verdict(self) -> str:
        """The verdict of all findings; both where the scalings differ."""
        verdicts = list(dict.fromkeys(f.verdict for f in self.findings))
        if len(verdicts) == 1:
            return verdicts[0]
        return "; ".join(f"{f.scaling}: {f.verdict}" for f in self.findings)


def table(claims: Iterable[Claim]) -> str:
    """The claims and their verdicts as a table in Markdown; equal ones of two scalings in a row."""
    lines = ["| | claim | scaling | verdict | at the paper's values |", "|---|---|---|---|---|"]
    for claim in claims:
        rows: dict[tuple[str, str], list[str]] = {}
        for one in claim.findings:
            rows.setdefault((f"**{one.verdict}**", one.at_paper), []).append(one.scaling)
        for k, (verdict, scalings) in enumerate(rows.items()):
            first = (claim.number, claim.sentence) if k == 0 else ("", "")
            cells = (*first, scalings[0] if len(scalings) == 1 else "both", *verdict)
            lines.append("| " + " | ".join(cells).replace("||", "‖") + " |")
    return "\n".join(lines)
