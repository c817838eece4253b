"""How the trace of a curve ends: one outcome for each ending that all curves have in common.

The last row of a trace is a point of the curve. It is on the bound at the end of a range, the first
row again on a closed curve, and otherwise the last point that was computed.
"""

from __future__ import annotations

from dataclasses import dataclass

from fastslow.results.base.outcome import Outcome


@dataclass(frozen=True)
class Ending:
    """An ending: the code and the sentence of its outcome, with names in braces for what varies.

    Parameters
    ----------
    code, sentence : str
    success : bool

    Examples
    --------
    >>> END_OF_RANGE.at(where="w = 6").message
    'reached w = 6, the end of the range.'
    """

    code: str
    sentence: str
    success: bool

    def at(self, **words: object) -> Outcome:
        """Return the outcome, given what varies."""
        return Outcome(self.code, self.sentence.format(**words), self.success)


END_OF_RANGE = Ending("end of range", "reached {where}, the end of the range.", True)

CLOSED_LOOP = Ending("closed loop", "the {curve} returned to its start: a closed loop.", True)

TOO_MANY_POINTS = Ending(
    "too many points",
    "the {curve} has {count} rows and continues beyond {where}; increase "
    "Continuation(max_points=…) or max_step.",
    False,
)

STEP_TOO_SMALL = Ending(
    "step too small",
    "no next point was found from {where} with steps down to {step:g}: {why}.",
    False,
)

#: Why there is no next point on curves of solutions of equations in the rates.
SINGULAR_CURVE = "the curve is singular there, or the rates are not defined beyond"

#: The end of a curve of branch points in two parameters.
NO_BRANCH_POINT = Ending(
    "no branch point",
    "branch points do not persist beyond {where}: without a symmetry of the model they are "
    "isolated in this plane.",
    False,
)
