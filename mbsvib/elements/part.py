"""What all parts share: the words of the call that made them, and their parameters."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, Any, Self

from mbsvib.common.arguments import DIRECTIONS

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector
    from mbsvib.elements.placement import Placement

Index = tuple[int, ...]


def derived(default: Any = None) -> Any:
    """Declare a field that follows from the others: neither compared, shown nor saved."""
    return field(default=default, repr=False, compare=False, metadata={"derived": True})


@dataclass(frozen=True, slots=True)
class ParameterField:
    """A field of a part whose numbers are parameters: a number, a vector or a symmetric 6x6 matrix as tuples.

    ``ends`` name the entries, None for a number; ``unit`` is that of all entries, or a function of their index.
    """

    name: str
    value: Any
    unit: str | Callable[[Index], str]
    ends: tuple[str, ...] | None = None

    def entries(self) -> Iterator[tuple[str, Index, float, str]]:
        """Yield the end of the name, the index, the value and the unit of each entry, those of a matrix once."""
        unit: Callable[[Index], str] = self.unit if callable(self.unit) else lambda _: str(self.unit)
        if self.ends is None:
            yield "", (), self.value, unit(())
        elif isinstance(self.value[0], tuple):
            for i in range(6):
                for j in range(i, 6):
                    end = f".{self.ends[i]}" + (f".{self.ends[j]}" if i != j else "")
                    yield end, (i, j), self.value[i][j], unit((i, j))
        else:
            for i, end in enumerate(self.ends):
                yield f".{end}", (i,), self.value[i], unit((i,))


def point(name: str, value: Any, unit: str = "m") -> ParameterField:
    """Return the field of a vector, such as a point [m], in world axes."""
    return ParameterField(name, value, unit, DIRECTIONS[:3])


def rotation() -> ParameterField:
    """Return the field ``orientation``: a rotation vector [rad] from the pose as described, world axes."""
    return ParameterField("orientation", (0.0, 0.0, 0.0), "rad", DIRECTIONS[3:])


def six(name: str, value: Any, units: tuple[str, str, str]) -> ParameterField:
    """Return the field of six values or of a symmetric 6x6 matrix on x y z rx ry rz.

    Parameters
    ----------
    name : str
        Name of the field.
    value : tuple
        Six values, or six rows of six.
    units : tuple of str
        Units of entries of two translations, of a translation and a rotation, and of two rotations.

    Returns
    -------
    ParameterField
        The field.
    """
    return ParameterField(name, value, lambda index: units[sum(i > 2 for i in (*index, index[0])[:2])], DIRECTIONS)


@dataclass(frozen=True, slots=True)
class Part:
    """A named, immutable piece of a model."""

    name: str

    def words(self) -> dict[str, Any]:
        """Return the arguments of the ``add_...`` call that makes this part, without those at their default."""
        result = {}
        for name, default in _arguments(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if default is MISSING or value != default:
                result[name] = value
        return result

    def arguments(self) -> dict[str, Any]:
        """Return all fields that do not follow from others, by name."""
        return {name: getattr(self, name) for name, _ in _arguments(type(self))}  # type: ignore[arg-type]

    def parameter_fields(self) -> Iterator[ParameterField]:
        """Yield the fields whose numbers are parameters; a part without parameters yields none."""
        return iter(())

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """Return the part with other values of some parameters.

        Parameters
        ----------
        values : mapping of str to float or tuple of float
            New values by field.

        Returns
        -------
        Part
            The changed part.

        Raises
        ------
        ModelError
            If a value is refused, as when the part is added.
        """
        assert not values  # a part without parameters
        return self

    def in_pose(self, pose: Placement, relaxed: bool) -> Part | dict[str, Any]:
        """Return the part in another pose of the bodies; one that is fixed to no body stays as it is.

        Parameters
        ----------
        pose : Placement
            The pose.
        relaxed : bool
            Whether springs keep the forces that they have as described; otherwise these follow from the motion.

        Returns
        -------
        Part or dict
            The part there, or the words of the call that adds it.

        Raises
        ------
        NoWordsError
            If no such part can be described in that pose.
        """
        return self

    @staticmethod
    def all_in_pose(parts: Sequence[Any], pose: Placement, relaxed: bool) -> list[Part | dict[str, Any]]:
        """Return parts of this kind in another pose, as ``in_pose`` returns each of them.

        Parameters
        ----------
        parts : sequence of Part
            The parts.
        pose : Placement
            The pose.
        relaxed : bool
            Whether springs keep the forces that they have as described.

        Returns
        -------
        list of Part or dict
            Each part there, or the words of the call that adds it.
        """
        return [part.in_pose(pose, relaxed) for part in parts]


@cache
def _arguments(kind: Any) -> tuple[tuple[str, Any], ...]:
    """Name and default of all fields that do not follow from the others."""
    return tuple((item.name, item.default) for item in fields(kind) if not item.metadata.get("derived"))


def defaults(kind: type[Part]) -> dict[str, Any]:
    """Return the words of a kind of part that have a default, with this default."""
    return {name: default for name, default in _arguments(kind) if default is not MISSING}  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Composed(Part):
    """A part that becomes several bodies, joints and springs when equations are made, such as a beam."""

    @property
    @abstractmethod
    def node_names(self) -> dict[str, Vector]:
        """Names of its own nodes, which are bodies, and where they are [m]."""

    @property
    @abstractmethod
    def element_names(self) -> tuple[str, ...]:
        """Names of its elements that carry forces."""

    @property
    @abstractmethod
    def made(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that it becomes."""

    @property
    @abstractmethod
    def account(self) -> str:
        """What it is made of, in a few words."""
