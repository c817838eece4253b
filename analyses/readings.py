"""Every claim of a figure at both ends of the source's frequencies, for every reading of its text.

The source leaves open which of two scalings its parameters follow, whether "0 < ω < 1" is in rad/s
or refers to the dimensionless ω_o, whether "T_om = 15" of figures 3 and 4 is the amplitude of the
torque or its peak, and which gap figure 5 has. Each claim is decided for each combination, from
rest, near the lower end of the frequencies and at the upper one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import FASTEST, NARROW, STIFFNESSES, TORQUES, WIDTHS, gear
from analyses.claims import LITTLE
from analyses.passages import REST
from analyses.stiffness import natural
from fastslow.passage.regimes import regimes_at
from fastslow.results.trajectory.long_time.regimes import CHAOTIC
from fastslow.systems.gears import SCALINGS

Floats = NDArray[np.float64]

#: Frequencies near the lower end of 0 < ω < 1 and at the upper one.
ENDS = (0.01, 1.0)

#: What these are: rad/s, or the dimensionless ω_o.
UNITS = {"ω": FASTEST, "ω_o": 1.0}

#: Amplitude of the torque of figures 3 and 4, N m: "T_om = 15" as amplitude, or peak T_m + T_am.
AMPLITUDES = {"a": 15.0, "p": 5.0}

#: Gap of figure 5: that of figure 4, the others of figure 3, and the φ given.
GAPS = {"1": {"D": NARROW}, "2": {"D": WIDTHS[1]}, "3": {"D": WIDTHS[2]}, "φ": {}}

#: Dimensionless frequency below which two periods from rest suffice, periods of faster runs, and
#: those of the longest run until which they settle or are chaotic.
SLOW, FAST_PERIODS, LONGEST = 0.1, 40, 64

#: Of motions that count as symmetric, and of states that count as the same.
SYMMETRIC, SAME = 0.01, 1e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """What the claims need to know of a motion from rest.

    Parameters
    ----------
    model : Model
    regime : str
    low, high : float
        Extent of x after the transient.
    fast : float
        Extent of v.
    speed, depth : float
        Of the first contact with the lower side after the transient: its speed, and how far the
        teeth deflect; NaN without one.
    repeats : bool
        Whether it has the period of the load.
    contacts : float
        Contacts in a period, those after rebounds included.
    twist : ndarray, shape (1024,)
        x over the last period.

    Notes
    -----
    Speed, depth, contacts and twist of a chaotic motion are NaN: those of one stretch of it would
    decide nothing.
    """

    model: fs.Model
    regime: str
    low: float
    high: float
    fast: float
    speed: float
    depth: float
    repeats: bool
    contacts: float
    twist: Floats

    @property
    def size(self) -> float:
        """The twist, peak to peak."""
        return self.high - self.low

    @property
    def unilateral(self) -> bool:
        return self.regime.startswith("unilateral")

    @property
    def impacts(self) -> bool:
        """Whether contact is lost and made again."""
        return not self.regime.startswith("meshed")

    @property
    def force(self) -> float:
        """Of that contact."""
        p = self.model.parameters
        return ((self.depth + p["D"]) ** 2 + p["A"]) * self.depth


def motion(model: fs.Model) -> Motion:
    """Run a gear from rest and measure its motion after the transient."""
    p = model.parameters
    slow = p["omega"] < SLOW
    periods = 2 if slow else FAST_PERIODS
    run = fs.simulate(model, REST, periods=periods)
    regime = run.regime or ""
    if not slow:
        found = regimes_at(model, np.array(REST), {}, periods=periods, max_periods=LONGEST)
        regime = str(found[0])
    end = run.span[1]
    since = 0.5 * end
    low, high = run.extremes("x", since=since)
    slowest, fastest = run.extremes("v", since=since)
    met = [c for c in run.crossings if c.time > since]
    onto = next((k for k, c in enumerate(met) if c.to_region == "S3"), None)
    speed = depth = float("nan")
    if onto is not None and onto + 1 < len(met):
        speed = abs(float(met[onto].state[1]))
        depth = -run.extremes("x", since=met[onto].time, until=met[onto + 1].time)[0] - p["D"]
    before, after = run(np.array([end * (1 - 1 / periods), end])).T
    repeats = bool(np.abs(after - before).max() < SAME)
    contacts = 2 / periods * sum(c.to_region != "S2" for c in met)
    times = end * (1 - np.arange(1024)[::-1] / 1024 / periods)
    twist = run(times)[0]
    if regime == CHAOTIC:
        speed = depth = contacts = float("nan")
        twist = np.full_like(twist, np.nan)
    return Motion(
        model, regime, low, high, fastest - slowest, speed, depth, repeats, contacts, twist
    )


@cache
def motions(figure: str, scaling: str, omega: float, reading: str) -> tuple[Motion, ...]:
    """The three motions of a figure for a reading of its torque or gap."""
    if figure == "3":
        given = [{"T_am": AMPLITUDES[reading], "D": D} for D in WIDTHS]
    elif figure == "4":
        given = [{"T_am": AMPLITUDES[reading], "D": NARROW, "k1": k1} for k1 in STIFFNESSES]
    else:
        given = [{"T_am": T, **GAPS[reading]} for T in TORQUES]
    return tuple(motion(gear(scaling, omega, **values)) for values in given)


Motions = Sequence[Motion]


def _rising(values: Sequence[float]) -> bool:
    return all(one < other for one, other in pairwise(values))


def _separate(found: Motions) -> bool:
    p = found[0].model.parameters
    return float(np.sqrt(p["A"] + p["D"] ** 2 - 0.25)) > 10 * p["omega"]


def _stays(found: Motions) -> bool:
    return found[2].unilateral and motion(found[2].model.with_parameters(D=1.0)).unilateral


def _distance(one: Motion, other: Motion) -> float:
    return float(np.sqrt(np.mean((one.twist - other.twist) ** 2)) / np.std(other.twist))


def _frequency(one: Motion) -> float:
    p = one.model.parameters
    return natural(p["B"] + p["C"], p["A"], p["D"])


@dataclass(frozen=True)
class Sentence:
    """A claim of a figure, and when its three motions, in the order of the source, agree with it.

    Parameters
    ----------
    number : str
        Of the claim of the page.
    figure : str
    words : str
        What is decided.
    agrees : callable
    """

    number: str
    figure: str
    words: str
    agrees: Callable[[Motions], bool]


#: Scaling, unit of the frequencies and end of their range, of each column of the table.
COLUMNS = tuple(product(SCALINGS, UNITS, ENDS))

#: A claim is decided by the criterion of the page, with the numbers of these motions.
SENTENCES = (
    Sentence("4", "4", "natural frequency of k1 = 1000 above 10 ω_o", _separate),
    Sentence(
        "5",
        "3",
        "D = 0.1 and 0.25 bilateral",
        lambda found: all(one.regime == "bilateral" for one in found[:2]),
    ),
    Sentence("6", "3", "D = 0.5 unilateral", lambda found: found[2].unilateral),
    Sentence(
        "7",
        "3",
        "D = 0.5 asymmetric",
        lambda found: abs(found[2].high + found[2].low) > SYMMETRIC * found[2].size,
    ),
    Sentence("8", "3", "D = 0.5 and 1 unilateral", _stays),
    Sentence(
        "9",
        "3",
        "the same regime at the three widths, and not chaotic",
        lambda found: found[0].regime != CHAOTIC and len({one.regime for one in found}) == 1,
    ),
    Sentence(
        "10",
        "3",
        "twist, peak to peak, within a half of each other",
        lambda found: max(one.size for one in found) < LITTLE * min(one.size for one in found),
    ),
    Sentence(
        "10b",
        "3",
        "a motion that is chaotic or not of the period of the load",
        lambda found: any(not one.repeats for one in found),
    ),
    Sentence(
        "10c",
        "3",
        "contact lost at D = 0.1 and 0.25",
        lambda found: all(one.impacts for one in found[:2]),
    ),
    Sentence(
        "10d",
        "3",
        "impacts on the lower side the faster, the wider the gap",
        lambda found: _rising([one.speed for one in found]),
    ),
    Sentence(
        "10e",
        "3",
        "twist, peak to peak, the larger, the wider the gap",
        lambda found: _rising([one.size for one in found]),
    ),
    Sentence(
        "11",
        "4",
        "vibration at the largest load the faster, the smaller k1",
        lambda found: _rising([_frequency(one) for one in reversed(found)]),
    ),
    Sentence(
        "12",
        "4",
        "twist, peak to peak, within a half of each other",
        lambda found: max(one.size for one in found) < LITTLE * min(one.size for one in found),
    ),
    Sentence(
        "12b",
        "4",
        "twists of k1 = 1000 and 7000 apart by half of the latter's RMS",
        lambda found: _distance(found[0], found[2]) > LITTLE - 1,
    ),
    Sentence(
        "13",
        "4",
        "the force of the impact the smaller, the larger k1",
        lambda found: _rising([one.force for one in reversed(found)]),
    ),
    Sentence("14", "5", "10 N m bilateral", lambda found: found[0].regime == "bilateral"),
    Sentence(
        "15",
        "5",
        "50 and 100 N m unilateral",
        lambda found: all(one.unilateral for one in found[1:]),
    ),
    Sentence(
        "16",
        "5",
        "impacts at 100 N m, and a natural frequency above 10 ω_o",
        lambda found: found[2].impacts and _separate(found),
    ),
    Sentence(
        "17",
        "5",
        "twist, peak to peak, the larger, the larger T_am",
        lambda found: _rising([one.size for one in found]),
    ),
    Sentence(
        "18",
        "5",
        "speed of the twist, peak to peak, the larger, the larger T_am",
        lambda found: _rising([one.fast for one in found]),
    ),
    Sentence(
        "18b",
        "5",
        "impacts in a period the more, the larger T_am",
        lambda found: _rising([one.contacts for one in found]),
    ),
)


@cache
def decided(scaling: str, unit: str, end: float) -> dict[str, dict[str, bool]]:
    """Whether each claim holds at one end of the frequencies, by claim and then by reading."""
    return {
        sentence.number: {
            reading: sentence.agrees(motions(sentence.figure, scaling, end * UNITS[unit], reading))
            for reading in (GAPS if sentence.figure == "5" else AMPLITUDES)
        }
        for sentence in SENTENCES
    }


def cell(answers: Mapping[str, bool]) -> str:
    """Yes, no, or the readings for which a claim holds."""
    if all(answers.values()):
        return "yes"
    return ", ".join(reading for reading, yes in answers.items() if yes) or "no"


def table() -> list[str]:
    """All answers as a table in Markdown."""
    heads = [f"{scaling}, {unit} = {end:g}" for scaling, unit, end in COLUMNS]
    lines = [
        f"| | holds if | {' | '.join(heads)} |",
        f"|---|---|{'---|' * len(COLUMNS)}",
    ]
    for sentence in SENTENCES:
        cells = [cell(decided(*column)[sentence.number]) for column in COLUMNS]
        lines.append(f"| {sentence.number} | {sentence.words} | {' | '.join(cells)} |")
    return lines
