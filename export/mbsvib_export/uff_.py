"""Universal files, as test laboratories exchange them: frequency responses, points, geometry and modes.

Written are units (data set 164), nodes (2411) with their displacement coordinate systems (2420), bodies as groups of
nodes (2467), lines from bodies to their points (82), frequency responses (58, double precision, function type 4), and
modes (55). Whole names of output and input stand in the lines ID 1 (``"output / input"``) and ID 2 (``"unit / unit"``)
of a response and, cut to ten characters, with its nodes.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.system import System
from mbsvib.common.arguments import shown
from mbsvib.common.arrays import Array
from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path, ascending, flag, kind_of, reals
from mbsvib.common.file_content import ContentError, content_of
from mbsvib.common.selection import Names
from mbsvib.errors import ExportError, LeftOutWarning, ResponseError, counted
from mbsvib.measurement.data import Measurement
from mbsvib.responses.frequency_grid import resonant_grid
from mbsvib_export.neutral import Source, SystemData, linear_of, refusal, with_ports
from mbsvib_export.responses import response_of
from mbsvib_export.uff_geometry import geometry_of, lines_of, modes_of
from mbsvib_export.uff_reading import measurement_of, series_of
from mbsvib_export.uff_records import AUTO_SPECTRUM, DENSITY, RECORD, Function
from mbsvib_export.uff_writing import measurement_sets

T = TypeVar("T")


def to_uff(
    system: Source | Measurement, path: str | os.PathLike[str], omega: ArrayLike | None = None, binary: bool = True,
    modes: bool = False, *, outputs: Names = None, inputs: Names = None,
) -> Path:  # fmt: skip
    """Write the frequency responses of all inputs and outputs to a universal file, with nodes and directions.

    A body is a node at its centre of mass, a point of a port another one. Ports along or about an axis have direction
    ±1 ... ±6 there; others along or about a line have a node of their own, with a displacement coordinate system whose
    x axis is the line. What is no motion or force of one body has a node without position, and direction 0. Output and
    input have the same node and direction only if they are a driving point.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace, SystemData or Measurement
        The equations. Nodes and directions are those of the model, also of a closed loop; state spaces and SystemData,
        from files, know no geometry. Of a measurement: the pairs that were measured, with coherence, nodes and lines;
        a ``LeftOutWarning`` names noise that the format does not have.
    path : str or path
        File to write, taken as it is: no suffix is added.
    omega : array-like, shape (n,), optional
        Angular frequencies [rad/s], ascending; default: those that resolve every resonance. ``system.frequency_grid()``
        resolves the antiresonances of each pair as well, whose number, and time, grows with outputs times inputs. None
        for a measurement, which has its own.
    binary : bool
        Whether values are kept bit for bit (data sets 58b), or as text: the format keeps six digits of a frequency
        then, and the responses, of twelve digits, are those at the rounded frequencies.
    modes : bool
        Whether to write the modes as well, to six digits, as the format keeps them: normal ones where damping is
        proportional, else complex ones, of which the format's readers take translations only; without those that do
        not oscillate. Of a measurement: those that it has.
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, there is nothing to write, frequencies do not ascend, a measured pair has unknown
        lines, or a name does not fit.
    ResponseError
        If a frequency is not finite or is an undamped pole of the system, or a name is unknown.
    """
    binary, modes = flag(binary, "to_uff", "binary", ExportError), flag(modes, "to_uff", "modes", ExportError)
    if isinstance(system, Measurement):
        data = system if outputs is None and inputs is None else system[outputs, inputs]
        name, frequency = "measurement", _writable(data, omega, binary)
        data = data if modes else replace(data, modes=())
    else:
        name, frequency, data = _measured(with_ports(system, outputs, inputs), omega, binary, modes)
    sets = list(measurement_sets(data, frequency, binary, name))
    return write_atomic(path, lambda stream: stream.writelines(sets))


def _measured(source: Any, omega: ArrayLike | None, binary: bool, modes: bool) -> tuple[str, Array, Measurement]:
    """Name, frequencies [Hz] and the measurement that shows all that a file keeps of a system."""
    linear: Any = source if isinstance(source, SystemData) else linear_of(source)
    if linear is None or kind_of(source) == "sparse system":
        raise refusal(source, "to_uff", "a System (model.linearize()), a closed loop, a state space, a Measurement or "
                      "what was read from a file")  # fmt: skip
    if not (linear.inputs and linear.outputs):
        raise ExportError(f"to_uff: '{linear.name}' has {counted(len(linear.inputs), 'input')} and "
                          f"{counted(len(linear.outputs), 'output')}; expected one of each at least (model.add_input, "
                          f"model.add_output).")  # fmt: skip
    if omega is None and not hasattr(linear, "poles"):
        raise ExportError("to_uff: omega is missing; a system out of a file has no frequency grid of its own.")
    if modes and not isinstance(linear, System):
        raise ExportError("to_uff: modes = True; only a System has modes in which its bodies move.")
    grid = resonant_grid(linear.poles()) if omega is None else omega
    frequency = ascending(grid, "to_uff", "omega", "a vector of ascending angular frequencies [rad/s] from 0 on, each "
                          "once, as readers of the format take them: np.unique(omega)", ExportError, 0.0, ndmin=1)
    frequency /= 2 * np.pi
    frequency = frequency if binary else np.unique(_five_digits(frequency))
    points = 2 * np.pi * frequency
    nodes, input_points, output_points = geometry_of(linear)
    return linear.name, frequency, Measurement(
        points, response_of(linear, points), linear.outputs, linear.inputs, output_units=linear.output_units,
        input_units=linear.input_units, output_points=output_points, input_points=input_points, nodes=nodes,
        lines=lines_of(nodes), modes=modes_of(linear, nodes) if modes else (),
    )  # fmt: skip


def _writable(data: Measurement, omega: ArrayLike | None, binary: bool) -> Array:
    """Frequencies [Hz] of a measurement as a file has them; refuse lines and name noise that none can hold."""
    if omega is not None:
        raise ExportError("to_uff: omega is given with a Measurement, which has its own lines; leave it out, or give "
                          "data.within(low, high).")  # fmt: skip
    frequency = data.frequencies if binary else _five_digits(data.frequencies)
    if (np.diff(frequency) <= 0.0).any():
        raise ExportError("to_uff: two lines of the measurement have the same frequency in the six digits of text; "
                          "write it with binary=True.")  # fmt: skip
    for values, what in ((data.responses, "response"), (data.coherence, "coherence")):
        unknown = data.is_measured[..., None] & np.isnan(data.responses if values is None else values)
        if unknown.any():
            i, j, k = np.argwhere(unknown)[0]
            raise ExportError(f"to_uff: the {what} of '{data.outputs[i]}' to '{data.inputs[j]}' is not known at "
                              f"{frequency[k]:g} Hz; expected all lines of a pair, or none: data.within(low, high).")
    if not data.is_measured.any():
        raise ExportError("to_uff: the measurement has no responses; expected one at least.")
    lost = [name for name in ("variance", "covariance", "noise_variance", "averages")
            if getattr(data, name) is not None]  # fmt: skip
    lost += ["quantity"] if any(q and not u for q, u in zip(data.quantity, data.output_units, strict=True)) else []
    if lost:
        warnings.warn(f"to_uff: {', '.join(lost)} of the measurement are left out: of noise the format has the "
                      f"coherence alone. data.to_npz keeps them.", LeftOutWarning, stacklevel=3)  # fmt: skip
    return frequency


def _five_digits(frequency: Array) -> Array:
    return np.array([float(f"{value:.5e}") for value in frequency])


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
        If the file cannot be read or is damaged, its responses have different frequencies, or a unit beside them, such
        as g, stands against those of the file, such as mm.
    """
    result, modes = _read(path, "from_uff", measurement_of)
    if modes:
        warnings.warn(f"from_uff: {os.fspath(path)}: modes are left out: {'; '.join(modes)}; expected displacements "
                      f"at nodes, of 3 or 6 real or complex values.", LeftOutWarning, stacklevel=2)  # fmt: skip
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
            for item in _series(path, "records_from_uff", "time records", RECORD)]  # fmt: skip


def densities_from_uff(path: str | os.PathLike[str], bandwidth: float | None = None) -> dict[str, Array]:
    """Return the power spectral densities of a universal file, as ``system.psd`` takes them for noise.

    S = A / b of auto spectra A [unit^2], mean squares by line, with the noise bandwidth b of a line

    Parameters
    ----------
    path : str or path
        The file, of any program.
    bandwidth : float, optional
        Noise bandwidth [Hz] of the lines of auto spectra, which the format does not keep: the distance of two lines
        times 1 (no window) or 1.5 (Hann). None: auto spectra are left out, by a ``LeftOutWarning``.

    Returns
    -------
    dict of str to array, shape (n, 2)
        Frequencies [Hz] and one-sided densities [unit^2/Hz], by node and direction, ``"12+Z"``.

    Raises
    ------
    ExportError
        If the file cannot be read or is damaged, holds no densities or two of one point, or has auto spectra alone and
        no bandwidth is given.
    """
    expected = "a positive number [Hz]"
    width = None if bandwidth is None else reals(bandwidth, "densities_from_uff", "bandwidth", expected, ExportError)
    if width is not None and not (width.ndim == 0 and 0.0 < width < np.inf):
        raise ExportError(f"densities_from_uff: bandwidth = {shown(bandwidth)}; expected {expected}.")
    items = _series(path, "densities_from_uff", "spectral densities", DENSITY, AUTO_SPECTRUM)
    autos = [item.output.name for item in items if item.kind == AUTO_SPECTRUM]
    if autos and bandwidth is None:
        missing = (f"densities_from_uff: {os.fspath(path)}: the auto spectra of {', '.join(autos)} are mean squares by "
                   f"line, not densities; give the noise bandwidth [Hz] of a line, bandwidth=.")  # fmt: skip
        if len(autos) == len(items):
            raise ExportError(missing)
        warnings.warn(f"{missing} They are left out.", LeftOutWarning, stacklevel=2)
        items = [item for item in items if item.kind == DENSITY]
    names = [item.output.name for item in items]
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise ExportError(f"densities_from_uff: {os.fspath(path)} has several spectra of {', '.join(twice)}; expected "
                          f"one of each point.")  # fmt: skip
    return {item.output.name: np.column_stack((item.frequency, item.values / (bandwidth or 1.0)
                                               if item.kind == AUTO_SPECTRUM else item.values))
            for item in items}  # fmt: skip


def _series(path: str | os.PathLike[str], caller: str, what: str, *kinds: int) -> list[Function]:
    """Return the functions of some ``kinds`` of a file."""
    functions = _read(path, caller, lambda raw: series_of(raw, kinds))
    if not functions:
        raise ExportError(f"{caller}: {os.fspath(path)} holds no {what}.")
    return functions


def _read(path: str | os.PathLike[str], caller: str, parse: Callable[[bytes], T]) -> T:
    """Return what a function makes of the content of a file, with all its errors as ``ExportError``."""
    where = os.fspath(a_path(path, caller, ExportError))
    try:
        return parse(content_of(where, ExportError, "a universal file"))
    except (ContentError, ResponseError) as error:
        raise ExportError(f"{where}: no universal file that can be read, or a damaged one: {error}.") from error
