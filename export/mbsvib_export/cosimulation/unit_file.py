"""FMUs as files: their signals and capabilities."""

from __future__ import annotations

import os
import zipfile
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mbsvib.common.expected import a_path
from mbsvib.errors import ExportError
from mbsvib_export.fmu_.reading import description_of
from mbsvib_export.packages import need

if TYPE_CHECKING:
    from collections.abc import Iterator


_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")


@dataclass(frozen=True, slots=True)
class Signal:
    """A scalar of an FMU: its name in mbsvib, its value reference, and its unit, also in SI base units."""

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

    @property
    def hides_states(self) -> bool:
        """Whether it may have states that it does not list, as units for co-simulation only may."""
        return self.description.modelExchange is None and not self.states


@contextmanager
def open_unit(path: str | os.PathLike[str], caller: str) -> Iterator[UnitFile]:
    """Unpack an FMU for the time of a with statement."""
    fmpy = need("fmpy", caller, "mbsvib[fmu]")
    file = a_path(path, caller, ExportError)
    with TemporaryDirectory(prefix="mbsvib-", ignore_cleanup_errors=True) as folder:
        try:
            description_of(file)
            description = fmpy.read_model_description(str(file))
            platforms = fmpy.supported_platforms(str(file))
            fmpy.extract(str(file), folder)
        except ExportError:
            raise
        except (zipfile.BadZipFile, KeyError, EOFError) as error:
            raise ExportError(f"{file}: is not an archive with a modelDescription.xml in it, or is damaged ({error}); "
                              f"export it again.") from error  # fmt: skip
        except Exception as error:  # fmpy raises its own and those of zlib and of XML, without a common root
            raise ExportError(f"{file}: cannot be read as an FMU: {error}. Export it again.") from error
        if not str(description.fmiVersion).startswith(("2.", "3.")):
            raise ExportError(f"{file}: is an FMU of FMI {description.fmiVersion}; expected 2.0 or 3.0.")
        if fmpy.platform not in platforms:
            raise ExportError(f"{file}: holds no binary for {fmpy.platform}, but for {', '.join(platforms) or 'none'}; "
                              f'export it on this platform, or for it: to_fmu(..., platforms="all").')  # fmt: skip
        yield _described(file, folder, description)


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
