"""Systems of mbsvib for other tools, one function a target.

>>> import mbsvib_export as mx
>>> plant = mx.to_control(system)                          # doctest: +SKIP
>>> mx.to_npz(system, "isolator.npz")                      # doctest: +SKIP

A target whose package is not installed says at the first call what to install; the others work without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsvib_export.c_ import CFiles, to_c
    from mbsvib_export.casadi_ import CasadiModel, to_casadi, to_casadi_eigenvalues, to_casadi_response
    from mbsvib_export.checking import Comparison, ExportCheck, check_export
    from mbsvib_export.control_ import to_control, to_frd
    from mbsvib_export.control_space import NamedStateSpace
    from mbsvib_export.cosimulation import CosimulationCheck, MasterCheck, check_cosimulation, to_ssp
    from mbsvib_export.dmig_ import to_dmig
    from mbsvib_export.exudyn_ import to_exudyn
    from mbsvib_export.fmu_ import FmuFile, to_fmu
    from mbsvib_export.hdf5_ import from_hdf5, to_hdf5
    from mbsvib_export.json_ import from_json, json_schema, to_json
    from mbsvib_export.mat_ import from_mat, to_mat
    from mbsvib_export.modelica_ import to_modelica
    from mbsvib_export.names_ import SignalNames
    from mbsvib_export.naming import named, with_names
    from mbsvib_export.neutral import SystemData
    from mbsvib_export.npz_ import BatchData, from_npz, from_npz_batch, to_npz, to_npz_batch
    from mbsvib_export.op4_ import to_op4
    from mbsvib_export.scipy_ import to_scipy
    from mbsvib_export.synthesis_ import augw, h2syn, hinfsyn, mixsyn
    from mbsvib_export.transfer_ import to_transfer_function
    from mbsvib_export.uff_ import densities_from_uff, from_uff, records_from_uff, to_uff
    from mbsvib_export.xarray_ import to_xarray

__all__ = [
    "BatchData", "CFiles", "CasadiModel", "Comparison", "CosimulationCheck", "ExportCheck", "FmuFile", "MasterCheck",
    "NamedStateSpace", "SignalNames", "SystemData", "augw", "check_cosimulation", "check_export", "densities_from_uff",
    "from_hdf5", "from_json", "from_mat", "from_npz", "from_npz_batch", "from_uff", "h2syn", "hinfsyn", "json_schema",
    "mixsyn", "named", "records_from_uff", "to_c", "to_casadi", "to_casadi_eigenvalues", "to_casadi_response",
    "to_control", "to_dmig", "to_exudyn", "to_fmu", "to_frd", "to_hdf5", "to_json", "to_mat", "to_modelica", "to_npz",
    "to_npz_batch", "to_op4", "to_scipy", "to_ssp", "to_transfer_function", "to_uff", "to_xarray", "with_names",
]  # fmt: skip
__dir__ = __all__.copy

# The names of each file, which is imported when one of them is asked for.
_NAMES = {
    "c_": "CFiles to_c", "casadi_": "CasadiModel to_casadi to_casadi_eigenvalues to_casadi_response",
    "checking": "check_export Comparison ExportCheck", "control_": "to_control to_frd",
    "control_space": "NamedStateSpace", "cosimulation": "check_cosimulation CosimulationCheck MasterCheck to_ssp",
    "dmig_": "to_dmig", "exudyn_": "to_exudyn", "fmu_": "FmuFile to_fmu", "hdf5_": "from_hdf5 to_hdf5",
    "json_": "from_json json_schema to_json", "mat_": "from_mat to_mat", "modelica_": "to_modelica",
    "names_": "SignalNames", "naming": "named with_names", "neutral": "SystemData",
    "npz_": "BatchData from_npz to_npz from_npz_batch to_npz_batch", "op4_": "to_op4", "scipy_": "to_scipy",
    "synthesis_": "augw h2syn hinfsyn mixsyn", "transfer_": "to_transfer_function",
    "uff_": "densities_from_uff from_uff records_from_uff to_uff", "xarray_": "to_xarray",
}  # fmt: skip
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    """Import a target's module on first use."""
    from importlib import import_module

    if name not in _HOMES:
        from mbsvib.common.misplaced import absent

        raise absent(__name__, name)
    value = getattr(import_module(f"mbsvib_export.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
