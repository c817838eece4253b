"""The page of all claims with verdicts, numbers and figures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from analyses import (
    bursting,
    canards,
    coexistence,
    converter,
    dead_zone,
    equilibria,
    frequency_response,
    gap_effects,
    gap_width,
    impact_energies,
    impact_response,
    load_amplitude,
    measured_torque,
    mesh_steps,
    negative_stiffness,
    orbits,
    physical_route,
    readings,
    responses,
    rigid_limit,
    sensitivities,
    slow_torque,
    spiking,
    stick_slip,
    stiffness,
    stories,
    tipping,
)
from analyses.claims import VERDICTS, Claim, table
from analyses.output import copy_figure
from fastslow.disk import write_text

SOURCES = (
    dead_zone,
    physical_route,
    stories,
    gap_width,
    gap_effects,
    stiffness,
    load_amplitude,
    responses,
    equilibria,
    negative_stiffness,
    frequency_response,
    orbits,
    stick_slip,
    slow_torque,
    mesh_steps,
    bursting,
    impact_response,
    measured_torque,
    spiking,
    converter,
    sensitivities,
    impact_energies,
    rigid_limit,
    coexistence,
    tipping,
    canards,
)

#: Captions of the figures.
CAPTIONS = {
    "dead_zone": "The dead zone (Fig. 1).",
    "physical_route": "One motion in four models, ω = 1 rad/s. (a) The angle of the load side, "
    "from two inertias. (b) The twist under both scalings, converted to rad. (c) Largest deviation "
    "up to the given time of the twist from that of the two inertias; dashed, 1e-9.",
    "physical_overlay": "The overlay in physical units: the twist of the gear in milliradians over "
    "the load torque in N m, ω = 1 rad/s, on its frozen equilibria.",
    "gap_width_consistent": "Fig. 3 under the consistent scaling: time series, phase portraits, "
    "overlays on the frozen equilibria.",
    "gap_width_printed": "Fig. 3 under the printed scaling.",
    "gap_region": "Region in which the three widths of Fig. 3 behave as stated; each point is "
    "three simulations. Dashed: the slow-load criterion for D = 0.5 (upper) and 0.25 (lower).",
    "regimes_width": "Regimes over D and C/B at ω_o = 0.01; dashed, the slow-load criterion.",
    "regimes_frequency": "Regimes over ω_o and C/B at D = 0.25; dashed, the slow-load criterion.",
    "map_width_load": "Regimes over D and C/B − 1 at ω_o = 0.01, with the cases of Fig. 3 (by D) "
    "and of Fig. 5 (by T_am; 10 N m has C < B).",
    "map_frequency_width": "Regimes over ω_o and D at T_am = 15 N m, with the cases of Fig. 3. "
    "The edges of chaotic areas are finer than the cells of the map, and not drawn as lines.",
    "map_stiffness_torque": "Regimes over k1 and T_am at D = 0.25, ω_o = 0.01, near the case "
    "of smallest load of Fig. 5; the others, and those of Fig. 4 at 15 N m, are above this range.",
    "resonances": "Loads no longer slow against the vibration in contact, at T_am = 15 N m: "
    "regimes over ω_o and D under the consistent scaling, and at the three widths under the "
    "printed one, from rest. The edges of chaotic areas are finer than the cells of the map, and "
    "not drawn as lines. Bar below (a): frequencies at which all three behave as stated for "
    "Fig. 3; none in (b).",
    "passages": "The last period of every case beside the gap: the overlays of Figs. 3 to 5, "
    "enlarged. Black: the frozen equilibria. The gear separates from each side when the load "
    "changes sign, makes contact on the other side with a delay, and vibrates there. Curves that "
    "coincide differ in width.",
    "stiffness_consistent": "Fig. 4 under the consistent scaling.",
    "stiffness_printed": "Fig. 4 under the printed scaling.",
    "contact_frequency": "Frequency in contact over the load: lines, √(3x² − 2Dx + A − 1/4); "
    "circles, measured on the trajectories. Dashed: above this load k1 = 1000 has a higher "
    "frequency than 7000.",
    "load_amplitude_consistent": "Fig. 5 under the consistent scaling, its gap taken as D = 0.25.",
    "load_amplitude_printed": "Fig. 5 under the printed scaling, its gap taken as D = 0.25.",
    "responses": "Time in the gap (a to c) and twist (d to f) over D, k1 and T_am; lines, "
    "predictions.",
    "equilibria": "The frozen equilibria of every case. (c, f) One curve, drawn wider where the "
    "torque is smaller and its range shorter.",
    "eigenvalues": "Eigenvalues along the equilibria, (a) of the source's gear, (b) of a soft one "
    "that has nodes beside the gap.",
    "negative_stiffness": "A gear with A < −D² follows a stable branch past its fold and jumps.",
    "relaxation": "(a) The folds over load and stiffness end on the interfaces at A = −D². "
    "(b) Region in which a load C sin(ω t) causes relaxation oscillations (bilateral).",
    "frequency_response": "Responses over the frequency of the load; solid, stable; grey, "
    "the mean and one harmonic with the describing function. (a) The gear pair with backlash of "
    "Kahraman and Singh (1990). (b) The gear through √A, D = 0.25.",
    "orbits": "The gear under a fast load, T_am = 15 N m and D = 0.25. (a) Orbits of one to four "
    "periods of the load, by continuation; solid, stable; triangles, simulations down and up in "
    "frequency, which also find chaotic motions. (b) The largest Lyapunov exponent of the motions "
    "that the simulations have settled on.",
    "stick_slip": "A block on a belt. (a) Its cycle, with two runs that merge with it where they "
    "first stick. (b) The multipliers of the cycle: 1 along it, and exactly 0. (c) By how much the "
    "block is faster than the belt, over the speed of the belt.",
    "bursting": "A bursting neuron. (a) Bursts over the equilibria and the envelope of the cycles "
    "of its frozen model, which end at a homoclinic orbit. (b) The period of the cycles, which "
    "grows logarithmically; λ is the unstable eigenvalue of the saddle.",
    "slow_torque": "A gear pair with a fast mesh stiffness under a slow torque, over the periodic "
    "orbits of its frozen model. (a) The twist at whole periods of the stiffness. (b) Its smallest "
    "and largest value in a period.",
    "mesh_steps": "A gear pair with a rectangular mesh stiffness under a slow torque. (a) Its "
    "smallest and largest twist in a period of the stiffness, over the periodic orbits of its "
    "frozen model. (b) The orbits at the corner CC3, where the teeth touch as a tooth pair leaves "
    "the mesh, and below and above it, where they touch after and before.",
    "impact_response": "The response of an oscillator with a rigid stop at x = 1. (a) Largest "
    "distance on the other side, along orbits and in simulations up and down in frequency. (b) The "
    "speed before the impact, which begins at zero where the motion without impacts grazes the "
    "stop. (c) The largest multiplier over this speed.",
    "measured_torque": "The gear under a measured torque. (a) The record, a dot every 10 time "
    "units, and its cubic table. (b) The overlay, enlarged at the gap. (c) Durations of the "
    "crossings of the gap over the slope of the torque where it is entered.",
    "spiking": "A neuron that fires and is reset. (a) Bursts over time; dotted, the resets. (b) "
    "Over the slow recovery, the equilibria and the envelope of the spiking of the frozen neuron; "
    "hatched, beyond the voltage at which it has fired. (c) Intervals between spikes, and the "
    "period of the frozen neuron, which becomes infinite at u*, where the reset is on the saddle.",
    "converter": "The route of a buck converter to chaos. (a) Its output at whole periods of the "
    "sawtooth over the input voltage: dots, simulations; lines, orbits of one to eight periods, "
    "dashed where they are unstable. (b) Its control voltage and the sawtooth in chaos at 33 V; "
    "the switch is closed where the sawtooth is higher.",
    "sensitivities": "By how many per cent one per cent more of each physical parameter changes "
    "(a) the widest gap that the load crosses, (b) the time in the gap and (c) the transmission "
    "error, peak to peak.",
    "impact_energies": "One period in physical units, ω = 1 rad/s. (a) The transmission error and "
    "(b) the torque of the contact at T_am = 15 N m. (c) The energy of each impact, on the upper "
    "(▲) and the lower side (▼).",
    "rigid_limit": "Elastic teeth beside rigid ones of the same restitution, D = 0.25. (a, b) The "
    "first rebounds on the lower side. (c) By how much more time passes between the first two "
    "impacts; line, the duration of a contact.",
    "coexistence": "Basins of attraction of coexisting motions, which are drawn at whole periods "
    "of the load, D = 0.25.",
    "tipping": "Tipping by a rate; dashed, critical rates as curves. (a) Stommel's boxes under "
    "pulses of fresh water of rate r and height D. (b) The temperature of the soil of "
    "the compost bomb at the critical rate of warming, and 0.1% below and above it. (c) "
    "A double well that moves by D at the rate r in front of a wall. (d) Its runs at "
    "three critical rates for D = 1.5; dotted, the saddle.",
    "canards": "Canards, and what replaces them at corners. (a, b) Extent of the cycles of van der "
    "Pol's oscillator and of the FitzHugh-Nagumo model; grey, the value of the maximal canard; "
    "square, the Hopf point. (c) Ratio of the eigenvalues of the folded node of forced van der "
    "Pol; lines, closed form. (d) The slow manifolds of Koper's model on a section through its "
    "folded node, with the canards (dots), of which four nearly coincide. (e) Extent of cycles at "
    "a corner over the inner slope; grey, 2√ε. (f) The gear under a load that is not very slow: "
    "its deviation from the frozen equilibria (blue), the lag x₁ (dashed) and the band x₁ ± |x₂|; "
    "square, the corners.",
}

HEAD = r"""# The paper, claim by claim

M. Ding, "Fast-slow Dynamical Analysis in Harmonic Gear Transmission System with Non-smooth Gear
Clearance Condition", Current Journal of Applied Science and Technology 42(7), 66-75, 2023,
doi [10.9734/CJAST/2023/v42i74082](https://doi.org/10.9734/CJAST/2023/v42i74082) (CC BY 4.0).

Five findings:

1. The paper's dimensionless parameters do not follow from its equations: a factor is missing
   (claim 3).
2. Whether impacts are bilateral depends on how "T_om = 15" is read; unilateral impact at the
   widest gap is not reproduced at the paper's load (claims 5 and 6).
3. Without negative stiffness the frozen gear has one curve of equilibria, without a fold and
   without the S-shape of relaxation oscillations (claims B2 and B4).
4. The gap is crossed late, by a law of its width and of the slope of the load alone (claim B1).
5. Under loads that are no longer slow, motions coexist, double their periods and become chaotic, so
   that the initial state decides which is reached (claims B6, B6b and B17).

This page lists each figure of the paper and each of its testable sentences with the computation
that tests it, a verdict, and numerical evidence. Text in quotation marks is from the paper. Claims
B1 to B22 are results that are not in the paper.

The dimensionless gear is $\ddot x + \dot x + (x^2 + A) f(x) = w$ with the load
$w = B + C\sin(\omega_\mathrm{o} t)$ and the dead zone $f$ of half-width $D$; S1 is contact on
the upper side, $x > D$, S2 the gap, S3 contact on the lower side, $x < -D$.

- *Two scalings.* The paper's $A$, $B$ and $C$ do not follow from its equations: a factor
  θ_s is missing. Every claim is tested with the values that follow from the equations
  (*consistent*) and with those printed (*printed*).
- *Unstated values.* The paper states only $0 < \omega < 1$ rad/s for the frequency of the load,
  and neither initial states nor time spans. They are varied where they matter; single simulations
  have ω_o = 0.01 and three periods from rest. The gap of Fig. 5 is not stated; it is taken as
  D = 0.25, the middle one of Fig. 3.
- *Verdicts*: a claim holds, does not hold, or holds conditionally: at other values of the
  parameters, at some of the paper's, or for one half of the sentence only. The column "at the
  paper's values" distinguishes these: *no*, at none of the values stated in the paper; *in part*,
  at some of them, in one half, or for one reading of them.
- *Impacts* are bilateral if contact is made on both sides in every period of the second half of a
  simulation, and unilateral if contact is lost and regained on one side only; meshed is contact
  without separation. A motion with a positive largest Lyapunov exponent is chaotic, and has no
  regime; one with periods that differ otherwise is not settled.
- *The frozen gear* is the gear under a constant load. Under a slow load the gear follows its
  equilibria; the overlay of a trajectory shows which branch is followed, and with what delay.
- *The slow-load criterion*: contact is made on the far side if $D$ is at most
  $D^* = [\sqrt{C^2 - B^2} - B\arccos(B/C)]/\omega_\mathrm{o} - \dots$, the distance
  that the gear moves while the load is negative.

The page is written by `python -m analyses --docs`.
"""

#: What the table of all readings shows.
READINGS = r"""Whether the claims of Figs. 3 to 5 hold at the paper's values, from rest, for each
way in which its text can be read: *yes*, for all readings of the torque or of the gap; *no*, for
none; else the readings for which they do. The scaling is one of two. "0 < ω < 1" is in rad/s or
means ω_o; columns are near its lower end and at its upper one. "T_om = 15" of Figs. 3 and 4 is the
amplitude T_am (*a*), or the peak, so that T_am = 5 N m (*p*). The gap of Fig. 5 is that of Fig. 4,
D = 0.1 (*1*), one of the others of Fig. 3, 0.25 (*2*) or 0.5 (*3*), or that of the φ given (*φ*).
Motions are measured after their transients; for what depends on single impacts, a chaotic one
decides *no*. Claims 1 to 3c and 13b do not depend on these.
"""

#: What stands in plain words, and its mathematics.
MATH = {
    "√(3x² − 2Dx + A − 1/4)": r"\sqrt{3x^2 - 2Dx + A - 1/4}",
    "√(A + D² − 1/4)": r"\sqrt{A + D^2 - 1/4}",
    "3x² − 2Dx + A = 1/4": r"3x^2 - 2Dx + A = 1/4",
    "t²/2 − t + 1 − e^(−t) = 2D/s": r"t^2/2 - t + 1 - \mathrm{e}^{-t} = 2D/s",
    "√(4D/s) + 1": r"\sqrt{4D/s} + 1",
    "1/(4(A + D²))": r"1/(4(A + D^2))",
    "1/(A + D²)": r"1/(A + D^2)",
    "A < 1/4 − D²": r"A < 1/4 - D^2",
    "A = J k1/C_eq²": r"A = J_\mathrm{eq} k_1/C_\mathrm{eq}^2",
    "f_h(θ) = θ_s f(x)": r"f_\mathrm{h}(\theta) = \theta_\mathrm{s} f(x)",
    "φ/θ_s": r"\varphi/\theta_\mathrm{s}",
    "C sin(ω t)": r"C\sin(\omega t)",
    "A < −D²": r"A < -D^2",
    "A = −D²": r"A = -D^2",
    "√(A + D²)": r"\sqrt{A + D^2}",
    "A + D²": r"A + D^2",
    "−D²": r"-D^2",
    "√A": r"\sqrt{A}",
    "C/B − 1": r"C/B - 1",
    "C/B": r"C/B",
    "det J": r"\det J",
    "ω_o": r"\omega_\mathrm{o}",
    "θ_s": r"\theta_\mathrm{s}",
    "T_am": r"T_\mathrm{am}",
    "T_cm": r"T_\mathrm{cm}",
    "T_im": r"T_\mathrm{im}",
    "T_in": r"T_\mathrm{in}",
    "T_on": r"T_\mathrm{on}",
    "J_ea": r"J_\mathrm{ea}",
    "J_eq": r"J_\mathrm{eq}",
    "θ_c": r"\theta_\mathrm{c}",
    "θ_o": r"\theta_\mathrm{o}",
    "θ_Γ": r"\theta_\Gamma",
    "ω_c": r"\omega_\mathrm{c}",
    "v_b": r"v_\mathrm{b}",
    "F_s": r"F_\mathrm{s}",
    "x² + A": r"x^2 + A",
    "T_om": r"T_\mathrm{om}",
    "T_m": r"T_\mathrm{m}",
    "k1": r"k_1",
    "ω": r"\omega",
}

#: Those, and powers of ten; none of them inside a word or a file's name.
SYMBOLS = re.compile(
    r"(?<![\w$\\])(?:" + "|".join(map(re.escape, MATH)) + r"|\d(?:\.\d+)?e-\d+)(?![\w$])"
)


@cache
def all_claims() -> tuple[Claim, ...]:
    """Every claim with its findings, in order."""
    return tuple(claim for source in SOURCES for claim in source.claims())


def typeset(text: str) -> str:
    """Text with its symbols and formulas as mathematics between dollar signs."""
    return SYMBOLS.sub(lambda found: _math(found[0]), text)


def _math(symbol: str) -> str:
    if symbol in MATH:
        return f"${MATH[symbol]}$"
    digits, power = symbol.split("e-")
    return rf"${digits}\times10^{{-{int(power)}}}$" if digits != "1" else f"$10^{{-{int(power)}}}$"


def folded(summary: str, lines: Sequence[str]) -> list[str]:
    """Lines of Markdown that a click on their summary unfolds."""
    text = "\n".join(lines).rstrip()
    return ["<details>", "<summary>", "", summary, "", "</summary>", "", text, "", "</details>", ""]


def headline(claim: Claim) -> str:
    """The number, the sentence and the verdicts of a claim."""
    verdicts = dict.fromkeys(finding.verdict for finding in claim.findings)
    return f"**{claim.number}.** {claim.sentence} *{', '.join(verdicts).capitalize()}.*"


def evidence(claim: Claim) -> list[str]:
    """The computation that tests a claim, with its verdicts and their numbers, in Markdown."""
    lines = [f"*Computed:* {claim.computed}", ""]
    told: dict[str, list[str]] = {}
    for finding in claim.findings:
        verdict: str = finding.verdict
        if verdict == "holds conditionally":
            verdict += f" (at the paper's values: {finding.at_paper})"
        told.setdefault(f"**{verdict}.** {finding.words}", []).append(finding.scaling)
    for words, scalings in told.items():
        lines.append(f"- {scalings[0] if len(scalings) == 1 else 'both'}: {words}")
    return [*lines, ""]


def page(claims: Sequence[Claim], figures: str) -> str:
    """The page in Markdown.

    Parameters
    ----------
    claims : sequence of Claim
    figures : str
        What stands before the name of a figure's file, e.g. ``"figures/"``.
    """
    found = [f.verdict for c in claims for f in c.findings]
    counts = [f"{found.count(verdict)} × {verdict}" for verdict in VERDICTS if verdict in found]
    own = [f.at_paper for c in claims for f in c.findings if f.verdict == "holds conditionally"]
    lines = [HEAD, f"Findings: {', '.join(counts)}.", ""]
    lines += [
        f"Of the {len(own)} that hold conditionally, {own.count('no')} hold at none of the "
        f"paper's own values and {own.count('in part')} in part.",
        "",
        *folded("**All verdicts in one table**", [table(claims)]),
        *folded(
            "**At both ends of the frequencies, for every reading**",
            [READINGS, *readings.table()],
        ),
        "## The claims",
        "",
        "A click unfolds the evidence with the figures.",
        "",
    ]
    shown: set[str] = set()
    for claim in claims:
        unfolded = evidence(claim)
        again = []
        for name in claim.figures:
            if name in shown:
                again.append(f"[{name}]({figures}{name}.png)")
                continue
            shown.add(name)
            caption = CAPTIONS[name]
            unfolded += [f"![{name}]({figures}{name}.png)", "", f"*{name}*: {caption}", ""]
            if name in stories.CASES:
                unfolded += stories.paragraphs(stories.stories()[name])
        if again:
            unfolded += [f"See also {', '.join(again)}.", ""]
        lines += folded(headline(claim), unfolded)
    return typeset("\n".join(lines).rstrip() + "\n")


def write_docs(drawn: Path, docs: Path) -> None:
    """Write the page and its figures, in fewer colours, into a folder of documentation.

    Parameters
    ----------
    drawn : Path
        Where the figures are.
    docs : Path
        Gets ``claims.md``, and ``figures`` inside it the figures.
    """
    claims = all_claims()
    (docs / "figures").mkdir(parents=True, exist_ok=True)
    write_text(docs / "claims.md", page(claims, "figures/"))
    for name in dict.fromkeys(name for claim in claims for name in claim.figures):
        copy_figure(drawn, docs, name)
