"""What a scene is asked, and how two sets of answers are compared."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.hunt.reference import matched

# Relative accuracy that all answers must have, besides what rounding of the data does.
RTOL = 1e-9
# An eigenvalue that the tolerance cannot tell from 0 is surely 0 below this share of it, and in doubt above.
SURELY = 0.1
# The error that modes claim for themselves is accepted up to this; beyond it, a number must not come in silence.
CLAIMED = 1e-6
# Wrenches in the pose, as a share of the largest, and of the largest force that cancels in them.
OF_FORCES, OF_CANCELLED = 1e-8, 64 * float(np.finfo(float).eps)
UNDETERMINED = "not determined by the model (redundant joints)"


class Mismatch(AssertionError):
    """Two sets of answers that differ by more than they may."""


@dataclass(frozen=True)
class Answers:
    """Answers of one linearization: ports are in the order of the scene, frequencies in those of the question."""

    size: int
    eigenvalues: np.ndarray | None
    errors: np.ndarray | None
    response: np.ndarray
    reactions: dict[str, Any]


@dataclass(frozen=True)
class Question:
    """Angular frequencies, names of ports, and how far answers may be from each other."""

    omega: np.ndarray
    inputs: tuple[Any, ...]
    outputs: tuple[Any, ...]
    eigenvalues: np.ndarray
    eigenvalue_tolerance: np.ndarray
    response: np.ndarray
    response_tolerance: np.ndarray
    determined: np.ndarray


def question(example):
    """What a scene is asked: frequencies below, between and above its resonances, and 0 where it is held."""
    reference = example.reference
    values, tolerance = reference.eigenvalues, reference.eigenvalue_tolerance
    omega = frequencies(values, tolerance)
    response, response_tolerance = reference.response(omega)
    largest = np.abs(response).max(axis=1, keepdims=True, initial=0.0)
    return Question(omega, tuple(example.scene.inputs), tuple(example.scene.outputs), values, tolerance, response,
                    response_tolerance + RTOL * largest, reference.determined)  # fmt: skip


def frequencies(values, tolerance):
    """0 where no eigenvalue is 0, one below all others, two far from resonances between them, one above."""
    size = np.sort(np.abs(values[np.abs(values) > 10 * tolerance]))
    if not len(size):
        return np.array([0.7, 13.0])
    edges = np.concatenate(([0.3 * size[0]], size, [1.7 * size[-1]]))
    distances = np.argsort(edges[1:] / edges[:-1])[::-1][:2]
    between = np.sqrt(edges[distances] * edges[distances + 1])
    held = [0.0] if len(size) == len(values) else []
    return np.array([*held, *np.sort([0.31 * size[0], *between, 1.63 * size[-1]])])


def rows_of(names, wanted):
    return [list(names).index(name) for name in wanted]


def response_of(system, q, scale=1.0):
    """The frequency response with ports in the order of the question; ``scale`` is that of the unit of time."""
    response = system.frequency_response(q.omega / scale)
    return response[rows_of(system.outputs, q.outputs)][:, rows_of(system.inputs, q.inputs)]


def answers(system, q, scale=1.0):
    """The answers of a dense system."""
    modes = system.modes()
    errors = modes.errors if len(modes.errors) == len(modes.eigenvalues) else np.repeat(modes.errors, 2)
    if len(errors) != len(modes.eigenvalues):
        errors = np.full(len(modes.eigenvalues), errors.max(initial=0.0))
    return Answers(len(modes.eigenvalues), modes.eigenvalues * scale, errors, response_of(system, q, scale),
                   dict(system.reactions))  # fmt: skip


def compare_eigenvalues(own, values, tolerance):
    """Each eigenvalue with that of the other set that is nearest, the sets taken as a whole."""
    if len(own.eigenvalues) != len(values):
        raise Mismatch(f"{len(own.eigenvalues)} eigenvalues, not {len(values)}")
    if not len(values):
        return
    result, distance = matched(values, own.eigenvalues)
    claimed = np.minimum(own.errors.max(initial=0.0), CLAIMED)
    share = distance / (tolerance + (RTOL + claimed) * np.abs(values) + 1e-300)
    worst = int(np.argmax(share))
    if share[worst] > 1.0:
        raise Mismatch(f"eigenvalue {result[worst]:.9g}, not {values[worst]:.9g}: {share[worst]:.1e} times what is "
                       f"allowed")  # fmt: skip


def compare_rigid(own, q):
    """Eigenvalues that are exactly 0: as many as the reference cannot tell from 0."""
    most, least = (int(np.sum(np.abs(q.eigenvalues) <= share * q.eigenvalue_tolerance)) for share in (1.0, SURELY))
    exact = int(np.sum(own.eigenvalues == 0))
    if not least <= exact <= most:
        raise Mismatch(f"{exact} eigenvalues are 0, not {least} to {most}; the smallest others are "
                       f"{np.sort(np.abs(own.eigenvalues[own.eigenvalues != 0]))[:3]}")  # fmt: skip


def compare_responses(response, expected, q, rows=None):
    """Responses of some outputs (default: all)."""
    rows = range(len(q.outputs)) if rows is None else rows
    for i in rows:
        share = np.abs(response[i] - expected[i]) / (q.response_tolerance[i] + 1e-300)
        if share.size and not share.max() <= 1.0:
            j, k = np.unravel_index(int(np.argmax(np.nan_to_num(share, nan=np.inf))), share.shape)
            raise Mismatch(
                f"response of '{q.outputs[i]}' to '{q.inputs[j]}' at {q.omega[k]:.6g} rad/s is "
                f"{response[i, j, k]:.9g}, not {expected[i, j, k]:.9g}: {share[j, k]:.1e} times what is allowed"
                + ("" if q.determined[i] else f"; this output is {UNDETERMINED}")
            )  # fmt: skip


def compare_reactions(reactions, expected, names, equations):
    """Wrenches in joints in the pose."""
    length = equations.length
    size = max((float(np.abs(w[:3]).max() + np.abs(w[3:]).max() / length) for w in expected.values()), default=0.0)
    for name in names:
        off = np.abs(reactions[name] - expected[name]) / np.array([1.0] * 3 + [length] * 3)
        if off.max() > OF_FORCES * size + OF_CANCELLED * equations.largest_term:
            raise Mismatch(f"reaction in '{name}' is {np.round(reactions[name], 6)}, not {np.round(expected[name], 6)}")
