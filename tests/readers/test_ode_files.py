"""Files of XPPAUT: what their lines mean, what is refused, and where."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.readers.xpp_reference import Reference

pytestmark = pytest.mark.slow

#: Everything of the manual that describes ODEs, in one model.
WHOLE = """# Morris-Lecar, twice, coupled
par iapp=.08, phi=.333,VK=-.7 vl=-.5
number gl=.5
!gsum=gl+2*gk
p gk=2
minf(v)=.5*(1+tanh((v-.01)/vb))
par vb=.145
ntot = n1 + n2
%[1..2]
v[j]' = iapp + gl*(vl-V[j]) + \\
  gk*w[j]*(vk-v[j]) + minf(v[j])*(1-v[j]) + if(t>5)then(stim(t))else(0)
dw[j]/dt = phi*(.5*(1+tanh((v[j]-.1)/.15))-w[j])*cosh((v[j]-.1)/.3)
init v[j]=0.0[j]
%
n[1..2]' = sum(0,1)of(shift(n1,i'))*.1 - n[j]^2 + heav(t-3)*flr(1.5) + mod(7,4)*(w1>.2)*.01
n1(0)=gsum/2
table stim % 11 0 10 .01*sin(t)
aux P.E.=ntot*2
" {iapp=.2,v1=.1} more current
set rest {iapp=0,v1=-.5,total=7}
bdry v1-v2'
@ total=12, xp=v1,yp=w1, xp2=t,yp2=n1
done
this line is not read
"""


def test_rates_are_those_of_an_independent_reading():
    file, reference = fs.read_ode(WHOLE), Reference(WHOLE)
    model = file.model
    assert [n.lower() for n in model.states] == reference.names
    assert list(file.initial.values()) == pytest.approx(reference.start, abs=1e-15)
    generator = np.random.default_rng(3)
    for t in (0.3, 4.2, 9.1):
        state = generator.uniform(0.05, 0.4, len(model.states))
        at = {real("t"): t, **dict(zip(map(real, model.states), state, strict=True))}
        at |= {real(n): v for n, v in model.parameters.items()}
        at |= {real(n): law.args[0].table(t) for n, law in model.forcing.items()}
        found = [float(rate.subs(at)) for rate in model.rates.values()]
        assert found == pytest.approx(reference.rates(t, list(state)), rel=1e-13)


def real(name):
    return sp.Symbol(name, real=True)


def test_a_parameter_that_no_formula_can_contain_is_dropped():
    file = fs.read_ode("x'=-x\nparam x(0)=-70, k=2\ndone")
    assert (dict(file.model.parameters), file.initial["x"]) == ({"k": 2.0}, 0.0)
    (note,) = (note for note in file.notes if "dropped" in note)
    assert note.startswith("line 2, column 7: 'x(0)' is a parameter that no formula can contain")


def test_everything_else_of_a_file():
    file = fs.read_ode(WHOLE)
    assert file.t == (0.0, 12.0)
    assert file.plots == (("v1", "w1"), ("t", "n1"))
    assert file.renamed == {"P.E.": "P_E_"}
    assert str(file.auxiliary["P_E_"]) == "2*n1 + 2*n2"
    assert file.initial["v1"] == 0.01
    assert file.initial["n1"] == 2.25
    rest = file.with_set("rest")
    assert (rest.model.parameters["iapp"], rest.initial["v1"], rest.t) == (0.0, -0.5, (0.0, 7.0))
    assert file.with_set("more current").model.parameters["iapp"] == 0.2
    assert file.comments == ("Morris-Lecar, twice, coupled",)
    assert any("the boundary condition" in note for note in file.notes)
    assert any("initial value of n1 is that of the parameter" in note for note in file.notes)
    assert "with 7 parameters" in file.summary()
    with pytest.raises(fs.UnknownNameError, match="unknown set 'rst'; did you mean 'rest'"):
        file.with_set("rst")


def rate(text, *more):
    """The rate of the only state of a file with one line of rates."""
    return fs.read_ode("\n".join([f"x'={text}", "par a=2,b=3", *more, "done"])).model.rates["x"]


X, A, B, T = (real(n) for n in "xabt")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-x^2", -(X**2)),
        ("2^3^2*x", 64 * X),
        ("a*(X+B)/2", A * (X + B) / 2),
        ("ln(a*x)+log10(x)", sp.log(A * X) + sp.log(X) / sp.log(10)),
        ("min(a,max(b,x))", sp.Min(A, sp.Max(B, X))),
        ("exp(-1000*(t-25))*x", sp.exp(25000 - 1000 * T) * X),
        ("sum(1,3)of(i'*x)", 6 * X),
        ("besselj(0,t)*x", sp.besselj(0, T) * X),
    ],
)
def test_formulas(text, expected):
    found = rate(text)
    at = {X: 0.7, A: 2, B: 3, T: 25.0}
    assert float(found.subs(at)) == pytest.approx(float(expected.subs(at)), rel=1e-14)


@pytest.mark.parametrize(
    ("text", "at", "expected"),
    [
        ("(x>a)*5", 2.5, 5),
        ("(x>a)*5", 1.5, 0),
        ("x>a+1", 2.5, 2),  # (x>a)+1
        ("(x>a|x<0)&not(b==4)", -1, 1),
        ("heav(x-a)*2+sign(x)", 3, 3),
        ("if(x<1)then(4)else(if(x<2)then(5)else(6))", 1.5, 5),
    ],
)
def test_conditions_are_numbers(text, at, expected):
    assert float(rate(text).subs({X: at, A: 2, B: 3})) == expected


def test_a_comparison_that_binds_more_tightly_is_noted():
    (note,) = fs.read_ode("x'=if(x>a+1)then(1)else(0)\npar a=1").notes
    assert note == "line 1, column 4: x > a comes before + 1: XPPAUT compares first"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x'=-a*x", "line 1, column 5: rate of x: 'a' has no definition"),
        ("par amp=1\nx'=-apm*x", "line 2, column 5: .*'apm' has no definition; did you mean amp"),
        ("x'=2*(x-1", r"line 1, column 10: rate of x: the formula ends after '1', where '\)'"),
        ("x'=1\ny'=\\\n x+*2", r"line 3, column 4: rate of y: cannot read '\*' after '\+'"),
        ("x'=a*-2\npar a=1", "rate of x: cannot read '-'"),
        ("x'=foo(x)", "foo is no function; a product is written *"),
        ("f(x,y)=x+y\nz'=f(z)", "f takes 2 arguments, received 1"),
        ("x'=sin(x,1)", "column 4: rate of x: sin takes 1 argument, received 2"),
        ("x'=b\nb=c\nc=b", "b is defined by itself: b → c → b"),
        ("f(y)=f(y)+1\nx'=f(x)", "f is defined by itself"),
        ("x'=1\nx'=2", "x is already a state, line 1"),
        ("x'=1\npar x=2", "x is already a state"),
        ("x'=1\ninit y=2", "an initial value of y, which is no state"),
        ("x'=sin\npar sin=1", "sin is a word of XPPAUT"),
        ("x[1..3]'=-x[j]+[k]", r"cannot read '\['"),
        ("x[1..99999]'=1", "an array of 99999 elements"),
        ("%[1..3]\nx[j]'=1", "the block of this array has no end"),
        ("x'=1\nglobal 1 x-1 {x=0", "expected an event such as global"),
        ("x'=1\nset a {b=1", "expected a set of values"),
        ("x'=1\n#include other.ode", "the text includes the file 'other.ode'; read it by fs.read"),
        (
            "x'=f(t)\ntable f data.tab",
            "table f is in the file 'data.tab'; read the text by fs.read",
        ),
        ("x'=__import__('os')", """rate of x: cannot read "'" after"""),
        ("x'=x.__class__", "has no definition"),
        ("x'=" + "(" * 500, "nested more than 64 levels deep"),
        ("x'=" + "+".join("x" * 30_000), "characters; expected at most 20000"),
        ("x'=x^1e9", "the exponent 1e9 is larger than 64"),
        ("2\nx'=1", "a file of the old style"),
        ("hello world", "no rate such as x'=… was found"),
        ("", "no rate such as x'=… was found"),
        ("x(t+1)=2*x", "line 1, column 1: a map"),
        ("x'=1\n@ meth=discrete", "a map"),
        ("x'=y\n0=y-x\nsolv y=1", "line 2, column 1: an algebraic equation"),
        ("x(t)=int{exp(-t)#x}", "a Volterra integral equation"),
        ("x'=int{exp(-t)#x}", "contains an integral"),
        ("markov z 2\n{0} {1}\n{1} {0}", "a Markov process"),
        ("x'=-delay(x,2)", r'a delay, which is refused; read the file without it by without=\["d'),
        ("wiener w\nx'=w", r'a Wiener process, which is refused; .*without=\["noise"\]'),
        ("special k=conv(even,3,1,w,x)\nx'=k(0)", r'without=\["special"\]'),
        ("export {x} {y}\nx'=1", r'without=\["export"\]'),
        (
            "x'=-x+1\nglobal 1 1+0*x {a=a+1}\npar a=0",
            r"the condition 1\+0\*x does not change its sign",
        ),
        ("x'=floor_of\nfloor_of=flr(x)", "line 1, column 4: rate of x: .*jumps at infinitely many"),
    ],
)
def test_refused(text, message):
    with pytest.raises(fs.ModelError, match=message):
        fs.read_ode(text)


def test_left_out_on_request():
    noisy = "wiener w\nx'=-delay(x,1)+w+normal(2,1)\ndone"
    file = fs.read_ode(noisy, without=["noise", "delays"])
    assert str(file.model.rates["x"]) == "2 - x"
    assert sum("left out" in note for note in file.notes) == 3
    with pytest.raises(fs.UnknownNameError, match="unknown kind to leave out 'nose'"):
        fs.read_ode(noisy, without=["nose"])


def test_a_quantity_used_before_its_line_is_read_as_meant():
    file = fs.read_ode("a=b+1\nb=2*x\nx'=-a")
    assert str(file.model.rates["x"]) == "-2*x - 1"
    assert "a uses b, which is defined later" in file.notes[0]


def test_numbers_are_those_that_xppaut_reads():
    file = fs.read_ode("x'=k\npar k=1/3, c=0.5;\ninit x=y0")
    assert (file.model.parameters["k"], file.initial["x"]) == (1.0, 0.0)
    assert sum("XPPAUT reads" in note for note in file.notes) == 3


def test_names_that_cannot_be_kept_are_listed():
    file = fs.read_ode("5HT'=-lambda*5HT+or\npar lambda=1,or=2")
    assert file.model.states == ("_5HT",)
    assert dict(file.renamed) == {"5HT": "_5HT", "or": "or_"}


def test_events_become_resets_events_and_stops():
    file = fs.read_ode(
        "v'=i-v\nn'=0\npar i=2,vth=1\n"
        "global 1 v-vth {v=0;n=n+1}\nglobal 1 t-5 {i=i+1}\nglobal 1 t-8 {i=0}\n"
        "global 1 n-3 {arret=1}\n@ total=10"
    )
    (reset,) = file.model.resets.values()
    assert dict(reset.jump) == {"v": 0, "n": real("n") + 1}
    assert [str(event) for event in file.model.events.values()] == [
        "when t - 5 > 0: i → i + 1; with values as of the execution",
        "when t - 8 > 0: i → 0",
    ]
    assert file.model.assigned == ("i",)
    assert file.stops == ("n - 3 > 0",)
    run = fs.simulate(file.model, file.initial, t=(0, 2))
    # from 0 to 1 towards 2 takes ln 2
    assert run["n"][-1] == 2
    assert run["v"][-1] == pytest.approx(2 - 2 * np.exp(2 * np.log(2) - 2), rel=1e-12)
    whole = fs.simulate(file.model, file.initial, t=(0, 10))
    assert [whole(t)[2] for t in (4, 6, 9)] == [2, 3, 0]


def test_an_event_of_parameters_in_the_middle_of_the_motion():
    # the hysteresis of a thermostat; XPPAUT assigns states in order, and parameters at the end
    file = fs.read_ode(
        "x'=k-x\nn'=0\npar k=2,m=0\n"
        "global 1 x-1 {k=-2;m=k;n=n+1}\nglobal -1 x+1 {k=2;m=k;n=n+1;x=x}\n"
        "global 0 x {m=n}\n@ total=10"
    )
    names = ["x - 1 > 0", "x + 1 < 0", "x > 0", "x < 0"]
    assert [*file.model.events] == names
    assert any("the sign 0 is read as either direction" in note for note in file.notes)
    assert file.model.events[names[0]].then["m"] == real("k")
    run = fs.simulate(file.model, {"x": 0.5, "n": 0}, t=(0, 10))
    turns = [one.time for name in names[:2] for one in run.events(name)]
    first = np.log(1.5)
    np.testing.assert_allclose(
        np.sort(turns), first + np.log(3) * np.arange(len(turns)), rtol=1e-12
    )
    assert run.final_state["n"] == len(turns)


def test_events_are_exported_and_read_as_the_same_model():
    v, u, c = map(real, ("v", "u", "c"))
    model = fs.Model(
        {v: v**2 - u + 1, u: v - u},
        parameters={c: -1},
        events={"spike": fs.Event(v > 3 + u, {c: c - u, u: u + v, v: c}), u < -2: {u: 0}},
    )
    written = fs.export(model, "xpp")["S1.ode"]
    assert fs.read_ode(written).model == model
    # in the order of their dependence
    assert "{c=c - u;u=u + v;v=c}" in written
    late = fs.Model({v: 1}, events={"late": fs.Event(v > 1, {v: 0}, delay=1)})
    with pytest.raises(fs.ModelError, match="event late: export to xpp cannot write a delay"):
        fs.export(late, "xpp")


def test_assignments_in_order_are_rewritten_to_all_at_once():
    file = fs.read_ode("x'=1\ny'=1\nglobal 1 x-1 {x=-1;y=x+y}")
    (reset,) = file.model.resets.values()
    assert dict(reset.jump) == {"x": -1, "y": real("y") - 1}


def test_an_impact_is_a_wall_and_a_passage_is_none():
    impact = "x'=v\nv'=-1\ninit x=1\nglobal -1 x {v=-r*v}\npar r=.9"
    assert len(fs.read_ode(impact).model.resets) == 1
    passage = fs.read_ode(impact.replace("-r*v", "r*v")).model
    assert (len(passage.resets), [*passage.events]) == (0, ["x < 0"])
    assert len(fs.read_ode(impact, without=["global"]).model.resets) == 0


def test_files_with_tables_includes_and_sets(tmp_path):
    (tmp_path / "pulse.tab").write_text("3\n0\n2\n0\n1\n5\n")
    (tmp_path / "rest.inc").write_text("par k=1\ny'=-y\n#done\nnot read\n")
    path = tmp_path / "one.ode"
    path.write_text("x'=pulse(t)-k*x\n#include rest.inc\ntable pulse pulse.tab\n@ total=4\ndone\n")
    file = fs.read(path)
    assert file.model.states == ("x", "y")
    # the lines of a table are continued
    assert file.model.forcing["pulse_of_t"].args[0].table([0.5, 1.5, 4.0]) == pytest.approx(
        [0.5, 3, 13]
    )
    saved = tmp_path / "one.ode.set"
    saved.write_text(
        "## Set file for one.ode on Monday\n2   Number of equations\n# Numerical stuff\n"
        "7  total\n# Old ICs\n0.5  X\n1.5  Y\n# Ending  ICs\n9  X\n# Parameters\n3  k\n# Graphics\n"
    )
    later = fs.read(saved)
    assert (later.initial["x"], later.initial["y"], later.model.parameters["k"], later.t[1]) == (
        0.5, 1.5, 3.0, 7.0,
    )  # fmt: skip
    saved.write_text("## Set file for one.ode on Monday\n# Old ICs\n0.5  X\n")
    with pytest.raises(fs.FileError, match="cut short: it has no value of y"):
        fs.read(saved)
    path.write_text("#include one.ode\nx'=1")
    with pytest.raises(fs.ModelError, match="include each other more than 20 times"):
        fs.read(path)


def test_encodings_sizes_and_other_files(tmp_path):
    path = tmp_path / "one.ode"
    path.write_bytes("# for µ\nx'=-x\n".encode("latin-1"))
    assert "was read as Latin-1" in fs.read(path).notes[0]
    path.write_bytes("x'=-x\n".encode("utf-16"))
    assert fs.read(path).model.states == ("x",)
    path.write_bytes(b"x'=-x\r\npar a=1\r\n\x00")
    with pytest.raises(fs.FileError, match="is not a text file"):
        fs.read(path)
    with path.open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(fs.FileError, match="it has 100000000 bytes; expected at most 8000000"):
        fs.read(path)
    (tmp_path / "b.fhn").write_text("0")
    with pytest.raises(fs.FileError, match=r"read by fs\.read_auto"):
        fs.read(tmp_path / "b.fhn")
    with pytest.raises(fs.FileError, match="No such file"):
        fs.read(tmp_path / "none.ode")


def test_a_run_agrees_with_lsoda():
    from tests.campaigns.suites import solution

    text = "v'=v*(1-v)*(v-a)-w+i*heav(t-20)\nw'=eps*(v-w)\npar a=.1,i=.2,eps=.02\n@ total=100"
    file, times = fs.read_ode(text), np.linspace(0, 100, 51)
    expected = solution(Reference(text), times, 1e-12)
    run = fs.simulate(file.model, file.initial, t=file.t, samples=times)
    assert np.abs(run["v"] - expected[0]).max() < 1e-8
