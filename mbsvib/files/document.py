"""A document: the plain values of a file, and the line number of each key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mbsvib.errors import ModelError

# (section, name, word): the path from the top of a document to one key
KeyPath = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Document:
    """The values of a file, as dicts, lists and scalars, and the line of each key."""

    file: str
    data: Any
    lines: Mapping[KeyPath, int]

    def error(
        self, key_path: KeyPath, message: str, *, element: str | None = None, field: str | None = None
    ) -> ModelError:
        """Build the error "FILE, line LINE, PLACE: MESSAGE"."""
        known = key_path
        while known and known not in self.lines:  # a key that is missing or is from an alias
            known = known[:-1]
        return fault(self.file, self.lines.get(known, 1), key_path, message, element=element, field=field)


def fault(
    file: str, line: int, key_path: KeyPath, message: str, *, column: int | None = None,
    element: str | None = None, field: str | None = None,
) -> ModelError:  # fmt: skip
    """Build the error "FILE, line LINE[, column COLUMN][, PLACE]: MESSAGE"."""
    location = [file, f"line {line}"]
    if column is not None:
        location.append(f"column {column}")
    if key_path:
        location.append(".".join(key_path))
    return ModelError(f"{', '.join(location)}: {message}", element=element, field=field)


def repeated(file: str, line: int, key_path: KeyPath, first: int) -> ModelError:
    """Build the error of a duplicate key."""
    return fault(file, line, key_path, f"'{key_path[-1]}' is already there on line {first}, and each key can be there "
                                       f"only once; rename or remove one.", element=key_path[-1])  # fmt: skip
