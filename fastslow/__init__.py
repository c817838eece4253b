"""Bifurcation and fast-slow analysis of piecewise-smooth ODEs, written once in SymPy.

Names are imported when first used, so that ``import fastslow`` is as quick as
``import numpy``.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fastslow import plot, systems
    from fastslow.continuation.settings import Continuation
    from fastslow.diagrams.point_curves import continue_points
    from fastslow.diagrams.solving import equilibria
    from fastslow.diagrams.tangency_points import tangencies
    from fastslow.diagrams.tracing import continue_equilibria
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
    from fastslow.interactive.explorers import explore
    from fastslow.interactive.pointers import inspect
    from fastslow.model.model import Model
    from fastslow.passage.delay_laws import predict_delay
    from fastslow.passage.hopf_delays import hopf_exit
    from fastslow.passage.overlays import overlay
    from fastslow.passage.regimes import classify_regime, regime_map
    from fastslow.passage.scaling_runs import delay_scaling
    from fastslow.passage.slow_loads import slow_load_criterion, slow_load_gap
    from fastslow.precompilation import precompile
    from fastslow.results.auto_files import read_auto
    from fastslow.results.branches import Branch
    from fastslow.results.delay_scalings import DelayScaling
    from fastslow.results.diagrams import Diagram
    from fastslow.results.drifts import Drift
    from fastslow.results.ensembles import Ensemble
    from fastslow.results.files import load
    from fastslow.results.lyapunov import LyapunovExponent
    from fastslow.results.overlays import Overlay
    from fastslow.results.point_branches import PointBranch, PointCurves
    from fastslow.results.points import Equilibrium, SpecialPoint
    from fastslow.results.refined_maps import RefinedMap
    from fastslow.results.regimes import Regimes, RegimeSet
    from fastslow.results.sections import Section
    from fastslow.results.slow_loads import SlowLoad
    from fastslow.results.spectra import Spectrum
    from fastslow.results.steady import SteadyState
    from fastslow.results.sweeps import Sweep
    from fastslow.results.trajectories import Trajectory
    from fastslow.simulation.ensembles import simulate_many
    from fastslow.simulation.separations import lyapunov_exponent
    from fastslow.simulation.settings import Integration
    from fastslow.simulation.sweeping import bifurcation_sweep
    from fastslow.simulation.trajectories import simulate
    from fastslow.sweeps.refinement import refined_map
    from fastslow.symbolic.derivation import Derivation, derive
    from fastslow.symbolic.reduction import reduce_states
    from fastslow.symbolic.scaling import disagreements, nondimensionalise
    from fastslow.symbolic.sources import export

__version__ = "0.1.0"

_HOME = {
    "ArgumentError": "errors",
    "Branch": "results.branches",
    "Continuation": "continuation.settings",
    "DelayScaling": "results.delay_scalings",
    "Derivation": "symbolic.derivation",
    "Diagram": "results.diagrams",
    "Drift": "results.drifts",
    "Ensemble": "results.ensembles",
    "Equilibrium": "results.points",
    "FastSlowError": "errors",
    "FileError": "errors",
    "Integration": "simulation.settings",
    "IncompleteWarning": "errors",
    "LyapunovExponent": "results.lyapunov",
    "MissingPackageError": "errors",
    "Model": "model.model",
    "ModelError": "errors",
    "OutOfRangeError": "errors",
    "Overlay": "results.overlays",
    "PointBranch": "results.point_branches",
    "PointCurves": "results.point_branches",
    "RefinedMap": "results.refined_maps",
    "RegimeSet": "results.regimes",
    "Regimes": "results.regimes",
    "Section": "results.sections",
    "SlowLoad": "results.slow_loads",
    "SpecialPoint": "results.points",
    "Spectrum": "results.spectra",
    "SteadyState": "results.steady",
    "Sweep": "results.sweeps",
    "Trajectory": "results.trajectories",
    "UnknownNameError": "errors",
    "bifurcation_sweep": "simulation.sweeping",
    "classify_regime": "passage.regimes",
    "continue_equilibria": "diagrams.tracing",
    "continue_points": "diagrams.point_curves",
    "delay_scaling": "passage.scaling_runs",
    "derive": "symbolic.derivation",
    "disagreements": "symbolic.scaling",
    "equilibria": "diagrams.solving",
    "explore": "interactive.explorers",
    "export": "symbolic.sources",
    "hopf_exit": "passage.hopf_delays",
    "inspect": "interactive.pointers",
    "load": "results.files",
    "lyapunov_exponent": "simulation.separations",
    "nondimensionalise": "symbolic.scaling",
    "overlay": "passage.overlays",
    "plot": "",
    "precompile": "precompilation",
    "predict_delay": "passage.delay_laws",
    "read_auto": "results.auto_files",
    "reduce_states": "symbolic.reduction",
    "refined_map": "sweeps.refinement",
    "regime_map": "passage.regimes",
    "simulate": "simulation.trajectories",
    "simulate_many": "simulation.ensembles",
    "slow_load_criterion": "passage.slow_loads",
    "slow_load_gap": "passage.slow_loads",
    "systems": "",
    "tangencies": "diagrams.tangency_points",
}

__all__ = [
    "ArgumentError",
    "Branch",
    "Continuation",
    "DelayScaling",
    "Derivation",
    "Diagram",
    "Drift",
    "Ensemble",
    "Equilibrium",
    "FastSlowError",
    "FileError",
    "IncompleteWarning",
    "Integration",
    "LyapunovExponent",
    "MissingPackageError",
    "Model",
    "ModelError",
    "OutOfRangeError",
    "Overlay",
    "PointBranch",
    "PointCurves",
    "RefinedMap",
    "RegimeSet",
    "Regimes",
    "Section",
    "SlowLoad",
    "SpecialPoint",
    "Spectrum",
    "SteadyState",
    "Sweep",
    "Trajectory",
    "UnknownNameError",
    "__version__",
    "bifurcation_sweep",
    "classify_regime",
    "continue_equilibria",
    "continue_points",
    "delay_scaling",
    "derive",
    "disagreements",
    "equilibria",
    "explore",
    "export",
    "hopf_exit",
    "inspect",
    "load",
    "lyapunov_exponent",
    "nondimensionalise",
    "overlay",
    "plot",
    "precompile",
    "predict_delay",
    "read_auto",
    "reduce_states",
    "refined_map",
    "regime_map",
    "simulate",
    "simulate_many",
    "slow_load_criterion",
    "slow_load_gap",
    "systems",
    "tangencies",
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
    return sorted({*globals(), *__all__})
