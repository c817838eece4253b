"""The types of special points: one record for each code, which answers what depends on it.

A record holds what follows from the code alone. How such points are found and continued is in the
kinds, which refer to a record (`fastslow.diagrams.points.kinds`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from fastslow.results.base.display import Displayed


@dataclass(frozen=True, kw_only=True, repr=False)
class PointType(Displayed):
    """The properties common to all special points of one code.

    Parameters
    ----------
    code : str
        The code, such as ``"LP"``.
    name : str
        The usual name, such as ``"fold"``.
    summary : str
        A one-sentence definition for the documentation.
    codimension : int
        0 for points that mark a row, 1 for points of a branch over one parameter, 2
        for points of a curve in a parameter plane.
    event : str
        The eigenvalues that define it: ``"zero"``, ``"imaginary pair"``,
        ``"opposite pair"`` (two real eigenvalues with sum zero); of orbits ``"multiplier 1"``,
        ``"multiplier -1"``, ``"multiplier pair"``; or ``""``.
    unstable : int, optional
        The change of the number of eigenvalues with positive real part, of orbits the number
        of multipliers outside the unit circle, at a generic point of this code; None for any
        number.
    two_rows : bool
        True for points with two rows of a branch, one in each of two regions.
    orbits : bool
        True for points of branches of periodic orbits, False for equilibria.
    law : str
        The delay law of slow passage: ``"fold"``, ``"boundary"``, ``"hopf"``,
        ``"branch point"``, or ``""`` for none.
    end : bool
        True for the first and last row of a branch, which are not drawn.
    turning : bool
        Whether a branch has an extremum of the parameter there.
    branching : bool
        Whether another branch of the same kind intersects there.
    starts_cycles : bool
        Whether periodic orbits of vanishing amplitude start there.
    exchanging : bool
        Whether two events of a periodic orbit exchange their order there.
    certified : bool
        Whether certificates prove the list of all such points of a diagram.
    coefficient : str
        The entry of a point that is its normal-form coefficient, and is tabulated along curves:
        ``"coefficient"``, ``"lyapunov"``, or ``""`` for none.
    transition : str
        The type of the transition that a slow passage makes there, ``""`` if it depends on the
        branches around.
    bursting : str
        Its name in classes of bursting, ``""`` if it depends on the point.
    shrinking : str
        The outcome of a branch of periodic orbits that shrink to such a point, ``""`` for none.
    ending : tuple of str
        Outcomes of branches of periodic orbits that end there with another limit.
    curves : tuple of str
        Codes of the curves that can be continued from the point in two parameters, the
        usual one first.
    auto : tuple of int
        Type numbers in files of AUTO-07p.
    marker : str
        Matplotlib marker in figures.
    colour : str
        Colour in the palette of `fastslow.plot.layout.style`.
    line : tuple, optional
        Matplotlib's line style and width of a curve of such points.

    Examples
    --------
    >>> POINT_TYPES["HB"].name, POINT_TYPES["HB"].unstable
    ('Hopf', 2)
    """

    code: str
    name: str
    summary: str
    codimension: int
    marker: str
    colour: str
    event: str = ""
    unstable: int | None = 0
    two_rows: bool = False
    orbits: bool = False
    law: str = ""
    end: bool = False
    turning: bool = False
    branching: bool = False
    starts_cycles: bool = False
    exchanging: bool = False
    certified: bool = False
    coefficient: str = ""
    transition: str = ""
    bursting: str = ""
    shrinking: str = ""
    ending: tuple[str, ...] = ()
    curves: tuple[str, ...] = ()
    auto: tuple[int, ...] = ()
    line: tuple[str | tuple[int, tuple[float, ...]], float] | None = None

    @property
    def changes_stability(self) -> bool:
        """True if the stability of a branch may change at such a point."""
        return self.unstable != 0

    @property
    def title(self) -> str:
        """Code and name, for legends."""
        return f"{self.code} {self.name}"


#: Type of a point that is not decided.
CANDIDATE = "candidate"

#: Type of a boundary equilibrium, or of a contact of orbits, at which a branch turns.
NON_SMOOTH_FOLD = "non-smooth fold"

#: The codes, by which other modules name the types.
END_POINT = "EP"
USER_VALUE = "UZ"
FOLD = "LP"
HOPF = "HB"
BRANCH_POINT = "BP"
NEUTRAL_SADDLE = "NSD"
BOUNDARY_EQUILIBRIUM = "BE"
TWO_FOLD = "TF"
FOLD_OF_CYCLES = "LPC"
PERIOD_DOUBLING = "PD"
TORUS = "TR"
BRANCH_POINT_OF_CYCLES = "BPC"
GRAZING = "GR"
HOMOCLINIC = "HC"
GRAZING_SLIDING = "GS"
CROSSING_SLIDING = "CS"
SWITCHING_SLIDING = "SS"
ADDING_SLIDING = "AS"
CORNER_COLLISION = "CC"
CUSP_OF_CYCLES = "CPC"
GENERALIZED_DOUBLING = "GPD"
CHENCINER = "CH"
FOLD_FLIP = "LPPD"
RESONANCE_1 = "R1"
RESONANCE_2 = "R2"
RESONANCE_3 = "R3"
RESONANCE_4 = "R4"
FOLD_TORUS = "LPNS"
FLIP_TORUS = "PDNS"
DOUBLE_TORUS = "NSNS"
GRAZING_FOLD = "LPGR"
GRAZING_DOUBLING = "PDGR"
GRAZING_TORUS = "NSGR"
TWO_CONTACTS = "GRGR"
DEGENERATE_GRAZING = "DGR"
CUSP = "CP"
BOGDANOV_TAKENS = "BT"
GENERALIZED_HOPF = "GH"
ZERO_HOPF = "ZH"
DOUBLE_HOPF = "HH"
FOLD_ON_INTERFACE = "BF"
HOPF_ON_INTERFACE = "BH"
BOUNDARY_EQUILIBRIUM_ON_TWO = "BB"
FOLDED_NODE = "FN"
FOLDED_SADDLE = "FS"
FOLDED_FOCUS = "FF"
CANARD_POINT = "CN"
FOLDED_SADDLE_NODE_1 = "FSN1"
FOLDED_SADDLE_NODE_2 = "FSN2"
CORNER = "BC"


_ALL = (
    PointType(
        code=END_POINT,
        name="end point",
        summary="First or last row of a branch.",
        codimension=0,
        auto=(9, -9),
        end=True,
        marker="|",
        colour="black",
    ),
    PointType(
        code=USER_VALUE,
        name="user value",
        summary="Row at a parameter value, or at a zero of an expression, given in ``marks=``.",
        codimension=0,
        auto=(-4,),
        marker="x",
        colour="black",
        line=((0, (1, 1)), 1.2),
    ),
    PointType(
        code=FOLD,
        name="fold",
        summary="Saddle-node (limit point): the branch has an extremum of the parameter.",
        codimension=1,
        event="zero",
        unstable=1,
        law="fold",
        curves=(FOLD,),
        auto=(2,),
        turning=True,
        certified=True,
        coefficient="coefficient",
        transition="jump",
        bursting="fold",
        ending=("saddle-node on the cycle",),
        marker="o",
        colour="vermilion",
        line=("-", 1.5),
    ),
    PointType(
        code=HOPF,
        name="Hopf",
        summary="Andronov-Hopf point: a complex pair of eigenvalues crosses the imaginary axis.",
        codimension=1,
        event="imaginary pair",
        unstable=2,
        law="hopf",
        curves=(HOPF,),
        auto=(3,),
        starts_cycles=True,
        certified=True,
        coefficient="lyapunov",
        transition="Hopf",
        bursting="Hopf",
        shrinking="Hopf point",
        marker="s",
        colour="green",
        line=((0, (6, 1.5)), 1.5),
    ),
    PointType(
        code=BRANCH_POINT,
        name="branch point",
        summary="Two branches intersect: transcritical and pitchfork bifurcations.",
        codimension=1,
        event="zero",
        unstable=1,
        law="branch point",
        curves=(BRANCH_POINT,),
        auto=(1,),
        branching=True,
        transition="branch point",
        bursting="branch point",
        marker="D",
        colour="orange",
        line=((0, (6, 1.5, 1, 1.5, 1, 1.5)), 1.3),
    ),
    PointType(
        code=NEUTRAL_SADDLE,
        name="neutral saddle",
        summary="Two real eigenvalues have sum zero; no bifurcation of equilibria.",
        codimension=1,
        event="opposite pair",
        curves=(HOPF,),
        marker="P",
        colour="grey",
        line=("-", 0.7),
    ),
    PointType(
        code=BOUNDARY_EQUILIBRIUM,
        name="boundary equilibrium",
        summary="An equilibrium reaches an interface.",
        codimension=1,
        unstable=None,
        two_rows=True,
        law="boundary",
        curves=(BOUNDARY_EQUILIBRIUM,),
        certified=True,
        shrinking="boundary equilibrium",
        ending=("boundary equilibrium on the cycle",),
        marker="^",
        colour="purple",
        line=((0, (5, 1.5, 1, 1.5)), 1.5),
    ),
    PointType(
        code=TWO_FOLD,
        name="two-fold",
        summary="A pseudo-equilibrium reaches a point where both fields are tangent to the "
        "interface; its branch ends there.",
        codimension=1,
        unstable=None,
        curves=(TWO_FOLD,),
        marker="*",
        colour="purple",
        line=((0, (1, 1.5)), 1.5),
    ),
    PointType(
        code=FOLD_OF_CYCLES,
        name="fold of cycles",
        summary="Saddle-node of periodic orbits: a multiplier is 1 where the branch has an "
        "extremum of the parameter.",
        codimension=1,
        event="multiplier 1",
        unstable=1,
        turning=True,
        bursting="fold cycle",
        marker="H",
        colour="vermilion",
        orbits=True,
        curves=(FOLD_OF_CYCLES,),
        line=((0, (9, 1.5)), 1.5),
    ),
    PointType(
        code=PERIOD_DOUBLING,
        name="period doubling",
        summary="Flip of periodic orbits: a multiplier is -1, and an orbit of twice the period "
        "branches off.",
        codimension=1,
        event="multiplier -1",
        unstable=1,
        transition="period doubling",
        ending=("period doubling",),
        marker="1",
        colour="blue",
        orbits=True,
        curves=(PERIOD_DOUBLING,),
        line=((0, (3, 1.2)), 1.5),
    ),
    PointType(
        code=TORUS,
        name="torus",
        summary="Neimark-Sacker bifurcation of periodic orbits: a complex pair of multipliers "
        "crosses the unit circle.",
        codimension=1,
        event="multiplier pair",
        unstable=2,
        transition="torus",
        marker="2",
        colour="green",
        orbits=True,
        curves=(TORUS,),
        line=((0, (4, 1, 1, 1)), 1.5),
    ),
    PointType(
        code=BRANCH_POINT_OF_CYCLES,
        name="branch point of cycles",
        summary="Two branches of periodic orbits intersect: a multiplier is 1.",
        codimension=1,
        event="multiplier 1",
        unstable=1,
        transition="branch point",
        marker="3",
        colour="orange",
        orbits=True,
        curves=(BRANCH_POINT_OF_CYCLES,),
        line=((0, (6, 1.5, 1, 1.5)), 1.3),
    ),
    PointType(
        code=GRAZING,
        name="grazing",
        summary="A periodic orbit touches an interface.",
        codimension=1,
        unstable=None,
        marker="4",
        colour="purple",
        orbits=True,
        curves=(GRAZING,),
        line=((0, (2, 0.8)), 1.5),
    ),
    PointType(
        code=HOMOCLINIC,
        name="homoclinic",
        summary="A periodic orbit becomes a homoclinic orbit of a saddle, with infinite period.",
        codimension=1,
        unstable=None,
        bursting="homoclinic",
        ending=("homoclinic to a pseudo-saddle",),
        marker="+",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=GRAZING_SLIDING,
        name="grazing-sliding",
        summary="A periodic orbit touches an interface on which it would slide.",
        codimension=1,
        unstable=None,
        marker="$g$",
        colour="purple",
        orbits=True,
        curves=(GRAZING_SLIDING,),
        line=((0, (2, 0.8, 0.8, 0.8)), 1.5),
    ),
    PointType(
        code=CROSSING_SLIDING,
        name="crossing-sliding",
        summary="A periodic orbit crosses an interface at the edge of its sliding set, from which "
        "the motion on the other side leaves.",
        codimension=1,
        unstable=None,
        marker="$c$",
        colour="purple",
        orbits=True,
        curves=(CROSSING_SLIDING,),
        line=((0, (5, 1, 1, 1)), 1.5),
    ),
    PointType(
        code=SWITCHING_SLIDING,
        name="switching-sliding",
        summary="A periodic orbit meets an interface at the edge of its sliding set, to which the "
        "motion on the other side returns.",
        codimension=1,
        unstable=None,
        marker="$s$",
        colour="purple",
        orbits=True,
        curves=(SWITCHING_SLIDING,),
        line=((0, (5, 1, 1, 1, 1, 1)), 1.5),
    ),
    PointType(
        code=ADDING_SLIDING,
        name="adding-sliding",
        summary="A sliding segment of a periodic orbit touches the edge of the sliding set from "
        "inside.",
        codimension=1,
        unstable=None,
        marker="$a$",
        colour="purple",
        orbits=True,
        curves=(ADDING_SLIDING,),
        line=((0, (1, 0.8)), 1.5),
    ),
    PointType(
        code=CORNER_COLLISION,
        name="corner collision",
        summary="Two events of a periodic orbit coincide, such as a crossing of an interface and "
        "an instant of a clock, and exchange their order.",
        codimension=1,
        unstable=None,
        exchanging=True,
        marker="$\\bowtie$",
        colour="purple",
        orbits=True,
    ),
    PointType(
        code=CUSP_OF_CYCLES,
        name="cusp of cycles",
        summary="Two folds of cycles collide: the quadratic coefficient of the return map "
        "vanishes.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{C}$",
        colour="vermilion",
        orbits=True,
    ),
    PointType(
        code=GENERALIZED_DOUBLING,
        name="generalized period doubling",
        summary="The cubic coefficient of the return map vanishes at a period doubling, which "
        "changes between super- and subcritical.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{D}$",
        colour="blue",
        orbits=True,
    ),
    PointType(
        code=CHENCINER,
        name="Chenciner",
        summary="The first Lyapunov coefficient of the return map vanishes at a torus bifurcation.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{H}$",
        colour="green",
        orbits=True,
    ),
    PointType(
        code=FOLD_FLIP,
        name="fold-flip",
        summary="The multipliers 1 and -1 at once.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{F}$",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=RESONANCE_1,
        name="1:1 resonance",
        summary="A double multiplier 1: a curve of torus bifurcations ends on a curve of folds "
        "of cycles.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{1}$",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=RESONANCE_2,
        name="1:2 resonance",
        summary="A double multiplier -1: a curve of torus bifurcations ends on a curve of "
        "period doublings.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{2}$",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=RESONANCE_3,
        name="1:3 resonance",
        summary="Multipliers that are third roots of unity at a torus bifurcation.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{3}$",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=RESONANCE_4,
        name="1:4 resonance",
        summary="Multipliers i and -i at a torus bifurcation.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{4}$",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=FOLD_TORUS,
        name="fold-torus",
        summary="The multiplier 1 and a complex pair on the unit circle.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{T}$",
        colour="green",
        orbits=True,
    ),
    PointType(
        code=FLIP_TORUS,
        name="flip-torus",
        summary="The multiplier -1 and a complex pair on the unit circle.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{U}$",
        colour="green",
        orbits=True,
    ),
    PointType(
        code=DOUBLE_TORUS,
        name="double torus",
        summary="Two complex pairs of multipliers on the unit circle.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{W}$",
        colour="black",
        orbits=True,
    ),
    PointType(
        code=GRAZING_FOLD,
        name="grazing fold of cycles",
        summary="An orbit with the multiplier 1 touches an interface.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{L}$",
        colour="vermilion",
        orbits=True,
    ),
    PointType(
        code=GRAZING_DOUBLING,
        name="grazing period doubling",
        summary="An orbit with the multiplier -1 touches an interface.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{P}$",
        colour="blue",
        orbits=True,
    ),
    PointType(
        code=GRAZING_TORUS,
        name="grazing torus",
        summary="An orbit with a complex pair of multipliers on the unit circle touches an "
        "interface.",
        codimension=2,
        unstable=None,
        marker="$\\mathbf{N}$",
        colour="green",
        orbits=True,
    ),
    PointType(
        code=TWO_CONTACTS,
        name="two contacts",
        summary="A periodic orbit has two contacts with interfaces at once, as in double grazing.",
        codimension=2,
        unstable=None,
        marker="$2g$",
        colour="purple",
        orbits=True,
    ),
    PointType(
        code=DEGENERATE_GRAZING,
        name="degenerate grazing",
        summary="A periodic orbit touches an interface with vanishing second derivative of the "
        "interface function, where a crossing and a touch coincide.",
        codimension=2,
        unstable=None,
        marker="$3g$",
        colour="purple",
        orbits=True,
    ),
    PointType(
        code=CUSP,
        name="cusp",
        summary="Two folds collide.",
        codimension=2,
        unstable=None,
        curves=(FOLD,),
        marker="v",
        colour="vermilion",
    ),
    PointType(
        code=BOGDANOV_TAKENS,
        name="Bogdanov-Takens",
        summary="A double zero eigenvalue: a curve of Hopf points ends on a curve of folds.",
        codimension=2,
        unstable=None,
        curves=(HOPF, FOLD),
        marker="p",
        colour="black",
    ),
    PointType(
        code=GENERALIZED_HOPF,
        name="generalized Hopf",
        summary="Bautin point: the first Lyapunov coefficient vanishes.",
        codimension=2,
        unstable=None,
        curves=(HOPF,),
        marker="h",
        colour="blue",
    ),
    PointType(
        code=ZERO_HOPF,
        name="zero-Hopf",
        summary="Fold-Hopf point: a zero eigenvalue and an imaginary pair.",
        codimension=2,
        unstable=None,
        curves=(HOPF, FOLD),
        marker="<",
        colour="black",
    ),
    PointType(
        code=DOUBLE_HOPF,
        name="double Hopf",
        summary="Hopf-Hopf point: two imaginary pairs.",
        codimension=2,
        unstable=None,
        curves=(HOPF,),
        marker=">",
        colour="black",
    ),
    PointType(
        code=FOLD_ON_INTERFACE,
        name="fold on an interface",
        summary="A fold reaches an interface.",
        codimension=2,
        unstable=None,
        curves=(BOUNDARY_EQUILIBRIUM, FOLD),
        marker="d",
        colour="purple",
    ),
    PointType(
        code=HOPF_ON_INTERFACE,
        name="Hopf on an interface",
        summary="A Hopf point reaches an interface.",
        codimension=2,
        unstable=None,
        curves=(BOUNDARY_EQUILIBRIUM, HOPF),
        marker="X",
        colour="green",
    ),
    PointType(
        code=BOUNDARY_EQUILIBRIUM_ON_TWO,
        name="boundary equilibrium on two interfaces",
        summary="A boundary equilibrium reaches a second interface.",
        codimension=2,
        unstable=None,
        curves=(BOUNDARY_EQUILIBRIUM,),
        marker="8",
        colour="purple",
    ),
    PointType(
        code=FOLDED_NODE,
        name="folded node",
        summary="A zero of the desingularised slow flow on a fold, with two real eigenvalues of "
        "one sign.",
        codimension=2,
        unstable=None,
        curves=(FOLDED_NODE,),
        marker="$n$",
        colour="vermilion",
        line=((0, (7, 1, 1, 1)), 1.5),
    ),
    PointType(
        code=FOLDED_SADDLE,
        name="folded saddle",
        summary="A zero of the desingularised slow flow on a fold, with real eigenvalues of "
        "opposite sign.",
        codimension=2,
        unstable=None,
        curves=(FOLDED_SADDLE,),
        marker="$x$",
        colour="vermilion",
        line=((0, (4, 1.5)), 1.5),
    ),
    PointType(
        code=FOLDED_FOCUS,
        name="folded focus",
        summary="A zero of the desingularised slow flow on a fold, with complex eigenvalues.",
        codimension=2,
        unstable=None,
        curves=(FOLDED_FOCUS,),
        marker="$f$",
        colour="vermilion",
        line=((0, (1, 1.2)), 1.5),
    ),
    PointType(
        code=CANARD_POINT,
        name="canard point",
        summary="The slow rate vanishes on a fold of the critical manifold.",
        codimension=2,
        unstable=None,
        curves=(CANARD_POINT,),
        marker="$k$",
        colour="green",
        line=((0, (7, 2)), 1.3),
    ),
    PointType(
        code=FOLDED_SADDLE_NODE_1,
        name="folded saddle-node of type I",
        summary="Two folded singularities collide.",
        codimension=2,
        unstable=None,
        curves=(FOLDED_SADDLE_NODE_1,),
        marker="$\\oplus$",
        colour="blue",
        line=((0, (7, 1.5, 2, 1.5)), 1.3),
    ),
    PointType(
        code=FOLDED_SADDLE_NODE_2,
        name="folded saddle-node of type II",
        summary="An equilibrium of the slow flow passes through a folded singularity.",
        codimension=2,
        unstable=None,
        curves=(FOLDED_SADDLE_NODE_2,),
        marker="$\\otimes$",
        colour="purple",
        line=((0, (7, 1.5, 2, 1.5, 2, 1.5)), 1.3),
    ),
    PointType(
        code=CORNER,
        name="corner",
        summary="An attracting and another sheet of the critical manifold meet on an interface.",
        codimension=2,
        unstable=None,
        marker="$L$",
        colour="purple",
    ),
)

#: All point types by code, in the order of legends.
POINT_TYPES: Mapping[str, PointType] = MappingProxyType({one.code: one for one in _ALL})


def kind_of(code: str) -> PointType:
    """Return the type of a code; one without properties for a code of a later version.

    Examples
    --------
    >>> kind_of("BP").name, kind_of("QQ").name
    ('branch point', 'QQ')
    """
    known = POINT_TYPES.get(code)
    return known or PointType(
        code=code,
        name=code,
        summary="",
        codimension=0,
        unstable=None,
        marker="o",
        colour="black",
    )


def turns(code: str, type_: str | None) -> bool:
    """Return whether a branch turns in its parameter at a point: at a fold, smooth or not.

    Examples
    --------
    >>> turns("LP", None), turns("BE", "non-smooth fold"), turns("BE", "persistence")
    (True, True, False)
    """
    return kind_of(code).turning or type_ == NON_SMOOTH_FOLD


def point_name(code: str) -> str:
    """Return the name of a code; an unknown code, from a later version, is returned itself.

    Examples
    --------
    >>> point_name("BP"), point_name("QQ")
    ('branch point', 'QQ')
    """
    return kind_of(code).name
