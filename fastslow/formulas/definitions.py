"""Named definitions of a model, in expressions given as text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

#: A name, which is no part of a number such as 1e5, and no function.
_NAME = re.compile(r"(?<![\w.])[^\W\d]\w*\b(?!\s*\()")


def definitions_of(model: Any) -> dict[str, str]:
    """Return the definitions of a model, or of a stored model, as text; empty for None."""
    structure = getattr(model, "structure", None)
    known = model if structure is None else structure
    return dict(getattr(known, "definition_texts", {}))


def with_definitions(expression: Any, definitions: Mapping[str, str]) -> Any:
    """Return an expression with names of definitions replaced by what they mean.

    Anything else is returned as it is.

    Examples
    --------
    >>> with_definitions("i_Ca - 1e5*i", {"i_Ca": "g*(V - E)", "e5": "0"})
    '(g*(V - E)) - 1e5*i'
    >>> with_definitions(3, {"i": "x"})
    3
    """
    if not definitions or not (isinstance(expression, str) or hasattr(expression, "free_symbols")):
        return expression
    text = str(expression)
    written = _NAME.sub(
        lambda found: f"({definitions[found[0]]})" if found[0] in definitions else found[0], text
    )
    return expression if written == text else written


def with_definitions_in(given: Any, definitions: Mapping[str, str]) -> Any:
    """Return a mapping with `with_definitions` for its values; anything else as it is."""
    if not isinstance(given, Mapping):
        return given
    return {key: with_definitions(value, definitions) for key, value in given.items()}
