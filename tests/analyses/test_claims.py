"""Every number of the verdict table, and what stands behind it."""

import json
import math
import re
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from string import Formatter

import mpmath
import numpy as np
import pytest
from PIL import Image
from scipy.integrate import trapezoid
from scipy.optimize import brentq

import fastslow as fs
from analyses import (
    bursting,
    canards,
    case_maps,
    cases,
    claims_page,
    coexistence,
    dead_zone,
    equilibria,
    frequency_response,
    gap_effects,
    gap_region,
    gap_width,
    load_amplitude,
    negative_stiffness,
    orbits,
    output,
    physical_route,
    readings,
    resonances,
    responses,
    sensitivities,
    stiffness,
    stories,
    tipping,
)
from analyses.claims import VERDICTS, Claim, Finding, table
from fastslow.systems.gears import SCALINGS, gear_scales

pytestmark = pytest.mark.slow

DOCS = Path(claims_page.__file__).parents[1] / "docs"

#: Verdict, whether it holds at the source's values, and numbers of every claim by scaling.
EXPECTED = {
    (row["claim"], row["scaling"]): (row["verdict"], row["at_paper"], row["numbers"])
    for row in json.loads((Path(__file__).parent / "claims.json").read_text(encoding="utf-8"))
}


#: Numbers of every overlay, by the figure that shows it.
STORIES = json.loads((Path(__file__).parent / "stories.json").read_text(encoding="utf-8"))


#: Sources whose computations take more than two seconds: the campaign `samples` runs them.
LONG = (
    *(bursting, canards, coexistence, frequency_response, gap_effects),
    *(gap_width, load_amplitude, orbits, sensitivities, tipping),
)


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(source, marks=pytest.mark.sample(0) if source in LONG else ())
        for source in claims_page.SOURCES
    ],
    ids=lambda source: source.__name__.rpartition(".")[2],
)
def claims(request):
    """The claims of one source."""
    return request.param.claims()


@pytest.fixture(scope="module")
def findings(claims):
    return {(c.number, f.scaling): f for c in claims for f in c.findings}


@pytest.fixture
def few(monkeypatch):
    """A page of few claims, without the table of all readings."""
    monkeypatch.setattr(claims_page, "all_claims", dead_zone.claims)
    monkeypatch.setattr(readings, "table", list)


#: What is taken over the samples of a run, which another processor's rounding moves: the
#: vibration in contact is sampled at the steps. The pages show two or three digits.
SAMPLED = {"behind": 2e-3, "upper": 1e-4, "lower": 1e-4}


def same(one, other, rel=2e-5):
    """Whether two numbers agree to the digits kept, of which the pages show fewer."""
    return one == pytest.approx(other, rel=rel, abs=1e-10, nan_ok=True)


def differences(findings):
    """Verdicts and numbers that are not those expected."""
    found = list(findings.keys() - EXPECTED.keys())
    for key in findings.keys() & EXPECTED.keys():
        verdict, at_paper, numbers = EXPECTED[key]
        finding = findings[key]
        found += [(*key, "verdict")] if finding.verdict != verdict else []
        found += [(*key, "at_paper")] if finding.at_paper != at_paper else []
        found += [(*key, name) for name in finding.numbers.keys() ^ numbers.keys()]
        for name in finding.numbers.keys() & numbers.keys():
            found += [] if same(finding.numbers[name], numbers[name]) else [(*key, name)]
    return found


def test_every_number_of_the_table(findings):
    assert differences(findings) == []


def test_the_page_of_the_docs_has_the_words_of_the_scripts(claims):
    text = (DOCS / "claims.md").read_text(encoding="utf-8")
    for claim in claims:
        assert claims_page.typeset("\n".join(claims_page.evidence(claim))) in text
        for line in table([claim]).splitlines()[2:]:
            assert claims_page.typeset(line) in text


def test_a_change_of_any_number_is_noticed(findings):
    for key, finding in findings.items():
        for name, value in finding.numbers.items():
            other = value * 1.0001 if value else 1e-3
            changed = replace(finding, numbers={**finding.numbers, name: other})
            if changed.words != finding.words:
                assert differences({**findings, key: changed}) == [(*key, name)]
        doubled = {name: 2 * value + 1 for name, value in finding.numbers.items()}
        other = "holds" if finding.verdict != "holds" else "does not hold"
        changed = replace(finding, numbers=doubled, verdict=other)
        assert len(differences({**findings, key: changed})) >= len(doubled) + 1
        if finding.verdict == "holds conditionally":
            turned = "no" if finding.at_paper == "in part" else "in part"
            changed = replace(finding, conditional=turned)
            assert differences({**findings, key: changed}) == [(*key, "at_paper")]


def test_every_number_is_one_of_those_asserted(findings):
    """What stands in the words of the evidence outside braces is a setting, no result."""
    for key, finding in findings.items():
        used = {name for _, name, _, _ in Formatter().parse(finding.template) if name}
        assert used == finding.numbers.keys(), key


def test_every_number_of_the_overlays():
    assert stories.stories().keys() == STORIES.keys() == set(stories.CASES)
    for name, expected in STORIES.items():
        found = [asdict(story) for story in stories.stories()[name]]
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert one.keys() == other.keys()
            for key, value in other.items():
                told = float("nan") if value is None else value
                rel = SAMPLED.get(key, 2e-5)
                assert one[key] == told if isinstance(value, str) else same(one[key], told, rel), (
                    key
                )


def test_the_overlays_against_the_load_and_the_crossings():
    for figure in stories.FIGURES:
        for scaling in SCALINGS:
            for case in cases.laid_cases(figure, scaling):
                p, story = case.setting.model.parameters, stories.story(case)
                # the part of the period in which the load is positive
                above = 0.5 + math.asin(min(1.0, p["B"] / p["C"])) / math.pi
                assert story.upper == pytest.approx(above, abs=0.01)
                if p["C"] < p["B"]:
                    assert (story.count, story.kind) == (0, "")
                    continue
                assert (story.count, story.kind) == (6, "gap crossing")
                near, far = next(
                    (a, b)
                    for a, b in pairwise(case.run.crossings)
                    if (a.interface, b.interface) == ("x - D", "x + D")
                )
                assert story.measured == pytest.approx(far.time - near.time, rel=1e-9)
                load = p["B"] + p["C"] * math.sin(p["omega"] * far.time)
                assert story.down == pytest.approx(load, rel=1e-9)
                slope = p["omega"] * math.sqrt(p["C"] ** 2 - p["B"] ** 2)
                assert story.law == pytest.approx(responses.crossing_time(p["D"], slope), rel=0.02)


def test_an_overlay_without_a_transition_has_dashes_in_its_row():
    lines = stories.paragraphs(stories.stories()["load_amplitude_consistent"])
    rows = [line for line in lines if line.startswith("| $")]
    assert rows[0].endswith("| none | – | – | – | – |")
    assert rows[2].startswith(r"| $T_\mathrm{am} = 100\ \mathrm{N\ m}$ | 53.2% |")
    assert lines[-2] == "Rhythm: fast-slow oscillation across the gap, without bifurcation."


def test_the_numbers_of_the_claims():
    numbers = list(dict.fromkeys(number for number, _ in EXPECTED))
    plain = [number for number in numbers if number.isdigit()]
    assert plain == [str(k) for k in range(1, 19)]
    added = ["1b", "3b", "3c", "4b", "10b", "10c", "10d", "10e", "10f", "12b", "13b", "18b"]
    added += ["B8b", "B5b", "B5c", "B6b"]
    assert [n for n in numbers if n[-1].isalpha()] == added
    own = {number for number in numbers if number[0] == "B" and number not in added}
    assert own == {f"B{k}" for k in range(1, 23)}


def test_canards_and_cycles_against_scipy_and_closed_forms():
    # Radau with a tolerance of 1e-12 along both sheets up to v = -1, and a root of their distance
    assert canards.current().value == pytest.approx(0.3119798183536, abs=1e-12)
    # the next coefficient of the series, −0.464, from what is left at two ratios of the rates
    near, far = ((canards.force(e).value - canards.series(e)) / e**4 for e in (0.005, 0.01))
    assert 2 * near - far == pytest.approx(-0.464, abs=2e-3)
    # DOP853 with a tolerance of 1e-12, between the extrema of x
    cycle = canards.corner_cycle(1e-3)
    assert cycle["max(x)"] - cycle["min(x)"] == pytest.approx(0.0083090532145, rel=1e-10)
    band = canards.passage().freezing
    assert band.lag[band.known, 0] == pytest.approx(canards.lag(band)[band.known], abs=1e-12)


def test_both_scalings_have_a_verdict(claims):
    for claim in claims:
        told = tuple(f.scaling for f in claim.findings)
        assert told in (SCALINGS, ("either",))
        assert all(f.verdict in VERDICTS for f in claim.findings)
        assert all(name in claims_page.CAPTIONS for name in claim.figures)


@pytest.mark.sample(0)
def test_the_page_in_the_docs_is_what_the_scripts_write():
    claims = claims_page.all_claims()
    assert {(c.number, f.scaling) for c in claims for f in c.findings} == EXPECTED.keys()
    text = (DOCS / "claims.md").read_text(encoding="utf-8")
    assert text == claims_page.page(claims, "figures/")


def test_the_page_in_the_docs_shows_every_figure():
    text = (DOCS / "claims.md").read_text(encoding="utf-8")
    for name in claims_page.CAPTIONS:
        assert f"](figures/{name}.png)" in text
        assert (DOCS / "figures" / f"{name}.png").stat().st_size < 100_000


@pytest.mark.usefixtures("few")
def test_a_page_shows_each_figure_once():
    one = Claim("1", "a", "b", (Finding("either", "holds", "{n:.0f}", {"n": -2}),), ("dead_zone",))
    text = claims_page.page([one, one], "")
    assert text.count("![") == 1
    assert text.count("](dead_zone.png)") == 2
    assert "Findings: 2 × holds.\n" in text


def test_a_claim_whose_scalings_differ_says_both():
    split = Claim(
        "1",
        "a",
        "b",
        (Finding("consistent", "holds", "yes"), Finding("printed", "does not hold", "no")),
    )
    assert split.verdict == "consistent: holds; printed: does not hold"
    assert table([split]).splitlines()[3] == "|  |  | printed | **does not hold** | no |"


def test_equal_verdicts_under_both_scalings_are_one_row():
    findings = (Finding("consistent", "holds", "a"), Finding("printed", "holds", "b"))
    same = Claim("1", "a", "b", findings)
    assert table([same]).splitlines()[2:] == ["| 1 | a | both | **holds** | yes |"]
    assert claims_page.evidence(same)[2:4] == [
        "- consistent: **holds.** a",
        "- printed: **holds.** b",
    ]


@pytest.mark.usefixtures("few")
def test_a_claim_that_holds_conditionally_says_whether_it_holds_at_the_papers_values():
    with pytest.raises(ValueError, match="at the source's own values"):
        Finding("either", "holds conditionally", "sometimes")
    told = Finding("either", "holds conditionally", "sometimes", conditional="in part")
    page = claims_page.page([Claim("1", "a", "b", (told,))], "")
    assert "| either | **holds conditionally** | in part |" in page
    assert "**holds conditionally (at the paper's values: in part).**" in page
    assert "Of the 1 that hold conditionally, 0 hold at none" in page


@pytest.mark.usefixtures("few")
def test_docs_are_written_with_their_figures(tmp_path):
    for name in claims_page.CAPTIONS:
        Image.new("RGB", (240, 120), (200, 30, 30)).save(tmp_path / f"{name}.png")
    claims_page.write_docs(tmp_path, tmp_path / "docs")
    assert (tmp_path / "docs/claims.md").read_text(encoding="utf-8").startswith("# The paper")
    with Image.open(tmp_path / "docs/figures/dead_zone.png") as image:
        assert image.size == (240, 120)


def test_figures_for_print_are_shown_in_the_scale_of_the_others(tmp_path):
    for dpi, width in ((150, 600), (300, 1200)):
        Image.new("RGB", (width, 300)).save(tmp_path / "a.png", dpi=(dpi, dpi))
        assert output.shrunk(tmp_path / "a.png").width == 600


def test_symbols_become_mathematics_and_names_of_files_do_not():
    told = claims_page.typeset("T_am at ω_o of k1, map_k1, θ_s, 1e-09 and 6.00e-03; $k1$ √A C/B")
    assert told == (
        r"$T_\mathrm{am}$ at $\omega_\mathrm{o}$ of $k_1$, map_k1, $\theta_\mathrm{s}$, $10^{-9}$ "
        r"and $6.00\times10^{-3}$; $k1$ $\sqrt{A}$ $C/B$"
    )
    page = (DOCS / "claims.md").read_text(encoding="utf-8")
    assert all(line.count("$") % 2 == 0 for line in page.splitlines())
    # GitHub takes the backslash from these
    assert not re.search(r"\\[,;!{}]", page)


def test_a_minus_is_one_but_for_exponents():
    template, numbers = "{a:.1f} e^({a:.1f} t) {b:.0e} S-shape", {"a": -2, "b": 1e-9}
    words = Finding("either", "holds", template, numbers).words
    assert words == "−2.0 e^(−2.0 t) 1e-09 S-shape"


def test_dead_zone_claim_reads_the_equations():
    assert [claim.verdict for claim in dead_zone.claims()] == ["holds", "holds"]


def test_one_motion_in_four_models():
    found = physical_route.route()
    # units of θ_s; the twist reaches 0.44 of them, the load side turns 41 rad
    assert found.spread < 1e-11
    assert found.rigid_error < 1e-13
    assert found.load_side.max() > 41
    assert np.abs(found.twist).max() / found.scale == pytest.approx(0.4402309819, abs=1e-9)
    assert physical_route.within(2e-9) == 2e-9


def test_the_widest_gap_against_its_expansion():
    for scaling in SCALINGS:
        p = cases.gear(scaling).parameters
        for omega, rel in ((0.01, 2e-6), (cases.FASTEST, 5e-6)):
            with mpmath.workdps(30):
                root = mpmath.sqrt(p["C"] ** 2 - p["B"] ** 2)
                leading = (root - p["B"] * mpmath.acos(p["B"] / p["C"])) / omega
                stiff = p["A"] + cases.GAP**2
                expanded = leading - omega * root / 4 * (1 - 1 / stiff) ** 2
            assert gap_width.widest(scaling, omega) == pytest.approx(float(expanded), rel=rel)


@pytest.mark.sample(0)
def test_the_region_of_figure_3_is_that_of_the_criterion():
    for scaling in SCALINGS:
        assert gap_region.distance(scaling) < 1e-3
        model = cases.gear(scaling)
        p = model.parameters
        # just inside both edges at 1 rad/s the widths are on either side, just outside not
        low, high = (gap_region.edge(scaling, D, np.array([cases.FASTEST]))[0] for D in (0.25, 0.5))
        for excess, word in (
            (low - 1e-3, gap_region.FEWER),
            (low + 1e-3, gap_region.AS_STATED),
            (high - 1e-3, gap_region.AS_STATED),
            (high + 1e-3, gap_region.ALL),
        ):
            regimes = [
                fs.simulate(
                    model.with_parameters(D=D, C=p["B"] * (1 + 10**excess), omega=cases.FASTEST),
                    [D, 0],
                    periods=2,
                ).regime
                for D in cases.WIDTHS
            ]
            assert gap_region.word_of(tuple(regimes)) == word


@pytest.mark.parametrize(
    ("plane", "regime"),
    [
        pytest.param(case_maps.MAPS[0], "bilateral", id="width_load"),
        pytest.param(case_maps.MAPS[1], None, id="frequency_width", marks=pytest.mark.sample(0)),
        pytest.param(
            case_maps.MAPS[2], "meshed upper", id="stiffness_torque", marks=pytest.mark.sample(0)
        ),
    ],
)
def test_the_maps_that_hold_the_cases(plane, regime):
    """Against the criterion; and the regime at the cases, but among chaotic motions."""
    for scaling in SCALINGS:
        found = case_maps.criterion(plane, scaling)
        # the criterion knows nothing of chaos, nor of resonances from ω_o of about a half on
        settled = np.array([word not in ("chaotic", "not settled") for word in found.found])
        share = found.areas[found.agree].sum() / found.areas[settled].sum()
        assert (1.0 if regime else 0.98) <= share <= 1.0
        assert settled.all() or regime is None
    found = case_maps.simulated(plane, "consistent")
    assert regime is None or all(found.at(*place) == regime for place in plane.marks.values())


@pytest.mark.sample(0)
def test_where_fast_loads_are_as_stated_ends_there():
    for start in resonances.STARTS:
        first, last = resonances.longest("consistent", start)
        for omega, stated in (
            (first - 0.01, False),
            (first + 1e-3, True),
            (4.3, True),
        ):
            widths = np.array(cases.WIDTHS)
            found = resonances.regimes("consistent", np.full(3, omega), widths, start)
            assert (tuple(found) == gap_region.STATED) is stated
        # next to the upper end the motion at D = 0.25 settles slowly, at some frequencies not
        # within the run
        found = resonances.regimes("consistent", np.full(3, last - 1e-3), widths, start)
        for regime, expected in zip(found, gap_region.STATED, strict=True):
            assert regime in (expected, "not settled")
    # of a motion that repeats, a plain run says the same
    found = [
        fs.simulate(cases.gear("consistent", 4.3, D=D), [0, 0], periods=200).regimes()
        for D in cases.WIDTHS
    ]
    assert all(regimes.settled for regimes in found)
    assert tuple(regimes.label for regimes in found) == gap_region.STATED


@pytest.mark.sample(0)
def test_chaos_is_counted_nowhere_as_a_regime():
    """Fault H1: from ω_o = 1.20 on runs had been unilateral by their last period."""
    omega = resonances.SCANNED["consistent"]
    for frequency in (0.98, 1.0, 1.2, 1.3, 1.7, 2.0):
        k = int(np.argmin(np.abs(omega - frequency)))
        assert resonances.scanned("consistent", cases.WIDTHS[2])[k] == "chaotic"
    assert min(resonances.bands("consistent"))[0] > 3.6
    assert resonances.bands("printed") == []
    assert 0.96 <= max(resonances.chaotic_below_one()) <= 1.001


def test_thresholds_of_the_mean_torque_are_those_of_the_criterion():
    """Fault H3: solved for, and compared with the motion in the gap in closed form."""
    for scaling in SCALINGS:
        p = cases.gear(scaling, D=cases.GAP, omega=cases.FASTEST).parameters
        for T_am, (bilateral, any_impact) in zip(
            cases.TORQUES, load_amplitude.thresholds(scaling), strict=True
        ):
            amplitude = p["C"] * T_am / 15.0

            def excess(mean, amplitude=amplitude, p=p):
                stiff = p["A"] + p["D"] ** 2
                low = p["B"] * mean / 10.0
                widest = fs.systems.slow_load_gap(
                    low, amplitude, p["omega"], stiffness=stiff, exact=True
                )
                return widest - p["D"]

            mean = brentq(excess, 0.9 * T_am, 0.996 * T_am, xtol=1e-12)
            assert bilateral == pytest.approx(mean, rel=1e-6)
            # contact is lost where the load changes sign, or just above
            assert any_impact == pytest.approx(10 * load_amplitude.ratio(T_am), rel=5e-5)
        (_, _), (first, second), (third, fourth) = load_amplitude.thresholds(scaling)
        assert first < second < third < fourth


def test_the_flank_is_the_branch_of_the_diagram():
    for scaling in SCALINGS:
        case = cases.laid_cases("stiffness", scaling)[1]
        p = case.setting.model.parameters
        (point,) = case.diagram.at(w=0.7 * p["B"])
        assert stiffness.flank(0.7 * p["B"], p["A"], p["D"]) == pytest.approx(point["x"], rel=1e-12)
        frequency = stiffness.natural(0.7 * p["B"], p["A"], p["D"])
        assert np.abs(point.eigenvalues.imag) == pytest.approx([frequency] * 2, rel=1e-10)


def test_vibrations_in_contact_have_the_natural_frequency():
    for scaling in SCALINGS:
        found = stiffness.vibrations(scaling)
        frequencies = [v.frequency for v in found]
        assert frequencies == sorted(frequencies)
        for vibration in found:
            assert vibration.frequency == pytest.approx(vibration.predicted, rel=3e-4)


def test_where_a_softer_gear_is_faster():
    for scaling in SCALINGS:
        for k1 in cases.STIFFNESSES:
            A = cases.gear(scaling, k1=k1).parameters["A"]
            load = stiffness.turning_load(A, 0.1)
            for factor, rises in ((0.98, 1), (1.02, -1)):
                ends = [stiffness.natural(factor * load, a, 0.1) for a in (A, A * (1 + 1e-6))]
                assert np.sign(ends[1] - ends[0]) == rises
        load = stiffness.overtaking_load(scaling)
        roots = []
        for k1 in (1000, 7000):
            A = cases.gear(scaling, k1=k1).parameters["A"]
            # x³ − D x² + A x − D A − w = 0 has one real root for these
            x = next(r.real for r in np.roots([1, -0.1, A, -0.1 * A - load]) if abs(r.imag) < 1e-6)
            roots.append(3 * x * x - 0.2 * x + A)
        assert roots[0] == pytest.approx(roots[1], rel=1e-9)


def test_light_bilateral_and_heavy_not_is_found_nowhere():
    for scaling in SCALINGS:
        rows = load_amplitude.over_means(scaling)
        for mean, regimes in zip(load_amplitude.MEANS, rows, strict=True):
            # the load changes sign where C > B, at these frequencies enough to cross the gap
            for T_am, regime in zip(cases.TORQUES, regimes, strict=True):
                signs = load_amplitude.ratio(T_am) * 10 / mean
                assert abs(signs - 1) > 0.005
                assert regime == ("bilateral" if signs > 1 else "meshed upper")


def test_the_time_in_the_gap_against_the_law_of_the_toolkit():
    case = cases.laid_cases("gap_width", "consistent")[1]
    p = case.setting.model.parameters
    slope = p["omega"] * math.sqrt(p["C"] ** 2 - p["B"] ** 2)
    law = fs.predict_delay(equilibria.corner(case), -slope)
    assert responses.crossing_time(p["D"], slope) == pytest.approx(law.duration, rel=5e-3)
    found = responses.response("D", "consistent")
    row = list(found.values).index(0.25)
    assert found.transit[row] == pytest.approx(law.duration, rel=1e-2)
    # of quadruple precision, at A = 41.67, B = 2.372, C = 3.546
    assert found.transit[row] == pytest.approx(7.11204519, rel=2e-4)


def test_the_limits_of_the_time_in_the_gap():
    assert responses.crossing_time(1e8, 1.0) == pytest.approx(math.sqrt(4e8) + 1, rel=1e-7)
    assert responses.crossing_time(1e-12, 1.0) == pytest.approx(12e-12 ** (1 / 3), rel=1e-3)


def test_eigenvalues_turn_complex_where_the_determinant_is_a_quarter():
    for scaling in SCALINGS:
        for case in cases.laid_cases("gap_width", scaling):
            p = case.setting.model.parameters
            expected = 1 / (4 * (p["A"] + p["D"] ** 2))
            assert equilibria.complex_from(case) == pytest.approx(expected, rel=1e-6)


def test_nodes_end_where_two_eigenvalues_meet():
    load = equilibria.node_load(equilibria.SOFT, cases.GAP)
    model = cases.gear("consistent").with_parameters(A=equilibria.SOFT, D=cases.GAP).frozen()
    for factor, kind in ((0.999, "node"), (1.001, "focus")):
        (point,) = fs.equilibria(model, w=factor * load)
        assert point.type == kind
    assert equilibria.node_load(41.67, 0.25) == 0
    (branch,) = equilibria.soft_diagram().branches
    inside = np.abs(branch["w"]) < 0.99 * load
    assert np.abs(branch.eigenvalues.imag[inside]).max() == 0
    assert np.abs(branch.eigenvalues.imag[~inside][:3]).min() > 0


def test_folds_begin_on_the_interfaces():
    for curve in negative_stiffness.fold_curves():
        (meet,) = curve.special("BF")
        assert meet["A"] == pytest.approx(-(cases.GAP**2), abs=1e-12)
        assert meet["w"] == pytest.approx(0, abs=1e-12)
    # an independent extremum of (x² + A)(x − D)
    slope = lambda x: 3 * x * x - 2 * cases.GAP * x - 0.6  # noqa: E731
    x = brentq(slope, 0.3, 1.0, xtol=1e-15)
    load = (x * x - 0.6) * (x - cases.GAP)
    assert negative_stiffness.fold_load(np.array([-0.6]))[0] == pytest.approx(-load, rel=1e-12)


def test_relaxation_oscillations_begin_a_little_beyond_the_fold():
    least, most = negative_stiffness.onset()
    assert 1 < least < most < 1.03
    assert negative_stiffness.case().run.regime == "bilateral"


def test_the_gap_is_no_part_of_what_the_teeth_deflect():
    for scaling in SCALINGS:
        found = stiffness.sizes(scaling)
        for case, teeth in zip(cases.laid_cases("stiffness", scaling), found.teeth, strict=True):
            p = case.setting.model.parameters
            # equilibria at both ends of the load, as deep as the contact is without its gap
            ends = [
                max(r.real for r in np.roots([1, -0.1, p["A"], -0.1 * p["A"] - load]) if not r.imag)
                for load in (p["C"] + p["B"], p["C"] - p["B"])
            ]
            # and the overshoot of the impact on the lower side, v/√A at most
            least = sum(ends) - 0.2
            assert least < teeth < least + impact_swing(case)
        ratios = found.ratios
        assert ratios["teeth"] > 5
        assert ratios["swing"] > 2
        assert (ratios["twist"] < 1.5) is (scaling == "printed")


def impact_swing(case):
    speed, depth = stiffness.impact(case)
    p = case.setting.model.parameters
    assert depth < 1.15 * (speed + 0.02) / math.sqrt(p["A"])
    return depth


def test_a_torque_of_the_input_shaft_would_not_give_equation_5():
    # J_eq = 0.0239155920, J_o = 0.024, N J_i = 0.068, T_m = 10
    expected = 0.0239155920 * (10 / 0.024 + 10 / 0.068)
    assert physical_route.shaft_torque() == pytest.approx(expected, rel=1e-8)
    assert physical_route.allowed_shift() == 0
    (finding,) = physical_route.claims()[3].findings
    assert finding.verdict == "does not hold"
    for name in ("T_on", "T_cm", "J_ea", "θ_Γ", "T_im"):
        assert name in finding.words


def test_overtones_against_a_quadrature():
    case = cases.laid_cases("gap_width", "consistent")[2]
    p, end = case.setting.model.parameters, case.run.span[1]
    times = np.linspace(end * 2 / 3, end, 200001)
    x = case.run(times)[0]
    angle = p["omega"] * times
    mean = trapezoid(x, angle) / (2 * np.pi)
    parts = [trapezoid(x * f(angle), angle) / np.pi for f in (np.cos, np.sin)]
    first = parts[0] ** 2 + parts[1] ** 2
    total = trapezoid((x - mean) ** 2, angle) / np.pi
    assert gap_effects.overtones(case) == pytest.approx(math.sqrt(total / first - 1), rel=2e-3)
    # a gear without clearance is nearly linear: x = w/A − (w/A)³/A, an overtone of C³/(4 A⁴)
    expected = p["C"] ** 3 / 4 / p["A"] ** 4 / (p["C"] / p["A"])
    expected = math.hypot(expected, 3 * p["B"] * p["C"] ** 2 / 2 / p["A"] ** 3 / p["C"])
    assert gap_effects.overtones_without_gap(case) == pytest.approx(expected, rel=0.05)


def test_relaxation_begins_nearer_to_the_fold_beyond_the_range_scanned():
    least, _ = negative_stiffness.onset()
    assert 1 < negative_stiffness.onset_at(-1.5) < least
    # the map and the bisection agree inside the range
    assert negative_stiffness.onset_at(-1.0) == pytest.approx(least, abs=2e-3)


def test_the_overlay_in_physical_units_is_the_dimensionless_one_in_its_scales():
    overlay, scales = physical_route.overlay(), gear_scales()
    assert [t.type for t in overlay.transitions] == ["gap crossing"] * 6
    p = fs.systems.harmonic_gear_from_physical(omega=1.0).parameters
    torque = 10 / p["B"]
    slope = p["omega"] * math.sqrt(p["C"] ** 2 - p["B"] ** 2)
    for transition in overlay.transitions:
        across = responses.crossing_time(p["D"], slope)
        assert transition.duration == pytest.approx(across * scales.time, rel=0.03)
        assert abs(transition.width) == pytest.approx(slope * across * torque, rel=0.1)


def test_the_output_speed_from_the_two_inertias():
    case = cases.laid_cases("load_amplitude", "consistent")[2]
    scales = gear_scales()
    low, high = cases.extent(case, "v")
    # N² J_i is 6.8 kg m², 283 times J_o
    expected = (high - low) * scales.angle / scales.time * 6.8 / 6.824
    twist, load = load_amplitude.output_speed(case, "consistent")
    assert twist == pytest.approx(expected, rel=1e-12)
    # J θ_o' of the rigid body is the integral of 100 N m times the sine
    assert load == pytest.approx(2 * 100 / (0.01 / scales.time) / 6.824, rel=1e-12)


def test_the_widths_studied_as_gaps():
    # D = 0.2989 and 5.104 are φ = 1.75e-2 rad in the reference values
    for scaling, width in (("consistent", 0.298869397), ("printed", 5.10416667)):
        assert cases.gear(scaling).parameters["D"] == pytest.approx(width, rel=1e-8)


def test_contact_is_lost_for_the_time_in_the_gap():
    for scaling in SCALINGS:
        for case in cases.laid_cases("gap_width", scaling):
            p = case.setting.model.parameters
            across, share = gap_effects.out_of_contact(case)
            slope = p["omega"] * math.sqrt(p["C"] ** 2 - p["B"] ** 2)
            least = 2 * responses.crossing_time(p["D"], slope) * p["omega"] / (2 * math.pi)
            assert across == 2
            # rebounds come on top
            assert 0.98 * least < share < 5 * least


@pytest.mark.sample(0)
def test_one_motion_at_each_width_and_frequency():
    for scaling in SCALINGS:
        assert max(gap_effects.spread(scaling)) < 1e-11


def test_impacts_need_a_load_that_changes_sign():
    for scaling in SCALINGS:
        light, *heavy = cases.laid_cases("load_amplitude", scaling)
        assert load_amplitude.impacts(light) == 0
        for case in heavy:
            since = case.run.span[1] * 2 / 3
            met = [c for c in case.run.crossings if c.time > since]
            # each contact that ends has begun
            assert load_amplitude.impacts(case) == len(met) / 2
