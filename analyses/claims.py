"""What the source states, what is computed for it, and the verdict, as one record."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

Verdict = Literal["holds", "does not hold", "holds conditionally", "beyond the paper"]
VERDICTS: tuple[str, ...] = get_args(Verdict)

#: Whether a claim holds at the values of the parameters that the source states it for.
AtPaper = Literal["yes", "no", "in part", "–"]

#: What the verdict alone decides; a claim that holds conditionally says it itself.
DECIDED: Mapping[str, AtPaper] = {"holds": "yes", "does not hold": "no", "beyond the paper": "–"}

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
    verdict : {"holds", "does not hold", "holds conditionally", "beyond the paper"}
        Conditionally: at other values of the parameters, at some of the source's, or one half
        of the sentence only.
    template : str
        The evidence in words, with the numbers in braces.
    numbers : mapping
        Name to value; every one stands in the template.
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
    numbers: Mapping[str, float] = field(default_factory=dict)
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
    """

    number: str
    sentence: str
    computed: str
    findings: tuple[Finding, ...]
    figures: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """The verdict of all findings; both where the scalings differ."""
        verdicts = list(dict.fromkeys(f.verdict for f in self.findings))
        if len(verdicts) == 1:
            return verdicts[0]
        return "; ".join(f"{f.scaling}: {f.verdict}" for f in self.findings)


def table(claims: Iterable[Claim]) -> str:
    """The claims and their verdicts as a table in Markdown."""
    lines = [
        "| | claim | scaling | verdict | at the paper's values | evidence |",
        "|---|---|---|---|---|---|",
    ]
    for claim in claims:
        for k, finding in enumerate(claim.findings):
            first = (claim.number, claim.sentence) if k == 0 else ("", "")
            verdict = f"**{finding.verdict}**"
            cells = (*first, finding.scaling, verdict, finding.at_paper, finding.words)
            lines.append("| " + " | ".join(cells).replace("||", "‖") + " |")
    return "\n".join(lines)
