"""Universal file format, data sets 58: frequency response functions as test laboratories exchange them.

One set for each output and input, in double precision: function type 4, angular frequency as frequency [Hz], complex
values. Output i is response node i, input j reference node j; whole names stand in the lines ID 1
(``"output / input"``) and ID 2 (``"unit / unit"``) and, cut to ten characters, with the nodes. The files are read by
pyuff; its own writer (2.5) leaves out the head of binary sets and miscounts their bytes.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.expected import a_path, kind_of
from mbsvib.errors import ExportError
from mbsvib_export.atomic_file import write_atomic
from mbsvib_export.neutral import SystemData, linear_of, refuse_many
from mbsvib_export.packages import need
from mbsvib_export.responses import second_order_response

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex


_INSTALL = "mbsvib[uff]"
# specific data types of the format; types without a number are 0, unknown
_TYPES = {"m": 8, "m/s": 11, "m/s^2": 12, "rad": 8, "rad/s": 11, "rad/s^2": 12, "N": 13, "N m": 13}
LINE = 80


@dataclass(frozen=True, repr=False, eq=False)
class ResponseData:
    """Frequency responses out of a file: ``omega`` (n,) [rad/s], ``response`` (outputs, inputs, n), names and units."""

    omega: Array
    response: Complex
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]

    def __repr__(self) -> str:
        return (f"ResponseData({len(self.inputs)} inputs, {len(self.outputs)} outputs, {len(self.omega)} "
                f"frequencies)")  # fmt: skip


def to_uff(
    system: System | SystemData, path: str | os.PathLike[str], omega: ArrayLike | None = None, binary: bool = True
) -> Path:
    """Write the frequency responses of all inputs and outputs to a universal file, data sets 58.

    Parameters
    ----------
    system : System or SystemData
        The equations of motion.
    path : str or path
        File to write, taken as it is: no suffix is added.
    omega : array-like, shape (n,), optional
        Angular frequencies [rad/s], ascending; default: the system's frequency grid.
    binary : bool
        Whether values are kept bit for bit (data sets 58b), or as text: the format keeps six digits of a frequency
        then, and the responses, of twelve digits, are those at the rounded frequencies.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    ExportError
        If the file cannot be written, there is nothing to write, or a name does not fit.
    ResponseError
        If a frequency is not finite or is an undamped pole of the system.
    """
    if not isinstance(system, SystemData) and (linear_of(system) is None or kind_of(system) == "sparse system"):
        refuse_many(system, "to_uff")
        raise ExportError(f"to_uff: system = {type(system).__name__}; expected a System (model.linearize()) or what "
                          f"was read from a file.")  # fmt: skip
    if not (system.inputs and system.outputs):
        raise ExportError(f"to_uff: '{system.name}' has {len(system.inputs)} inputs and {len(system.outputs)} outputs; "
                          f"expected one of each at least (model.add_input, model.add_output).")  # fmt: skip
    if omega is None:
        if isinstance(system, SystemData):
            raise ExportError("to_uff: omega is missing; a system out of a file has no frequency grid of its own.")
        omega = system.frequency_grid()
    frequency = np.atleast_1d(np.asarray(omega, dtype=float)) / (2 * np.pi)
    if not binary:
        frequency = np.unique([float(f"{value:.5e}") for value in frequency])
    points = 2 * np.pi * frequency
    response = (second_order_response(system, points) if isinstance(system, SystemData)
                else system.frequency_response(points))  # fmt: skip
    content = b"".join(_data_set(system, i, j, frequency, response[i, j], binary)
                       for j in range(len(system.inputs)) for i in range(len(system.outputs)))  # fmt: skip
    return write_atomic(path, lambda stream: stream.write(content))


def from_uff(path: str | os.PathLike[str]) -> ResponseData:
    """Return the frequency responses that ``to_uff`` wrote.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    ResponseData
        Frequencies, responses, names and units.

    Raises
    ------
    ExportError
        If pyuff is not installed, the file cannot be read or is damaged, or its sets are not those of ``to_uff``.
    """
    pyuff = need("pyuff", "from_uff", _INSTALL)
    where = str(a_path(path, "from_uff", ExportError))
    if not Path(path).is_file():
        raise ExportError(f"{where}: cannot be read: there is no such file; expected a file of to_uff.")
    try:
        file = pyuff.UFF(where)
        sets = [file.read_sets(k) for k, kind in enumerate(file.get_set_types()) if kind == 58]
        return _gathered(sets)
    except Exception as error:  # pyuff's own errors are plain Exceptions
        raise ExportError(f"{where}: no universal file of to_uff, or a damaged one ({error}); write it "
                          f"again.") from error  # fmt: skip


def _data_set(system: System | SystemData, i: int, j: int, frequency: Array, values: Complex, binary: bool) -> bytes:
    names = f"{system.outputs[i]} / {system.inputs[j]}"
    if len(names) > LINE or not names.isascii() or names.count(" / ") != 1:
        raise ExportError(f"to_uff: the names '{names}' do not fit into a line of the format; expected at most {LINE} "
                          f"characters of ASCII without ' / '. Give the input or output another name.")  # fmt: skip
    units = (system.output_units[i], system.input_units[j])
    samples = np.stack([frequency, values.real, values.imag], axis=1)
    # little-endian IEEE numbers behind eleven lines of text
    kind = f"{'    58b'}{1:6}{2:6}{11:12}{samples.nbytes:12}{0:6}{0:6}{0:12}{0:12}" if binary else "    58"
    lines = [
        kind.ljust(LINE), names.ljust(LINE), f"{units[0]} / {units[1]}".ljust(LINE), "written by mbsvib".ljust(LINE),
        "NONE".ljust(LINE), "NONE".ljust(LINE),
        f"{4:5}{0:10}{0:5}{0:10} {_short(system.outputs[i]):>10}{i + 1:10}{0:4} {_short(system.inputs[j]):>10}"
        f"{j + 1:10}{0:4}",
        f"{6:10}{len(frequency):10}{0:10}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}",
        *(f"{number:10}{0:5}{0:5}{0:5} {label:<20} {unit[:20]:<20}" for number, label, unit in (
            (18, "Frequency", "Hz"), (_TYPES.get(units[0], 0), "Response", units[0]),
            (_TYPES.get(units[1], 0), "Reference", units[1]), (0, "NONE", "NONE"))),
    ]  # fmt: skip
    content = (samples.astype("<f8").tobytes() if binary else
               "".join(f"{x:13.5e}{re:20.11e}{im:20.11e}\n" for x, re, im in samples.tolist()).encode())  # fmt: skip
    head = "\n".join([f"{-1:6}".ljust(LINE), *lines]) + "\n"
    return head.encode("ascii", "replace") + content + f"{-1:6}".ljust(LINE).encode() + b"\n"


def _short(name: str) -> str:
    return name.replace(" ", "_")[:10]


def _gathered(sets: list[dict[str, Any]]) -> ResponseData:
    by_nodes = {(int(item["rsp_node"]), int(item["ref_node"])): item for item in sets}
    outputs, inputs = max(i for i, _ in by_nodes), max(j for _, j in by_nodes)
    abscissa = np.asarray(by_nodes[1, 1]["x"])
    response = np.empty((outputs, inputs, len(abscissa)), dtype=complex)
    for (i, j), item in by_nodes.items():
        if not np.array_equal(item["x"], abscissa):
            raise ExportError("the sets have different frequencies.")
        response[i - 1, j - 1] = item["data"]
    if len(by_nodes) != outputs * inputs:
        raise ExportError(f"{len(by_nodes)} sets for {outputs} outputs and {inputs} inputs.")

    def words(key: str, at: int, nodes: list[tuple[int, int]]) -> tuple[str, ...]:
        return tuple(str(by_nodes[node][key]).split(" / ")[at].strip() for node in nodes)

    rows, columns = [(i + 1, 1) for i in range(outputs)], [(1, j + 1) for j in range(inputs)]
    return ResponseData(2 * np.pi * abscissa, response, words("id1", 1, columns), words("id2", 1, columns),
                        words("id1", 0, rows), words("id2", 0, rows))  # fmt: skip
