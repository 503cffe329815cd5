"""mbsvib: from a multibody description to named, minimal state-space systems."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mbsvib.errors import (
    AccuracyWarning,
    EquilibriumError,
    ExportError,
    LargeDisplacementWarning,
    LeftOutWarning,
    MbsvibError,
    ModelError,
    NearSingularWarning,
    OutsideTableWarning,
    ResponseError,
    SimulationError,
    SingularPoseError,
    UndeterminedForceWarning,
    UnstableWarning,
)
from mbsvib.version import __version__

if TYPE_CHECKING:
    from mbsvib import isolation, library, plots, report, studies
    from mbsvib.api.assembling import assemble
    from mbsvib.api.linearize import linearize
    from mbsvib.api.model import Model
    from mbsvib.api.modes import Modes
    from mbsvib.api.run import Run
    from mbsvib.api.state_space import StateSpace
    from mbsvib.api.system import System
    from mbsvib.certificate import certify
    from mbsvib.elements.dynamic import Dynamic
    from mbsvib.files import load, save
    from mbsvib.library import from_dh
    from mbsvib.measurement.comparing import compare
    from mbsvib.measurement.data import Measurement
    from mbsvib.measurement.modes import MeasuredModes
    from mbsvib.measurement.records import Records
    from mbsvib.mjcf import load_mjcf
    from mbsvib.modes.disparity import modal_disparity
    from mbsvib.studies import optimize, sweep, tolerances, track
    from mbsvib.tuning import goals, tunable, tune
    from mbsvib.urdf import load_urdf, save_urdf

__all__ = [
    "AccuracyWarning",
    "Dynamic",
    "EquilibriumError",
    "ExportError",
    "LargeDisplacementWarning",
    "LeftOutWarning",
    "MbsvibError",
    "MeasuredModes",
    "Measurement",
    "Model",
    "ModelError",
    "Modes",
    "NearSingularWarning",
    "OutsideTableWarning",
    "Records",
    "ResponseError",
    "Run",
    "SimulationError",
    "SingularPoseError",
    "StateSpace",
    "System",
    "UndeterminedForceWarning",
    "UnstableWarning",
    "__version__",
    "assemble",
    "certify",
    "compare",
    "from_dh",
    "goals",
    "isolation",
    "library",
    "linearize",
    "load",
    "load_mjcf",
    "load_urdf",
    "modal_disparity",
    "optimize",
    "plots",
    "report",
    "save",
    "save_urdf",
    "studies",
    "sweep",
    "tolerances",
    "track",
    "tunable",
    "tune",
]
__dir__ = __all__.copy

_HOMES = {
    "Dynamic": "mbsvib.elements.dynamic",
    "MeasuredModes": "mbsvib.measurement.modes",
    "Measurement": "mbsvib.measurement.data",
    "Model": "mbsvib.api.model",
    "Modes": "mbsvib.api.modes",
    "Records": "mbsvib.measurement.records",
    "Run": "mbsvib.api.run",
    "StateSpace": "mbsvib.api.state_space",
    "System": "mbsvib.api.system",
    "assemble": "mbsvib.api.assembling",
    "certify": "mbsvib.certificate.certifying",
    "compare": "mbsvib.measurement.comparing",
    "from_dh": "mbsvib.library",
    "goals": "mbsvib.tuning",
    "isolation": "mbsvib.isolation",
    "library": "mbsvib.library",
    "plots": "mbsvib.plots",
    "linearize": "mbsvib.api.linearize",
    "load": "mbsvib.files",
    "load_mjcf": "mbsvib.mjcf",
    "load_urdf": "mbsvib.urdf",
    "modal_disparity": "mbsvib.modes.disparity",
    "optimize": "mbsvib.studies",
    "report": "mbsvib.report",
    "save": "mbsvib.files",
    "save_urdf": "mbsvib.urdf",
    "studies": "mbsvib.studies",
    "sweep": "mbsvib.studies",
    "tolerances": "mbsvib.studies",
    "track": "mbsvib.studies",
    "tunable": "mbsvib.tuning",
    "tune": "mbsvib.tuning",
}


def __getattr__(name: str) -> Any:
    """Import public names on first use, so that ``import mbsvib`` stays quick."""
    from importlib import import_module

    if name not in _HOMES:
        from mbsvib.common.misplaced import absent

        raise absent(__name__, name)
    home = import_module(_HOMES[name])
    value = home if home.__name__ == f"mbsvib.{name}" else getattr(home, name)
    globals()[name] = value
    return value
