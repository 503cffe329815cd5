"""Files of exporters as bytes, and errors of their readers, all of which become ``ExportError``."""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mbsvib.common.expected import a_path
from mbsvib.common.file_content import content_of, shortened
from mbsvib.errors import ExportError

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def content_read(path: str | os.PathLike[str], kind: str, target: str) -> Iterator[bytes]:
    """Return a context that gives the content of a file, and in which all errors of a reader become ``ExportError``.

    ``kind``: of file, in words. ``target``: what follows ``to_`` and ``from_`` in the names of writer and reader.
    """
    file, writer = a_path(path, f"from_{target}", ExportError), f"to_{target}"
    content, name = content_of(file, ExportError, f"a file of {writer}"), os.fspath(file)
    try:
        yield content
    except OSError as error:
        raise ExportError(f"{name}: cannot be read: {error.strerror or error}; expected a file of {writer}.") from error
    except ExportError as error:
        raise ExportError(f"{name}: {error}") from error
    except Exception as error:  # readers of damaged files raise exceptions of many kinds
        raise ExportError(f"{name}: no {kind} of {writer}, or a damaged one ({shortened(error)}); write it "
                          f"again.") from error
