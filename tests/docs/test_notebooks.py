"""A notebook runs, and what is stored in it is what it gives today.

The campaign `samples` runs all of them.
``python tests/docs/test_notebooks.py`` runs them all and stores their outputs anew; look
at the figures before committing them.
"""

import json
import re
import tempfile
from pathlib import Path

import nbformat
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import fsolve

from tests.docs.kernels import NOTEBOOKS, Kernel

pytestmark = pytest.mark.slow

#: A number in an output; a sign with a space behind it belongs to a formula.
NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:e[+-]?\d+)?")


def executed(kernel, name, extra=()):
    """A notebook with fresh outputs; each text of code `extra` gets a cell of its own."""
    notebook = nbformat.read(NOTEBOOKS[name], as_version=4)
    notebook.cells += [nbformat.v4.new_code_cell(code) for code in extra]
    with tempfile.TemporaryDirectory() as folder:
        kernel.execute({name: notebook}, Path(folder))
    # the version of Python is not part of a notebook, nor what Matplotlib says when it is new
    notebook.metadata.pop("language_info")
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [o for o in cell.outputs if "font cache" not in o.get("text", "")]
    return notebook


def outputs(notebook):
    return [(c.id, o) for c in notebook.cells if c.cell_type == "code" for o in c.outputs]


def texts(notebook):
    """Every text put out, with its cell and what it is."""
    found = []
    for cell, output in outputs(notebook):
        if output.output_type == "stream":
            found.append((cell, output.name, output.text))
        else:
            found += [
                (cell, kind, data)
                for kind, data in sorted(output.data.items())
                if kind != "image/png"
            ]
    return found


def figures(notebook):
    return [cell for cell, output in outputs(notebook) if "image/png" in output.get("data", {})]


def alike(one, other):
    """Whether two texts have the same words, and numbers to five digits."""
    if NUMBER.split(one) != NUMBER.split(other):
        return False
    pair = [np.array(NUMBER.findall(text), dtype=float) for text in (one, other)]
    return np.allclose(*pair, rtol=1e-5, atol=1e-9)


# ---------------------------------------------------------------- independent values


def transit():
    """How far the load goes while the gear crosses its gap downwards, by SciPy."""

    def rates(t, s):
        load = 2.372 + 3.546 * np.sin(0.01 * t)
        gap = s[0] - np.clip(s[0], -0.25, 0.25)
        return s[1], load - s[1] - (s[0] ** 2 + 41.67) * gap

    def edge(side):
        def event(t, s):
            return s[0] - side

        event.direction = -1
        return event

    # at t = 300 the start is forgotten
    run = solve_ivp(
        rates, (300, 400), [0.3, 0], "DOP853", events=(edge(0.25), edge(-0.25)),
        rtol=1e-10, atol=1e-12, max_step=0.2,
    )  # fmt: skip
    leave, land = run.t_events[0][-1], run.t_events[1][0]
    return 3.546 * (np.sin(0.01 * leave) - np.sin(0.01 * land))


def stick_slip():
    """Period at u = 0.3: a slip from x = 0.4 by SciPy, and the way back at the belt's speed."""

    def rates(t, s):
        slip = (s[1] - 0.3) / 0.5
        return s[1], -s[0] + 0.4 + 0.075 * (3 * slip - slip**3)

    def caught(t, s):
        return s[1] - 0.3 if t > 1 else -1.0

    caught.terminal = True
    run = solve_ivp(rates, (0, 20), [0.4, 0.3], "DOP853", events=caught, rtol=1e-12, atol=1e-13)
    return run.t[-1] + (0.4 - run.y[0, -1]) / 0.3


def beat():
    """ε times the period of McKean's cell as ε goes to zero, by quadrature along both sheets."""
    a, b, gamma = 0.25, -0.35, 0.5
    low, high = -a / 2, (1 - a) / 2
    silent = quad(lambda w: -1 / (-w + b - gamma * w), low, high)[0]
    return silent + quad(lambda w: 1 / (1 - w + b - gamma * w), low, high)[0]


def hot_state():
    """Where the tank's Jacobian has no trace at p2 = 14, p3 = 2: u1, u2, p1."""

    def conditions(z):
        u1, u2, p1 = z
        rate, heat = p1 * (1 - u1) * np.exp(u2), p1 * np.exp(u2)
        return -u1 + rate, -3 * u2 + 14 * rate, -1 - heat - 3 + 14 * rate

    return fsolve(conditions, [0.9, 4.2, 0.13], xtol=1e-14)


FOLD = (0.25 + np.sqrt(0.25**2 + 1.8)) / 3

#: Expressions in a notebook's own names, their values from elsewhere, and the digits they share.
KNOWN = {
    "gear": {
        "folded.folds[1]['x']": (FOLD, 1e-13),
        "folded.bistable()[0, 1]": (-(FOLD**2 - 0.6) * (FOLD - 0.25), 1e-12),
        "len(run.crossings)": (41, 0),
        "overlay.transitions[0].width": (transit, 1e-7),
        "gap.exponent": (0.5, 3e-3),
        # the first zero of the Airy function, over the cube root of the curvature
        "late.coefficients[0]": (2.338107410459767 / (3 * FOLD - 0.25) ** (1 / 3), 1e-4),
        "jumps.transitions[0].delay / jumps.transitions[0].predicted": (1, 0.03),
    },
    "branches": {
        "diagram.bistable()[0, 1]": (-(FOLD**2 - 0.6) * (FOLD - 0.25), 1e-12),
        "diagram.folds[1].coefficient": (0.25 - 3 * FOLD, 1e-12),
        "meets['A']": (-1 / 16, 1e-13),
        "cusp['A']": (1 / 48, 1e-11),
        "tip.coefficient": (-1, 1e-10),
        "bt['p_1']": (np.exp(-1.5) / 2, 1e-13),
        "bt['p_2']": (13.5, 1e-13),
        "cp['p_1']": (np.exp(-2), 1e-13),
        "hopf['p_1']": (lambda: hot_state()[2], 1e-11),
        "hopf['u_2']": (lambda: hot_state()[1], 1e-11),
    },
    "own_model": {
        "hopf['u']": (0.5, 1e-13),
        "exit_point.value": ((np.sqrt(3 - 3 * 0.49) - 0.7) / 2, 1e-8),
        "releases[-1].time - releases[-2].time": (stick_slip, 1e-9),
        "sticks": (np.sqrt(0.8) / 2, 0.009),
        "swept.at(u=0.48).max()": (2 * np.sqrt(0.25 - 0.48**2), 0.02),
        "measured_period(2e-5)": (beat, 3e-4),
        "slow_period(0.25, -0.35, 0.5)": (beat, 1e-13),
        "knee['w']": (-0.125, 1e-13),
        "np.abs(late.delay / late.eps / exact - 1).max() + 1": (1, 1e-7),
        "hysteresis.bistable()[0, 1]": (0.75, 1e-13),
    },
}


@pytest.fixture(scope="module", params=NOTEBOOKS)
def both(request, kernel):
    """A notebook as stored and as run now, and the numbers asked of it."""
    name = request.param
    asked = f"{{text: float(eval(text)) for text in {list(KNOWN[name])!r}}}"
    fresh = executed(kernel, name, [f"import json\nprint(json.dumps({asked}))"])
    numbers = json.loads(fresh.cells.pop().outputs[0].text)
    return name, nbformat.read(NOTEBOOKS[name], as_version=4), fresh, numbers


def test_there_are_three():
    assert set(NOTEBOOKS) == set(KNOWN)


@pytest.mark.sample(1)
def test_what_is_stored_is_what_it_gives(both):
    _, stored, fresh, _ = both
    old, new = texts(stored), texts(fresh)
    assert [entry[:2] for entry in old] == [entry[:2] for entry in new]
    for (cell, kind, before), (_, _, now) in zip(old, new, strict=True):
        assert alike(before, now), f"{cell}, {kind}: stored\n{before}\nnow\n{now}"
    assert figures(stored) == figures(fresh)


@pytest.mark.sample(1)
def test_the_numbers_are_those_found_elsewhere(both):
    name, _, _, numbers = both
    for text, (value, digits) in KNOWN[name].items():
        expected = value() if callable(value) else value
        assert numbers[text] == pytest.approx(expected, rel=digits, abs=0), text


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_stored_notebook_is_clean(name):
    path = NOTEBOOKS[name]
    stored = nbformat.read(path, as_version=4)
    nbformat.validate(stored)
    assert path.stat().st_size <= 500_000
    assert set(stored.metadata) == {"kernelspec"}
    assert stored.metadata.kernelspec.name == "python3"
    assert all(not cell.metadata for cell in stored.cells)
    assert [c.id for c in stored.cells] == [
        f"{name.replace('_', '-')}-{k + 1:02d}" for k in range(len(stored.cells))
    ]
    assert len(figures(stored)) >= 3
    assert "## Try this" in stored.cells[-1].source
    for cell, kind, text in texts(stored):
        assert kind != "stderr", cell
        assert not re.search(r"(?<![\w.\d])/\w+/\w+|[A-Z]:\\|0x[0-9a-f]{6}", _words(text)), cell


def _words(text):
    """Without the ends of HTML tags, and LaTeX's fractions."""
    return re.sub(r"</\w+>", "", text)


def test_texts_that_differ_are_told_apart():
    assert alike("x = 0.123456, v = -0.0", "x = 0.1234561, v = 0.0")
    assert not alike("x = 0.1234", "x = 0.1235")
    assert not alike("x = 1", "v = 1")
    assert not alike("1 and 2", "1 and")


if __name__ == "__main__":
    with Kernel() as started:
        for name, path in NOTEBOOKS.items():
            nbformat.write(executed(started, name), path)
