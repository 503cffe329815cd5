"""The certificate: values of all checks, their verdict, and what was skipped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from mbsvib.common.atomic_file import write_atomic
from mbsvib.common.columnar import Columnar, by_name
from mbsvib.common.display import Displayed
from mbsvib.errors import MbsvibError

PASSED, FAILED = "passed", "failed"


@dataclass(frozen=True, slots=True, repr=False)
class Check(Displayed):
    """One check: its ``value`` against its ``limit``, and what it is of in words.

    ``passed`` is None where a value is reported without a limit.
    """

    name: str
    """What is checked."""
    value: float | None
    limit: str
    passed: bool | None
    words: str


@dataclass(frozen=True, slots=True, repr=False)
class Certificate(Columnar, Displayed):
    """What was checked of the linear equations of a model.

    ``verdict`` is "passed" or "failed"; checks that were skipped, with the reason by their names in ``skipped``, fail
    nothing. ``engine`` is the other engine that eigenvalues were compared with, None without one. ``details`` are the
    numbers behind each check, ``versions`` those of all programs that took part.
    """

    name: str
    """Name of the model."""
    verdict: str
    checks: tuple[Check, ...]
    engine: str | None
    skipped: Mapping[str, str]
    details: Mapping[str, Mapping[str, Any]]
    versions: Mapping[str, str]

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return self.verdict == PASSED

    def table(self) -> dict[str, Any]:
        """Return the checks, and what was skipped, as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        marks = {True: "passed", False: "FAILED", None: ""}
        rows = [(check.name, "-" if check.value is None else f"{check.value:.2g}", check.limit, marks[check.passed],
                 check.words) for check in self.checks]  # fmt: skip
        columns = [("check", "left"), ("value", "right"), ("limit", "left"), ("", "left"), ("of", "left")]
        notes = [f"skipped: {name}: {why}" for name, why in self.skipped.items()]
        return {"title": f"Certificate of {self.name}: {self.verdict}", "columns": columns, "rows": rows,
                "notes": [*notes, ", ".join(map(" ".join, self.versions.items()))]}  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return the checks as columns by name.

        Returns
        -------
        dict of str to array, shape (checks,)
            ``check``, ``value`` (not a number where it was skipped), ``limit``, ``result`` ("passed", "failed" or ""),
            ``of``.
        """
        words = {True: PASSED, False: FAILED, None: ""}
        return by_name(("check", "value", "limit", "result", "of"), [
            (check.name, float("nan") if check.value is None else check.value, check.limit, words[check.passed],
             check.words) for check in self.checks])  # fmt: skip

    def content(self) -> dict[str, Any]:
        """Return the certificate as JSON has it.

        Returns
        -------
        dict
            ``verdict``, a value by the name of each check (``"rank.margin"``; None where it was skipped), ``engine``,
            ``skipped``, ``versions``, and the numbers behind each check by the first word of its name.
        """
        values = {check.name: check.value for check in self.checks}
        return {"name": self.name, "verdict": self.verdict, **values, "engine": self.engine,
                "failed": [check.name for check in self.checks if check.passed is False],
                "skipped": dict(self.skipped), "versions": dict(self.versions),
                **{key: dict(part) for key, part in self.details.items()}}  # fmt: skip

    def to_json(self, path: str | PathLike[str]) -> Path:
        """Write the certificate as JSON, for CI.

        Parameters
        ----------
        path : str or path-like
            Where to; a file that is there is replaced once the new one is complete.

        Returns
        -------
        Path
            The path written.

        Raises
        ------
        MbsvibError
            If the file cannot be written.
        """
        text = json.dumps(self.content(), indent=2, allow_nan=False) + "\n"
        return write_atomic(path, lambda stream: stream.write(text.encode()), MbsvibError)
