"""Universal files, as test laboratories exchange them: frequency responses, points, geometry and modes.

Written are units (data set 164), nodes (2411) with their displacement coordinate systems (2420), bodies as groups of
nodes (2467), lines from bodies to their points (82), frequency responses (58, double precision, function type 4), and
modes (55). Whole names of output and input stand in the lines ID 1 (``"output / input"``) and ID 2 (``"unit / unit"``)
of a response and, cut to ten characters, with its nodes.
"""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path, kind_of
from mbsvib.common.file_content import ContentError, content_of
from mbsvib.errors import ExportError, LeftOutWarning, ResponseError
from mbsvib.responses.frequency_grid import resonant_grid
from mbsvib_export.neutral import SystemData, linear_of, refusal, with_ports
from mbsvib_export.responses import response_of
from mbsvib_export.uff_geometry import geometry_of, geometry_sets, mode_sets
from mbsvib_export.uff_reading import measurement_of, series_of
from mbsvib_export.uff_records import MARK

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.common.selection import Names
    from mbsvib.measurement.data import Measurement
    from mbsvib.measurement.points import Point
    from mbsvib_export.neutral import Source
    from mbsvib_export.uff_records import Function


# specific data types of the format; types without a number are 0, unknown
_TYPES = {"m": 8, "m/s": 11, "m/s^2": 12, "rad": 8, "rad/s": 11, "rad/s^2": 12, "N": 13, "N m": 13}
LINE = 80


def to_uff(
    system: Source, path: str | os.PathLike[str],
    omega: ArrayLike | None = None, binary: bool = True, modes: bool = False,
    *, outputs: Names = None, inputs: Names = None,
) -> Path:  # fmt: skip
    """Write the frequency responses of all inputs and outputs to a universal file, with nodes and directions.

    A body is a node at its centre of mass, a point of a port another one. Ports along or about an axis have direction
    ±1 ... ±6 there; others along or about a line have a node of their own, with a displacement coordinate system whose
    x axis is the line. What is no motion or force of one body has a node without position, and direction 0. Output and
    input have the same node and direction only if they are a driving point.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace or SystemData
        The equations. Nodes and directions are those of the model, also of a closed loop; state spaces and SystemData,
        from files, know no geometry.
    path : str or path
        File to write, taken as it is: no suffix is added.
    omega : array-like, shape (n,), optional
        Angular frequencies [rad/s], ascending; default: those that resolve every resonance. ``system.frequency_grid()``
        resolves the antiresonances of each pair as well, whose number, and time, grows with outputs times inputs.
    binary : bool
        Whether values are kept bit for bit (data sets 58b), or as text: the format keeps six digits of a frequency
        then, and the responses, of twelve digits, are those at the rounded frequencies.
    modes : bool
        Whether to write the modes as well, to six digits, as the format keeps them: normal ones where damping is
        proportional, else complex ones, of which the format's readers take translations only; without those that do
        not oscillate.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, there is nothing to write, frequencies do not ascend, or a name does not fit.
    ResponseError
        If a frequency is not finite or is an undamped pole of the system, or a name is unknown.
    """
    system = with_ports(system, outputs, inputs)
    linear: Any = system if isinstance(system, SystemData) else linear_of(system)
    if linear is None or kind_of(system) == "sparse system":
        raise refusal(system, "to_uff", "a System (model.linearize()), a closed loop, a state space or what was read "
                      "from a file")  # fmt: skip
    if not (linear.inputs and linear.outputs):
        raise ExportError(f"to_uff: '{linear.name}' has {len(linear.inputs)} inputs and {len(linear.outputs)} outputs; "
                          f"expected one of each at least (model.add_input, model.add_output).")  # fmt: skip
    if omega is None and not hasattr(linear, "poles"):
        raise ExportError("to_uff: omega is missing; a system out of a file has no frequency grid of its own.")
    if modes and not isinstance(linear, System):
        raise ExportError("to_uff: modes = True; only a System has modes in which its bodies move.")
    grid = resonant_grid(linear.poles()) if omega is None else omega
    frequency = np.atleast_1d(np.asarray(grid, dtype=float)) / (2 * np.pi)
    if frequency.ndim != 1 or not len(frequency) or (frequency < 0.0).any() or (np.diff(frequency) <= 0.0).any():
        raise ExportError("to_uff: omega does not ascend from 0 on; expected a vector of ascending angular frequencies "
                          "[rad/s], each once, as readers of the format take them: np.unique(omega).")  # fmt: skip
    if not binary:
        frequency = np.unique([float(f"{value:.5e}") for value in frequency])
    points = 2 * np.pi * frequency
    response = response_of(linear, points)
    geometry = geometry_of(linear)
    sets = [item.encode("ascii", "replace") for item in geometry_sets(geometry)]
    sets += [_function(linear, i, j, (output, source), frequency, response[i, j], binary)
             for j, source in enumerate(geometry.inputs) for i, output in enumerate(geometry.outputs)]  # fmt: skip
    if modes:
        sets += [item.encode("ascii", "replace") for item in mode_sets(linear, geometry)]
    return write_atomic(path, lambda stream: stream.writelines(sets))


def from_uff(path: str | os.PathLike[str]) -> Measurement:
    """Return what a universal file holds: measured frequency responses with their points, nodes and modes.

    Data sets 58 (responses and their coherence, text and binary), 55 and 2414 (modes), 15 and 2411 (nodes), 2420
    (coordinate systems), 2467 (groups), 82 (lines) and 164 (units) are read, and converted to SI units. Files of
    ``to_uff`` give the names of the model; in others, an output or input is called by its entity, node and direction,
    ``"12+Z"``.

    Parameters
    ----------
    path : str or path
        The file, of any program.

    Returns
    -------
    Measurement
        Responses, names, units, points, nodes and modes; ``left_out`` lists what else is in the file. A
        ``LeftOutWarning`` names modes that cannot be read.

    Raises
    ------
    ExportError
        If the file cannot be read or is damaged, or its responses have different frequencies.
    """
    where = os.fspath(a_path(path, "from_uff", ExportError))
    raw = content_of(where, ExportError, "a universal file")
    try:
        result, modes = measurement_of(raw)
    except (ContentError, ResponseError) as error:
        raise ExportError(f"{where}: no universal file that can be read, or a damaged one: {error}.") from error
    if modes:
        warnings.warn(f"from_uff: {where}: modes are left out: {'; '.join(modes)}; expected displacements at nodes, of "
                      f"3 or 6 real or complex values.", LeftOutWarning, stacklevel=2)  # fmt: skip
    return result


def records_from_uff(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Return the time records of a universal file, for ``mv.Measurement.from_sep005``.

    Parameters
    ----------
    path : str or path
        The file, of any program.

    Returns
    -------
    list of dict
        Each with "name" (``"12+Z"``: node and direction), "data" (n,), "time" (n,) [s] and "unit_str", in SI units.

    Raises
    ------
    ExportError
        If the file cannot be read or is damaged, or holds no time records.
    """
    return [{"name": item.output.name, "data": item.values, "time": item.frequency, "unit_str": item.output.unit}
            for item in _series(path, "records_from_uff", False)]  # fmt: skip


def densities_from_uff(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Return the power spectral densities of a universal file, as ``system.psd`` takes them for noise.

    Parameters
    ----------
    path : str or path
        The file, of any program.

    Returns
    -------
    dict of str to array, shape (n, 2)
        Frequencies [Hz] and one-sided densities [unit^2/Hz], by node and direction, ``"12+Z"``.

    Raises
    ------
    ExportError
        If the file cannot be read or is damaged, or holds no densities.
    """
    return {item.output.name: np.column_stack((item.frequency, item.values))
            for item in _series(path, "densities_from_uff", True)}  # fmt: skip


def _series(path: str | os.PathLike[str], caller: str, density: bool) -> list[Function]:
    where = os.fspath(a_path(path, caller, ExportError))
    try:
        found = series_of(content_of(where, ExportError, "a universal file"), density)
    except ContentError as error:
        raise ExportError(f"{where}: no universal file that can be read, or a damaged one: {error}.") from error
    if not found:
        raise ExportError(f"{caller}: {where} holds no {'spectral densities' if density else 'time records'}.")
    return found


def _function(
    system: Any, i: int, j: int, points: tuple[Point, Point], frequency: Array, values: Complex,
    binary: bool,
) -> bytes:  # fmt: skip
    names = f"{system.outputs[i]} / {system.inputs[j]}"
    if len(names) > LINE or not names.isascii() or not names.isprintable() or names.count(" / ") != 1:
        raise ExportError(f"to_uff: the names {names!r} do not fit into a line of the format; expected at most {LINE} "
                          f"characters of ASCII without ' / '. Give the input or output another name.")  # fmt: skip
    units = (system.output_units[i], system.input_units[j])
    table = np.stack([frequency, values.real, values.imag], axis=1)
    # little-endian IEEE numbers behind eleven lines of text
    kind = f"{'    58b'}{1:6}{2:6}{11:12}{table.nbytes:12}{0:6}{0:6}{0:12}{0:12}" if binary else "    58"
    output, source = points
    lines = [
        kind.ljust(LINE), names.ljust(LINE), f"{units[0]} / {units[1]}".ljust(LINE), MARK.ljust(LINE),
        "NONE".ljust(LINE), "NONE".ljust(LINE),
        f"{4:5}{0:10}{0:5}{0:10} {_short(system.outputs[i]):>10}{output.node:10}{output.direction:4} "
        f"{_short(system.inputs[j]):>10}{source.node:10}{source.direction:4}",
        f"{6:10}{len(frequency):10}{0:10}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}",
        *(f"{number:10}{0:5}{0:5}{0:5} {label:<20} {unit[:20]:<20}" for number, label, unit in (
            (18, "Frequency", "Hz"), (_TYPES.get(units[0], 0), "Response", units[0]),
            (_TYPES.get(units[1], 0), "Reference", units[1]), (0, "NONE", "NONE"))),
    ]  # fmt: skip
    content = (table.astype("<f8").tobytes() if binary else
               "".join(f"{x:13.5e}{re:20.11e}{im:20.11e}\n" for x, re, im in table.tolist()).encode())  # fmt: skip
    head = "\n".join([f"{-1:6}".ljust(LINE), *lines]) + "\n"
    return head.encode("ascii", "replace") + content + f"{-1:6}".ljust(LINE).encode() + b"\n"


def _short(name: str) -> str:
    return name.replace(" ", "_")[:10]
