"""The JSON schema of model files."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of model files, for editors that complete and check as one types.

    Write it next to a model as ``model.schema.json``; the line ``# yaml-language-server: $schema=model.schema.json``
    at the top of a YAML file, or the key ``"$schema": "model.schema.json"`` in a JSON file, ties the two together.

    Returns
    -------
    dict
        The schema; words and mandatory words are those of the ``add_...`` calls.
    """
    text = (files("mbsvib.files") / "model.schema.json").read_text(encoding="utf-8")
    result: dict[str, Any] = json.loads(text)
    return result
