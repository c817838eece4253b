"""The gallery of published models: figures, pages, scripts, notebooks and indexes.

Everything is read off the modules of `analyses.gallery`; there is no list beside them.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import fastslow as fs
from analyses import gallery
from analyses.claims import MINUS, Claim
from analyses.gallery import About
from analyses.output import Output, copy_figure
from fastslow.disk import write_text

#: Lines of code, without blank ones and docstrings, that a page shows at most.
MOST_LINES = 25

#: A public name in code: `fs.simulate`, `fs.plot.diagram`.
PUBLIC = re.compile(r"fs\.((?:plot\.|systems\.)?\w+)")


@dataclass(frozen=True)
class Entry:
    """A module of the gallery.

    Parameters
    ----------
    name : str
    """

    name: str

    @property
    def about(self) -> About:
        """What is known about the model."""
        found: About = self._module.ABOUT
        return found

    @property
    def model(self) -> Callable[[], fs.Model]:
        """The function that returns the model."""
        found: Callable[[], fs.Model] = self._module.model
        return found

    @property
    def figure(self) -> Callable[[], fs.plot.Drawing]:
        """The function that draws."""
        found: Callable[[], fs.plot.Drawing] = self._module.figure
        return found

    @property
    def claims(self) -> tuple[Claim, ...]:
        """What the source states."""
        found: tuple[Claim, ...] = self._module.claims()
        return found

    @property
    def path(self) -> Path:
        """The file of the module."""
        return Path(gallery.__path__[0]) / f"{self.name}.py"

    @property
    def file(self) -> Path:
        """The file of another program from which the model is read, if there is one."""
        return self.path.with_suffix(".ode")

    @property
    def label(self) -> str:
        """Authors, as the title begins, and the year: "Mitchell, Schaeffer 2003"."""
        return f"{self.about.title.partition(':')[0]} {self.name[-4:]}"

    @property
    def used(self) -> tuple[str, ...]:
        """The public names that the module uses, such as ``"plot.diagram"``."""
        return public_names(self.path.read_text("utf-8"))

    def draw(self, into: Output) -> None:
        """Draw the figure into a folder."""
        into.save(self.figure().figure, self.name)

    @property
    def _module(self) -> Any:
        return import_module(f"analyses.gallery.{self.name}")


@cache
def entries() -> tuple[Entry, ...]:
    """Every model of the gallery, by name."""
    return tuple(Entry(found.name) for found in iter_modules(gallery.__path__))


def public_names(source: str) -> tuple[str, ...]:
    """The public functions and classes of fastslow that a source calls, by name.

    Examples
    --------
    >>> public_names("import fastslow as fs; fs.plot.diagram(fs.load('a.npz')).save('a.png')")
    ('load', 'plot.diagram')
    """
    calls = (node.func for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))
    names = (PUBLIC.fullmatch(ast.unparse(call)) for call in calls)
    return tuple(sorted({name[1] for name in names if name}))


def script(entry: Entry) -> str:
    """The code of a model as a script: `model` and `figure` with what they import."""
    source = entry.path.read_text("utf-8")
    tree = ast.parse(source)
    functions = [
        node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name in SHOWN
    ]
    names = {node.id for f in functions for node in ast.walk(f) if isinstance(node, ast.Name)}
    imports = [
        node
        for node in tree.body
        if isinstance(node, ast.Import | ast.ImportFrom)
        and {alias.asname or alias.name for alias in node.names} & names
    ]
    own = [node for node in imports if "fastslow" in ast.unparse(node)]
    others = [node for node in imports if node not in own]
    text = [f'"""{entry.about.title}."""']
    text += ["\n".join(ast.unparse(node) for node in part) for part in (others, own) if part]
    body = "\n\n\n".join(str(ast.get_source_segment(source, node)) for node in functions)
    if "FILE" in names:
        text.append(f'FILE = "{entry.file.name}"')
    main = f'if __name__ == "__main__":\n    figure().save("{entry.name}.png")'
    return "\n\n".join(text) + f"\n\n\n{body}\n\n\n{main}\n"


#: The functions that a page shows.
SHOWN = ("model", "figure")


def lines_of_code(entry: Entry) -> int:
    """Lines of `model` and `figure`, without blank ones and docstrings."""
    tree = ast.parse(entry.path.read_text("utf-8"))
    found = 0
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name in SHOWN:
            found += len(str(ast.unparse(node.args)).splitlines())
            lines = set(range(node.body[1].lineno, int(node.end_lineno or 0) + 1))
            source = entry.path.read_text("utf-8").splitlines()
            found += sum(bool(source[k - 1].strip()) for k in lines)
    return found


def notebook(entry: Entry) -> str:
    """The script as a notebook: a heading, the code, and a cell that draws."""
    code = script(entry).split('\n\n\nif __name__ == "__main__":')[0].split("\n\n", 1)[1]
    cells = [
        ("markdown", f"# {entry.about.title}\n\n{entry.about.source}."),
        ("code", code),
        ("code", "figure()"),
    ]
    written: list[dict[str, object]] = []
    for k, (kind, text) in enumerate(cells):
        cell = {
            "cell_type": kind,
            "id": f"{entry.name.replace('_', '-')}-{k + 1:02d}",
            "metadata": {},
            "source": text.splitlines(keepends=True),
        }
        written.append(cell | ({"execution_count": None, "outputs": []} if kind == "code" else {}))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {
        "cells": written,
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def page(entry: Entry) -> str:
    """The page of a model."""
    about, model = entry.about, entry.model()
    values = ", ".join(f"${name} = {value:g}$" for name, value in latex_values(model))
    file = (
        f"The file: {{download}}`{entry.file.name} <{entry.file.name}>`.\n\n"
        f":::{{literalinclude}} {entry.file.name}\n:language: none\n:::"
    )
    lines = [
        f"# {about.title}",
        "",
        about.why,
        "",
        "## Equations",
        "",
        about.equations or model.to_latex(),
        "",
        *([f"Parameters: {values}.", ""] if values else []),
        f"*Slow:* {about.slow}",
        "",
        "## Figure",
        "",
        f":::{{figure}} ../figures/{entry.name}.png",
        f":alt: {plain(about.title)}",
        "",
        about.caption,
        ":::",
        "",
        f"*Beside the source:* {compared_numbers(entry.claims)} {about.compared}",
        "",
        f"*Source:* {about.source}.",
        "",
        "## Code",
        "",
        f":::{{literalinclude}} {entry.name}.py",
        ":language: python",
        ":::",
        "",
        f"Download it as a {{download}}`script <{entry.name}.py>` or a "
        f"{{download}}`notebook <{entry.name}.ipynb>`. It uses {links(entry.used)}.",
        "",
        *([file, ""] if entry.file.exists() else []),
        "## Claims",
        "",
        *(line for claim in entry.claims for line in claim_lines(claim)),
        "## What the source does not say",
        "",
        *(f"- {text}" for text in about.unsaid),
    ]
    return "\n".join(lines) + "\n"


def compared_numbers(claims: Iterable[Claim]) -> str:
    """A sentence that counts the numbers on a page which the source prints."""
    quantities = [one for claim in claims for one in claim.quantities]
    printed = sum(bool(one.published) for one in quantities)
    here = "computed here and compared with independent calculations"
    if not printed:
        return f"The {len(quantities)} results below are {here}; no published value is known."
    verb = "is" if printed == 1 else "are"
    return (
        f"{printed} of the {len(quantities)} results below {verb} printed in the source; the "
        f"others are {here}. The figure itself was not compared."
    )


def latex_values(model: fs.Model) -> Iterator[tuple[str, float]]:
    """The parameters of a model in LaTeX, with their values."""
    import sympy as sp

    for name, value in model.parameters.items():
        yield sp.latex(sp.Symbol(name)), value


def plain(text: str) -> str:
    """Text without the marks of Markdown and mathematics."""
    return re.sub(r"[$*`\\]", "", text)


def claim_lines(claim: Claim) -> list[str]:
    """A claim with its verdict, evidence and quantities."""
    (finding,) = claim.findings
    lines = [
        f"### {claim.number}. {claim.sentence}",
        "",
        f"*Computed:* {claim.computed}",
        "",
        f"**{finding.verdict.capitalize()}.** {finding.words}",
        "",
    ]
    if claim.quantities:
        lines += [
            "| quantity | published | computed | independent reference | its source |",
            "|---|---|---|---|---|",
        ]
        for one in claim.quantities:
            values = (one.published or "–", one.rounded, one.reference)
            signed = (MINUS.sub("−", value) for value in values)
            lines.append(f"| {one.name} | {' | '.join(signed)} | {one.how} |")
        lines.append("")
    return lines


def home(name: str) -> str:
    """Where a public name is documented: the page of a function, or a heading of the reference."""
    pages = Path(fs.__file__).parents[1] / "docs" / "reference"
    if (pages / "functions" / f"fastslow.{name}.md").exists():
        return f"../reference/functions/fastslow.{name}.md"
    for path in sorted(pages.glob("*.md")):
        if re.search(rf"^### {re.escape(name)}$", path.read_text("utf-8"), re.MULTILINE):
            return f"../reference/{path.name}#{anchor(name)}"
    raise LookupError(f"no page of the reference has the heading {name}")


def anchor(heading: str) -> str:
    """The anchor of a heading, as MyST makes it."""
    return re.sub(r"[^\w-]", "", heading.lower())


def links(names: Iterable[str]) -> str:
    """Public names as links into the reference."""
    return ", ".join(f"[`fs.{name}`]({home(name)})" for name in names)


def index(found: Iterable[Entry]) -> str:
    """The front page: thumbnails, indexes by field, by phenomenon and by function."""
    found = tuple(found)
    lines = [
        "# Gallery of published models",
        "",
        "Models of the literature, each with its published figure and claims reproduced in at most "
        f"{MOST_LINES} lines. `python -m analyses --gallery` draws all figures.",
        "",
        "They are listed [by field](#by-field), [by phenomenon](#by-phenomenon) and "
        "[by function](#by-function). [Bursting cells](cells.md) are read from files. The "
        "[studies](studies.md) are complete analyses of one gear, and of some other models; the "
        "[questions](questions.md) are cases that users of other programs asked for.",
        "",
        "::::{container} thumbnails",
    ]
    for entry in found:
        lines += [
            f":::{{figure}} ../figures/{entry.name}.png",
            f":alt: {plain(entry.about.title)}",
            f":target: {entry.name}.html",
            "",
            f"[{entry.about.title}]({entry.name}.md)",
            ":::",
        ]
    lines += ["::::", "", "## By field", ""]
    lines += listed({e: (e.about.field,) for e in found})
    lines += ["## By phenomenon", ""]
    lines += listed({e: e.about.phenomena for e in found})
    lines += ["## By function", "", "Read off the code of each model.", ""]
    lines += listed({e: e.used for e in found}, lambda name: links([name]))[:-1]
    toc = [
        "",
        "```{toctree}",
        ":hidden:",
        "",
        *(entry.name for entry in found),
        "cells",
        "studies",
        "questions",
        "```",
    ]
    return "\n".join([*lines, *toc]) + "\n"


def listed(terms: Mapping[Entry, Iterable[str]], shown: Callable[[str], str] = str) -> list[str]:
    """Terms in alphabetical order, each with its models."""
    lines = []
    for term in sorted({t for found in terms.values() for t in found}, key=str.casefold):
        models = (f"[{e.label}]({e.name}.md)" for e, found in terms.items() if term in found)
        lines.append(f"- {shown(term)}: {', '.join(models)}")
    return [*lines, ""]


def texts(found: Iterable[Entry]) -> dict[str, str]:
    """The text of the index and of every file of some models, by name."""
    written = {"index.md": index(entries())}
    for entry in found:
        written[f"{entry.name}.md"] = page(entry)
        written[f"{entry.name}.py"] = script(entry)
        written[f"{entry.name}.ipynb"] = notebook(entry)
        if entry.file.exists():
            written[entry.file.name] = entry.file.read_text("utf-8")
    return written


def write_docs(drawn: Path, docs: Path, found: Sequence[Entry]) -> None:
    """Write pages, scripts, notebooks and figures into a folder of documentation.

    Parameters
    ----------
    drawn : Path
        Where the figures are.
    docs : Path
        Gets ``gallery``, and the figures in ``figures``.
    found : sequence of Entry
        The models whose pages are written; the index has all.
    """
    (docs / "gallery").mkdir(parents=True, exist_ok=True)
    (docs / "figures").mkdir(parents=True, exist_ok=True)
    for name, text in texts(found).items():
        write_text(docs / "gallery" / name, text)
    for entry in found:
        copy_figure(drawn, docs, entry.name)
