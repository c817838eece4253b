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
