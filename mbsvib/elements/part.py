"""What all parts share: the way back to the words of the call that made them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from mbsvib.common.arguments import Vector


def derived(default: Any = None) -> Any:
    """Declare a field that follows from the others: neither compared, shown nor saved."""
    return field(default=default, repr=False, compare=False, metadata={"derived": True})


@dataclass(frozen=True, slots=True)
class Part:
    """A named, immutable piece of a model."""

    name: str

    def words(self) -> dict[str, Any]:
        """Return the arguments of the ``add_...`` call that makes this part, without those at their default."""
        result = {}
        for name, default in _given(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if default is MISSING or value != default:
                result[name] = value
        return result


@cache
def _given(kind: Any) -> tuple[tuple[str, Any], ...]:
    """Name and default of all fields that do not follow from the others."""
    return tuple((item.name, item.default) for item in fields(kind) if not item.metadata.get("derived"))


def defaults(kind: type[Part]) -> dict[str, Any]:
    """Return the words of a kind of part that have a default, with this default."""
    return {name: default for name, default in _given(kind) if default is not MISSING}  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Numbered(Part):
    """A part that tells by itself which parameters it has."""

    @abstractmethod
    def numbers(self) -> Iterator[tuple[str, tuple[str, ...] | None, Any]]:
        """Yield all parameters of the part.

        Returns
        -------
        iterator of (str, tuple of str or None, float or tuple of float)
            The field, the names of its entries if it has several, and its value.
        """

    @abstractmethod
    def number(self, field: str) -> Any:
        """Return the value of a parameter.

        Parameters
        ----------
        field : str
            A field of ``numbers()``.

        Returns
        -------
        float or tuple of float
            Its value, in the unit of the field.
        """

    @abstractmethod
    def with_numbers(self, values: Mapping[str, Any]) -> Self:
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


@dataclass(frozen=True, slots=True)
class Composed(Numbered):
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
