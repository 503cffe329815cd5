"""Loaded beams in variants: the forces in their elements and their geometric stiffness, of all variants at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbsvib.common.arrays import Array, Bools, Index
from mbsvib.elements.beam import Beam
from mbsvib.elements.rows import ElementRows
from mbsvib.elements.shared_rows import SharedRows
from mbsvib.equations.batch_values import Values
from mbsvib.equations.beam_prestress import bent_lines, check_compression, least_energy_forces, unloaded_lines
from mbsvib.equations.matrices import MinimalRows
from mbsvib.equations.scene import Scene
from mbsvib.equations.statics import forces_along
from mbsvib.equations.wrenches import with_values_at
from mbsvib.kinematics.relative_motion import Triplets
from mbsvib.kinematics.shared_rows import in_order, shared_rows
from mbsvib.linalg.components import stacked_all
from mbsvib.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class Prestress:
    """The loaded ``beams`` of a ``model`` whose expansion has rows for the bent lines of all elements.

    ``lines`` (rows,) are the places of these rows among the elastic ones that bodies share.
    """

    model: Mechanism
    beams: tuple[Beam, ...]
    lines: Index

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of the elements of all beams."""
        return tuple([name for beam in self.beams for name in beam.element_names])

    def weights(self, values: Values) -> dict[str, dict[str, Array]]:
        """Return forces and places (3, n) of the weights on nodes that differ in variants, by name and field."""
        varied, result = values.fields.get("gravity", {}).get(""), {}
        gravity = np.array(self.model.gravity or (0.0, 0.0, 0.0))[:, None] if varied is None else varied
        for beam in self.beams:
            if varied is None and beam.name not in values.fields:
                continue
            masses, points = values.beams.get(beam.name, beam).node_weights()
            for i in range(masses.shape[-1]):
                fields = {"force": gravity * masses[..., i], "position": points[..., i, :].T.reshape(3, -1)}
                result[f"{beam.name}.weight{i}"] = {
                    key: np.broadcast_to(array, (3, values.count)) for key, array in fields.items()}  # fmt: skip
        return result

    def columns(self, scene: Scene, springs: ElementRows) -> Index:
        """Return the columns of all elements among the rows of connections, by element and axis."""
        number = {part.name: i for i, part in enumerate(scene.elements)}
        result = []
        for name in self.elements:
            own = np.flatnonzero(springs.owner == number[name])
            result.append(own[np.argsort(springs.unit[own].argmax(axis=1))])
        return np.concatenate(result)

    def loaded(
        self, scene: Scene, relative: Triplets, minimal: MinimalRows, columns: Index, values: Values
    ) -> tuple[Scene, Bools]:
        """Return the arrays of variants with the forces in elements, and the stiffness of bent lines, and which complex
        steps (n,) have no derivative, as an element takes a force at once.

        ``relative``: the relative displacements of the scene; ``minimal``: its rows in minimal coordinates;
        ``columns``: those of the elements.
        """
        assert scene.loads is not None
        assert scene.shared is not None
        assert scene.shared.elastic is not None
        applied, elastic, count, names = scene.loads[0], scene.shared.elastic, values.count, self.elements
        at = np.array([applied.names.index(name) for name in names])
        axes = stacked_all([own for beam in self.beams for _, own in values.beams.get(beam.name, beam).frames()])
        preload = self._forces(replace(scene, loads=(_with_wrenches(applied, at, np.zeros((count, len(at), 6))), {})),
                               relative, minimal, columns, values)  # fmt: skip
        lost: Bools = np.asarray(np.isnan(preload.imag).any(axis=(-1, -2)))
        if lost.any():
            preload.imag[lost] = 0.0
        turned = np.concatenate([(axes @ half[..., None])[..., 0] for half in (preload[..., :3], preload[..., 3:])], -1)
        stiffness = elastic.stiffness if elastic.stiffness.ndim == 2 else values.repeated(elastic.stiffness)
        stiffness[:, self.lines] = np.concatenate([rows.stiffness for rows in self._lines(preload, values)], axis=-1)
        elastic = replace(elastic, stiffness=stiffness)
        scene = replace(scene, loads=(_with_wrenches(applied, at, turned), {}),
                        shared=replace(scene.shared, elastic=elastic))  # fmt: skip
        return scene, lost

    def _forces(
        self, scene: Scene, relative: Triplets, minimal: MinimalRows, columns: Index, values: Values
    ) -> Array:
        """The forces (n, elements, 6) that balance a scene whose elements have none, in their axes."""
        springs, start = scene.springs, scene.locked
        residual, _ = forces_along(scene, minimal.motion)
        forces = least_energy_forces(
            minimal.rows[..., columns, :], relative.dense(start, start + len(springs.owner))[..., columns, :],
            np.sqrt(springs.stiffness[..., columns]), -residual)  # fmt: skip
        shape = (values.count, len(self.elements), 6)
        return np.array(np.broadcast_to(forces.reshape(-1, *shape[1:]), shape), np.result_type(forces, values.numbers))

    def _lines(self, preload: Array, values: Values) -> list[SharedRows]:
        gravity = values.fields.get("gravity", {}).get("")
        fall: Any = np.array(self.model.gravity or (0.0, 0.0, 0.0)) if gravity is None else gravity.T[:, None, :]
        result, start = [], 0
        for beam in self.beams:
            own = preload[:, start : start + len(beam.element_names)]
            falls = np.broadcast_to(fall, (*own.shape[:-1], 3))
            varied = values.beams.get(beam.name, beam)
            check_compression(varied, own)
            result += bent_lines(varied, own, falls, every=True)
            start += own.shape[1]
        return result


def _with_wrenches(applied: Any, at: Index, wrenches: Array) -> Any:
    """Applied wrenches with those (n, k, 6) of the pairs ``at`` (k,)."""
    pairs, count = applied.pairs, len(wrenches)
    force, torque = (with_values_at(array, at, np.moveaxis(part, -1, 0), count) for array, part in (
        (pairs.force, wrenches[..., :3]), (pairs.torque, wrenches[..., 3:])))  # fmt: skip
    return replace(applied, pairs=replace(pairs, force=force, torque=torque))


def prestress(model: Mechanism, scene: Scene) -> tuple[Prestress, Scene] | None:
    """Return what the variants of a loaded mechanism with beams share, and its scene with rows for all bent lines.

    None without loaded beams, and where forces in superelements, in bent beams or in parts on hubs are not stated for
    variants.
    """
    expansion = model.expansion
    if scene.loads is None or scene.shared is None or expansion is None or model.hubs or scene.shared.elastic is None:
        return None
    beams = [part for part in expansion.owners if isinstance(part, Beam)]
    constant = tuple([rows for rows in expansion.elastic if rows.stiffness is None])
    names: Mapping[str, int] = {name: i for i, name in enumerate(scene.shared.names)}
    others = {rows.owner for rows in (*expansion.mass, *constant)} - {beam.name for beam in beams}
    if others or not beams or {beam.name for beam in beams} != names.keys() or any(
            beam.displacements is not None for beam in beams):  # fmt: skip
        return None
    beams.sort(key=lambda beam: names[beam.name])
    lines: list[SharedRows] = []
    for beam in beams:
        lines += unloaded_lines(beam)
    ordered = in_order((*constant, *lines))
    first = np.cumsum([0, *[rows.matrix.shape[-2] for rows in ordered]])
    starts = {id(rows): start for rows, start in zip(ordered, first.tolist(), strict=False)}
    places = np.concatenate([starts[id(rows)] + np.arange(rows.matrix.shape[-2]) for rows in lines])
    model = model.with_parts(expansion=replace(expansion, elastic=(*constant, *lines)))
    assert model.expansion is not None
    scene = replace(scene, shared=shared_rows(model.expansion, scene.topology.body_numbers, scene.shared.first))
    return Prestress(model, tuple(beams), places), scene
