"""The outcome of a computation: a code, a message and a flag for success."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fastslow.results.base.display import Displayed

#: Codes of ends at which the tracing stopped, though the branch continues.
CUT_SHORT = ("too many points", "too many folds", "step too small")

#: Codes of ends that belong to the model, so that the branch was traced completely.
ENDS_OF_MODEL = ("left the window",)


@dataclass(frozen=True)
class Outcome(Displayed):
    """The outcome at an end of a branch or a trajectory.

    Parameters
    ----------
    code : str
        Short stable name for use in programs, e.g. ``"end of range"``.
    message : str
        One sentence with the cause and, where there is one, a remedy.
    success : bool
        Whether the requested end was reached.
    notes : tuple of str
        Sentences of the message that warn of a doubtful result, such as one decided by
        rounding.

    Examples
    --------
    >>> print(Outcome("end of range", "reached w = 6, the end of the range.", True))
    reached w = 6, the end of the range.
    """

    code: str
    message: str
    success: bool
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.message

    def __bool__(self) -> bool:
        return self.success


def with_notes(outcome: Outcome, notes: Sequence[str]) -> Outcome:
    """Return the outcome with further sentences of warning, each once.

    Examples
    --------
    >>> done = Outcome("end of time", "reached t = 1.", True)
    >>> print(with_notes(done, ["x fell below its atol."]))
    reached t = 1. x fell below its atol.
    """
    new = tuple(note for note in notes if note not in outcome.notes)
    message = " ".join([outcome.message, *new])
    return replace(outcome, message=message, notes=(*outcome.notes, *new))


def stopped_early(outcome: Outcome) -> str:
    """Return a sentence for results of a run that ended early, else empty text."""
    return "" if outcome.success else f" The run ended early: {outcome}"


def early_end(outcome: Outcome) -> str:
    """Return the code of the outcome of a run that ended early, else empty text."""
    return "" if outcome.success else outcome.code


def with_ends(
    search: Outcome, ends: Sequence[tuple[Outcome, Outcome]], unexplained: int
) -> Outcome:
    """Return the outcome of a search for branches, with the number of incomplete branches.

    Parameters
    ----------
    search : Outcome
        Of the search itself.
    ends : sequence of (Outcome, Outcome)
        Of every branch, at its first and last row.
    unexplained : int
        Changes of the number of unstable eigenvalues without a special point.

    Examples
    --------
    >>> done, full = Outcome("end of range", "", True), Outcome("too many points", "", False)
    >>> print(with_ends(Outcome("searched", "All.", True), [(done, full), (done, done)], 0))
    1 of 2 branches ended unsuccessfully (too many points).
    """
    failed = [
        {o.code for o in pair if not o.success and o.code not in ENDS_OF_MODEL} for pair in ends
    ]
    count = sum(map(bool, failed))
    sentences = []
    if count:
        codes = Counter(code for pair in failed for code in pair)
        words = ", ".join(f"{n} × {code}" if n > 1 else code for code, n in codes.items())
        sentences.append(
            f"{count} of {len(ends)} branch{'es' if len(ends) > 1 else ''} ended unsuccessfully "
            f"({words})."
        )
    if unexplained:
        sentences.append(
            f"{unexplained} change{'s' if unexplained > 1 else ''} of the number of unstable "
            "eigenvalues without a special point that explains it: see diagram.unexplained."
        )
    if not sentences:
        return search
    if not search.success:
        return replace(search, message=" ".join([search.message, *sentences]))
    if count:
        return Outcome("cut short", " ".join(sentences), False)
    return Outcome("unexplained", " ".join(sentences), False)
