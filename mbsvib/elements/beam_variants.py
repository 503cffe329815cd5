"""Beams in many variants at once: their numbers as arrays, and where their nodes and elements are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Matrix3, Vector
from mbsvib.common.arrays import Array, Bools
from mbsvib.elements.beam_element import Element
from mbsvib.elements.beam_points import PARALLEL, straight
from mbsvib.elements.part import Composed
from mbsvib.elements.sections import Circle, Rectangle, with_fields
from mbsvib.linalg.components import add, product, rotation_vector, scale, transpose

# The horizontal part of an element's direction below which it stands upright.
UPRIGHT = 0.05
MATERIAL = ("E", "rho", "nu", "G")
DAMPING = frozenset({"alpha", "beta", "damping_ratio"})
# Numbers of which each has limits of its own, those of its sign.
SIGNED = DAMPING | {"E", "G", "rho", "A", "Iy", "Iz", "J", "ky", "kz"}


class InVariants(Composed):
    """What a beam says of variants of itself, with numbers that are arrays (n,) or (3, n)."""

    __slots__ = ()

    if TYPE_CHECKING:  # what beams are
        section: Any
        material: Any
        start: Vector | None
        end: Vector | None
        axis: Vector | None
        length: float | None
        y_axis: Any
        beta: float

        def lines(self) -> list[tuple[Any, Any, Any]]: ...
        def frames(self) -> list[tuple[float, Matrix3]]: ...
        def parts(self) -> list[Element]: ...
        def middle(self, i: int) -> Vector: ...

    @property
    def batched_fields(self) -> frozenset[str]:
        """All of its numbers, unless it is bent, but for ends by which its axes may jump."""
        jumping = frozenset() if self.turns_smoothly else frozenset({"start", "end"})
        return frozenset() if self.displacements is not None else frozenset(
            item.name for item in self.parameter_fields()) - jumping  # fmt: skip

    @property
    def turns_smoothly(self) -> bool:
        """Whether its axes turn smoothly with its ends: those of one that stands upright jump as it is tilted."""
        return self.y_axis is not None or not any(
            np.hypot(axes[0][0], axes[1][0]) < UPRIGHT for _, axes in self.frames())  # fmt: skip

    @property
    def signed_fields(self) -> frozenset[str]:
        return SIGNED | ({"width", "height", "radius"} if isinstance(self.section, Circle | Rectangle) else set())

    def suspects(self, values: Mapping[str, Array]) -> Bools | bool:
        if not values.keys() <= self.batched_fields:
            return True
        nu, varied = values.get("nu", np.zeros(1)), self.of_variants(values)
        result: Bools = ~((nu > -1.0) & (nu <= 0.5)) | varied.section.doubtful
        for name, value in values.items():
            if value.ndim == 1 and name != "nu":
                result = result | (value < 0.0 if name in DAMPING else value <= 0.0)
        if self.places & values.keys():
            with np.errstate(divide="ignore", invalid="ignore"):
                result = result | ~np.asarray([sine >= PARALLEL for _, _, sine in varied.lines()]).all(axis=0)
        return result

    def of_variants(self, values: Mapping[str, Array]) -> Self:
        """Return the beam with the numbers of many variants, unchecked, for its elements alone.

        Parameters
        ----------
        values : mapping of str to array, shape (n,) or (3, n)
            Values of its ``batched_fields``.

        Returns
        -------
        Beam
            The beam, whose elements have arrays; components of points and axes have them.
        """
        elsewhere = self.nodes_of_variants(values) if self.places & values.keys() else {}
        return with_fields(self, {"section": with_fields(self.section, values), **values, **elsewhere,
                                  "material": with_fields(self.material, values)})  # fmt: skip

    @property
    def places(self) -> frozenset[str]:
        """Numbers that put its nodes elsewhere."""
        return frozenset({"start", "end", "length"})

    def nodes_of_variants(self, values: Mapping[str, Array]) -> dict[str, Any]:
        """Return the fields that its ``places`` change, with components of variants.

        Parameters
        ----------
        values : mapping of str to array
            Values of its ``batched_fields``, with the variants on the last axis.

        Returns
        -------
        dict
            ``points``.
        """
        start: Any = tuple(values.get("start", self.start))  # type: ignore[arg-type]
        if self.axis is None:
            end: Any = tuple(values.get("end", self.end))  # type: ignore[arg-type]
        else:
            end = add(start, scale(values.get("length", self.length), check.axis(self.axis, self.name, "axis")))
        return {"points": straight(start, end, len(self.points) - 1)}

    def replaced_coefficients(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        beam, count = self.of_variants(fields), np.broadcast_shapes(*[value.shape[-1:] for value in fields.values()])
        made: dict[int, dict[str, Array]] = {}
        for part in (parts := beam.parts()):
            if id(part) not in made:
                k = np.array([np.broadcast_to(value, count) for value in part.stiffness()])
                made[id(part)] = {"stiffness": k, "damping": beam.beta * k}
        return {name: made[id(part)] for name, part in zip(self.element_names, parts, strict=True)}

    def replaced_places(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        if not self.places & fields.keys():
            return {}
        varied, count = self.of_variants(fields), np.broadcast_shapes(*[value.shape[-1:] for value in fields.values()])

        def of_variants(vector: Any) -> Array:
            return np.array([np.broadcast_to(x, count) for x in vector])

        result = {name: {"position": of_variants(point)} for name, point in varied.node_names.items()}
        turns: dict[int, Array] = {}
        for i, (name, (_, axes), (_, nominal)) in enumerate(zip(self.element_names, varied.frames(), self.frames(),
                                                                strict=True)):  # fmt: skip
            if id(axes) not in turns:
                turns[id(axes)] = of_variants(rotation_vector(product(axes, transpose(nominal))))
            result[name] = {"position": of_variants(varied.middle(i)), "orientation": turns[id(axes)]}
        return result
