"""What all cases of the gear share: the run, its diagram, the overlay, and a row of numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fastslow as fs

#: Angular frequency of the load in every case; the source leaves it out.
OMEGA = 0.01
PERIODS = 3
REST = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Setting:
    """One set of parameters of the gear.

    Parameters
    ----------
    name : str
        What the figure's file is called.
    title : str
        What differs from the other settings, as mathematics.
    model : Model
    stated : str
        The regime that the source states, or "" where it states none.
    """

    name: str
    title: str
    model: fs.Model
    stated: str = ""


@dataclass(frozen=True, eq=False)
class Case:
    """A setting: its run over three slow periods and the overlay on its diagram."""

    setting: Setting
    overlay: fs.Overlay

    @property
    def run(self) -> fs.Trajectory:
        return self.overlay.run

    @property
    def diagram(self) -> fs.Diagram:
        return self.overlay.diagram


@dataclass(frozen=True)
class Row:
    """The numbers of one case.

    Parameters
    ----------
    case : str
    A, B, C, D : float
        Parameters of the dimensionless gear.
    BE, LP : int
        Boundary equilibria and folds of the diagram.
    crossings : int
        Crossings of interfaces over the whole run.
    jumps, transits : int
        Transitions at a fold, and across the gap.
    regime : str
        Over the last period.
    stated : str
        The regime that the source states, "" where it states none.
    largest_delay : float
        Of all transitions, in units of the load; nan without a transition.
    """

    case: str
    A: float
    B: float
    C: float
    D: float
    BE: int
    LP: int
    crossings: int
    jumps: int
    transits: int
    regime: str
    stated: str
    largest_delay: float


def laid(setting: Setting) -> Case:
    """Run a gear over three slow periods from rest and overlay it on its diagram."""
    model = setting.model
    load, swing = model.parameters["B"], model.parameters["C"]
    # the whole load, and enough below zero to show the gap
    over = (min(load - 1.1 * swing, -0.3 * swing), load + 1.1 * swing)
    diagram = fs.continue_equilibria(model.frozen(), "w", over=over)
    run = fs.simulate(model, REST, periods=PERIODS)
    return Case(setting, fs.overlay(diagram, run))


def row(case: Case) -> Row:
    """The numbers of a case for the summary table."""
    values = case.setting.model.parameters
    delays = np.abs(case.overlay.delays)
    kinds = [t.type for t in case.overlay.transitions]
    return Row(
        case.setting.name,
        values["A"],
        values["B"],
        values["C"],
        values["D"],
        len(case.diagram.boundary_equilibria),
        len(case.diagram.folds),
        len(case.run.crossings),
        kinds.count("jump"),
        kinds.count("gap crossing"),
        case.run.regime or "none",
        case.setting.stated,
        float(np.nanmax(delays)) if np.isfinite(delays).any() else float("nan"),
    )


def draw(case: Case) -> fs.plot.PanelDrawing:
    """The panel of a case: time series, phase portrait, overlay."""
    load = rf"$\omega_\mathrm{{o}} = {OMEGA:g}$, {PERIODS} periods from rest"
    return fs.plot.panel(case.overlay, title=f"{case.setting.title}, {load}")
