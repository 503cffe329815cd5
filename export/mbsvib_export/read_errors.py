"""Errors of readers of files: all of them become ``ExportError``."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mbsvib.common.file_content import shortened
from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def read_errors(path: str | os.PathLike[str], kind: str, writer: str) -> Iterator[None]:
    """Return a context in which all errors of a reader of files of ``writer`` become ``ExportError``."""
    name = os.fspath(path)
    try:
        yield
    except OSError as error:
        raise ExportError(f"{name}: cannot be read: {error.strerror or error}; expected a file of {writer}.") from error
    except ExportError as error:
        raise ExportError(f"{name}: {error}") from error
    except Exception as error:  # readers of damaged files raise exceptions of many kinds
        raise ExportError(f"{name}: no {kind} of {writer}, or a damaged one ({shortened(error)}); write it "
                          f"again.") from error
