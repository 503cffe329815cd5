"""FMUs as files: their signals and capabilities."""

from __future__ import annotations

import os
import re
import zipfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mbsvib.common.expected import a_path
from mbsvib.errors import ExportError
from mbsvib_export.packages import need

if TYPE_CHECKING:
    from collections.abc import Iterator


# FMUs are refused beyond: their sources, binaries of six platforms and matrices take a few megabytes.
MOST_ENTRIES, LARGEST = 10_000, 1_000_000_000
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")
_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")


@dataclass(frozen=True, slots=True)
class Signal:
    """A scalar of an FMU: its name in mbsvib, its value reference, its unit with what that is in SI base units."""

    name: str
    reference: int
    unit: str
    base: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class UnitFile:
    """An unpacked FMU: data of its description, and data for making instances."""

    path: Path
    folder: str
    description: Any
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...]
    rates: tuple[int, ...]

    @property
    def name(self) -> str:
        """Name of the FMU."""
        return str(self.description.modelName)

    @property
    def new(self) -> bool:
        """Whether it is one of FMI 3."""
        return str(self.description.fmiVersion).startswith("3")


@contextmanager
def open_unit(path: str | os.PathLike[str], caller: str) -> Iterator[UnitFile]:
    """Unpack an FMU for the time of a with statement.

    Parameters
    ----------
    path : str or path
        The file.
    caller : str
        Name of the public function that needs it.

    Returns
    -------
    iterator of UnitFile
        One: signals and description.

    Raises
    ------
    ExportError
        If fmpy is not installed, or the file is none that it can read or this platform can run.
    """
    fmpy = need("fmpy", caller, "mbsvib[fmu]")
    file = a_path(path, caller, ExportError)
    with TemporaryDirectory(prefix="mbsvib-", ignore_cleanup_errors=True) as folder:
        try:
            _check_archive(file)
            description = fmpy.read_model_description(str(file))
            platforms = fmpy.supported_platforms(str(file))
            fmpy.extract(str(file), folder)
        except FileNotFoundError as error:
            raise ExportError(f"{file}: there is no such file.") from error
        except ExportError:
            raise
        except (zipfile.BadZipFile, KeyError, EOFError) as error:
            raise ExportError(f"{file}: is not an archive with a modelDescription.xml in it, or is damaged ({error}); "
                              f"export it again.") from error  # fmt: skip
        except Exception as error:  # fmpy raises its own and those of zlib and of XML, without a common root
            raise ExportError(f"{file}: cannot be read as an FMU: {error}. Export it again.") from error
        if not str(description.fmiVersion).startswith(("2.", "3.")):
            raise ExportError(f"{file}: is an FMU of FMI {description.fmiVersion}; expected 2.0 or 3.0.")
        for kind in (description.modelExchange, description.coSimulation):
            # the name of the binary is made of it: a path would load a library from outside of the archive
            if kind is not None and not _IDENTIFIER.fullmatch(str(kind.modelIdentifier)):
                raise ExportError(f"{file}: modelIdentifier = {str(kind.modelIdentifier)!r}; expected the name of a C "
                                  f"function, of letters, digits and underscores. Nothing of it was run.")  # fmt: skip
        if fmpy.platform not in platforms:
            raise ExportError(f"{file}: holds no binary for {fmpy.platform}, but for {', '.join(platforms) or 'none'}; "
                              f'export it on this platform, or for it: to_fmu(..., platforms="all").')  # fmt: skip
        yield _described(file, folder, description)


def _check_archive(file: Path) -> None:
    """Refuse an archive that would fill memory or disk, before anything is unpacked."""
    with zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
    size = sum(entry.file_size for entry in entries)
    if len(entries) > MOST_ENTRIES or size > LARGEST:
        raise ExportError(f"{file}: holds {len(entries)} files of {size / 1e9:.3g} GB together; expected at most "
                          f"{MOST_ENTRIES} files of {LARGEST / 1e9:.3g} GB, as an FMU has. Nothing was unpacked.")


def _described(file: Path, folder: str, description: Any) -> UnitFile:
    units = {item.name: item.baseUnit for item in description.unitDefinitions}

    def signal(variable: Any, name: str) -> Signal:
        if variable.type not in ("Real", "Float64") or variable.dimensions:
            raise ExportError(f"{file}: '{variable.name}' is of type {variable.type}; expected scalars of type Real or "
                              f"Float64 only.")  # fmt: skip
        base = units.get(variable.unit)
        numbers = None if base is None else tuple(float(getattr(base, key)) for key in _BASE)
        return Signal(name, int(variable.valueReference), variable.unit or "", numbers)

    inputs = [item for item in description.modelVariables if item.causality == "input"]
    names = {item.name for item in inputs}

    def plain(name: str) -> str:
        """The name that the export changed where an input has the same one."""
        short = name.removesuffix(" (output)")
        return short if short in names else name

    rates = [item.variable for item in description.derivatives]
    return UnitFile(
        file, folder, description, tuple(signal(item, item.name) for item in inputs),
        tuple(signal(item, plain(item.name)) for item in description.modelVariables if item.causality == "output"),
        tuple(signal(item.derivative, item.derivative.name) for item in rates),
        tuple(int(item.valueReference) for item in rates),
    )  # fmt: skip
