"""What all parts share: the way back to the words of the call that made them."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from typing import Any


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
