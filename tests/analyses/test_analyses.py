"""The numbers behind the figures of the gear."""

import csv
import math
import re
from contextlib import redirect_stdout
from functools import cache, partial
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analyses import __main__ as everything
from analyses import claims_page, dead_zone, negative_stiffness, output, plot_figures, readings
from analyses.case_maps import MAPS
from analyses.cases import laid_cases
from analyses.output import Output
from analyses.passages import OMEGA
from analyses.plot_figures import panel
from fastslow.systems.gears import SCALINGS

from .drawn import CHAOTIC, SAME, difference

pytestmark = pytest.mark.slow

DOCS = Path(everything.__file__).parents[1] / "docs"


#: What draws a figure, by its name in `python -m analyses`.
STEPS = [name for name, _ in everything.steps(Output(DOCS)) if not name.startswith("claims: ")]

#: Figures with maps of many runs, or many orbits: the campaign `samples` draws them.
LONG = (
    "gap region",
    "resonances",
    "orbits",
    "coexistence",
    "tipping",
    "canards",
    *(plane.name for plane in MAPS),
)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A folder, and what draws a step into it, once, and returns the overlaps by figure."""
    into = Output(tmp_path_factory.mktemp("figures"), ("png",), check=True)
    work = dict(everything.steps(into))

    @cache
    def draw(step):
        before = set(into.overlaps)
        work[step]()
        return {name: into.overlaps[name] for name in into.overlaps.keys() - before}

    return into.folder, draw


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """What the command writes, with one figure and few claims, and the rows that it returns."""
    folder = tmp_path_factory.mktemp("written")
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as printed:
        patch.setattr(
            everything, "steps", lambda into: [("dead zone", partial(dead_zone.main, into))]
        )
        patch.setattr(everything, "all_claims", dead_zone.claims)
        patch.setattr(readings, "table", list)
        rows = everything.main([str(folder), "--png", "--check"])
    return folder, {row.case: row for row in rows}, printed.getvalue()


@pytest.fixture(scope="module")
def gaps():
    return laid_cases("gap_width", "consistent")


@pytest.fixture(scope="module")
def folded():
    return negative_stiffness.case()


@pytest.mark.parametrize(
    "step", [pytest.param(s, marks=pytest.mark.sample(0 if s in LONG else 4)) for s in STEPS]
)
def test_a_figure_is_that_of_the_docs(drawn, step):
    """And no label, legend or name covers a curve, marker, axis or another text."""
    folder, draw = drawn
    overlaps = draw(step)
    assert overlaps.keys() <= claims_page.CAPTIONS.keys()
    assert overlaps
    for name, found in overlaps.items():
        assert found == (), name
        assert (folder / f"{name}.png").stat().st_size > 5000
        assert name in CHAOTIC or difference(folder, name) < SAME, name


@pytest.mark.sample(0)
def test_every_figure_is_drawn(drawn):
    _, draw = drawn
    found = [name for step in STEPS for name in draw(step)]
    assert sorted(found) == sorted(claims_page.CAPTIONS)


def test_what_is_written(written):
    folder, rows, printed = written
    names = {"dead_zone.png", "index.md", "regime_maps.csv", "summary.csv"}
    assert {path.name for path in folder.iterdir()} == names
    with (folder / "summary.csv").open(encoding="utf-8") as file:
        assert [line["case"] for line in csv.DictReader(file)] == list(rows)
    assert len(rows) == 19
    assert "dead_zone: no overlaps\n" in printed


def test_the_index_shows_the_figures_of_the_claims(written):
    text = (written[0] / "index.md").read_text(encoding="utf-8")
    assert re.findall(r"^!\[[^\]]*\]\((\w+)\.png\)$", text, re.MULTILINE) == ["dead_zone"]
    for claim in dead_zone.claims():
        assert claims_page.typeset("\n".join(claims_page.evidence(claim))) in text


def test_what_the_runs_show(written):
    _, rows, _ = written
    assert all(row.BE == 2 for row in rows.values())
    assert {name for name, row in rows.items() if row.LP} == {"negative_stiffness"}
    regimes = {name: row.regime for name, row in rows.items() if row.regime != "bilateral"}
    # the source states the opposite: bilateral at 10 N m, unilateral at 50, 100 and at D = 0.5
    assert regimes == {f"load_amplitude_10_{scaling}": "meshed upper" for scaling in SCALINGS}
    for scaling in SCALINGS:
        light = rows[f"load_amplitude_10_{scaling}"]
        assert light.stated == "bilateral"
        assert rows[f"load_amplitude_100_{scaling}"].stated == "unilateral"
        assert rows[f"gap_width_0.5_{scaling}"].stated == "unilateral"
        assert light.transits == 0
        assert math.isnan(light.largest_delay)


def test_the_table_has_a_line_for_each_case(written):
    _, rows, _ = written
    lines = everything.table(list(rows.values())).splitlines()
    assert len(lines) == 2 + len(rows)
    assert lines[0].split()[:7] == ["case", "A", "B", "C", "D", "BE", "LP"]


def test_the_regime_maps_agree_with_slow_load_theory(written):
    with (written[0] / "regime_maps.csv").open(encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    width, frequency = ({k: float(v) for k, v in row.items() if k != "map"} for row in lines)
    assert [row["map"] for row in lines] == ["regimes_width", "regimes_frequency"]
    for row in (width, frequency):
        assert row["bilateral"] + row["unilateral"] + row["meshed"] == pytest.approx(1, abs=1e-12)
        # solved in the gap it is right wherever it was tried, to the accuracy of the edges
        assert row["agreement_exact"] == 1
        assert row["distance_exact"] < 2e-5
        assert row["corners"] < 0.5 * row["pixels"]
    assert width["agreement"] == 1
    assert 0.99 < frequency["agreement"] < 1
    assert frequency["distance"] == pytest.approx(0.0027, abs=1e-4)
    # bilateral at D = 0.25 and unilateral at 0.5 only where the load barely changes sign
    assert width["change_from"] == pytest.approx(1.010829, abs=4e-6)
    assert width["change_to"] == pytest.approx(1.017209, abs=4e-6)
    assert math.isnan(frequency["change_from"])


def test_figures_for_screen_and_print(tmp_path):
    folder = tmp_path / "not there" / "yet"
    dead_zone.main(Output(folder))
    assert (folder / "dead_zone.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "dead_zone.png").read_bytes().startswith(b"\x89PNG")


def test_colours_of_marks_are_kept_in_a_palette():
    """A few pixels of a marker beside a photograph's worth of greys."""
    image = np.random.default_rng(0).integers(100, 140, (200, 200, 1)).repeat(3, axis=2)
    marks = [(0, 114, 178), (213, 94, 0), (0, 158, 115), (230, 159, 0), (204, 121, 167)]
    for k, mark in enumerate(marks):
        image[10 * k : 10 * k + 8, :40] = mark
    few = output.in_few_colours(Image.fromarray(image.astype(np.uint8)))
    shown = np.asarray(few.convert("RGB"), dtype=int)
    for k, mark in enumerate(marks):
        assert (shown[10 * k : 10 * k + 8, :40] == mark).all()
    assert np.abs(shown - image).max() <= 1


def test_an_interrupted_figure_leaves_the_one_before(tmp_path, monkeypatch):
    dead_zone.main(Output(tmp_path, ("png",)))
    before = (tmp_path / "dead_zone.png").read_bytes()

    def interrupted(_figure, path, _dpi):
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(output, "save", interrupted)
    with pytest.raises(KeyboardInterrupt):
        dead_zone.main(Output(tmp_path, ("png",)))
    assert (tmp_path / "dead_zone.png").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["dead_zone.png"]


def test_an_interruption_says_what_is_kept(tmp_path, capsys):
    def interrupted():
        raise KeyboardInterrupt

    done = []
    work = [("first", lambda: done.append(1)), ("second", interrupted), ("third", interrupted)]
    with pytest.raises(SystemExit) as ending:
        everything.run(work, tmp_path)
    assert ending.value.code == 130
    assert done == [1]
    assert f"Interrupted at step 2 of 3, second. The figures finished so far are in {tmp_path}" in (
        capsys.readouterr().out
    )


def test_a_folder_that_cannot_be_written_is_named_at_once(tmp_path, capsys):
    taken = tmp_path / "taken"
    taken.write_text("a file", encoding="utf-8")
    for folder in (taken, taken / "below"):
        with pytest.raises(SystemExit) as ending:
            everything.main([str(folder)])
        assert ending.value.code == 2
        assert f"cannot write into {folder}: " in capsys.readouterr().err


def test_options(capsys, monkeypatch):
    # argparse breaks lines at the width of the terminal, and colours them where told to
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    with pytest.raises(SystemExit) as ending:
        everything.main(["--pdf"])
    assert ending.value.code == 2
    assert "unrecognized arguments: --pdf" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ending:
        everything.main(["--help"])
    assert ending.value.code == 0
    told = capsys.readouterr().out
    assert "python -m analyses [-h] [--png] [--docs] [--gallery] [--only MODEL]" in told
    assert "`index.md`" in told


def test_dead_zone():
    x = np.array([-1.0, -0.25, -0.1, 0.0, 0.25, 0.3, 1.0])
    assert dead_zone.transmitted(x) == pytest.approx([-0.75, 0, 0, 0, 0, 0.05, 0.75], abs=1e-14)


def test_the_gap_is_passed_as_late_as_slow_theory_says(gaps):
    # crossing the gap takes √(4D/s) + 1 at the slope s of the load where it is zero
    for case in gaps:
        p = case.setting.model.parameters
        slope = OMEGA * math.sqrt(p["C"] ** 2 - p["B"] ** 2)
        leave, reach = next(
            (one.time, other.time)
            for one, other in zip(case.run.crossings, case.run.crossings[1:], strict=False)
            if (one.interface, other.interface) == ("x - D", "x + D")
        )
        assert reach - leave == pytest.approx(math.sqrt(4 * p["D"] / slope) + 1, rel=0.05)


def test_wider_gaps_delay_more(gaps):
    delays = [np.nanmax(np.abs(case.overlay.delays)) for case in gaps]
    assert delays == sorted(delays)
    assert all(len(case.overlay.transitions) == 6 for case in gaps)
    assert {t.type for case in gaps for t in case.overlay.transitions} == {"gap crossing"}


def test_the_natural_frequency_falls_with_the_stiffness():
    frequencies = []
    for case in laid_cases("stiffness", "consistent"):
        (point,) = case.diagram.at(w=2.0)
        p, x = case.setting.model.parameters, point["x"]
        expected = math.sqrt(3 * x**2 - 2 * p["D"] * x + p["A"] - 0.25)
        assert np.abs(point.eigenvalues.imag) == pytest.approx([expected] * 2, rel=1e-10)
        frequencies.append(expected)
    assert frequencies == sorted(frequencies)


def test_the_smallest_load_amplitude_never_unloads():
    cases = laid_cases("load_amplitude", "consistent")
    lowest = [float(case.run["w"].min()) for case in cases]
    assert lowest[0] == pytest.approx(0.00834, abs=1e-4)
    assert max(lowest[1:]) < -9
    assert cases[0].run.itinerary[-1] == "S1"
    assert cases[0].run.crossings[-1].time < 5
    sizes = [float(np.ptp(case.run["x"][case.run.t > 1000])) for case in cases]
    assert sizes == sorted(sizes)


def test_folds_and_jumps(folded):
    loads = sorted(point["w"] for point in folded.diagram.folds)
    assert loads == pytest.approx([-0.0894402097712473, 0.0894402097712473], rel=1e-12)
    assert [t.type for t in folded.overlay.transitions] == ["jump"] * 5
    for jump in folded.overlay.transitions:
        # past the fold, in the direction in which the load drifts
        assert jump.delay > 0
        assert abs(jump.value) > 0.0894402097712473
        assert jump.value * jump.state[0] > 0


@pytest.mark.parametrize(
    "draw",
    [
        pytest.param(draw, id=draw.__name__, marks=pytest.mark.sample(int(draw is panel)))
        for draw in plot_figures.FIGURES
    ],
)
def test_a_figure_of_the_reference_is_the_one_drawn(tmp_path, draw):
    """That of `panel` is in the README."""
    name = f"plot_{draw.__name__}"
    Output(tmp_path, formats=("png",)).save(draw().figure, name)
    assert difference(tmp_path, name) < SAME
