"""Published models, one module each, named after the author and the year of the source.

Every module of this package has

``ABOUT``
    What is known about the model beside its equations, an `About`.
``model()``
    The model at the parameter values of the figure.
``figure()``
    Draw what the source shows. `model` and `figure` are the code that a page of the gallery
    shows: together at most 25 lines, of public functions only.
``claims()``
    What the source states, as `analyses.claims.Claim`, with the computed quantities beside
    independent references.

The modules are found by their being here; pages, indexes and tests follow from them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class About:
    """What is known about a model of the gallery beside its equations.

    All texts are Markdown without a full stop at the end of `title`.

    Parameters
    ----------
    title : str
        Heading of the page: the authors, a colon, and what the model is.
    why : str
        Why the model matters, and the question that it answers.
    source : str
        Reference with the numbers of the equations and figures.
    field : str
        Field of research, one entry of the index by field.
    phenomena : tuple of str
        Entries of the index by phenomenon.
    slow : str
        What is slow, and against what.
    caption : str
        Caption of the figure.
    compared : str
        What the source shows, and in what the figure differs; a comparison only with a number.
    unsaid : tuple of str
        What the source does not state, and what is taken here.
    equations : str
        Equations in LaTeX, as the source writes them; those of the model by default.

    Raises
    ------
    ValueError
        If one of them is empty.
    """

    title: str
    why: str
    source: str
    field: str
    phenomena: tuple[str, ...]
    slow: str
    caption: str
    compared: str
    unsaid: tuple[str, ...]
    equations: str = ""

    def __post_init__(self) -> None:
        for field in fields(self):
            if not getattr(self, field.name) and field.name != "equations":
                raise ValueError(f"{field.name} is empty; a page of the gallery shows it")
