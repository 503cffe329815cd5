"""Write the golden numbers anew: ``python -m tests.golden [SCENE ...]`` (default: all scenes).

The golden numbers are what the code computed when they were written. They show that a change that only moves or
restates code changes no result: they are **never rewritten in such a change**. Rewrite them where a result changes for
a reason that a test with a reference of its own shows: a mended defect, another choice of coordinates, a refusal that
becomes an answer, a new scene. The commit says which scenes change and why, and changes nothing else.

Scenes are model files: of the library; of random mechanisms as ``tests/support`` and ``tests/hunt`` made them (the
number is the seed; of the hunt only those of which all comparisons held); and some for what these have seldom. Between
them they have each feature of ``tests/hunt/features.py``.

Tolerances are computed: each scene is run again with all its data changed in the last bit, and an array may differ by
``MARGIN`` times what that does to it, or by its accuracy in ``answers.ACCURACY`` if that is more. Zeros that such
changes leave exactly 0 must stay so. What may differ by its own size is rounding of zeros, see ``differences``.
"""

import json
import math
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np

import mbsvib as mv
from tests.golden import store
from tests.golden.answers import ACCURACY, MATRICES, answers, differences, has_zeros, linearized, names

RUNS, MARGIN = 6, 10.0
# A variant has two parameters, each this share off.
VARIED, ATTEMPTS = 1.02, 25
# Points of the response, as shares of the poles' lowest, mean and highest natural frequency [rad/s].
POINTS = (0.7, 1.03, 1.3)


def main(selected):
    entries, numbers = {}, {}
    if selected:
        entries = store.index()
        with np.load(store.VALUES) as archive:
            numbers = {name: archive[name] for name in archive.files}
    for name in selected or store.scenes():
        entries[name], numbers[name] = record(name, store.scenes()[name])
    known = [name for name in store.scenes() if name in entries]
    store.write({name: entries[name] for name in known}, {name: numbers[name] for name in known})


def record(name, path):
    """The entry of the index and the numbers of one scene."""
    model = mv.load(path)
    system = linearized(model, method="dense")
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    question = {"omega": frequencies(system.poles()), "sparse": sparse_kind(model), "variant": variant(model, rng)}
    system, arrays = answers(model, question)
    tolerance = {key: [ACCURACY[array.kind]] * len(differences(array, array.values)) for key, array in arrays.items()}
    exact = dict.fromkeys(arrays, True)
    for _ in range(RUNS):
        again, others = answers(*disturbed(path, question, rng))
        if names(again) != names(system) or set(others) != set(arrays):
            raise ValueError(f"{name}: rounding of the data changes the choice of coordinates or what is redundant.")
        for key, array in arrays.items():
            off = differences(others[key], array.values)
            tolerance[key] = [max(old, MARGIN * new) for old, new in zip(tolerance[key], off, strict=True)]
            exact[key] &= bool(has_zeros(others[key].values, array.values))
    entry = names(system) | {"question": question, "arrays": {}}
    for key, array in arrays.items():
        entry["arrays"][key] = {"shape": array.values.shape}
        if any(share > ACCURACY[array.kind] for share in tolerance[key]):
            entry["arrays"][key]["tolerance"] = [up(share) for share in tolerance[key]]
        if not exact[key]:
            entry["arrays"][key]["zeros"] = "rounded"
    return entry, store.flat(arrays)


def up(share):
    """A number of two digits that is not less."""
    unit = 10.0 ** (math.floor(math.log10(share)) - 1)
    return float(f"{math.ceil(share / unit * (1 - 1e-12)) * unit:.1e}")


def frequencies(poles):
    """Three angular frequencies between and outside of the natural ones."""
    size = np.abs(poles[poles != 0.0])
    low, high = (size.min(), size.max()) if len(size) else (1.0, 10.0)
    return [float(f"{w:.3g}") for w in np.array(POINTS) * [low, math.sqrt(low * high), high]]


def sparse_kind(model):
    """What the sparse engine has: "modes" (and responses), "response" or None."""
    try:
        sparse = linearized(model, method="sparse")
        sparse.frequency_response([1.0])
    except mv.MbsvibError:
        return None
    try:
        sparse.modes(1)
    except mv.MbsvibError:
        return "response"
    return "modes"


def variant(model, rng):
    """Two parameters that may vary together, at other values, or None where batches do not have the scene."""
    parameters = {name: value for name, value in linearized(model, method="dense").parameters.items() if value}
    for _ in range(ATTEMPTS if len(parameters) > 1 else 0):
        selected = rng.choice(list(parameters), 2, replace=False).tolist()
        result = {name: VARIED * parameters[name] for name in selected}
        try:
            batch = linearized(model, values={name: [parameters[name], value] for name, value in result.items()})
        except mv.MbsvibError:
            continue
        if any(np.any(getattr(batch, key)[0] != getattr(batch, key)[-1]) for key in MATRICES):
            return result
    return None


def disturbed(path, question, rng):
    """The model and question with each number, but 0 and whole ones, changed in the last bit."""

    def near(value):
        return float(np.nextafter(value, rng.choice([-np.inf, np.inf]))) if value else value

    def walk(data):
        if isinstance(data, dict):
            return {key: walk(value) for key, value in data.items()}
        if isinstance(data, list):
            values = [walk(value) for value in data]
            if is_symmetric(data):
                return [[values[min(i, j)][max(i, j)] for j in range(len(values))] for i in range(len(values))]
            return values
        return near(data) if isinstance(data, float) else data

    data = walk(json.loads(path.read_text(encoding="utf-8")))
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / path.name
        again.write_text(json.dumps(data), encoding="utf-8")
        return mv.load(again), question | {"variant": walk(question["variant"])}


def is_symmetric(data):
    """Whether nested lists are a symmetric matrix."""
    square = len(data) > 1 and all(isinstance(row, list) and len(row) == len(data) for row in data)
    return square and all(data[i][j] == data[j][i] for i in range(len(data)) for j in range(i))


if __name__ == "__main__":
    main(sys.argv[1:])
