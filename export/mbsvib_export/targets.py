"""The table of targets that are files: suffixes, contents, and the functions that write and read them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any


@dataclass(frozen=True, slots=True)
class Target:
    """Files with some ``suffixes``, the usual one first, and their ``contents`` in words; the names of the functions of
    this package that write and read them; the ``options`` that ``writes`` has beside ports.

    ``checked``: what of a file is compared with a system, "equations", "responses", "matrices" or "unit"; "" if
    nothing.
    """

    suffixes: tuple[str, ...]
    contents: str
    writes: str
    reads: str = ""
    options: tuple[str, ...] = ()
    checked: str = ""

    def write(self, *args: Any, **kwargs: Any) -> Any:
        """Call the function that writes such files."""
        return getattr(import_module("mbsvib_export"), self.writes)(*args, **kwargs)

    def read(self, path: Any) -> Any:
        """Call the function that reads such files."""
        return getattr(import_module("mbsvib_export"), self.reads)(path)


_STATES = ("realization",)
TARGETS = (
    Target((".json",), "the linear system with names and units as JSON", "to_json", "from_json", _STATES, "equations"),
    Target((".npz",), "the linear system with names and units as numpy arrays", "to_npz", "from_npz", _STATES,
           "equations"),
    Target((".mat",), "the linear system for MATLAB and Octave, and a script that loads it", "to_mat", "from_mat",
           _STATES, "equations"),
    Target((".h5", ".hdf5"), "the linear system with names and units as HDF5", "to_hdf5", "from_hdf5", _STATES,
           "equations"),
    Target((".uff", ".unv"), "frequency responses and geometry as universal file", "to_uff", "from_uff",
           checked="responses"),
    Target((".op4",), "M, C, K and the other matrices for Nastran", "to_op4", checked="matrices"),
    Target((".pch",), "M, C, K as DMIG cards for Nastran", "to_dmig", checked="matrices"),
    Target((".fmu",), "an FMU, for model exchange and co-simulation", "to_fmu",
           options=("realization", "version", "platforms", "tunable"), checked="unit"),
    Target((".mo",), "the state space as a model in Modelica", "to_modelica", options=_STATES),
    Target((".c",), "the discrete-time state space as C source, with header and test program beside it", "to_c",
           options=("realization", "step", "method")),
)  # fmt: skip
BY_SUFFIX = {suffix: target for target in TARGETS for suffix in target.suffixes}
