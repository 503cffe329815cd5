"""MATLAB's .mat, for ``ss`` and ``mechss``, and a script beside it that rebuilds the named objects and checks them.

    A B C D E Ts                             x' = A x + B u, y = C x + D u;  E empty: identity;  Ts 0: continuous
    Name InputName InputUnit OutputName OutputUnit StateName StateUnit
    mech.M .C .K .B .F .G .D                 M q'' + C q' + K q = B u, y = F q + G q' + D u, as mechss takes it
    mech.CoordinateName .CoordinateUnit      F, G, D are empty where an acceleration cannot be written so
    check.omega (n, 1), .response (outputs, inputs, n), .scale     what the frequency response must be, and its size
    uncertain.Name .Variable .Unit .Nominal .Range .Half .Repetitions           parameters of an uncertain plant: ureal
    mbsvib                                   all else that ``from_mat`` needs: Cq Cv Ca D, bodies, transform

Octave takes bytes for characters, and those of MATLAB have 16 bits: in names, a character that is not ASCII becomes
``~`` and its number (``~FC``, ``~1F600``). The script puts the names back that were changed so, out of mbsvib.mapped
and mbsvib.original (UTF-8, as numbers).
"""

from __future__ import annotations

import os
import re
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbsvib.api.state_space import StateSpace
from mbsvib.api.system import System
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path, flag
from mbsvib.common.mat_file import cells, read_mat_file
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError
from mbsvib.responses.state_space import StateSpace as FirstOrder
from mbsvib.uncertain.plant import UncertainPlant
from mbsvib_export.neutral import ERROR_BOUND, OF_SPACE, THROUGH, Source, SystemData, data_of, shapes, with_ports
from mbsvib_export.reading import content_read
from mbsvib_export.record import FORMAT, NEEDED, OPTIONAL, SPACE_FORMAT, VERSION, check_version, data_from
from mbsvib_export.responses import check_points, poles_of, response_of, response_scale
from mbsvib_export.templates_ import check_companion, filled
from mbsvib_export.uncertain_ import is_uncertain, matlab_parameters, with_channels

# Accelerations are taken into F, G and D by M^-1; where M is singular, a row that M^-1 would not reach is left over.
LEFT_OVER = 1e-11
TOLERANCE = 1e-6  # of the script: relative difference of responses; MATLAB scales state spaces by its own rules
# Variables of names and units, and what they are in a state space.
SIGNALS = [(signal, kind, end) for signal in ("Input", "Output", "State")
           for kind, end in (("Name", "s"), ("Unit", "_units"))]  # fmt: skip
_FOREIGN = re.compile(r"[^\x00-\x7f]")
TITLE = 116  # bytes of free text that a .mat file begins with


def to_mat(
    system: Source | UncertainPlant, path: str | os.PathLike[str], realization: str = "physical", loader: bool = True,
    *, outputs: Names = None, inputs: Names = None,
) -> Path:  # fmt: skip
    """Write a system to a .mat file of MATLAB, and beside it a script that rebuilds it there with all its names.

    ``[plant, mech] = load_stewart()`` gives an ``ss`` and a ``mechss`` object (in Octave ``ss`` of its package control,
    without it a struct) after comparing their frequency response with that in the file. Of an uncertain plant it gives
    a ``uss`` object where MATLAB has them; the equations in the file have inputs "PARAMETER.w" and outputs
    "PARAMETER.z" before all others, w = (p - nominal) / half z, and ``uncertain`` has the parameters.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace, SystemData or UncertainPlant
        The equations of motion, or first-order equations alone, which make no ``mechss`` object.
    path : str or path
        File to write; its name ends in .mat.
    realization : str
        States of the state space: "physical", "modal" or "balanced".
    loader : bool
        Whether to write the script ``load_NAME.m`` into the same folder.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If a file cannot be written, its name does not end in .mat, or no system is given.
    ResponseError
        If the realization, or the name of an output or input, is unknown.
    """
    plant: Any = system if is_uncertain(system) else None
    system = with_ports(system, outputs, inputs) if plant is None else with_channels(plant, outputs, inputs)
    data = data_of(system, realization, "to_mat")
    content = _content(data, system if isinstance(system, System) and isinstance(data, SystemData) else data)
    if plant is not None:
        content["uncertain"] = matlab_parameters(plant, _Words().cells)
    from scipy.io import savemat

    stream = BytesIO()
    savemat(stream, content, format="5", long_field_names=True, oned_as="column")
    # scipy writes the time into the title; without it the same system gives the same bytes
    rest = stream.getvalue()[TITLE:]
    document = title(rest) + rest
    goal = Path(a_path(path, "to_mat", ExportError))
    if flag(loader, "to_mat", "loader", ExportError) and goal.suffix.lower() != ".mat":
        raise ExportError(f"to_mat: path = '{goal}'; expected a name that ends in .mat, by which MATLAB knows the file "
                          f"that its script loads. With loader=False any name will do.")  # fmt: skip
    is_new = not os.path.lexists(goal)
    name = "load_" + re.sub(r"[^0-9A-Za-z_]", "_", goal.stem)[:50]
    companion = goal.with_name(f"{name}.m")
    if loader:
        quoted = _quoted(goal.name)
        lookup = f"fileparts(mfilename('fullpath')), {quoted});".encode()
        check_companion(companion, lambda file: b"Written by mbsvib." in (old := file.read_bytes()) and lookup in old,
                        f"the script of '{goal.name}'", "Move it, take another name for the .mat file, or say "
                        "loader=False.")  # fmt: skip
    result = write_atomic(path, lambda file: file.write(document))
    if loader:
        text = filled("load.m", function=name, upper=name.upper(), system=ascii(data.name), file=ascii(goal.name),
                      text=quoted, tolerance=f"{TOLERANCE:.0e}")  # fmt: skip
        try:
            write_atomic(companion, lambda file: file.write(text.encode("ascii")))
        except ExportError:
            if is_new:
                result.unlink(missing_ok=True)
            raise
    return result


def _quoted(name: str) -> str:
    """A text of MATLAB and Octave, in a script of ASCII: others by their bytes in UTF-8, as file systems have them."""
    if name.isascii() and name.isprintable():
        return "'" + name.replace("'", "''") + "'"
    return f"native2unicode(uint8([{' '.join(map(str, os.fsencode(name)))}]), 'UTF-8')"


def from_mat(path: str | os.PathLike[str]) -> SystemData | StateSpace:
    """Return the system, or the state space, that ``to_mat`` wrote.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    SystemData, or StateSpace
        Matrices, names and units; ``to_control``, ``to_json`` and the other exporters take it. A StateSpace of
        first-order equations alone.

    Raises
    ------
    ExportError
        If the file cannot be read, is damaged, or is of a later version of the format.
    """
    with content_read(path, ".mat file", "mat") as raw:
        if raw[:TITLE] != title(raw[TITLE:]):
            raise ExportError("no .mat file as to_mat wrote it: damaged, or saved by another program; write it again.")
        arrays = read_mat_file(raw)
        extra = arrays["mbsvib"]
        check_version(extra["format"], int(extra["version"].item()))
        return data_from(_record(arrays, extra))


def title(content: bytes) -> bytes:
    """The free text at the beginning, with a checksum of all that follows."""
    return f"MATLAB 5.0 MAT-file, written by mbsvib, crc32 {zlib.crc32(content):08x}".encode().ljust(TITLE)


def _content(data: SystemData | FirstOrder, source: System | SystemData | FirstOrder) -> dict[str, Any]:
    """All variables of the file; what belongs to equations of motion is empty where there are none."""
    words, omega = _Words(), check_points(poles_of(source))
    response = response_of(source, omega)
    if isinstance(data, SystemData):
        space, (first, rate, through) = data.state_space, _mechss(data)
        mech = {"M": data.M, "C": data.C, "K": data.K, "B": data.B, "F": first, "G": rate, "D": through,
                "CoordinateName": words.cells(data.coordinates),
                "CoordinateUnit": words.cells(data.coordinate_units)}  # fmt: skip
        extra = {"format": FORMAT, "transform": space.transform, "bodies": words.cells(data.bodies),
                 "body_motion": data.body_motion, **{key: getattr(data, key) for key in ("Cq", "Cv", "Ca", "D")},
                 **({} if space.through is None else {THROUGH: space.through})}  # fmt: skip
    else:
        space = data
        mech = {**dict.fromkeys(("M", "C", "K", "B", "F", "G", "D"), np.zeros((0, 0))),
                **dict.fromkeys(("CoordinateName", "CoordinateUnit"), words.cells(()))}  # fmt: skip
        extra = {"format": SPACE_FORMAT, **({} if space.error_bound is None else {ERROR_BOUND: space.error_bound})}
    result: dict[str, Any] = {
        **{key: getattr(space, key) for key in "ABCD"}, "E": np.zeros((0, 0)), "Ts": 0.0,
        "Name": words.plain(data.name),
        **{f"{signal}{kind}": words.cells(getattr(space, f"{signal.lower()}{end}")) for signal, kind, end in SIGNALS},
        "mech": mech,
        "check": {"omega": omega[:, None], "response": response, "scale": response_scale(response, source, omega)},
        "mbsvib": {"version": float(VERSION), "realization": space.realization, **extra},
    }  # fmt: skip
    if words.changed:
        result["mbsvib"]["mapped"] = cells(tuple(words.changed.values()))
        result["mbsvib"]["original"] = cells(tuple(np.frombuffer(name.encode(), dtype=np.uint8)
                                                    for name in words.changed))  # fmt: skip
    return result


def _mechss(data: SystemData) -> tuple[Array, Array, Array]:
    """F, G, D with the accelerations taken in: Ca q'' = X M q'' = X (B u - C q' - K q) where X M = Ca."""
    if not data.Ca.any():
        return data.Cq, data.Cv, data.D
    size = np.sqrt(np.abs(np.diag(data.M)))
    size = np.where(size > 0.0, size, 1.0)
    even, right = data.M / np.outer(size, size), (data.Ca / size).T
    x = np.linalg.lstsq(even, right, rcond=None)[0]
    if np.abs(even @ x - right).max() > LEFT_OVER * np.abs(right).max():
        none = np.zeros((0, 0))
        return none, none, none
    x = (x / size[:, None]).T
    return data.Cq - x @ data.K, data.Cv - x @ data.C, data.D + x @ data.B


class _Words:
    """Names in ASCII, no two of them the same, and what was ``changed``."""

    def __init__(self) -> None:
        self.changed: dict[str, str] = {}

    def plain(self, name: str, others: tuple[str, ...] = ()) -> str:
        if name not in self.changed and not name.isascii():
            unique = _FOREIGN.sub(lambda match: f"~{ord(match[0]):X}", name)
            while unique in self.changed.values() or unique in others:
                unique += "_"
            self.changed[name] = unique
        return self.changed.get(name, name)

    def cells(self, names: tuple[str, ...]) -> NDArray[Any]:
        return cells(tuple(self.plain(name, names) for name in names))


class _Texts:
    """Names as they were before ``_Words``."""

    def __init__(self, extra: dict[str, Any]) -> None:
        self.origin = ({word: bytes(code.ravel()).decode() for word, code in
                        zip(extra["mapped"].ravel(), extra["original"].ravel(), strict=True)}
                       if "mapped" in extra else {})  # fmt: skip

    def text(self, value: Any) -> str:
        if not isinstance(value, str):
            raise ValueError("a name is not a text")
        return self.origin.get(value, value)

    def all(self, cells: NDArray[Any]) -> tuple[str, ...]:
        return tuple(self.text(cell) for cell in cells.ravel())

    def signals(self, arrays: dict[str, Any]) -> dict[str, Any]:
        """Names and units of inputs, outputs and states."""
        return {f"{signal.lower()}{end}": self.all(arrays[f"{signal}{kind}"]) for signal, kind, end in SIGNALS}


def _real(array: NDArray[Any], shape: tuple[int, ...]) -> Array:
    # .mat files do not store the shapes of arrays without entries, nor that a last axis has one
    result = np.array(array, dtype=float)
    return result.reshape(shape) if not result.size or len(shape) > 2 else result


def _record(arrays: dict[str, Any], extra: dict[str, Any]) -> dict[str, Any]:
    """The record that variables of a file hold."""
    texts, form, mech = _Texts(extra), extra["format"], arrays["mech"]
    record: dict[str, Any] = {"format": form, "name": texts.text(arrays["Name"]),
                              "realization": texts.text(extra["realization"]), **texts.signals(arrays)}  # fmt: skip
    of_system = {"coordinates": texts.all(mech["CoordinateName"]), "bodies": texts.all(extra["bodies"]),
                 "coordinate_units": texts.all(mech["CoordinateUnit"])} if form == FORMAT else {}  # fmt: skip
    record |= of_system
    n, i, o = (len(record[key]) for key in ("states", "inputs", "outputs"))
    expected = shapes(len(of_system.get("coordinates", ())), n, i, o, len(of_system.get("bodies", ())))
    for key in (*NEEDED[form], OPTIONAL[form]):
        label = key.removeprefix(OF_SPACE)
        group = mech if key in "MCKB" else arrays if key != label and label in "ABCD" else extra
        if label in group and key in expected:
            record[key] = _real(group[label], expected[key])
        elif label in group and label == ERROR_BOUND:
            record[key] = float(group[label].item())
    return record
