"""What a vertical axis shows: a state, or an expression in states and parameters."""

from __future__ import annotations

import ast
import re

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.plot.style import typeset
from fastslow.results.branches import Branch
from fastslow.results.diagrams import Diagram
from fastslow.results.formulas import FUNCTIONS, evaluated, names_in
from fastslow.results.points import SpecialPoint


def along(diagram: Diagram, branch: Branch, expression: str) -> NDArray[np.float64]:
    """A state, or an expression in states and parameters, at the rows of a branch."""
    columns = {name: branch[name] for name in (*branch.states, diagram.parameter)}
    values = evaluated(expression, {**diagram.parameters, **columns})
    return np.broadcast_to(values, branch.parameter.shape)


def at_point(point: SpecialPoint, expression: str) -> float:
    """A state, or an expression in states and parameters, at a special point."""
    states = dict(zip(point.states, point.state.tolist(), strict=True))
    return float(evaluated(expression, {**point.parameters, **states}))


def expression_of(diagram: Diagram, name: object) -> str:
    """A state, by default the first, or an expression in the states and the parameters.

    Raises
    ------
    UnknownNameError
        For a name that is neither; for a parameter alone.
    ArgumentError
        For what is no expression.
    """
    text = diagram.states[0] if name is None else str(name)
    known = dict.fromkeys((*diagram.states, diagram.parameter, *diagram.parameters), 0.0)
    if text in diagram.states:
        return text
    if text.isidentifier() or not names_in(text, known) & set(diagram.states):
        raise unknown_name("state", text, diagram.states)
    return text


def written(expression: str) -> str:
    """An expression as the label of an axis: names as mathematics."""
    try:
        tree = ast.parse(expression, mode="eval").body
    except SyntaxError:
        return typeset(expression)
    if isinstance(tree, ast.Name):
        return typeset(expression)
    names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)} - set(FUNCTIONS)
    text = re.sub(r"\*\*\s*\(?(\d+)\)?", r"^{\1}", expression).replace("*", r"\,")
    for name in sorted(names, key=len, reverse=True):
        text = re.sub(rf"\b{name}\b", lambda m: typeset(m[0]).strip("$"), text)
    return f"${text}$"
