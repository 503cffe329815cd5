"""Writing FMUs: one call, one file (or one for each version)."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, overload

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.display import Displayed
from mbsvib.common.expected import a_path, names
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.version import __version__
from mbsvib_export.fmu_.binaries import PLATFORMS, binaries
from mbsvib_export.fmu_.description import VERSIONS, description
from mbsvib_export.fmu_.matrices import matrices_file
from mbsvib_export.fmu_.names import identifier
from mbsvib_export.fmu_.plant import Plant, plant_of
from mbsvib_export.fmu_.variables import attributes, variables_of
from mbsvib_export.neutral import Source
from mbsvib_export.templates_ import check_companion

# Bytes of a description in which its attributes are looked for.
HEAD = 20_000


@dataclass(frozen=True, slots=True, repr=False)
class FmuFile(Displayed):
    """An FMU that was written: its path and version, its platforms, and the names of its variables.

    ``names`` leads from the names of mbsvib to those in the file, by kind: "input", "output", "parameter", "state".
    They are the same but where FMI allows no name twice: of an input and an output of one name the latter has another.
    """

    path: Path
    version: str
    platforms: tuple[str, ...]
    names: dict[str, dict[str, str]]

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    @property
    def other_platforms(self) -> tuple[str, ...]:
        """Platforms that the file has no binary for; ``to_fmu(..., platforms="all")`` adds them."""
        return tuple(name for name in PLATFORMS if name not in self.platforms)

    def __repr__(self) -> str:
        missing = f'; not for {", ".join(self.other_platforms)}: platforms="all"' if self.other_platforms else ""
        return f"FmuFile('{self.path}', FMI {self.version}, runs on {', '.join(self.platforms)}{missing})"

    def __str__(self) -> str:
        return str(self.path)


@overload
def to_fmu(
    system: Source, path: str | os.PathLike[str], version: str = ..., *, tunable: Sequence[str] = ...,
    realization: str = ..., platforms: Names = ..., outputs: Names = ..., inputs: Names = ...,
) -> FmuFile: ...  # fmt: skip


@overload
def to_fmu(
    system: Source, path: str | os.PathLike[str], version: tuple[str, ...] | list[str], *, tunable: Sequence[str] = ...,
    realization: str = ..., platforms: Names = ..., outputs: Names = ..., inputs: Names = ...,
) -> tuple[FmuFile, ...]: ...  # fmt: skip


def to_fmu(
    system: Source, path: str | os.PathLike[str], version: str | Sequence[str] = "3.0", *, tunable: Sequence[str] = (),
    realization: str = "physical", platforms: Names = None, outputs: Names = None, inputs: Names = None,
) -> FmuFile | tuple[FmuFile, ...]:  # fmt: skip
    """Write a system as a functional mock-up unit, for model exchange and co-simulation at once.

    x' = A x + B u,  y = C x + D u

    Co-simulation steps by the matrix exponential: exact for inputs that are held over a step, or linear in it (FMI 2.0:
    input derivatives; FMI 3.0: intermediate update), at any step size. Outputs follow inputs at once where D is not
    zero; most masters then see them one step late. Directional and adjoint derivatives are exact. Modal states make a
    large system quicker, 400 states ten times; physical ones have the units and names of coordinates.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, SystemData, control.StateSpace or control.TransferFunction
        The equations of motion, a state space that is ready, or a controller in continuous time.
    path : str or path
        The file, ``"plant.fmu"``. With several versions, ``"plant-fmi2.fmu"`` and ``"plant-fmi3.fmu"`` are written.
    version : str or sequence of str
        "2.0", "3.0" or both.
    tunable : sequence of str
        Parameters of a System that the importer may change between steps: stiffness, damping and mass, on which M, C
        and K depend affinely (``"leg1.k.stiffness"``, or a pattern, ``"leg*.k.stiffness"``). States are physical then.
    realization : str
        The states of a System: "physical" or "modal".
    platforms : str, sequence of str or None
        "x86_64-linux", "aarch64-linux", "x86_64-windows", "x86-windows", "x86_64-darwin", "aarch64-darwin" or "all".
        Default: this one, those that the wheel of mbsvib brought, and Linux and Windows of 64 bits where zig is
        installed. What is not there yet is compiled once and kept: for this platform by gcc or clang in a second, for
        others by zig (``pip install "mbsvib[fmu]"``) in one or two minutes the first time. The ``repr`` of the
        result says what is in the file.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    FmuFile, or a tuple of them for several versions
        Path, version, platforms, and the map of names.

    Raises
    ------
    ExportError
        If the file cannot be written, no compiler is there, a parameter is not affine, or the source is not a
        continuous system. Nothing is left half-written.
    ModelError
        If a parameter is unknown.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    listed = version if isinstance(version, (list, tuple)) else [version]
    versions = tuple(each for i, each in enumerate(listed) if each not in listed[:i])
    if not versions or not all(isinstance(each, str) and each in VERSIONS for each in versions):
        raise ExportError(f'to_fmu: version = {version!r}; expected "2.0", "3.0" or both, ("2.0", "3.0").')
    goal = a_path(path, "to_fmu", ExportError)
    if goal.suffix.lower() != ".fmu":
        raise ExportError(f"to_fmu: path = '{goal}'; expected a name that ends in .fmu, by which importers know it.")
    plant = plant_of(system, realization, tuple(names(tunable, "to_fmu", "tunable", ExportError)), outputs, inputs)
    libraries = binaries(platforms if platforms is None or isinstance(platforms, str) else
                         tuple(names(platforms, "to_fmu", "platforms", ExportError)))
    if isinstance(version, str):
        return _write(plant, goal, version, libraries)
    paths = [goal.with_name(f"{goal.stem}-fmi{fmi_version[0]}{goal.suffix}") for fmi_version in versions]
    for path in paths:
        check_companion(path, lambda file: _holds(file, plant.space.name), f"an FMU of '{plant.space.name}' by mbsvib",
                        "Move it, or take another name.")  # fmt: skip
    return tuple(_write(plant, path, fmi_version, libraries) for path, fmi_version in zip(paths, versions, strict=True))


def _write(plant: Plant, path: Path, version: str, libraries: dict[str, bytes]) -> FmuFile:
    variables, space = variables_of(plant), plant.space
    name = identifier(space.name)
    head = {
        "modelName": space.name or "system",
        "description": f"Linear system {space.name}, {len(space.states)} states ({space.realization})",
        "generationTool": f"mbsvib {__version__}",
    }
    content, token = matrices_file(plant, description(version, variables, head, name, ""))
    described = description(version, variables, head, name, token)

    def write(stream: IO[bytes]) -> None:
        with zipfile.ZipFile(stream, "w") as archive:
            _put(archive, "modelDescription.xml", described.encode())
            _put(archive, "resources/model.lti", content)
            for target, library in libraries.items():
                folder = target if version == "3.0" else PLATFORMS[target].folder_2
                _put(archive, f"binaries/{folder}/{name}{PLATFORMS[target].suffix}", library)

    return FmuFile(write_atomic(path, write), version, tuple(libraries), variables.names)


def _holds(path: Path, name: str) -> bool:
    """Whether a file is an FMU that mbsvib has written for a model of this name."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as stream:
            head = stream.read(HEAD).decode(errors="replace")
    except (KeyError, zipfile.BadZipFile):
        return False
    return 'generationTool="mbsvib ' in head and attributes(modelName=name or "system") in head


def _put(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """A member without the time of day: the same system gives the same file, bit for bit."""
    entry = zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0))
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content, zipfile.ZIP_DEFLATED, compresslevel=1)
