"""SBML files of our own writing against closed forms; the test suite of SBML is a campaign."""

import math

import pytest

import fastslow as fs

pytest.importorskip("libsbml", reason="libSBML is an extra")

pytestmark = pytest.mark.slow

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<sbml xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1">
<model id="m">
<listOfCompartments>
<compartment id="c" size="2" constant="true"/>{compartments}
</listOfCompartments>
<listOfSpecies>
<species id="A" compartment="{where}" initialAmount="4" hasOnlySubstanceUnits="false"
 boundaryCondition="false" constant="false"/>
<species id="B" compartment="{where}" initialConcentration="0" hasOnlySubstanceUnits="false"
 boundaryCondition="false" constant="false"/>
</listOfSpecies>
<listOfParameters>
<parameter id="k" value="0.5" constant="true"/>
<parameter id="n" value="0" constant="false"/>
<parameter id="total" constant="false"/>
</listOfParameters>
{before}
<listOfReactions>
<reaction id="r" reversible="false" fast="{fast}">
<listOfReactants><speciesReference species="A" stoichiometry="1" constant="true"/></listOfReactants>
<listOfProducts><speciesReference species="B" stoichiometry="2" constant="true"/></listOfProducts>
<kineticLaw>{law}</kineticLaw>
</reaction>
</listOfReactions>
{after}
</model>
</sbml>
"""
MATH = '<math xmlns="http://www.w3.org/1998/Math/MathML">{}</math>'
LAW = MATH.format("<apply><times/><ci>{where}</ci><ci>k</ci><ci>A</ci></apply>")
SUM = MATH.format("<apply><plus/><ci>A</ci><ci>B</ci></apply>")
TOTAL = f'<listOfRules><assignmentRule variable="total">{SUM}</assignmentRule></listOfRules>'
EVENT = f"""<listOfEvents><event id="refill" useValuesFromTriggerTime="true">
<trigger initialValue="true" persistent="true">
{MATH.format("<apply><lt/><ci>A</ci><cn>1</cn></apply>")}</trigger>
<delay>{MATH.format("<cn>0.25</cn>")}</delay>
<listOfEventAssignments>
<eventAssignment variable="A">{MATH.format("<cn>3</cn>")}</eventAssignment>
<eventAssignment variable="n">{MATH.format("<apply><plus/><ci>n</ci><cn>1</cn></apply>")}
</eventAssignment></listOfEventAssignments></event></listOfEvents>"""


def read(folder, **given):
    values = {"where": "c", "compartments": "", "before": TOTAL, "after": "", "fast": "false"}
    values |= given
    values["law"] = values.get("law", LAW).format(where=values["where"])
    path = folder / "model.xml"
    path.write_text(HEAD.format(**values))
    return fs.read(path)


def test_reactions_and_assignment_rules(tmp_path):
    file = read(tmp_path)
    assert file.model.states == ("A", "B")
    assert dict(file.initial) == {"A": 2, "B": 0}
    assert str(file.auxiliary["total"]) == "A + B"
    assert str(file.auxiliary["amount of A"]) == "A*c"
    run = fs.simulate(file.model, file.initial, t=(0, 3), integration=fs.Integration(rtol=1e-12))
    decay = math.exp(-1.5)
    assert run(3).tolist() == pytest.approx([2 * decay, 4 * (1 - decay)], rel=1e-11)


def test_units_and_names_are_kept(tmp_path):
    unit = """<listOfUnitDefinitions><unitDefinition id="per_minute"><listOfUnits>
    <unit kind="second" exponent="-1" scale="0" multiplier="60"/></listOfUnits></unitDefinition>
    </listOfUnitDefinitions><listOfCompartments>"""
    path = tmp_path / "model.xml"
    read(tmp_path)
    text = path.read_text().replace("<listOfCompartments>", unit, 1)
    text = text.replace('<model id="m">', '<model id="m" timeUnits="second" substanceUnits="mole">')
    text = text.replace('id="c" size="2"', 'id="c" name="the cell" size="2" units="litre"')
    path.write_text(text.replace('<parameter id="k"', '<parameter id="k" units="per_minute"'))
    file = fs.read(path)
    assert dict(file.labels) == {"c": "the cell"}
    concentration = dict.fromkeys(("A", "B"), "mole litre^-1")
    expected = {"t": "second", "c": "litre", "k": "(60 second)^-1", **concentration}
    assert dict(file.units) == expected
    assert "the cell" in repr(file)


def test_events_with_a_delay(tmp_path):
    file = read(tmp_path, after=EVENT)
    run = fs.simulate(file.model, file.initial, t=(0, 3), integration=fs.Integration(rtol=1e-12))
    # A = 2 exp(-t/2) falls below 1 at t = 2 ln 2
    assert [one.time for one in run.events] == pytest.approx([2 * math.log(2) + 0.25], rel=1e-11)
    assert run.final_state["n"] == 1
    assert run(3)[0] == pytest.approx(3 * math.exp(-(2.75 - 2 * math.log(2)) / 2), rel=1e-11)


def test_species_in_a_compartment_that_grows(tmp_path):
    grows = '<compartment id="d" size="1" constant="false"/>'
    rule = MATH.format("<apply><times/><cn>0.1</cn><ci>d</ci></apply>")
    rules = f'<listOfRules><rateRule variable="d">{rule}</rateRule></listOfRules>'
    file = read(tmp_path, where="d", compartments=grows, before=rules)
    # the states are amounts, and so is the rate of the reaction d k A
    assert dict(file.initial) == {"d": 1, "A": 4, "B": 0}
    assert str(file.auxiliary["concentration of A"]) == "A/d"
    run = fs.simulate(file.model, file.initial, t=(0, 3), integration=fs.Integration(rtol=1e-12))
    assert run["A"][-1] == pytest.approx(4 * math.exp(-1.5), rel=1e-11)
    assert run["d"][-1] == pytest.approx(math.exp(0.3), rel=1e-11)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"fast": "true"}, "reaction r: expected one that is not fast"),
        (
            {"before": f"<listOfRules><algebraicRule>{SUM}</algebraicRule></listOfRules>"},
            "algebraicRule: expected assignment and rate rules",
        ),
        (
            {"law": MATH.format("<apply><ci>f</ci><ci>A</ci></apply>")},
            "functionDefinition f: expected one with a formula",
        ),
        (
            {"before": TOTAL.replace("<ci>A</ci>", "<ci>total</ci>")},
            "total: its value depends on itself",
        ),
    ],
)
def test_what_has_no_counterpart_is_refused(tmp_path, given, message):
    with pytest.raises(fs.ModelError, match=message):
        read(tmp_path, **given)


def test_files_that_are_no_models(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text("<sbml><model>")
    with pytest.raises(fs.FileError, match=r"model\.xml"):
        fs.read_sbml(path)
    path.write_text('<?xml version="1.0"?><html/>')
    with pytest.raises(fs.FileError, match=r"model\.xml"):
        fs.read_sbml(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(fs.FileError, match="cannot be read"):
        fs.read_sbml(path)


def test_a_rate_rule_is_that_of_a_concentration_in_a_compartment_that_grows(tmp_path):
    """S' = 0.4 in a growing compartment; 0.1 after t = 0.45, S = its value at 0.45, plus 0.2."""
    plus = MATH.format("<apply><plus/><ci>S</ci><cn>0.2</cn></apply>")
    time = "http://www.sbml.org/sbml/symbols/time"
    time = f'<csymbol encoding="text" definitionURL="{time}">time</csymbol>'
    trigger = MATH.format(f"<apply><geq/>{time}<cn>0.45</cn></apply>")
    path = tmp_path / "model.xml"
    path.write_text(f"""<?xml version="1.0" encoding="UTF-8"?>
<sbml xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1"><model id="m">
<listOfCompartments><compartment id="C" size="0.5" constant="false"/></listOfCompartments>
<listOfSpecies><species id="S" compartment="C" initialConcentration="0" boundaryCondition="true"
 hasOnlySubstanceUnits="false" constant="false"/></listOfSpecies>
<listOfRules><rateRule variable="S">{MATH.format("<cn>0.4</cn>")}</rateRule>
<rateRule variable="C">{MATH.format("<cn>0.2</cn>")}</rateRule></listOfRules>
<listOfEvents><event id="E" useValuesFromTriggerTime="true">
<trigger initialValue="true" persistent="true">{trigger}</trigger>
<delay>{MATH.format("<cn>0.1</cn>")}</delay><listOfEventAssignments>
<eventAssignment variable="S">{plus}</eventAssignment></listOfEventAssignments></event>
</listOfEvents></model></sbml>""")
    file = fs.read_sbml(path)
    run = fs.simulate(file.model, file.initial, t=(0, 1))
    # libSBML drops an event whose trigger it cannot read
    path.write_text(path.read_text().replace(">time</csymbol>", "/>"))
    with pytest.raises(fs.FileError, match=r"no SBML: line 9, .* floating-point number in MathML"):
        fs.read_sbml(path)
    assert run(1.0)[file.model.states.index("S")] == pytest.approx(0.18 + 0.2 + 0.4 * 0.45)
    assert str(file.auxiliary["amount of S"]) == "C*S"


def test_a_relaxation_oscillator_goes_from_its_file_to_the_overlay_in_three_lines(tmp_path):
    def rule(variable, formula):
        import libsbml

        math = libsbml.writeMathMLToString(libsbml.parseL3Formula(formula))
        return f'<rateRule variable="{variable}">{math.partition("?>")[2]}</rateRule>'

    path = tmp_path / "oscillator.xml"
    path.write_text(f"""<?xml version="1.0" encoding="UTF-8"?>
<sbml xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1"><model id="m">
<listOfParameters><parameter id="x" value="2" constant="false"/>
<parameter id="z" value="0" constant="false"/></listOfParameters>
<listOfRules>{rule("x", "x - x^3/3 - z")}{rule("z", "x/100")}</listOfRules></model></sbml>""")
    file = fs.read(path)
    found = fs.analyse(file, t=(0, 300))
    assert found.plot().lines
    assert str(found.overlay.bursting) == "relaxation oscillation (symmetric fold/fold)"
