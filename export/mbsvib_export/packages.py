"""Packages that one target needs and the others do not: imported at the first use, and asked for by name."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from mbsvib.errors import ExportError


def need(package: str, caller: str, install: str) -> Any:
    """Import a package that an exporter requires, by its import name, such as ``"scipy.signal"``.

    ``install``: what pip is told to install: a requirement, or an extra such as ``"mbsvib[casadi]"``.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package.split(".")[0]:  # the package is there; something it needs itself is not
            raise
        raise ExportError(
            f'{caller}: the package {error.name} is not installed; install it with:  pip install "{install}"'
        ) from error
