"""SBML files: models of reactions between species, with rules and events.

Elements are read by libSBML. The state of a species is the value that its name has in formulas, a
concentration or an amount; in a compartment whose size changes it is the amount.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import sympy as sp

from fastslow.arguments import path as path_of_file
from fastslow.arguments import validated
from fastslow.errors import FileError, MissingPackageError, ModelError
from fastslow.formulas.grammar import RESERVED
from fastslow.model.events import AT_EXECUTION, AT_TRIGGER, Event
from fastslow.model.model import Model
from fastslow.model.structure import TIME, real
from fastslow.readers.model_files import ModelFile
from fastslow.readers.sbml_formulas import RATE_OF, Formulas
from fastslow.results.base.named_mapping import NamedMapping

#: Packages that do not change the meaning of a model; the first are operations of Version 2.
WITHOUT_MEANING = ("l3v2extendedmath", "layout", "render", "groups")

#: Length of a run of a file, which gives none.
DEFAULT_SPAN = (0.0, 10.0)


@validated(path=path_of_file)
def read_sbml(path: str | os.PathLike[str]) -> ModelFile:
    """Read a model from an SBML file, of Level 2 or 3.

    Compartments, species, parameters, function definitions, initial assignments, assignment and
    rate rules, reactions with their kinetic laws and stoichiometries, conversion factors and events
    are read. Constraints are dropped with a note. libSBML, of the extra ``sbml``, is needed.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    ModelFile
        Quantities given by assignment rules, rates of reactions, and amounts and concentrations
        of species are ``auxiliary``.

    Raises
    ------
    FileError
        For a file that cannot be read or is no SBML.
    ModelError
        For algebraic rules, fast reactions, the function delay, and packages that are required,
        with the element and its id.
    MissingPackageError
        Without libSBML.

    See Also
    --------
    fastslow.read, fastslow.read_ode

    Examples
    --------
    >>> read_sbml("nothing.xml")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: nothing.xml cannot be read: No such file or directory
    """
    source = Path(path)
    try:
        written = source.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError(f"{source} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{source} cannot be read: {error.reason} at byte {error.start}") from error
    try:
        import libsbml
    except ImportError as error:
        raise MissingPackageError(
            "SBML files are read by libSBML; install it by pip install fastslow[sbml]"
        ) from error
    document = libsbml.readSBMLFromString(written)
    for k in range(document.getNumErrors()):
        fault = document.getError(k)
        if fault.getSeverity() >= libsbml.LIBSBML_SEV_ERROR:
            # libSBML leaves out what it cannot read
            raise FileError(
                f"{source} is no {'XML' if fault.isXML() else 'SBML'}: line {fault.getLine()}, "
                f"column {fault.getColumn()}: {fault.getShortMessage()}"
            )
    content = document.getModel()
    if content is None:
        raise FileError(f"{source} contains no SBML model")
    _refuse(document, content)
    return _SbmlModel(content).file()


def _refuse(document: Any, content: Any) -> None:
    """Raise for elements that have no counterpart."""
    for k in range(document.getNumPlugins()):
        package = document.getPlugin(k).getPackageName()
        if package not in WITHOUT_MEANING and document.getPackageRequired(package):
            raise ModelError(f"package {package}: expected SBML without packages that it requires")
    for rule in content.getListOfRules():
        if rule.isAlgebraic():
            raise ModelError("algebraicRule: expected assignment and rate rules")
    for reaction in content.getListOfReactions():
        if reaction.isSetFast() and reaction.getFast():
            raise ModelError(f"reaction {reaction.getId()}: expected one that is not fast")


@dataclass
class _SbmlModel:
    """A model of libSBML with what has been read of it.

    Expressions are raw as long as they contain the names of the file; `resolved` expressions
    contain states and parameters.
    """

    content: Any
    notes: list[str] = field(default_factory=list)
    renamed: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    values: dict[str, sp.Expr] = field(default_factory=dict)
    known_rates: dict[str, sp.Expr] = field(default_factory=dict)
    open: list[tuple[str, str]] = field(default_factory=list)

    @cached_property
    def formulas(self) -> Formulas:
        return Formulas(self.content, self.name_of)

    def name_of(self, given: str) -> str:
        """Name in the model: t is time, and Avogadro's number has no name."""
        if given != TIME.name:
            return given
        self.renamed[given] = f"{given}_"
        return f"{given}_"

    def symbol(self, given: str) -> sp.Symbol:
        return real(self.name_of(given))

    # elements by id

    @cached_property
    def species(self) -> dict[str, Any]:
        return {one.getId(): one for one in self.content.getListOfSpecies()}

    @cached_property
    def compartments(self) -> dict[str, Any]:
        return {one.getId(): one for one in self.content.getListOfCompartments()}

    @cached_property
    def reactions(self) -> dict[str, Any]:
        return {one.getId(): one for one in self.content.getListOfReactions()}

    @cached_property
    def references(self) -> dict[str, Any]:
        """Species references that have an id, which is the name of a stoichiometry."""
        return {
            one.getId(): one
            for reaction in self.reactions.values()
            for side in (reaction.getListOfReactants(), reaction.getListOfProducts())
            for one in side
            if one.isSetId()
        }

    def _rules(self, kind: str) -> dict[str, sp.Expr]:
        return {
            rule.getVariable(): self.formulas.number(rule.getMath())
            for rule in self.content.getListOfRules()
            if getattr(rule, kind)() and rule.isSetMath()
        }

    @cached_property
    def assigned(self) -> dict[str, sp.Expr]:
        return self._rules("isAssignment")

    @cached_property
    def rate_rules(self) -> dict[str, sp.Expr]:
        return self._rules("isRate")

    @cached_property
    def initially(self) -> dict[str, sp.Expr]:
        return {
            one.getSymbol(): self.formulas.number(one.getMath())
            for one in self.content.getListOfInitialAssignments()
            if one.isSetMath()
        }

    @cached_property
    def by_events(self) -> set[str]:
        """What events assign."""
        return {
            one.getVariable()
            for event in self.content.getListOfEvents()
            for one in event.getListOfEventAssignments()
        }

    def varies(self, compartment: str) -> bool:
        """Whether the size of a compartment changes."""
        return compartment in {*self.assigned, *self.rate_rules, *self.by_events}

    def as_amount(self, name: str) -> bool:
        """Whether the state of a species is its amount, while its name is a concentration.

        A rate rule is that of the concentration; the amount is conserved where events assign the
        size.
        """
        one = self.species[name]
        size = one.getCompartment()
        if name in self.rate_rules and size in {*self.rate_rules} - self.by_events:
            return False
        return not one.getHasOnlySubstanceUnits() and self.varies(size)

    def size(self, name: str) -> sp.Expr:
        """Size of the compartment of a species."""
        return self.value(self.species[name].getCompartment())

    # values of names

    def value(self, name: str) -> sp.Expr:
        """Return what a name stands for, in states and parameters."""
        if name not in self.values:
            if ("value", name) in self.open:
                raise ModelError(f"assignmentRule {name}: its value depends on itself")
            self.open.append(("value", name))
            if name in self.assigned:
                found = self.resolved(self.assigned[name])
            elif name in self.reactions:
                found = self.speed(name)
            elif name in self.species and self.as_amount(name):
                found = self.symbol(name) / self.size(name)
            else:
                found = self.symbol(name)
            self.open.pop()
            self.values[name] = found
        return self.values[name]

    def resolved(self, raw: Any) -> Any:
        """Replace the names in a formula by what they stand for."""
        names = {self.symbol(n): n for n in self.every}
        found = {s: self.value(names[s]) for s in raw.free_symbols if s in names}
        written = raw.xreplace(found)
        rates = {
            call: self.slope(names[call.args[0]])
            for call in raw.atoms(RATE_OF)
            if call.args[0] in names
        }
        # of a local parameter
        rates |= {call: sp.S.Zero for call in raw.atoms(RATE_OF) if call.args[0].is_number}
        if rates:
            written = raw.xreplace(rates).xreplace(found)
        return written

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        return tuple(one.getId() for one in self.content.getListOfParameters())

    @cached_property
    def every(self) -> tuple[str, ...]:
        """All names that formulas may contain."""
        elements = (*self.compartments, *self.species, *self.parameters)
        return (*elements, *self.reactions, *self.references)

    def speed(self, name: str) -> sp.Expr:
        """Rate of a reaction."""
        law = self.reactions[name].getKineticLaw()
        if law is None or not law.isSetMath():
            return sp.S.Zero
        local = {
            one.getId(): sp.Float(one.getValue())
            for group in (law.getListOfParameters(), law.getListOfLocalParameters())
            for one in group
        }
        return self.resolved(self.formulas.number(law.getMath(), local))

    def slope(self, name: str) -> sp.Expr:
        """Rate of change of the value of a name."""
        found = self.value(name)
        total = found.diff(TIME)
        for symbol in found.free_symbols - {TIME}:
            key = next((n for n in self.every if self.symbol(n) == symbol), None)
            if key is not None:
                total += found.diff(symbol) * self.rate(key)
        return total

    def rate(self, name: str) -> sp.Expr:
        """Rate of a state, 0 of a parameter."""
        if name not in self.known_rates:
            if ("rate", name) in self.open:
                raise ModelError(f"{name}: its rate depends on itself")
            self.open.append(("rate", name))
            self.known_rates[name] = self._rate(name)
            self.open.pop()
        return self.known_rates[name]

    def _rate(self, name: str) -> sp.Expr:
        if name in self.rate_rules:
            rate = self.resolved(self.rate_rules[name])
            if name in self.species and self.as_amount(name):
                size = self.species[name].getCompartment()
                rate = rate * self.value(size) + self.value(name) * self.slope(size)
            return rate
        if name not in self.reacting:
            return sp.S.Zero
        one, total = self.species[name], sp.S.Zero
        for key, reaction in self.reactions.items():
            for sign, side in (
                (-1, reaction.getListOfReactants()),
                (1, reaction.getListOfProducts()),
            ):
                for reference in side:
                    if reference.getSpecies() == name:
                        total += sign * self.stoichiometry(reference) * self.value(key)
        factor = one.getConversionFactor() or self.content.getConversionFactor()
        if factor:
            total *= self.value(factor)
        if one.getHasOnlySubstanceUnits() or self.as_amount(name):
            return total
        return total / self.size(name)

    def stoichiometry(self, reference: Any) -> sp.Expr:
        if reference.isSetStoichiometryMath():
            return self.resolved(self.formulas.number(reference.getStoichiometryMath().getMath()))
        if reference.isSetId() and reference.getId() in self.changing:
            return self.value(reference.getId())
        if reference.isSetId() and reference.getId() in self.initially:
            return sp.Float(self.number(reference.getId()))
        return sp.nsimplify(reference.getStoichiometry(), rational=True)

    @cached_property
    def changing(self) -> set[str]:
        return {*self.assigned, *self.rate_rules, *self.by_events}

    @cached_property
    def reacting(self) -> set[str]:
        """Species that reactions change."""
        found = {
            reference.getSpecies()
            for reaction in self.reactions.values()
            for side in (reaction.getListOfReactants(), reaction.getListOfProducts())
            for reference in side
        }
        free = {n for n in found if not self.species[n].getBoundaryCondition()}
        return free - {*self.assigned, *self.rate_rules}

    # numbers at the start

    def number(self, name: str) -> float:
        """Value of a name at the start."""
        if name not in self.numbers:
            if ("number", name) in self.open:
                raise ModelError(f"initialAssignment {name}: its value depends on itself")
            self.open.append(("number", name))
            self.numbers[name] = self._number(name)
            self.open.pop()
        return self.numbers[name]

    def _number(self, name: str) -> float:
        raw = self.initially.get(name, self.assigned.get(name))
        if raw is not None:
            return self.evaluated(raw, name)
        if name in self.reactions:
            return self.evaluated(self.speed(name), name)
        if name in self.species:
            one = self.species[name]
            amounts = one.getHasOnlySubstanceUnits()
            size = 1.0 if one.getCompartment() not in self.compartments else None
            if one.isSetInitialAmount():
                return float(one.getInitialAmount()) / (
                    1.0 if amounts else size or self.number(one.getCompartment())
                )
            if one.isSetInitialConcentration():
                return float(one.getInitialConcentration()) * (
                    self.number(one.getCompartment()) if amounts else 1.0
                )
            return self.missing("species", name)
        if name in self.compartments:
            one = self.compartments[name]
            return float(one.getSize()) if one.isSetSize() else self.missing("compartment", name)
        if name in self.references:
            return float(self.references[name].getStoichiometry())
        one = self.content.getParameter(name)
        return float(one.getValue()) if one.isSetValue() else self.missing("parameter", name)

    def missing(self, kind: str, name: str) -> float:
        value = 1.0 if kind == "compartment" else 0.0
        self.notes.append(f"{kind} {name} has no value; it is read as {value:g}")
        return value

    def evaluated(self, raw: sp.Expr, name: str) -> float:
        names = {self.symbol(n): n for n in self.every}
        if raw.atoms(RATE_OF):
            raw = self.resolved(raw)
        known = {s: self.number(names[s]) for s in raw.free_symbols if s in names}
        # in floating-point numbers throughout, so that equality means that of numbers
        constants = {sp.pi: sp.Float(math.pi), sp.E: sp.Float(math.e)}
        found = sp.sympify(raw.xreplace(constants).subs({**known, TIME: DEFAULT_SPAN[0]})).evalf()
        if not found.is_Number or not found.is_finite:
            raise ModelError(
                f"initialAssignment {name}: expected a finite number, received {found}"
            )
        return float(found)

    # the model

    def kept(self, name: str) -> float:
        """Initial value of a state or parameter: the amount of some species."""
        value = self.number(name)
        if name in self.species and self.as_amount(name):
            value *= self.number(self.species[name].getCompartment())
        return value

    def events(self) -> dict[str, Event]:
        found: dict[str, Event] = {}
        for k, event in enumerate(self.content.getListOfEvents()):
            trigger = event.getTrigger()
            if trigger is None or not trigger.isSetMath():
                continue
            name = event.getId() or f"event {k + 1}"
            then: dict[str, sp.Expr] = {}
            raw = {
                one.getVariable(): self.formulas.number(one.getMath())
                for one in event.getListOfEventAssignments()
                if one.isSetMath()
            }
            for target, written in raw.items():
                value = self.resolved(written)
                if target in self.species and self.as_amount(target):
                    size = self.species[target].getCompartment()
                    if event.getUseValuesFromTriggerTime() and event.isSetDelay():
                        raise ModelError(
                            f"event {name}: {target} is assigned a concentration after a delay, in "
                            "the compartment that changes meanwhile; expected an amount"
                        )
                    # the size before the event, also if the event assigns it
                    value = value * self.value(size)
                then[self.name_of(target)] = value
            if not then:
                continue
            delay, priority = event.getDelay(), event.getPriority()
            at_trigger = event.getUseValuesFromTriggerTime()
            found[name] = Event(
                self.resolved(self.formulas.condition(trigger.getMath())),
                then,
                delay=self.resolved(self.formulas.number(delay.getMath()))
                if delay is not None and delay.isSetMath()
                else 0,
                priority=self.resolved(self.formulas.number(priority.getMath()))
                if priority is not None and priority.isSetMath()
                else None,
                persistent=trigger.getPersistent() if trigger.isSetPersistent() else True,
                initially=trigger.getInitialValue() if trigger.isSetInitialValue() else True,
                values=AT_TRIGGER if at_trigger else AT_EXECUTION,
            )
        return found

    def file(self) -> ModelFile:
        for one in self.content.getListOfConstraints():
            self.notes.append(f"constraint {one.getId()} is dropped".replace("  ", " "))
        states = [n for n in self.every if n in self.rate_rules or n in self.reacting]
        rates = {self.name_of(n): self.rate(n) for n in states}
        fixed = [n for n in self.every if n not in (*states, *self.assigned, *self.reactions)]
        events = self.events()
        if not rates:
            moved = [n for n in fixed if n in self.by_events][:1]
            rates = {self.name_of(n): sp.S.Zero for n in moved} or {"unchanged": sp.S.Zero}
            states, fixed = moved, [n for n in fixed if n not in moved]
        initial = {self.name_of(n): self.kept(n) for n in states} or {"unchanged": 0.0}
        parameters = {self.name_of(n): self.kept(n) for n in fixed}
        auxiliary = {n: self.value(n) for n in (*self.assigned, *self.reactions)}
        taken = {*rates, *parameters}
        named = {n: e for n, e in auxiliary.items() if n not in (*taken, *RESERVED)}
        model = Model(rates, parameters=parameters, events=events, definitions=named)
        for n, one in self.species.items():
            substance, size = one.getHasOnlySubstanceUnits(), self.size(n)
            auxiliary[f"amount of {n}"] = self.value(n) * (1 if substance else size)
            auxiliary[f"concentration of {n}"] = self.value(n) / (size if substance else 1)
        return ModelFile(
            model=model,
            initial=NamedMapping("state", initial),
            t=DEFAULT_SPAN,
            auxiliary=NamedMapping("quantity", auxiliary),
            notes=tuple(self.notes),
            renamed=NamedMapping("name", self.renamed),
            units=NamedMapping("name", self.units()),
            labels=NamedMapping("name", self.labels()),
        )

    def labels(self) -> dict[str, str]:
        """Names of elements that differ from their ids."""
        elements = {n: self.content.getElementBySId(n) for n in self.every}
        return {
            self.name_of(n): one.getName()
            for n, one in elements.items()
            if one.isSetName() and one.getName() != n
        }

    def units(self) -> dict[str, str]:
        """Units of the states and parameters that have any, and of time."""
        found = {TIME.name: self.content.getTimeUnits()} if self.content.getTimeUnits() else {}
        for n in (*self.compartments, *self.species, *self.parameters):
            # the amount of a species whose name is a concentration has another one
            if n in self.species and self.as_amount(n):
                continue
            text = unit_text(self.content.getElementBySId(n).getDerivedUnitDefinition())
            if text:
                found[self.name_of(n)] = text
        return found


def unit_text(definition: Any) -> str:
    """Return a unit as text, such as ``"(0.001 mole) litre^-1"``; empty for an unknown one."""
    import libsbml

    factors = []
    for k in range(0 if definition is None else definition.getNumUnits()):
        unit = definition.getUnit(k)
        multiplier = unit.getMultiplier() * 10.0 ** unit.getScale()
        kind, exponent = libsbml.UnitKind_toString(unit.getKind()), unit.getExponentAsDouble()
        base = kind if multiplier == 1 else f"({multiplier:g} {kind})"
        factors.append(base if exponent == 1 else f"{base}^{exponent:g}")
    return " ".join(factors)
