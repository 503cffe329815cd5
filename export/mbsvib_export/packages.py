"""Packages that one target needs and the others do not: imported at the first use, and asked for by name."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from mbsvib.errors import ExportError

# What pip is told to install for each: a requirement, or an extra of mbsvib.
INSTALL = {"control": "control>=0.10.1", "h5py": "mbsvib[hdf5]", "exudyn": "exudyn>=1.13", "fmpy": "mbsvib[fmu]",
           "casadi": "mbsvib[casadi]"}  # fmt: skip


def need(package: str, caller: str) -> Any:
    """Import a package of ``INSTALL`` that an exporter requires."""
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:  # the package is there; something it needs itself is not
            raise
        raise ExportError(
            f'{caller}: the package {package} is not installed; install it with:  pip install "{INSTALL[package]}"'
        ) from error
