"""A measurement as the data sets of a universal file: units 164, coordinate systems 2420, nodes 2411, groups 2467,
lines 82, responses and coherences 58, modes 55.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mbsvib.common.arrays import Array, Complex
from mbsvib.errors import ExportError
from mbsvib.measurement.data import MeasuredMode, Measurement
from mbsvib.measurement.points import Node
from mbsvib_export.uff_geometry import by_body
from mbsvib_export.uff_records import COHERENCE, MARK, RESPONSE

# specific data types of the format; types without a number are 0, unknown
_TYPES = {"m": 8, "m/s": 11, "m/s^2": 12, "rad": 8, "rad/s": 11, "rad/s^2": 12, "N": 13, "N m": 13}
_NODES = 7  # type of entities in groups
_REAL, _COMPLEX = 2, 5
_LINE = 80


def measurement_sets(data: Measurement, frequency: Array, binary: bool, title: str) -> Iterator[bytes]:
    """Yield all data sets of a file; ``frequency`` (n,) are the frequencies [Hz] as they are written."""
    for item in _geometry_sets(data):
        yield item.encode("ascii", "replace")
    for i, j in np.argwhere(data.is_measured.T)[:, ::-1].tolist():
        yield _function(data, i, j, frequency, data.responses[i, j], binary)
        if data.coherence is not None:
            yield _function(data, i, j, frequency, data.coherence[i, j], binary)
    for item in _mode_sets(data, title):
        yield item.encode("ascii", "replace")


def _geometry_sets(data: Measurement) -> Iterator[str]:
    """Data sets of units, nodes, bodies and lines."""
    yield _set(164, [f"{1:10}{'SI: metre (newton)':<20}{2:10}", _reals(1.0, 1.0, 1.0), _reals(273.15)])
    if not data.nodes:
        return
    lines = [f"{1:10}", "directions of inputs and outputs"]
    for node in data.nodes:
        if node.axes is not None:
            lines += [f"{node.number:10}{0:10}{0:10}", f"direction at node {node.number}",
                      *(_reals(*row) for row in zip(*node.axes, strict=True)), _reals(0.0, 0.0, 0.0)]  # fmt: skip
    if len(lines) > 2:
        yield _set(2420, lines)
    lines = []
    for node in data.nodes:
        lines += [_integers(node.number, 0, 0 if node.axes is None else node.number, 1), _reals(*node.position)]
    yield _set(2411, lines)
    lines, traces = [], []
    for k, (body, nodes) in enumerate(by_body(data.nodes).items(), 1):
        entries = [_integers(_NODES, node.number, 0, 0) for node in nodes]
        if body:
            lines += [_integers(k, 0, 0, 0, 0, 0, 0, len(nodes)), _plain(body),
                      *("".join(entries[i : i + 2]) for i in range(0, len(entries), 2))]  # fmt: skip
        own = {node.number for node in nodes}
        trace = [number for line in data.lines if line[0] in own for number in (*line, 0)]
        if trace:
            traces.append(_set(82, [_integers(k, len(trace), 0), _plain(body),
                                    *(_integers(*trace[i : i + 8]) for i in range(0, len(trace), 8))]))  # fmt: skip
    if lines:
        yield _set(2467, lines)
    yield from traces


def _function(data: Measurement, i: int, j: int, frequency: Array, values: Array | Complex, binary: bool) -> bytes:
    """A response, if values are complex, or a coherence."""
    names = f"{data.outputs[i]} / {data.inputs[j]}"
    if len(names) > _LINE or not names.isascii() or not names.isprintable() or names.count(" / ") != 1:
        raise ExportError(f"to_uff: the names {names!r} do not fit into a line of the format; expected at most {_LINE} "
                          f"characters of ASCII without ' / '. Give the input or output another name.")  # fmt: skip
    output, source = data.output_points[i], data.input_points[j]
    if np.iscomplexobj(values):
        kind, data_type, units = RESPONSE, 6, (data.output_units[i], data.input_units[j])
        table = np.stack([frequency, values.real, values.imag], axis=1)
        words = [f"{x:13.5e}{re:20.11e}{im:20.11e}" for x, re, im in table.tolist()]
    else:
        kind, data_type, units = COHERENCE, 4, ("", "")
        table = np.stack([frequency, values], axis=1)
        words = [f"{x:13.5e}{y:20.11e}" for x, y in table.tolist()]
        words = ["".join(words[k : k + 2]) for k in range(0, len(words), 2)]
    # little-endian IEEE numbers behind eleven lines of text
    head = f"{'    58b'}{1:6}{2:6}{11:12}{table.nbytes:12}{0:6}{0:6}{0:12}{0:12}" if binary else "    58"
    lines = [f"{-1:6}", head, names, f"{units[0]} / {units[1]}", MARK, "NONE", "NONE"]
    lines = [line.ljust(_LINE) for line in lines] + [
        f"{kind:5}{0:10}{0:5}{0:10} {_short(data.outputs[i]):>10}{output.node:10}{output.direction:4} "
        f"{_short(data.inputs[j]):>10}{source.node:10}{source.direction:4}",
        f"{data_type:10}{len(frequency):10}{0:10}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}",
        *(f"{number:10}{0:5}{0:5}{0:5} {label:<20} {unit[:20]:<20}" for number, label, unit in (
            (18, "Frequency", "Hz"), (_TYPES.get(units[0], 0), "Response", units[0]),
            (_TYPES.get(units[1], 0), "Reference", units[1]), (0, "NONE", "NONE"))),
    ]  # fmt: skip
    content = table.astype("<f8").tobytes() if binary else "".join(f"{line}\n" for line in words).encode()
    end = f"{-1:6}".ljust(_LINE) + "\n"
    return ("\n".join(lines) + "\n").encode("ascii", "replace") + content + end.encode()


def _mode_sets(data: Measurement, title: str) -> Iterator[str]:
    """Modes as data sets 55 at each node; those that do not oscillate have no place in the format and are left out."""
    nodes = {node.number: node for node in data.nodes}
    for k, mode in enumerate(data.modes):
        is_rigid = mode.frequency == 0.0 and mode.damping_ratio == 0.0
        if not (is_rigid or abs(mode.damping_ratio) < 1.0):
            continue
        known = [(nodes.get(number), number, row) for number, row in zip(mode.nodes, mode.shape, strict=True)
                 if not np.isnan(row[:3]).any()]  # fmt: skip
        is_real = not np.iscomplexobj(mode.shape)
        # common readers take three complex numbers, not six
        size = 6 if is_real and not any(np.isnan(row).any() for *_, row in known) else 3
        layout = (2, 3 if size == 6 else 2, 8, _REAL, size) if is_real else (3, 2, 8, _COMPLEX, size)
        lines = [
            _plain(mode.name if mode.name.strip() else f"Mode {k + 1}"), _plain(title), "NONE", "NONE", "NONE",
            _integers(1, *layout), _integers(2, 4 if is_real else 6, 1, k + 1),
            "".join(f"{number:13.5E}" for number in _eigenvalue(mode, is_real)),
        ]  # fmt: skip
        for node, number, row in known:
            flat = _in_axes(node, row)[:size]
            flat = flat if is_real else np.stack((flat.real, flat.imag), axis=1).ravel()
            words = [f"{value:13.5E}" for value in flat.tolist()]
            lines += [f"{number:10}", *("".join(words[i : i + 6]) for i in range(0, len(words), 6))]
        yield _set(55, lines)


def _eigenvalue(mode: MeasuredMode, is_real: bool) -> tuple[float, ...]:
    """Frequency [Hz] and damping ratio of a normal mode, s = (-z + i sqrt(1 - z^2)) w of a complex one."""
    if is_real:
        return mode.frequency, 0.0, mode.damping_ratio, 0.0
    size, ratio = 2 * np.pi * mode.frequency, mode.damping_ratio
    return 0.0 - ratio * size, np.sqrt((1.0 - ratio) * (1.0 + ratio)) * size, 0.0, 0.0, 0.0, 0.0


def _in_axes(node: Node | None, row: Array | Complex) -> Array | Complex:
    """Displacement and rotation in the displacement coordinate system of a node."""
    axes = np.eye(3) if node is None or node.axes is None else np.array(node.axes).T
    return np.concatenate((axes @ row[:3], axes @ row[3:]))


def _set(kind: int, lines: list[str]) -> str:
    return "".join(f"{line}\n" for line in (f"{-1:6}", f"{kind:6}", *lines, f"{-1:6}"))


def _reals(*values: float) -> str:
    return "".join(f"{value:25.16E}" for value in values).replace("E", "D")


def _integers(*numbers: int) -> str:
    return "".join(f"{number:10}" for number in numbers)


def _plain(name: str) -> str:
    """A name as a line of ASCII; a line of -1 would end the data set."""
    text = "".join(letter if letter.isprintable() else " " for letter in name)[:_LINE]
    return f"'{text}'" if text.strip() == "-1" else text


def _short(name: str) -> str:
    return name.replace(" ", "_")[:10]
