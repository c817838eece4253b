"""Exported quotients with a removable singularity, at the singular point and far from it."""

import re
import shutil
import subprocess

import numpy as np
import pytest
import sympy as sp

from fastslow.exporters.formats import export
from fastslow.model.model import Model
from fastslow.quotients import QUOTIENTS

x, y, p = sp.symbols("x y p", real=True)
DISTANCES = (0.0, 1e-300, 1e-9, 0.19, 0.21, 0.501, 0.525, 0.99, 1.01, 1.99, 2.01, 30.0, 700.0)
POINTS = [sign * d for d in DISTANCES for sign in (1, -1)]
WRITTEN = {
    "exp_quotient": (x + p) / (sp.exp(x + p) - 1),
    "sinh_quotient": sp.sinh(x + p) / (x + p),
    "sin_quotient": sp.sin(x + p) / (x + p),
    "log_quotient": sp.log(1 + x + p) / (x + p),
}

#: Relative error of values, and of slopes. At 1.21 the slope of log(y)/(y − 1) is the difference of
#: two terms that are eleven times larger, each with three roundings.
ACCURATE = dict.fromkeys(WRITTEN, (2e-15, 2e-15)) | {"log_quotient": (2e-15, 8e-15)}


def expected(name, order):
    shift = 1 if name == "log_quotient" else 0
    return [(d, QUOTIENTS[name](d + shift, order)) for d in POINTS if not shift or d > -1]


def model_of(name):
    return Model({x: WRITTEN[name]}, parameters={p: 0})


@pytest.mark.parametrize("name", WRITTEN)
def test_numpy(name):
    space = {}
    exec(export(model_of(name), "numpy")["S1.py"], space)
    with np.errstate(all="raise", under="ignore"):
        for function, order in (("rates", 0), ("jacobian", 1)):
            for distance, value in expected(name, order):
                found = np.ravel(space[function](0.0, np.array([distance])))[0]
                rel = ACCURATE[name][order]
                assert found == pytest.approx(value, rel=rel, abs=4e-16), (distance, order)


@pytest.mark.parametrize("name", WRITTEN)
def test_xpp(name):
    text = export(model_of(name), "xpp")["S1.ode"]
    (call,) = re.findall(r"(\w+)\(y\)=", text)
    (body,) = re.findall(rf"{call}\(y\)=(.*)", text)
    assert len(call) <= 9
    assert f"x'={call}(" in text
    for old, new in (("if(", "IF(("), (")then(", "),("), (")else(", "),("), ("^", "**")):
        body = body.replace(old, new)
    body += ")" * body.count("IF(")
    functions = {n: getattr(np, n) for n in ("exp", "sin", "sinh", "abs", "log")}
    functions |= {"IF": np.where, "ln": np.log}
    for distance, value in expected(name, 0):
        with np.errstate(all="ignore"):
            argument = np.float64(distance) + (name == "log_quotient")
            found = eval(body, {**functions, "y": argument})
        assert found == pytest.approx(value, rel=4e-15, abs=4e-16), distance


DRIVER = """
PROGRAM TEST
  DOUBLE PRECISION :: U(1), PAR(36), F(1), DFDU(1,1), DFDP(1,36)
  INTEGER :: ICP(1), IOS
  PAR = 0
  DO
    READ (*, *, IOSTAT=IOS) U(1)
    IF (IOS /= 0) EXIT
    CALL FUNC(1, U, ICP, PAR, 2, F, DFDU, DFDP)
    PRINT *, F(1), DFDU(1,1), DFDP(1,1)
  END DO
END PROGRAM TEST
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gfortran") is None, reason="gfortran is not installed")
@pytest.mark.parametrize("name", ["exp_quotient", "log_quotient"])
def test_auto(name, tmp_path):
    export(model_of(name), "auto", tmp_path)
    (tmp_path / "driver.f90").write_text(DRIVER)
    command = ["gfortran", "-Wall", "S1.f90", "driver.f90", "-o", "driver"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=60)
    lines = "\n".join(repr(d) for d, _ in expected(name, 0))
    done = subprocess.run(
        [tmp_path / "driver"], input=lines, capture_output=True, text=True, check=True, timeout=60
    )
    found = [[float(word) for word in line.split()] for line in done.stdout.splitlines()]
    for row, (d, value), (_, slope) in zip(
        found, expected(name, 0), expected(name, 1), strict=True
    ):
        rel = ACCURATE[name][1]
        assert row == pytest.approx([value, slope, slope], rel=rel, abs=4e-16), d


def test_names_of_the_functions_are_not_those_of_symbols():
    name = sp.Symbol("expq0", real=True)
    rate = x / (sp.exp(x) - 1) - name
    space = {}
    exec(export(Model({x: rate}, parameters={name: 1}), "numpy")["S1.py"], space)
    assert space["rates"](0.0, [0.0]) == pytest.approx([0.0])
    text = export(Model({x: rate}, parameters={name: 1}), "xpp")["S1.ode"]
    assert re.search(r"^par expq0_2=1.0$", text, flags=re.M)
