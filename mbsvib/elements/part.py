"""The base class of all parts: arguments of the call that made them, parameters, and change of pose."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from operator import attrgetter
from typing import Any, ClassVar, Self

import numpy as np

from mbsvib.common.arguments import Vector, rotated
from mbsvib.common.arrays import Array, Bools
from mbsvib.common.display import Completed
from mbsvib.elements.placement import Placement
from mbsvib.elements.pose import Pose
from mbsvib.elements.roles import ParameterField, Role
from mbsvib.errors import NoWordsError

# What checks the arguments of the call that adds a part and builds it, by class, as the table of families has it.
MAKERS: dict[type, Callable[..., Any]] = {}


def derived(default: Any = None) -> Any:
    """Declare a field that is computed from the others: neither compared, shown nor saved."""
    return field(default=default, repr=False, compare=False, metadata={"derived": True})


@dataclass(frozen=True, slots=True)
class Part(Completed):
    """A named, immutable part of a model, with the ``roles`` of its fields in the order of its parameters."""

    _engine = (
        "all_in_pose arguments batched_fields body_positions constructor_kwargs in_pose parameter_fields placed "
        "point_fields replaced_coefficients replaced_fields replaced_places roles signed_fields suspects "
        "suspects_among symbol with_values"
    )

    roles: ClassVar[Mapping[str, Role]] = {}

    name: str
    """Name in the model."""

    @property
    def family(self) -> str:
        """Name of its family in texts, such as ``"torsion spring"``."""
        return re.sub("(?<!^)([A-Z])", r" \1", type(self).__name__).lower()

    @property
    def point_fields(self) -> tuple[str, ...]:
        """Names of its fields that are points [m]; of two points the first is on the first body."""
        return tuple([key for key in ("position", "start", "end") if getattr(self, key, None) is not None])

    @property
    def body_positions(self) -> Mapping[str, Vector]:
        """Names and positions [m] of the bodies that it adds to the mechanism."""
        return {}

    @property
    def symbol(self) -> str:
        """Its symbol in pictures: body, joint, spring (along a line), bushing, coupler, composed, arrow, or none."""
        return ""

    @property
    def batched_fields(self) -> frozenset[str]:
        """Fields whose values many variants can have at once; with others they are linearized one by one."""
        return _fields_that(type(self), "batched")  # type: ignore[arg-type]

    @property
    def signed_fields(self) -> frozenset[str]:
        """Fields of which the part accepts all values that have the signs of its own; others are checked each time."""
        return _fields_that(type(self), "signed")  # type: ignore[arg-type]

    def suspects(self, values: Mapping[str, Array]) -> Bools | bool:
        """Return which variants have values that such a part might refuse, so that it is to be built with them.

        Parameters
        ----------
        values : mapping of str to array
            New values by field, with the variants on the last axis.

        Returns
        -------
        array of bool, shape (variants,), or bool
            Variants to check, or whether all are.
        """
        known = {key: np.array(getattr(self, key), dtype=float)[..., None, None]
                 for key in (*values, *self.point_fields) if key in self.roles}  # fmt: skip
        result = self.suspects_among({key: array[..., None, :] for key, array in values.items()}, known)
        return result if isinstance(result, bool) else result[0]

    @classmethod
    def suspects_among(cls, values: Mapping[str, Array], nominal: Mapping[str, Array]) -> Bools | bool:
        """Return which of many such parts have values that they might refuse, by the roles of their fields.

        Parameters
        ----------
        values : mapping of str to array, shape (..., parts, variants)
            New values by field.
        nominal : mapping of str to array, shape (..., parts, 1)
            Those of the parts as they are, also of all their points.

        Returns
        -------
        array of bool, shape (parts, variants), or bool
            Variants to check, or whether all are.
        """
        if not values.keys() <= cls.roles.keys():
            return True
        result: Bools | bool = False
        for name in values:
            result = result | cls.roles[name].doubtful(nominal, name, values)
        return result

    def replaced_fields(self, fields: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the values of the part of the same name that replaces it in the equations.

        Parameters
        ----------
        fields : mapping of str to array
            Values by field, with the variants on the last axis.

        Returns
        -------
        mapping of str to array
            The same values by the fields of that part; of a part that nothing replaces, as they are.
        """
        return fields

    def replaced_coefficients(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        """Return stiffness and damping of the connections that replace it.

        Parameters
        ----------
        fields : mapping of str to array
            Values of its fields by name, with the variants on the last axis.

        Returns
        -------
        dict
            {name of a connection: {field: values}}; none for what stands for itself.
        """
        return {}

    def replaced_places(self, fields: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
        """Return where the bodies, joints and connections are that replace it, as far as that follows from the fields.

        Parameters
        ----------
        fields : mapping of str to array
            Values of its fields by name, with the variants on the last axis.

        Returns
        -------
        dict
            {name: {"position": points (3, n) [m], "orientation": rotation vectors (3, n) from the present axes}}.
        """
        return {}

    def constructor_kwargs(self) -> dict[str, Any]:
        """Return the arguments of the ``add_...`` call that makes this part, except those at their default."""
        result = {}
        for name, default in _arguments(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if default is MISSING or value != default:
                result[name] = value
        return result

    def arguments(self) -> dict[str, Any]:
        """Return all fields that are not computed from others, by name."""
        return {name: getattr(self, name) for name, _ in _arguments(type(self))}  # type: ignore[arg-type]

    def _arguments_with(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return ``arguments()`` with other values; that of ``orientation`` is a rotation vector [rad], world axes."""
        arguments, changed = self.arguments(), dict(values)
        if "orientation" in changed:
            changed["orientation"] = rotated(changed["orientation"], arguments["orientation"])
        return arguments | changed

    def parameter_fields(self) -> Iterator[ParameterField]:
        """Yield the fields whose values are parameters."""
        for name, role in self.roles.items():
            if role.unit is not None and (role.turn or getattr(self, name) is not None):
                yield role.field(name, getattr(self, name))

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """Return the part with other values of some parameters.

        Parameters
        ----------
        values : mapping of str to float or tuple of float
            New values by field.

        Returns
        -------
        Part
            The part with these values.

        Raises
        ------
        ModelError
            If a value is invalid for such a part.
        """
        result: Self = MAKERS.get(type(self), type(self))(**self._arguments_with(values))
        return result

    def in_pose(self, pose: Pose, relaxed: bool) -> Part | dict[str, Any]:
        """Return the part in another pose of the bodies, which carry its fields as their roles say.

        Parameters
        ----------
        pose : Pose
            The pose.
        relaxed : bool
            True: springs keep their forces of the reference pose. False: their forces change with their deformation.

        Returns
        -------
        Part or dict
            The part in this pose, or the arguments of the call that adds it.

        Raises
        ------
        NoWordsError
            If no such part can be described in this pose.
        """
        kind: Any = type(self)
        fields_of, attached, checked = _attached_fields(kind)
        values, changes = list(fields_of(self)), {}
        for k, name, on, moved, follows in attached:
            if values[k] is not None and (follows is None or values[follows]) and not pose.is_unmoved(values[on]):
                values[k] = changes[name] = getattr(pose, moved)(values[on], values[k])
        if not changes:
            return self
        result: Part | dict[str, Any] = self.constructor_kwargs() | changes if checked else kind(*values)
        return result

    @property
    def reversed_axis(self) -> int | None:
        """Number of its axis that a mirrored copy reverses; None where its directions are those of the world."""
        return None

    def placed(self, to: Placement) -> Any:
        """Return its copy in another place, maybe mirrored.

        Parameters
        ----------
        to : Placement
            Names and place of the copy.

        Returns
        -------
        Part or dict of str
            The copy, or those arguments of its call that differ from its own.

        Raises
        ------
        NoWordsError
            If no such part can be described there.
        """
        if self.roles:
            return {name: getattr(to, role.placed)(value) for name, role in self.roles.items()
                    if role.placed and (value := getattr(self, name)) is not None}  # fmt: skip
        raise NoWordsError(f"{self.family} '{self.name}': there are no copies of such parts; leave it out of the model "
                           f"that is added, and add it afterwards.", element=self.name)  # fmt: skip

    @staticmethod
    def all_in_pose(parts: Sequence[Any], pose: Pose, relaxed: bool) -> list[Part | dict[str, Any]]:
        """Return parts of one family in another pose.

        Parameters
        ----------
        parts : sequence of Part
            The parts.
        pose : Pose
            The pose.
        relaxed : bool
            As in ``in_pose``.

        Returns
        -------
        list of Part or dict
            The result of ``in_pose`` for each part.
        """
        return [part.in_pose(pose, relaxed) for part in parts]


@cache
def _fields_that(kind: Any, word: str) -> frozenset[str]:
    """Fields that are parameters whose roles are what a word says."""
    return frozenset(name for name, role in kind.roles.items() if role.unit is not None and getattr(role, word))


@cache
def _attached_fields(kind: Any) -> tuple[Callable[..., tuple[Any, ...]], list[tuple[Any, ...]], bool]:
    """What returns all fields of a part, which of them bodies carry, and whether any of these is checked.

    The second are the number and name of a field, the number of that of its body, the method of the pose, and the
    number of its flag or None.
    """
    names = [item.name for item in fields(kind)]
    roles = [(names.index(name), name, role) for name, role in kind.roles.items() if role.on and role.moved]
    return attrgetter(*names), [
        (k, name, names.index(role.on), role.moved, names.index(role.follows) if role.follows else None)
        for k, name, role in roles], any(role.checked for _, _, role in roles)  # fmt: skip


@cache
def _arguments(kind: Any) -> tuple[tuple[str, Any], ...]:
    """Name and default of all fields that are not computed from others."""
    return tuple((item.name, item.default) for item in fields(kind) if not item.metadata.get("derived"))


def defaults(kind: type[Part]) -> dict[str, Any]:
    """Return the arguments of a class of parts that have a default, with this default."""
    return {name: default for name, default in _arguments(kind) if default is not MISSING}  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Composed(Part):
    """A part that bodies, joints and springs replace in the equations, such as a beam."""

    symbol = "composed"

    @property
    @abstractmethod
    def displacements(self) -> tuple[Any, ...] | None:
        """Displacements of its nodes and internal coordinates in its loaded pose; None if it carries no forces."""

    @property
    @abstractmethod
    def points(self) -> tuple[Vector, ...]:
        """Points of its nodes [m], world axes."""

    @abstractmethod
    def body_of(self, i: int) -> str:
        """Return the name of the body at node i: the node itself, or the body that holds it.

        Parameters
        ----------
        i : int
            Number of the node, from 0.

        Returns
        -------
        str
            Name of a body or ground.
        """

    @property
    def node_bodies(self) -> tuple[tuple[str, Vector], ...]:
        """Body and point [m] of each node."""
        return tuple([(self.body_of(i), point) for i, point in enumerate(self.points)])

    @property
    @abstractmethod
    def root(self) -> str:
        """Name of the body in whose frame it is linear."""

    @property
    def carriers(self) -> tuple[str, ...]:
        """Names of the bodies whose displacements are internal coordinates, three each."""
        return ()

    @property
    @abstractmethod
    def node_names(self) -> dict[str, Vector]:
        """Names and points [m] of its nodes that are bodies of their own."""

    @property
    def body_positions(self) -> Mapping[str, Vector]:
        """Names and positions [m] of the bodies that it adds to the mechanism."""
        return self.node_names | dict.fromkeys(self.carriers, self.points[0])

    @property
    @abstractmethod
    def outlines(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the nodes along the lines that represent it in pictures."""

    @property
    @abstractmethod
    def element_names(self) -> tuple[str, ...]:
        """Names of its elements that carry forces."""

    @property
    @abstractmethod
    def generated_names(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that replace it in the equations."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """Its name and the numbers of its elements and nodes."""
