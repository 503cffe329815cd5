"""What a scene is asked: matrices, poles and responses; also of its sparse system and of a variant in a batch."""

import warnings
from dataclasses import dataclass

import numpy as np

import mbsvib as mv

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
NAMES = (
    "coordinates", "coordinate_units", "inputs", "input_units", "outputs", "output_units", "tree", "cut_joints",
    "redundant",
)  # fmt: skip
SPARSE_MODES = 3

# Relative accuracy of each kind of array where nothing is ill-conditioned: matrices differ by the order of their sums,
# sparse systems and batches solve for the dependent coordinates, poles and responses solve for everything.
ACCURACY = {"dense": 1e-14, "sparse": 1e-12, "batch": 1e-12, "solved": 1e-11}


@dataclass(frozen=True)
class Array:
    """Numbers of a scene: ``rows`` and ``columns`` are the units along the first two axes, ``kind`` is their accuracy.

    Eigenvalues have no columns; each of them counts by its own size, and their order is of no account.
    """

    kind: str
    values: np.ndarray
    rows: tuple[str, ...]
    columns: tuple[str, ...] | None = None


def names(system):
    """Names, units, and the structure of the mechanism."""
    return {key: list(getattr(system, key)) for key in NAMES}


def linearized(model, **words):
    """The equations; forces in joints that redundant constraints leave open are numbers like others here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mv.UndeterminedForceWarning)
        return model.linearize(**words)


def answers(model, question):
    """The dense system and all arrays of a scene, by name; ``question`` says for which frequencies and variant."""
    system = linearized(model, method="dense")
    omega = np.array(question["omega"])
    arrays = {key: Array("dense", getattr(system, key), *units(system, key)) for key in MATRICES}
    if system.tree or system.cut_joints:
        wrenches = np.array(list(system.reactions.values()))
        arrays["reactions"] = Array("dense", wrenches, ("",) * len(wrenches), ("N",) * 3 + ("N m",) * 3)
    arrays["poles"] = eigenvalues("solved", system.poles())
    arrays["response"] = Array("solved", system.frequency_response(omega), *units(system, "D"))
    if question["sparse"]:
        sparse = linearized(model, method="sparse")
        arrays["sparse.response"] = Array("sparse", sparse.frequency_response(omega), *units(system, "D"))
        if question["sparse"] == "modes":
            modes = sparse.modes(min(SPARSE_MODES, sparse.dof))
            arrays["sparse.eigenvalues"] = eigenvalues("sparse", modes.eigenvalues)
    if question["variant"]:
        values = {name: [value] for name, value in question["variant"].items()}
        batch = linearized(model, values=values)
        for key in MATRICES:
            arrays[f"batch.{key}"] = Array("batch", getattr(batch, key)[0], *units(system, key))
    return system, arrays


def eigenvalues(kind, values):
    return Array(kind, values, ("1/s",) * len(values))


def units(system, key):
    """Units along the rows and columns of a matrix."""
    rows = system.coordinate_units if key in "MCKB" else system.output_units
    columns = system.input_units if key in "BD" else system.coordinate_units
    return rows, columns


def blocks(array):
    """Indices of the entries that have the same units, block by block."""
    rows, columns = np.array(array.rows), np.array(array.columns)
    for row in sorted(set(array.rows)):
        for column in sorted(set(array.columns)):
            yield np.ix_(np.flatnonzero(rows == row), np.flatnonzero(columns == column))


def differences(array, expected, tolerance=0.0):
    """Largest difference of each block as a share of its largest entry; of eigenvalues, of each itself.

    Responses have a third axis, along which each frequency counts by its own largest entry. A block of zeros counts by
    the largest entry of all. One whose ``tolerance`` is its own size is rounding of zeros: it may differ by as much as
    the accuracy of the array allows of the largest entry of all.
    """
    if array.columns is None:
        return [difference_of_eigenvalues(array.values, expected)]
    overall = np.abs(expected).max(initial=0.0) or 1.0
    parts = list(blocks(array))
    result = []
    for block, share in zip(parts, np.broadcast_to(tolerance, len(parts)), strict=True):
        off, size = (np.abs(part).max(axis=(0, 1)) for part in (array.values[block] - expected[block], expected[block]))
        least = overall * ACCURACY[array.kind] / share if share >= 1.0 else 0.0
        result.append(float(np.max(off / np.where(size > 0.0, np.maximum(size, least), overall))))
    return result


def difference_of_eigenvalues(values, expected):
    """Largest relative distance of each expected eigenvalue from the one that is nearest, each taken once."""
    left, shares = list(values), [0.0]
    for value in sorted(expected, key=abs, reverse=True):
        nearest = min(range(len(left)), key=lambda k: abs(left[k] - value))
        distance = abs(left.pop(nearest) - value)
        shares.append(distance / max(abs(value), 1e-300) if distance else 0.0)
    return float(np.max(shares))


def has_zeros(values, expected):
    """Whether each entry that is exactly 0 in ``expected`` is so in ``values``."""
    return not np.any(values[expected == 0.0]) if expected.ndim > 1 else np.sum(values == 0) == np.sum(expected == 0)
