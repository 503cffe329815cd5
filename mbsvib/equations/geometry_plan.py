"""The arrays of a mechanism as functions of some of its numbers: which entries follow which numbers is found once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Index
from mbsvib.elements.beam import Beam
from mbsvib.elements.beam_expansion import dampers, masses
from mbsvib.elements.bushing import Bushing, rows_of_matrices
from mbsvib.elements.families import connection_rows
from mbsvib.elements.rows import ElementRows, Rows
from mbsvib.elements.shared_rows import Expansion, Node, SharedRows
from mbsvib.equations.batch_values import Values
from mbsvib.equations.beam_prestress import unloaded_lines
from mbsvib.equations.inertia import SpatialInertia, tensor_factors
from mbsvib.equations.placing import Placing, with_columns
from mbsvib.equations.ports import port_bodies
from mbsvib.equations.scene import Scene
from mbsvib.kinematics.couplings import Couplings
from mbsvib.kinematics.relative_motion import in_order
from mbsvib.kinematics.shared_rows import Shared, shared_rows
from mbsvib.mechanism.changes import COEFFICIENTS, Slots
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import FLOATS

Places = Mapping[str, Mapping[str, Index]]


@dataclass(frozen=True)
class GeometryPlan:
    """How the arrays of a ``scene`` follow from the numbers of some slots; None stands for what is constant.

    ``bodies`` (k,) have the positions ``centres`` (3, k), and ``ports`` (p,) theirs at the centres ``port_centres``
    (3, p). Of ``springs``, ``coefficients`` are the rows of numbers of some columns by name; elements of ``matrices``
    have rows that are made anew; ``replacing`` are connections that vary, one that replaces each in the equations with
    coefficients of its own, and its columns; ``elastic`` are parts whose rows in the ``expansion`` vary. ``masses`` are
    bodies with the rows of their masses, ``tensors`` those whose tensor varies.
    """

    scene: Scene
    index: Places
    bodies: Index
    centres: Index
    twists: Placing | None
    cuts: Placing | None
    measured: Placing | None
    springs: ElementRows
    elements: Placing | None
    coefficients: Mapping[str, tuple[Index, Index]]
    matrices: tuple[int, ...]
    masses: tuple[Index, Index]
    tensors: tuple[Tensors, ...]
    ports: Index
    port_centres: Index
    inertial_outputs: tuple[Index | None, ...]
    replacing: tuple[tuple[Any, Any, Index], ...]
    expansion: Expansion | None
    elastic: tuple[Beam, ...]

    @property
    def constant(self) -> bool:
        """Whether coefficients, masses and tensors alone vary: places, directions and ratios are constant."""
        varies = any(part is not None for part in (self.twists, self.cuts, self.measured, self.elements))
        coupled = any(part.name in self.index for part in self.scene.couplers)
        return not (varies or coupled or len(self.bodies) or len(self.ports) or self.matrices)

    def at(self, values: Values) -> Scene:
        """Return the arrays of the mechanism in all variants.

        Arrays (3, n) of vectors become (3, variants, n) where they vary, all others (variants, ...).
        """
        scene, numbers = self.scene, values.numbers
        changes: dict[str, Any] = {}
        if len(self.bodies):
            position = values.repeated(scene.position)
            position[:, self.bodies] = numbers[self.centres].transpose(2, 1, 0)
            changes["position"] = position
        if self.twists is not None:
            linear, angular, point = self.twists.at(values)
            changes["coordinates"] = replace(scene.coordinates, linear=linear, angular=angular, point=point)
        if scene.cuts is not None and (self.cuts is not None or scene.cuts.couplings is not None):
            rows = scene.cuts.rows if self.cuts is None else _rows(scene.cuts.rows, self.cuts, values)
            changes["cuts"] = replace(scene.cuts, rows=rows, couplings=self._couplings(values))
        if self.springs is not scene.springs or self.elements is not None or self.coefficients or self.matrices or (
                self.replacing):
            changes["springs"] = self._springs(values)
        if len(self.ports) or any(rows is not None for rows in self.inertial_outputs):
            changes["port"] = self._ports(numbers)
        if len(self.masses[0]) or self.tensors:
            changes["inertia"] = self._inertia(values)
        if self.elastic:
            changes["shared"] = self._shared(values)
        return replace(scene, **changes) if changes else scene

    def _springs(self, values: Values) -> ElementRows:
        """Rows of the spring-dampers, in all directions with a coefficient that varies or is not zero."""
        springs, numbers = self.springs, values.numbers
        changes: dict[str, Any] = {}
        for key, (columns, rows) in self.coefficients.items():
            array = values.repeated(getattr(springs, key))
            array[:, columns] = numbers[rows].T
            changes[key] = array
        made: dict[str, Any] = {}
        for owner, part, columns in self.replacing:
            if owner.name not in made:
                made[owner.name] = owner.replaced_coefficients(values.fields[owner.name])
            for key, array in part.row_values(made[owner.name][part.name], springs.unit[columns]).items():
                if key not in changes:
                    changes[key] = values.repeated(getattr(springs, key))
                changes[key][:, columns] = array.T
        if self.elements is not None:
            changes["rows"] = _rows(springs.rows, self.elements, values)
        springs = replace(springs, **changes) if changes else springs
        if not self.matrices:
            return springs
        number = self.scene.topology.body_numbers
        return ElementRows.join([springs, *(_of_matrix(self.scene.elements[i], i, number, values)
                                            for i in self.matrices)])  # fmt: skip

    def _shared(self, values: Values) -> Shared:
        """Rows between more than two bodies, some with matrices or coefficients that vary."""
        assert self.expansion is not None
        assert self.scene.shared is not None
        loaded = any(rows.stiffness is not None for rows in self.expansion.elastic)
        mass, elastic, lines = {}, {}, {}
        for part in self.elastic:
            varied = values.beams[part.name]
            rows = masses(varied)
            mass[part.name], elastic[part.name] = iter(rows), iter(dampers(varied, rows))
            if loaded and part.element_names[0] in self.index:
                lines[part.name] = iter(unloaded_lines(varied))
        points: dict[Node, Any] = {}

        def of_variants(constant: Sequence[SharedRows], made: Mapping[str, Iterator[SharedRows]]) -> list[SharedRows]:
            result = []
            for rows in constant:
                varied = (made if rows.stiffness is None else lines).get(rows.owner)
                if varied is not None:
                    new = next(varied)
                    nodes = tuple([replace(node, owner=rows.owner) if any(map(np.ndim, at.point)) else node
                                   for node, at in zip(rows.nodes, new.nodes, strict=True)])  # fmt: skip
                    points.update((node, at.point) for node, at in zip(nodes, new.nodes, strict=True) if node.owner)
                    rows = replace(new, nodes=nodes)
                result.append(rows)
            return result

        expansion = replace(self.expansion, mass=tuple(of_variants(self.expansion.mass, mass)),
                            elastic=tuple(of_variants(self.expansion.elastic, elastic)))  # fmt: skip
        return shared_rows(expansion, self.scene.topology.body_numbers, self.scene.shared.first, points)

    def _couplings(self, values: Values) -> Couplings | None:
        """The relations of couplers, and the coordinates of cut joints that they measure."""
        scene, fields = self.scene, values.fields
        couplings = None if scene.cuts is None else scene.cuts.couplings
        if couplings is None:
            return None
        value = couplings.value
        for i, part in enumerate(scene.couplers):
            if part.name in self.index:
                value = values.repeated(value) if value.ndim == 1 else value
                value[:, couplings.row == i] = part.coefficients_of(fields[part.name]).T
        measured = couplings.measured
        if self.measured is not None:
            measured = _rows(measured, self.measured, values)
        return replace(couplings, value=value, measured=measured)

    def _ports(self, numbers: Array) -> Any:
        """Ports; without a position they are at the centre of mass of their body, or of the body relative to ground."""
        port, rows = self.scene.port, self.scene.port.rows
        if len(self.ports):
            rows = replace(rows, point=with_columns(rows.point, self.ports, numbers[self.port_centres].swapaxes(1, 2)))
        outputs = [(row, output, at if own is None else numbers[own].T)
                   for (row, output, at), own in zip(port.inertial_outputs, self.inertial_outputs, strict=True)]
        return replace(port, rows=rows, inertial_outputs=tuple(outputs))

    def _inertia(self, values: Values) -> SpatialInertia:
        linear, angular, numbers = self.scene.inertia.linear, self.scene.inertia.angular, values.numbers
        bodies, rows = self.masses
        if len(bodies):
            linear = values.repeated(linear)
            linear[:, bodies] = np.sqrt(numbers[rows].T)
        angular = values.repeated(angular) if self.tensors else angular
        for group in self.tensors:
            root = group.roots(values)
            missing = root.shape[-2] - angular.shape[-2]
            if missing > 0:  # steps have more rows
                angular = np.pad(angular, ((0, 0), (0, 0), (0, missing), (0, 0)))
            angular[:, group.bodies, : root.shape[-2]] = root
        return SpatialInertia(linear, angular)


@dataclass(frozen=True, slots=True)
class Tensors:
    """Bodies (k,) whose tensors vary: ``entries`` (k, 6) and ``axes`` (k, 3, 3) of the model, with the rows of the
    numbers of the entries (6, k), and the numbers of their ``turns`` (k,) among those that vary, None where either is
    constant.
    """

    bodies: Index
    entries: Array
    axes: Array
    entry_rows: Index | None
    turns: Index | None

    @staticmethod
    def groups(scene: Scene, slots: Slots) -> tuple[Tensors, ...]:
        """Return the bodies of a scene in up to three groups."""
        fields = [slots.complete.get(body.name, {}) for body in scene.bodies]
        result = []
        for keys in (("inertia", "orientation"), ("inertia",), ("orientation",)):
            which = [k for k, own in enumerate(fields) if own.keys() & {"inertia", "orientation"} == set(keys)]
            if which:
                bodies = [scene.bodies[k] for k in which]
                result.append(Tensors(
                    np.array(which), np.array([body.inertia for body in bodies]),
                    np.array([body.orientation for body in bodies]),
                    np.stack([fields[k]["inertia"] for k in which], axis=-1) if "inertia" in keys else None,
                    np.array([slots.turning[body.name] for body in bodies]) if "orientation" in keys else None,
                ))  # fmt: skip
        return tuple(result)

    def roots(self, values: Values) -> Array:
        """Return their square roots in world axes (..., k, rows, 3)."""
        axes, entries = self.axes, self.entries
        if self.turns is not None:
            axes = values.rotations[:, self.turns] @ axes
        if self.entry_rows is not None:
            entries = values.numbers[self.entry_rows].transpose(2, 1, 0)
        return np.asarray(tensor_factors(entries) @ axes.swapaxes(-1, -2))


def geometry_plan(model: Mechanism, scene: Scene, slots: Slots) -> GeometryPlan:
    """Return how the arrays of a mechanism follow from the numbers of some slots."""
    index = slots.complete
    number = scene.topology.body_numbers
    moved = {number[name]: fields["position"] for name, fields in index.items()
             if name in number and "position" in fields}  # fmt: skip
    springs, elements, coefficients, matrices = _elements(scene, number, slots)
    masses = [(number[name], fields["mass"]) for name, fields in index.items() if name in number and "mass" in fields]
    bodies, rows = (np.array([pair[i] for pair in masses], dtype=np.intp) for i in (0, 1))
    ports, inertial = _centred_ports(model, scene, moved, number)
    return GeometryPlan(
        scene, index, np.array(list(moved), dtype=np.intp), _stacked(list(moved.values())),
        _twists(scene, slots, moved), _cuts(scene, slots), _measured(scene, slots), springs, elements, coefficients,
        matrices, (bodies, rows), Tensors.groups(scene, slots), np.array([row for row, _ in ports], dtype=np.intp),
        _stacked([at for _, at in ports]), inertial, _replacing(scene, springs, slots), model.expansion,
        tuple([part for name in slots.index if isinstance(part := slots.parameters.parts[name], Beam)]),
    )  # fmt: skip


def _stacked(rows: Sequence[Index]) -> Index:
    """Rows of vectors, (3, k)."""
    return np.array(rows, dtype=np.intp).reshape(-1, 3).T


def _rows(rows: Rows, placing: Placing, values: Values) -> Rows:
    force, moment, point = placing.at(values)
    return Rows(rows.first, rows.second, point, force, moment)


def _twists(scene: Scene, slots: Slots, moved: Mapping[int, Index]) -> Placing | None:
    twists, start = scene.coordinates, 0
    owners, centres, pitched = [], [], []
    for branch in in_order(scene.topology.branches):
        joint = None if branch.joint == FLOATS else scene.topology.joints[branch.joint]
        columns = range(start, start + (6 if joint is None else len(joint.freedom)))
        start = columns.stop
        if (joint is None or joint.position is None) and branch.body in moved:
            centres.append((moved[branch.body], columns))
        if joint is not None:
            owners.append((joint, columns))
            pitch = slots.complete.get(joint.name, {}).get("pitch")
            if pitch is not None:
                pitched += [(pitch, column, twists.angular[:, column]) for column in columns]
    return Placing.of((twists.linear, twists.angular, twists.point), owners, slots, centres, pitched)


def _cuts(scene: Scene, slots: Slots) -> Placing | None:
    cuts = scene.cuts
    if cuts is None:
        return None
    owners, pitched = [], []
    for count, k in enumerate(scene.topology.cut):
        joint = scene.topology.joints[k]
        columns = np.flatnonzero(cuts.joint[: len(cuts.rows.first)] == count).tolist()
        owners.append((joint, columns))
        pitch = slots.complete.get(joint.name, {}).get("pitch")
        if pitch is not None:
            pitched += [(pitch, column, -cuts.rows.force[:, column])
                        for column, (direction, _) in zip(columns, joint.locked, strict=True) if direction == "z"]
    rows = cuts.rows
    return Placing.of((rows.force, rows.moment, rows.point), owners, slots, (), pitched, pitches_second=True)


def _measured(scene: Scene, slots: Slots) -> Placing | None:
    if scene.cuts is None or scene.cuts.couplings is None:
        return None
    rows, owners = scene.cuts.couplings.measured, [(joint, [k]) for k, (joint, _) in enumerate(scene.measured)]
    return Placing.of((rows.force, rows.moment, rows.point), owners, slots)


def _elements(
    scene: Scene, number: Mapping[str, int], slots: Slots
) -> tuple[ElementRows, Placing | None, dict[str, tuple[Index, Index]], tuple[int, ...]]:
    """Rows of elements, how they are placed, rows of their coefficients, and the elements with 6x6 matrices that vary.
    """
    index, varied = slots.complete, set(slots.target.tolist())
    parts = list(scene.elements)
    varying = [i for i, part in enumerate(parts) if part.name in index]
    if not varying:
        return scene.springs, None, {}, ()
    matrices = tuple([i for i in varying if isinstance(parts[i], Bushing) and _has_matrix(parts[i])])
    for i in varying:
        if i not in matrices:
            fields = index[parts[i].name]
            active = {field: _active(getattr(parts[i], field), fields[field], varied)
                      for field in COEFFICIENTS if field in fields}  # fmt: skip
            parts[i] = replace(parts[i], **active)
    springs = scene.springs if parts == list(scene.elements) else connection_rows(parts, number)
    if matrices:
        springs = springs.take((~np.isin(springs.owner, matrices)).nonzero()[0])
    owners = [(scene.elements[i], np.flatnonzero(springs.owner == i).tolist()) for i in varying if i not in matrices]
    columns_of: dict[str, list[tuple[int, int]]] = {}
    for part, columns in owners:
        numbers: Any = {field: places[..., None] for field, places in index[part.name].items()}
        of_rows = part.row_values(numbers, springs.unit[columns]) if numbers.keys() & set(COEFFICIENTS) else {}
        for key, places in of_rows.items():
            pairs = zip(columns, places[:, 0].astype(int).tolist(), strict=True)
            columns_of.setdefault(key, []).extend([pair for pair in pairs if pair[1] in varied])
    coefficients = {key: (np.array([column for column, _ in pairs], dtype=np.intp),
                          np.array([row for _, row in pairs], dtype=np.intp))
                    for key, pairs in columns_of.items() if pairs}  # fmt: skip
    rows = springs.rows
    placing = Placing.of((rows.force, rows.moment, rows.point), owners, slots)
    return springs, placing, coefficients, matrices


def _replacing(scene: Scene, springs: ElementRows, slots: Slots) -> tuple[tuple[Any, Any, Index], ...]:
    """Connections that vary, with one that replaces each in the equations and its columns."""
    numbers = {part.name: i for i, part in enumerate(scene.elements)}
    owners = [slots.parameters.parts[name] for name in slots.index]
    return tuple([(owner, scene.elements[numbers[name]], np.flatnonzero(springs.owner == numbers[name]))
                  for owner in owners for name in owner.replaced_coefficients({}) if name in numbers])  # fmt: skip


def _active(nominal: Any, rows: Index, varied: set[int]) -> Any:
    """Values that are not zero where those of the model are not, or vary: the element has a row there."""
    if rows.ndim:
        return tuple([value or float(int(row) in varied) for value, row in zip(nominal, rows, strict=True)])
    return nominal or float(int(rows) in varied)


def _has_matrix(part: Any) -> bool:
    return isinstance(part.stiffness[0], tuple) or isinstance(part.damping[0], tuple)


def _of_matrix(part: Any, owner: int, number: Mapping[str, int], values: Values) -> ElementRows:
    """Rows of a bushing with matrices: eigenvectors of its stiffness, then of its damping (symmetric parts)."""
    fields, count = values.fields[part.name], values.count
    axes = np.broadcast_to(np.array(part.orientation), (count, 3, 3))
    if "orientation" in fields:
        axes = values.rotations[:, values.slots.turning[part.name]] @ np.array(part.orientation)
    point = np.broadcast_to(fields.get("position", np.array(part.position)[:, None]), (3, count)).T
    matrices = []
    for key in ("stiffness", "damping"):
        matrix = np.moveaxis(fields[key], -1, 0) if key in fields else np.array(getattr(part, key))
        matrix = matrix if matrix.shape[-2:] == (6, 6) else matrix[..., None] * np.eye(6)
        matrices.append(np.broadcast_to(matrix, (count, 6, 6))[:, None])
    ends = [np.array([k]) for k in (number[part.first], number[part.second], owner)]
    return rows_of_matrices(ends, point[:, None], axes[:, None], matrices)


def _centred_ports(
    model: Mechanism, scene: Scene, moved: Mapping[int, Index], number: Mapping[str, int]
) -> tuple[list[tuple[int, Index]], tuple[Index | None, ...]]:
    """Rows of ports without a position, at the centre of mass of a body that moves, and those of inertial outputs."""
    at_centre, centre_of = [], {}
    for row, (part, body) in enumerate(port_bodies(model, number)):
        if part.position is None and body in moved:
            at_centre.append((row, moved[body]))
            centre_of[part] = moved[body]
    return at_centre, tuple([centre_of.get(output) for _, output, _ in scene.port.inertial_outputs])
