"""What all parts share: the way back to the words of the call that made them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Self


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
        for item in fields(self):
            value = getattr(self, item.name)
            if not item.metadata.get("derived") and (item.default is MISSING or value != item.default):
                result[item.name] = value
        return result


@dataclass(frozen=True, slots=True)
class Numbered(Part):
    """A part that tells by itself which parameters it has."""

    @abstractmethod
    def numbers(self) -> Iterator[tuple[str, tuple[str, ...] | None, Any]]:
        """Yield (field, names of its entries, value) of all its parameters."""

    @abstractmethod
    def number(self, field: str) -> Any:
        """Return the value of a parameter."""

    @abstractmethod
    def with_numbers(self, values: Mapping[str, Any]) -> Self:
        """Return the part with other values of some parameters, checked as when it was added."""


@dataclass(frozen=True, slots=True)
class Composed(Numbered):
    """A part that becomes several bodies, joints and springs when equations are made, such as a beam."""

    @property
    @abstractmethod
    def made(self) -> tuple[str, ...]:
        """Names of the bodies, joints and springs that it becomes."""

    @property
    @abstractmethod
    def account(self) -> str:
        """What it is made of, in a few words."""
