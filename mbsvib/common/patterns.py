"""Names, and patterns of names with ``*``, ``?`` and ``[...]`` as in file names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import translate


def matching(pattern: str, known: Iterable[str]) -> list[str]:
    """Return the pattern itself if it is a known name, which may have brackets, else all known names that fit it."""
    names = list(known)
    return [pattern] if pattern in names else list(filter(re.compile(translate(pattern)).match, names))
