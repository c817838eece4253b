"""Bifurcation and fast-slow analysis of piecewise-smooth ODEs, written once in SymPy.

Names are imported when first used, so that ``import fastslow`` is as quick as
``import numpy``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastslow import plot, systems
    from fastslow.analysing import Analysis, analyse
    from fastslow.certification.certifying import certify
    from fastslow.certification.points.points import prove
    from fastslow.certification.settings import Certification
    from fastslow.continuation.settings import Continuation
    from fastslow.diagrams.curves.point_curves import continue_points
    from fastslow.diagrams.curves.tangency_points import tangencies
    from fastslow.diagrams.solve.solving import equilibria
    from fastslow.diagrams.trace.tracing import continue_equilibria
    from fastslow.errors import (
        ArgumentError,
        FastSlowError,
        FileError,
        IncompleteWarning,
        MissingPackageError,
        ModelError,
        OutOfRangeError,
        UnknownNameError,
    )
    from fastslow.exporters.formats import export
    from fastslow.interactive.explorers import explore
    from fastslow.interactive.pointers import pick
    from fastslow.model.events import Event
    from fastslow.model.model import Model
    from fastslow.model.tabulated import Tabulated
    from fastslow.orbits.canards.funnels import find_canards
    from fastslow.orbits.canards.maximal_canards import find_canard
    from fastslow.orbits.canards.singular_cycles import singular_cycle
    from fastslow.orbits.derivatives.exponents import lyapunov
    from fastslow.orbits.find.finding import find_orbit
    from fastslow.orbits.trace.branches import continue_orbits
    from fastslow.orbits.trace.frozen_branches import continue_cycles
    from fastslow.passage.delays.predicting import predict_delay
    from fastslow.passage.delays.scaling_runs import delay_scaling
    from fastslow.passage.overlay.overlays import overlay
    from fastslow.passage.regimes import classify_regime, regime_map
    from fastslow.passage.tipping.critical_rates import critical_rate
    from fastslow.passage.tipping.departures import beyond_fold
    from fastslow.passage.tipping.edge_tracking import edge_state
    from fastslow.passage.tipping.shocks import minimal_shock
    from fastslow.passage.tipping.tipping_maps import basin_instability, tipping_map
    from fastslow.precompilation import precompile
    from fastslow.readers.model_files import ModelFile, ParameterSet
    from fastslow.readers.ode_files import read_ode
    from fastslow.readers.paths import read
    from fastslow.readers.sbml_files import read_sbml
    from fastslow.results.branch.branch import Branch
    from fastslow.results.branch.diagram import Diagram
    from fastslow.results.branch.point_branch import PointBranch, PointCurves
    from fastslow.results.certificates import Certificate, ProvedCurve
    from fastslow.results.edge_states import EdgeState
    from fastslow.results.enclosures import Enclosure
    from fastslow.results.fold_departures import BeyondFold
    from fastslow.results.io.auto_files import read_auto
    from fastslow.results.io.files import load
    from fastslow.results.maps.adaptive_map import RefinedMap
    from fastslow.results.maps.grid import Grid
    from fastslow.results.maps.sobol_indices import SobolIndices
    from fastslow.results.orbits.attractors import Attractors
    from fastslow.results.orbits.basin_fractions import BasinFractions
    from fastslow.results.orbits.canard import Canard
    from fastslow.results.orbits.folded_canards import Canards
    from fastslow.results.orbits.orbit import Orbit
    from fastslow.results.orbits.orbit_branch import OrbitBranch
    from fastslow.results.orbits.singular import SingularCycle
    from fastslow.results.overlay.delay_scaling import DelayScaling
    from fastslow.results.overlay.delays import (
        BoundaryDelay,
        BranchPointExit,
        Delay,
        FoldDelay,
        GapCrossing,
        HopfExit,
    )
    from fastslow.results.overlay.drifts import Drift
    from fastslow.results.overlay.overlay import Overlay
    from fastslow.results.points import Equilibrium, SpecialPoint
    from fastslow.results.shocks import MinimalShock, Shock
    from fastslow.results.threshold_curves import ThresholdCurve
    from fastslow.results.tipping import CriticalRate, RateThreshold
    from fastslow.results.trajectory.ensemble import Ensemble
    from fastslow.results.trajectory.long_time.lyapunov_exponents import LyapunovExponents
    from fastslow.results.trajectory.long_time.periodicity import Periodicity
    from fastslow.results.trajectory.long_time.regimes import Regimes, RegimeSet
    from fastslow.results.trajectory.long_time.section import Section
    from fastslow.results.trajectory.long_time.spectrum import Spectrum
    from fastslow.results.trajectory.long_time.sweep import BifurcationSweep
    from fastslow.results.trajectory.sensitivity import Sensitivity
    from fastslow.results.trajectory.trajectory import Trajectory
    from fastslow.simulation.many import simulate_many
    from fastslow.simulation.one import simulate
    from fastslow.simulation.settings import Execution, Integration, Observation
    from fastslow.simulation.sweep import bifurcation_sweep
    from fastslow.sweeps.attraction import attractors
    from fastslow.sweeps.basin_maps import basins
    from fastslow.sweeps.grid_sweep import sweep
    from fastslow.sweeps.refinement import refined_map
    from fastslow.sweeps.settings import Refinement
    from fastslow.sweeps.variance_shares import sobol
    from fastslow.symbolic.derivation import Derivation
    from fastslow.symbolic.deriving import derive
    from fastslow.symbolic.reduction import reduce_states
    from fastslow.symbolic.scaling import compare_scalings, nondimensionalise
    from fastslow.symbolic.slow_flows import SlowFlow, slow_flow

__version__ = "0.1.0"

_HOME = {
    "Analysis": "analysing",
    "ArgumentError": "errors",
    "Attractors": "results.orbits.attractors",
    "BasinFractions": "results.orbits.basin_fractions",
    "BoundaryDelay": "results.overlay.delays",
    "Branch": "results.branch.branch",
    "BranchPointExit": "results.overlay.delays",
    "Canard": "results.orbits.canard",
    "Canards": "results.orbits.folded_canards",
    "Certificate": "results.certificates",
    "Certification": "certification.settings",
    "Continuation": "continuation.settings",
    "CriticalRate": "results.tipping",
    "Delay": "results.overlay.delays",
    "DelayScaling": "results.overlay.delay_scaling",
    "Derivation": "symbolic.derivation",
    "Diagram": "results.branch.diagram",
    "Drift": "results.overlay.drifts",
    "EdgeState": "results.edge_states",
    "BeyondFold": "results.fold_departures",
    "Ensemble": "results.trajectory.ensemble",
    "Enclosure": "results.enclosures",
    "Equilibrium": "results.points",
    "Event": "model.events",
    "Execution": "simulation.settings",
    "FastSlowError": "errors",
    "FileError": "errors",
    "FoldDelay": "results.overlay.delays",
    "GapCrossing": "results.overlay.delays",
    "Grid": "results.maps.grid",
    "HopfExit": "results.overlay.delays",
    "Integration": "simulation.settings",
    "IncompleteWarning": "errors",
    "LyapunovExponents": "results.trajectory.long_time.lyapunov_exponents",
    "MinimalShock": "results.shocks",
    "MissingPackageError": "errors",
    "Model": "model.model",
    "ModelError": "errors",
    "ModelFile": "readers.model_files",
    "OutOfRangeError": "errors",
    "Observation": "simulation.settings",
    "Orbit": "results.orbits.orbit",
    "OrbitBranch": "results.orbits.orbit_branch",
    "Overlay": "results.overlay.overlay",
    "PointBranch": "results.branch.point_branch",
    "PointCurves": "results.branch.point_branch",
    "ProvedCurve": "results.certificates",
    "RefinedMap": "results.maps.adaptive_map",
    "RateThreshold": "results.tipping",
    "Refinement": "sweeps.settings",
    "RegimeSet": "results.trajectory.long_time.regimes",
    "Regimes": "results.trajectory.long_time.regimes",
    "Section": "results.trajectory.long_time.section",
    "Sensitivity": "results.trajectory.sensitivity",
    "Shock": "results.shocks",
    "SingularCycle": "results.orbits.singular",
    "SlowFlow": "symbolic.slow_flows",
    "SobolIndices": "results.maps.sobol_indices",
    "SpecialPoint": "results.points",
    "Spectrum": "results.trajectory.long_time.spectrum",
    "ParameterSet": "readers.model_files",
    "Periodicity": "results.trajectory.long_time.periodicity",
    "BifurcationSweep": "results.trajectory.long_time.sweep",
    "Tabulated": "model.tabulated",
    "ThresholdCurve": "results.threshold_curves",
    "Trajectory": "results.trajectory.trajectory",
    "UnknownNameError": "errors",
    "analyse": "analysing",
    "attractors": "sweeps.attraction",
    "basin_instability": "passage.tipping.tipping_maps",
    "basins": "sweeps.basin_maps",
    "bifurcation_sweep": "simulation.sweep",
    "certify": "certification.certifying",
    "classify_regime": "passage.regimes",
    "continue_cycles": "orbits.trace.frozen_branches",
    "continue_orbits": "orbits.trace.branches",
    "continue_equilibria": "diagrams.trace.tracing",
    "continue_points": "diagrams.curves.point_curves",
    "critical_rate": "passage.tipping.critical_rates",
    "delay_scaling": "passage.delays.scaling_runs",
    "derive": "symbolic.deriving",
    "compare_scalings": "symbolic.scaling",
    "edge_state": "passage.tipping.edge_tracking",
    "beyond_fold": "passage.tipping.departures",
    "equilibria": "diagrams.solve.solving",
    "explore": "interactive.explorers",
    "export": "exporters.formats",
    "find_canard": "orbits.canards.maximal_canards",
    "find_canards": "orbits.canards.funnels",
    "find_orbit": "orbits.find.finding",
    "pick": "interactive.pointers",
    "load": "results.io.files",
    "lyapunov": "orbits.derivatives.exponents",
    "minimal_shock": "passage.tipping.shocks",
    "nondimensionalise": "symbolic.scaling",
    "overlay": "passage.overlay.overlays",
    "plot": "",
    "precompile": "precompilation",
    "predict_delay": "passage.delays.predicting",
    "prove": "certification.points.points",
    "read": "readers.paths",
    "read_auto": "results.io.auto_files",
    "read_ode": "readers.ode_files",
    "read_sbml": "readers.sbml_files",
    "reduce_states": "symbolic.reduction",
    "refined_map": "sweeps.refinement",
    "regime_map": "passage.regimes",
    "simulate": "simulation.one",
    "simulate_many": "simulation.many",
    "singular_cycle": "orbits.canards.singular_cycles",
    "slow_flow": "symbolic.slow_flows",
    "sobol": "sweeps.variance_shares",
    "sweep": "sweeps.grid_sweep",
    "systems": "",
    "tangencies": "diagrams.curves.tangency_points",
    "tipping_map": "passage.tipping.tipping_maps",
}

__all__ = [
    "Analysis",
    "ArgumentError",
    "Attractors",
    "BasinFractions",
    "BeyondFold",
    "BifurcationSweep",
    "BoundaryDelay",
    "Branch",
    "BranchPointExit",
    "Canard",
    "Canards",
    "Certificate",
    "Certification",
    "Continuation",
    "CriticalRate",
    "Delay",
    "DelayScaling",
    "Derivation",
    "Diagram",
    "Drift",
    "EdgeState",
    "Enclosure",
    "Ensemble",
    "Equilibrium",
    "Event",
    "Execution",
    "FastSlowError",
    "FileError",
    "FoldDelay",
    "GapCrossing",
    "Grid",
    "HopfExit",
    "IncompleteWarning",
    "Integration",
    "LyapunovExponents",
    "MinimalShock",
    "MissingPackageError",
    "Model",
    "ModelError",
    "ModelFile",
    "Observation",
    "Orbit",
    "OrbitBranch",
    "OutOfRangeError",
    "Overlay",
    "ParameterSet",
    "Periodicity",
    "PointBranch",
    "PointCurves",
    "ProvedCurve",
    "RateThreshold",
    "RefinedMap",
    "Refinement",
    "RegimeSet",
    "Regimes",
    "Section",
    "Sensitivity",
    "Shock",
    "SingularCycle",
    "SlowFlow",
    "SobolIndices",
    "SpecialPoint",
    "Spectrum",
    "Tabulated",
    "ThresholdCurve",
    "Trajectory",
    "UnknownNameError",
    "__version__",
    "analyse",
    "attractors",
    "basin_instability",
    "basins",
    "beyond_fold",
    "bifurcation_sweep",
    "certify",
    "classify_regime",
    "compare_scalings",
    "continue_cycles",
    "continue_equilibria",
    "continue_orbits",
    "continue_points",
    "critical_rate",
    "delay_scaling",
    "derive",
    "edge_state",
    "equilibria",
    "explore",
    "export",
    "find_canard",
    "find_canards",
    "find_orbit",
    "load",
    "lyapunov",
    "minimal_shock",
    "nondimensionalise",
    "overlay",
    "pick",
    "plot",
    "precompile",
    "predict_delay",
    "prove",
    "read",
    "read_auto",
    "read_ode",
    "read_sbml",
    "reduce_states",
    "refined_map",
    "regime_map",
    "simulate",
    "simulate_many",
    "singular_cycle",
    "slow_flow",
    "sobol",
    "sweep",
    "systems",
    "tangencies",
    "tipping_map",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        from fastslow.errors import unknown_name

        # the machinery of import and copying probes for names such as __path__
        if name.startswith("__"):
            raise AttributeError(f"module 'fastslow' has no attribute '{name}'")
        raise AttributeError(f"module 'fastslow': {unknown_name('name', name, __all__)}")
    home = _HOME[name]
    module = import_module(f"fastslow.{home or name}")
    value = getattr(module, name) if home else module
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
