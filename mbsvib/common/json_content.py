"""JSON of unknown origin: finite numbers, each key once in an object, and errors of one class."""

from __future__ import annotations

import json
from typing import Any, NoReturn

from mbsvib.common.file_content import ContentError, shortened


def read_json_content(content: str | bytes, nan: bool = False) -> Any:
    """Return what a JSON text, or its UTF-8 bytes, holds; ContentError if it is damaged.

    ``nan``: whether NaN and Infinity are numbers, which JSON does not have.
    """
    try:
        text = content if isinstance(content, str) else content.decode("utf-8-sig")
        constant = float if nan else _refuse_constant
        return json.loads(text, parse_constant=constant, object_pairs_hook=_without_duplicates)
    except ContentError:
        raise
    except json.JSONDecodeError as error:
        raise ContentError(f"line {error.lineno}, column {error.colno}: {error.msg}") from error
    except RecursionError as error:
        raise ContentError("no JSON that is read: lists and objects are nested too deep") from error
    except ValueError as error:  # no UTF-8, or an integer of thousands of digits
        raise ContentError(f"no JSON that is read: {shortened(error)}") from error


def _refuse_constant(word: str) -> NoReturn:
    raise ContentError(f"{word} is not a number; expected finite numbers only")


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise ContentError(f"the key '{twice[:60]}' is there twice in one object; each key can be there only once. "
                           f"Remove one")  # fmt: skip
    return result
