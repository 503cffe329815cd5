"""From data sets of universal files to a measurement: 58, 55, 2414, 15, 2411, 2420, 82, 164 and 2467."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from math import hypot, pi, sqrt

import numpy as np

from mbsvib.common.arguments import Matrix3
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.file_content import ContentError, check_dense, check_shape
from mbsvib.measurement.data import MeasuredMode, Measurement
from mbsvib.measurement.points import Node, matrix3
from mbsvib_export.uff_records import COHERENCE, Axis, DataSet, Function, data_sets, function_of

_NODES = 7  # type of entities in groups
_AT_NODES = 1
_CARTESIAN, _CYLINDRICAL, _SPHERICAL = 0, 1, 2  # types of coordinate systems
_NORMAL, _MODAL = 2, (2, 3, 7)  # types of analysis: normal modes; these, complex modes and those of first order
_DISPLACEMENT = 8
_REAL_VALUES, _COMPLEX_VALUES = (2, 4), (5, 6)  # types of data: single and double precision
# Frequencies of responses that agree to this share are the same: single precision, and five digits of text.
_SAME = 2e-5


@dataclass(frozen=True, slots=True)
class _System:
    """A coordinate system: ``kind`` (Cartesian, cylindrical or spherical), ``axes`` (3, 3) as columns, ``origin`` (3,),
    in units of the file.
    """

    kind: int
    axes: Array
    origin: Array

    def position(self, numbers: Array) -> Array:
        """Return a position in world axes from its three coordinates; angles are in degrees."""
        if self.kind == _CARTESIAN:
            local = numbers
        elif self.kind == _CYLINDRICAL:
            turn = np.radians(numbers[1])
            local = np.array([numbers[0] * np.cos(turn), numbers[0] * np.sin(turn), numbers[2]])
        else:
            tilt, turn = np.radians(numbers[1:])
            local = numbers[0] * np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        return np.asarray(self.origin + self.axes @ local)

    def axes_at(self, position: Array) -> Array:
        """Return the axes (3, 3) of displacements at a position: of the system, or along its coordinates there."""
        if self.kind == _CARTESIAN:
            return self.axes
        x, y, z = self.axes.T @ (position - self.origin)
        turn, tilt = np.arctan2(y, x), np.arctan2(np.hypot(x, y), z)
        radial, around = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        local = (radial, around, up) if self.kind == _CYLINDRICAL else (
            np.sin(tilt) * radial + np.cos(tilt) * up, np.cos(tilt) * radial - np.sin(tilt) * up, around)  # fmt: skip
        return np.asarray(self.axes @ np.column_stack(local))


@dataclass(slots=True)
class _Content:
    """What the preceding data sets have defined."""

    length: float = 1.0
    force: float = 1.0
    positions: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    system_of: dict[int, int] = field(default_factory=dict)
    systems: dict[int, _System] = field(default_factory=dict)
    defined_in: set[int] = field(default_factory=set)
    names: dict[int, str] = field(default_factory=dict)
    lines: list[tuple[int, ...]] = field(default_factory=list)
    functions: list[Function] = field(default_factory=list)
    modes: list[MeasuredMode] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    modes_left_out: set[str] = field(default_factory=set)


def measurement_of(raw: bytes) -> tuple[Measurement, tuple[str, ...]]:
    """Return responses, points, nodes, modes and lines of a universal file, in SI units, and modes that are left out.
    """
    content = _Content()
    sets = list(data_sets(raw))
    content.length, content.force = _file_units(sets)
    # coordinate systems before the nodes, and modes behind them
    for item in sorted(sets, key=lambda item: (item.kind in _MODES) - (item.kind == _SYSTEMS)):
        if item.kind in _READERS:
            _READERS[item.kind](item, content)
        elif item.kind not in (164, 151):
            content.left_out[f"data set {item.kind}"] += 1
    if not (content.functions or content.modes or content.positions):
        others = f"; only {', '.join(content.left_out)}" if content.left_out else ""
        raise ContentError(f"it holds no responses, modes or nodes{others}")
    used = content.defined_in.union(content.system_of.values()) - {0}
    unknown = sorted(used - content.systems.keys())
    if unknown:
        content.left_out[f"coordinate system {', '.join(map(str, unknown))}, which is not in the file: taken for that "
                         "of the world"] += 1  # fmt: skip
    nodes = tuple(Node(number, content.names.get(number, ""), position, _axes(number, content))
                  for number, position in content.positions.items())  # fmt: skip
    left_out = {kind: f"{count} of {kind}" for kind, count in content.left_out.items()}
    return (_measurement(content, nodes, tuple(left_out.values()), len(raw)),
            tuple(text for kind, text in left_out.items() if kind in content.modes_left_out))


def _measurement(content: _Content, nodes: tuple[Node, ...], left_out: tuple[str, ...], size: int) -> Measurement:
    coherences = [function for function in content.functions if function.kind == COHERENCE]
    functions = [function for function in content.functions if function.kind != COHERENCE]
    omega = 2 * pi * functions[0].frequency if functions else np.zeros(0)
    outputs: dict[str, Axis] = {}
    inputs: dict[str, Axis] = {}
    for function in functions:
        for axes, axis in ((outputs, function.output), (inputs, function.input)):
            known = axes.setdefault(axis.name, axis)
            if (known.point, known.unit) != (axis.point, axis.unit):
                raise ContentError(f"'{axis.name}' is at {known.point} in {known.unit!r} and at {axis.point} in "
                                   f"{axis.unit!r}")  # fmt: skip
    check_dense(2 * len(outputs) * max(1, len(inputs)), len(omega), size, "all pairs of outputs and inputs")
    responses = np.full((len(outputs), len(inputs), len(omega)), complex(np.nan, np.nan))
    rows, columns = ({name: k for k, name in enumerate(axes)} for axes in (outputs, inputs))
    for function in functions:
        at = rows[function.output.name], columns[function.input.name]
        if len(function.frequency) != len(omega) or not np.allclose(2 * pi * function.frequency, omega, _SAME, 0.0):
            raise ContentError(f"the responses of '{functions[0].output.name}' and '{function.output.name}' have "
                               f"different frequencies; expected one list for all")  # fmt: skip
        if not np.isnan(responses[at]).all():
            raise ContentError(f"the response of '{function.output.name}' to '{function.input.name}' is there twice")
        responses[at] = function.values
    coherence, unread = _coherence(coherences, responses, rows, columns, omega)
    return Measurement(
        omega, responses, tuple(outputs), tuple(inputs), coherence=coherence,
        output_units=tuple(axis.unit for axis in outputs.values()),
        input_units=tuple(axis.unit for axis in inputs.values()),
        output_points=tuple(axis.point for axis in outputs.values()),
        input_points=tuple(axis.point for axis in inputs.values()), nodes=nodes, modes=tuple(content.modes),
        lines=tuple(content.lines), left_out=(*left_out, *unread),
    )  # fmt: skip


def _coherence(
    coherences: list[Function], responses: Complex, rows: dict[str, int], columns: dict[str, int], omega: Array
) -> tuple[Array | None, tuple[str, ...]]:
    """Coherence of all responses, if the file has it, else None with what is left out."""
    values = np.full(responses.shape, np.nan)
    for function in coherences:
        at = rows.get(function.output.name), columns.get(function.input.name)
        if None not in at and len(function.frequency) == len(omega) and \
                np.allclose(2 * pi * function.frequency, omega, _SAME, 0.0):  # fmt: skip
            values[at] = function.values
    if coherences and not np.isnan(values[~np.isnan(responses)]).any():
        return values, ()
    return None, (f"{len(coherences)} of data set 58: coherence, not of all responses or of other frequencies",
                  ) if coherences else ()  # fmt: skip


def series_of(raw: bytes, kinds: tuple[int, ...]) -> list[Function]:
    """Return the functions of some kinds in a universal file, in SI units."""
    sets = list(data_sets(raw))
    units = _file_units(sets)
    functions = [function_of(item, *units, kinds) for item in sets if item.kind == 58]
    return [item for item in functions if not isinstance(item, str)]


def _file_units(sets: list[DataSet]) -> tuple[float, float]:
    """Units of length and force of a file; those of SI where it does not say them."""
    units = [_units(item) for item in sets if item.kind == 164] or [(1.0, 1.0)]
    if len(set(units)) > 1:
        raise ContentError(f"{len(units)} data sets 164 with different units")
    return units[0]


def _units(data: DataSet) -> tuple[float, float]:
    length, force = data.reals(1, 25, 25)
    if not (length > 0.0 and force > 0.0):
        raise ContentError(f"data set 164 at line {data.start} has units of {length} and {force}; expected positive "
                           f"factors")  # fmt: skip
    return length, force


def _function(data: DataSet, content: _Content) -> None:
    result = function_of(data, content.length, content.force)
    if isinstance(result, str):
        content.left_out[result] += 1
    else:
        content.functions.append(result)


def _add_node(content: _Content, number: int, system: int, position: Array) -> None:
    if number < 1 or number in content.positions:
        raise ContentError(f"the node {number} is there twice, or no number of a node")
    x, y, z = (position / content.length).tolist()
    content.positions[number], content.system_of[number] = (x, y, z), system


def _nodes_15(data: DataSet, content: _Content) -> None:
    for k in range(len(data.lines)):
        number, defined_in, system, _ = data.integers(k, 10, 10, 10, 10)
        position = np.array(data.reals(k, -40, 13, 13, 13))
        if defined_in in content.systems:
            position = content.systems[defined_in].position(position)
        content.defined_in.add(defined_in)
        _add_node(content, number, system, position)


def _nodes_2411(data: DataSet, content: _Content) -> None:
    for k in range(0, len(data.lines), 2):
        number, _, system, _ = data.integers(k, 10, 10, 10, 10)
        _add_node(content, number, system, np.array(data.reals(k + 1, 25, 25, 25)))


def _systems(data: DataSet, content: _Content) -> None:
    for k in range(2, len(data.lines), 6):
        number, kind, _ = data.integers(k, 10, 10, 10)
        rows = np.array([data.reals(k + 2 + i, 25, 25, 25) for i in range(4)])
        if kind not in (_CARTESIAN, _CYLINDRICAL, _SPHERICAL) or number in content.systems:
            raise ContentError(f"the coordinate system {number} of type {kind} is there twice, or of no known type")
        content.systems[number] = _System(kind, rows[:3].T, rows[3])


def _groups(data: DataSet, content: _Content) -> None:
    k = 0
    while k < len(data.lines):
        count = data.integers(k, *[-10] * 7, 10)[0]
        name = data.line(k + 1)[:80].strip()
        check_shape((count,), 1, sum(map(len, data.lines[k + 2 :])), f"data set {data.kind} at line {data.start}")
        for i in range(count):
            kind, number = data.integers(k + 2 + i // 2, *([-40] if i % 2 else []), 10, 10)
            if kind == _NODES:
                content.names[number] = name
        k += 2 + -(-count // 2)


def _lines(data: DataSet, content: _Content) -> None:
    count = data.integers(0, -10, 10)[0]
    numbers = data.table(2, count, (10,) * 8)
    line: list[int] = []
    for number in [*numbers.astype(int).tolist(), 0]:
        if number:
            line.append(number)
        elif line:
            content.lines.append(tuple(line))
            line = []


def _mode_55(data: DataSet, content: _Content) -> None:
    layout = data.integers(5, *[10] * 6)
    integers, reals = data.integers(6, 10, 10)
    if not (2 <= integers <= 100 and 1 <= reals <= 100):
        raise ContentError(f"data set 55 at line {data.start} announces {integers} and {reals} numbers of a mode")
    at = 6 + -(-(2 + integers) // 8)
    numbers = np.zeros(3)
    numbers[: min(reals, 3)] = data.table(at, reals, (13,) * 6)[:3]
    normal = float(numbers[0]), float(numbers[2])
    _add_mode(data, content, layout, data.line(0), normal, numbers[:2], at + -(-reals // 6))


def _mode_2414(data: DataSet, content: _Content) -> None:
    """Analysis data as newer programs write them: numbers of all kinds of analysis at fixed places."""
    layout, location = data.integers(8, *[10] * 6), data.integers(2, 10)[0]
    if location != _AT_NODES:
        _leave_out(content, layout[1],
                   f"data set 2414: analysis type {layout[1]}, at location {location}, not at nodes")  # fmt: skip
        return
    _, frequency, eigenvalue, _, damping, _ = data.reals(11, *[13] * 6)
    if frequency == 0.0 and eigenvalue > 0.0:
        frequency = sqrt(eigenvalue) / (2 * pi)
    _add_mode(data, content, layout, data.line(1), (frequency, damping), np.array(data.reals(12, 13, 13)), 13)


def _add_mode(
    data: DataSet, content: _Content, layout: list[int], name: str, normal: tuple[float, float], eigenvalue: Array,
    at: int,
) -> None:  # fmt: skip
    """Add a mode, its nodes from line ``at`` on; ``normal``: frequency [Hz], damping; ``eigenvalue`` (2,) of others."""
    _, analysis, characteristic, kind, values, per_node = layout
    if analysis not in _MODAL or kind != _DISPLACEMENT or characteristic not in (2, 3) \
            or values not in (*_REAL_VALUES, *_COMPLEX_VALUES) or per_node not in (3, 6):  # fmt: skip
        _leave_out(content, analysis, f"data set {data.kind}: analysis type {analysis}, result type {kind}, data type "
                                      f"{values}")  # fmt: skip
        return
    frequency, damping = normal
    if analysis != _NORMAL:
        size = hypot(*eigenvalue)
        frequency, damping = size / (2 * pi), -float(eigenvalue[0]) / size if size else 0.0
    is_complex = values in _COMPLEX_VALUES
    width = per_node * (2 if is_complex else 1)
    step = 1 + -(-width // 6)
    numbered, shapes = [], []
    for k in range(at, len(data.lines), step):
        numbered.append(data.integers(k, 10)[0])
        shapes.append(_displacement(data.table(k + 1, width, (13,) * 6), is_complex, numbered[-1], content))
    if len(set(numbered)) < len(numbered):
        raise ContentError(f"data set {data.kind} at line {data.start} has a node twice")
    shape: Array | Complex = np.asarray(shapes, dtype=complex if is_complex else float).reshape(len(numbered), 6)
    content.modes.append(MeasuredMode(name.strip(), frequency, damping, tuple(numbered), shape))


def _leave_out(content: _Content, analysis: int, words: str) -> None:
    """Note analysis data that are not read, and whether they are modes."""
    content.left_out[words] += 1
    if analysis in _MODAL:
        content.modes_left_out.add(words)


def _displacement(numbers: Array, is_complex: bool, node: int, content: _Content) -> Array | Complex:
    """Six components of a node in world axes; rotations that the file does not have are NaN."""
    values = numbers[0::2] + 1j * numbers[1::2] if is_complex else numbers
    six = np.concatenate((values, np.full(6 - len(values), np.nan)))
    six[:3] /= content.length
    axes = _axes(node, content)
    return np.asarray(six if axes is None else np.concatenate((np.dot(axes, six[:3]), np.dot(axes, six[3:]))))


def _axes(node: int, content: _Content) -> Matrix3 | None:
    """Axes of displacements at a node as columns, where they are not those of the world."""
    system = content.systems.get(content.system_of.get(node, 0))
    if system is None:
        return None
    axes = system.axes_at(np.multiply(content.positions[node], content.length))
    return None if (axes == np.eye(3)).all() else matrix3(axes)


_MODES = {55: _mode_55, 2414: _mode_2414}
_SYSTEMS = 2420
_READERS = {58: _function, 15: _nodes_15, 2411: _nodes_2411, _SYSTEMS: _systems, 2467: _groups, 82: _lines, **_MODES}
