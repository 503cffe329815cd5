"""What completions list: the names for users, without those by which folders of mbsvib use each other's results."""

from __future__ import annotations

from typing import Any


class Completed:
    """A class whose ``dir`` leaves out the names in ``_engine``, of itself and of the classes it is made of."""

    __slots__ = ()
    _engine = ""  # names, by spaces, that are public between the folders of mbsvib and of no use in scripts

    def __dir__(self) -> list[str]:
        return completed_names(self)


def completed_names(value: Any) -> list[str]:
    """Return the names of ``dir`` without those of the engine."""
    hidden = " ".join([vars(kind).get("_engine", "") for kind in type(value).__mro__]).split()
    return [name for name in object.__dir__(value) if name not in hidden]
