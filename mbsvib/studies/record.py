"""The record of a study: one line of JSON for each point, appended as soon as it is computed.

The first line identifies the study. A line that was truncated by an interruption is dropped.
"""

from __future__ import annotations

import json
import os
from functools import partial
from hashlib import sha256
from time import monotonic
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.expected import a_path
from mbsvib.common.file_content import ContentError, content_of, read_json_content
from mbsvib.errors import ModelError
from mbsvib.studies.plants import name_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from types import TracebackType

    from mbsvib.api.model import Model
    from mbsvib.studies.results import Points
    from mbsvib.studies.running import Outcome, Question

VERSION = 1
# Lines are flushed to the operating system at once, and to the disk after this many seconds.
SYNC = 1.0


class Record:
    """A file of results: ``known`` are those of the file, ``add`` appends more; a context manager."""

    def __init__(self, path: str | os.PathLike[str], head: Mapping[str, Any]) -> None:
        self.path = a_path(path, "sweep", partial(ModelError, field="file"))
        self.known: dict[int, Outcome] = {}
        self._stream: IO[bytes] | None = None
        self._synced = monotonic()
        content = b""
        if os.path.lexists(self.path):
            content = content_of(self.path, partial(ModelError, field="file"), "the record of a study, or a new file")
        complete = content[: content.rfind(b"\n") + 1]
        lines = complete.splitlines()
        if lines:
            self._check(lines[0], head)
        for number, line in enumerate(lines[1:], 2):
            self._add_known(line, number, head["points"])
        if len(complete) < len(content) or not lines:
            start = complete or (json.dumps(head) + "\n").encode()
            write_atomic(self.path, lambda stream: stream.write(start), partial(ModelError, field="file"))

    def _check(self, line: bytes, head: Mapping[str, Any]) -> None:
        try:
            header = read_json_content(line)
        except ContentError:
            header = None
        if not isinstance(header, dict) or "study" not in header:
            raise ModelError(f"{self.path}: this is not a record of a study; give another file.", field="file")
        for key, value in head.items():
            if header.get(key) != value:
                raise ModelError(f"{self.path}: it is the record of another study ({key} is not the same); delete it, "
                                 f"or give another file.", field="file")  # fmt: skip

    def _add_known(self, line: bytes, number: int, points: int) -> None:
        """Read a line; a point is there again only if it failed before, as points that failed are asked again."""
        try:
            entry = read_json_content(line, nan=True)
            if not isinstance(entry, dict) or set(entry) not in ({"point", "error"}, {"point", "result"}):
                raise ContentError("expected a point and its result or error")
            point = entry["point"]
            if type(point) is not int or not 0 <= point < points:
                raise ContentError(f"point {str(point)[:40]}; expected one from 0 to {points - 1}")
            if not isinstance(self.known.get(point, ""), str):
                raise ContentError(f"the result of point {point} is there twice")
            outcome: Any = entry.get("error", entry.get("result"))
            if "result" in entry:
                outcome = {label: _decoded(value) for label, value in outcome.items()}
            elif not isinstance(outcome, str):
                raise ContentError("an error that is not a text")
        except (ContentError, AttributeError, ValueError, KeyError, TypeError, OverflowError) as error:
            reason = error if isinstance(error, ContentError) else "a result that is not an array of numbers"
            raise ModelError(f"{self.path}, line {number}: this is not a line of a record: {reason}. Remove the line "
                             f"to compute its point again, or give another file.", field="file") from error  # fmt: skip
        self.known[point] = outcome

    def add(self, outcomes: Iterable[tuple[int, Outcome]]) -> None:
        """Append results."""
        assert self._stream is not None
        self._stream.write("".join([_line(point, outcome) for point, outcome in outcomes]).encode())
        self._stream.flush()
        if monotonic() - self._synced > SYNC:
            os.fsync(self._stream.fileno())
            self._synced = monotonic()

    def __enter__(self) -> Record:
        self._stream = open(self.path, "ab")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._stream is not None:
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()


def head(model: Model, points: Points, values: Mapping[str, Any], question: Question) -> dict[str, Any]:
    """Return the header that identifies a study: the model, the values of its parameters, and names of the results.

    ``values`` (n,): values of parameters at the points.
    """
    from mbsvib.files.saving import described, json_text

    digest = sha256()
    for name, column in values.items():
        digest.update(name.encode() + b"\0" + np.ascontiguousarray(column, dtype="<f8").tobytes())
    results: dict[str, Any] = {label: item if isinstance(item, str) else name_of(item)
                               for label, item in question.items.items()}  # fmt: skip
    if question.plant.name is not None:
        results = {"plant": question.plant.name, "of": results}
    text = json_text(described(model))
    return {"study": VERSION, "name": model.name, "model": sha256(text.encode()).hexdigest(), "of": results,
            "variables": list(points.columns), "points": len(points), "values": digest.hexdigest()}  # fmt: skip


def _line(point: int, outcome: Outcome) -> str:
    if isinstance(outcome, str):
        return json.dumps({"point": point, "error": outcome}) + "\n"
    return json.dumps({"point": point, "result": {label: _encoded(value) for label, value in outcome.items()}}) + "\n"


def _encoded(value: Any) -> Any:
    if np.iscomplexobj(value):
        return {"real": value.real.tolist(), "imag": value.imag.tolist()}
    return value.tolist()


def _decoded(value: Any) -> Any:
    """Return an array of numbers; ValueError of anything else."""
    if isinstance(value, dict):
        real, imag = (_decoded(value[part]) for part in ("real", "imag"))
        if real.shape != imag.shape or len(value) > 2:
            raise ValueError("real and imaginary parts of other shapes")
        return real + 1j * imag
    result = np.asarray(value)
    if result.dtype.kind not in "biuf":
        raise ValueError("no numbers")
    return result
