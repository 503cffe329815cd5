"""Files of golden scenes: a model file each, one index of names and tolerances, and one archive of all numbers.

``index.json`` has for each scene its names and units, the question, and of each array its shape. It has "tolerance" by
blocks of equal units where rounding of the data makes one larger than ``answers.ACCURACY``, and "zeros" where these are
"rounded", not exact. ``values.npz`` has one array of doubles for each scene: all numbers in the order of the index,
complex ones as two doubles.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SCENES, INDEX, VALUES = HERE / "scenes", HERE / "index.json", HERE / "values.npz"
COMPLEX = ("poles", "response", "sparse.response", "sparse.eigenvalues")


@cache
def scenes():
    """Model files by the names of their scenes."""
    return {path.stem: path for path in sorted(SCENES.glob("*.json"))}


def index():
    """The entries of all scenes."""
    return json.loads(INDEX.read_text(encoding="utf-8"))


def expected(name, entry):
    """Arrays of a scene by name."""
    with np.load(VALUES) as archive:
        numbers = archive[name]
    result, start = {}, 0
    for key, array in entry["arrays"].items():
        count = int(np.prod(array["shape"])) * (2 if key in COMPLEX else 1)
        values = numbers[start : start + count]
        result[key] = (values.view(complex) if key in COMPLEX else values).reshape(array["shape"])
        start += count
    return result


def flat(arrays):
    """The numbers of a scene in one array."""
    parts = [np.ascontiguousarray(array.values, dtype=complex if key in COMPLEX else float).ravel().view(float)
             for key, array in arrays.items()]  # fmt: skip
    return np.concatenate(parts)


def write(entries, numbers):
    """Write index and archive: a line for each scene's names, question and arrays, so that a change shows where."""
    lines = []
    for name, entry in entries.items():
        parts = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in entry.items()]
        lines.append(f" {json.dumps(name)}: {{\n" + ",\n".join(parts) + "\n }")
    INDEX.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    np.savez_compressed(VALUES, **numbers)
