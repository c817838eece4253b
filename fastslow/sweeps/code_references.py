"""What the byte code of a function refers to by name."""

from __future__ import annotations

import dis
import itertools
import types
from collections.abc import Iterator
from dataclasses import dataclass

#: Functions of Python whose result depends on names or code that exist only when it is called.
DYNAMIC = ("__import__", "compile", "eval", "exec", "getattr", "globals", "import_module", "vars")

#: Instructions that do not compute anything.
SILENT = ("CACHE", "EXTENDED_ARG", "KW_NAMES", "NOP", "PRECALL", "RESUME")


@dataclass(frozen=True)
class CodeReferences:
    """Names in a code and in the functions inside it.

    Parameters
    ----------
    names : tuple of str
        Names of globals and attributes, and texts, which may be names of attributes.
    imports : tuple of (str, int)
        Modules that are imported, and what may be one, with the levels of relative imports.
    dynamic : tuple of str
        Calls of functions such as ``eval``, with the line; not ``getattr`` of a constant name.
    """

    names: tuple[str, ...]
    imports: tuple[tuple[str, int], ...]
    dynamic: tuple[str, ...]


def references(code: types.CodeType) -> CodeReferences:
    """Return the names to which a code refers.

    Examples
    --------
    >>> references(compile("import a.b; getattr(c, 'd'); eval(e)", "", "exec"))
    CodeReferences(names=('a.b', 'a', 'getattr', 'c', 'eval', 'e', 'd'), imports=(('a.b', 0),), \
dynamic=('eval in <module>, line 1',))
    """
    names: list[str] = []
    imports: list[tuple[str, int]] = []
    dynamic: list[str] = []
    for part in codes_within(code):
        names += part.co_names
        names += [text for text in _texts(part.co_consts) if text.isidentifier()]
        steps = [step for step in dis.get_instructions(part) if step.opname not in SILENT]
        line = part.co_firstlineno
        for k, step in enumerate(steps):
            if step.starts_line:
                line = int(step.starts_line)
            if step.opname == "IMPORT_NAME":
                level = steps[k - 2].argval if k > 1 else 0
                imports.append((step.argval, level if type(level) is int else 0))
                # what is imported from a package may be a module
                for taken in itertools.takewhile(_takes, steps[k + 1 :]):
                    if taken.opname == "IMPORT_FROM":
                        given = f"{step.argval}.{taken.argval}".lstrip(".")
                        imports.append((given, imports[-1][1]))
            elif _named(step) in DYNAMIC and not (
                _named(step) == "getattr" and _constant_attribute(steps[k:])
            ):
                dynamic.append(f"{_named(step)} in {part.co_name}, line {line}")
    return CodeReferences(
        tuple(dict.fromkeys(names)), tuple(dict.fromkeys(imports)), tuple(dict.fromkeys(dynamic))
    )


def codes_within(code: types.CodeType) -> Iterator[types.CodeType]:
    """Yield a code and those of the functions and classes inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from codes_within(constant)


def _takes(step: dis.Instruction) -> bool:
    """Return True for instructions that take names from an imported module."""
    return step.opname == "IMPORT_FROM" or step.opname.startswith("STORE_")


def _texts(constants: tuple[object, ...]) -> Iterator[str]:
    for constant in constants:
        if isinstance(constant, str):
            yield constant
        elif isinstance(constant, tuple):
            yield from _texts(constant)


def _named(step: dis.Instruction) -> str:
    """Return the name that an instruction looks up."""
    if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
        return str(step.argval)
    # of a module; the others are methods of objects too, such as `compile`
    return "import_module" if step.argval == "import_module" else ""


def _constant_attribute(steps: list[dis.Instruction]) -> bool:
    """Return True if the name in a call of ``getattr``, which begins here, is a constant."""
    count = 0
    for k, step in enumerate(steps[1:], 1):
        if step.opname == "CALL":
            if step.arg == count:
                # the second argument; a default after it is one instruction, or it is not found
                name = steps[k - count + 1]
                return name.opname == "LOAD_CONST" and isinstance(name.argval, str)
            count -= (step.arg or 0) + 1
        else:
            count += dis.stack_effect(step.opcode, step.arg)
        if count < 0:
            break
    return False
