"""How results of the toolbox are held against the reference."""

import warnings

import numpy as np
from hypothesis import reject
from numpy.testing import assert_allclose

import mbsvib as mv


def linearized(model, **words):
    """The model's system; a pose that is reported as (nearly) singular is no example."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", mv.NearSingularWarning)
        try:
            return model.linearize(**words)
        except (mv.SingularPoseError, mv.NearSingularWarning):
            reject()


def both_ways(model):
    """The model's dense and its sparse system; in place of one, the kind of its doubt about the pose."""
    result = []
    for method in ("dense", "sparse"):
        with warnings.catch_warnings():
            warnings.simplefilter("error", mv.NearSingularWarning)
            try:
                result.append(model.linearize(method=method))
            except (mv.SingularPoseError, mv.NearSingularWarning) as doubt:
                result.append(type(doubt))
    return result


def elastic_size(model):
    """The largest stiffness and damping, against which an entry that should be zero is judged."""
    springs = model.springs.values()
    return (max((float(np.max(np.abs(s.stiffness))) for s in springs), default=1.0),
            max((float(np.max(np.abs(s.damping))) for s in springs), default=1.0))  # fmt: skip


def assert_same_matrices(system, reference, rtol=1e-12):
    """All matrices of the system, against those of the reference in the same coordinates."""
    stiffness, damping = elastic_size(reference.model)
    exact = reference.minimal(system.coordinates)
    floor = {"K": stiffness, "C": damping, "Cq": max(1.0, stiffness), "Cv": max(1.0, damping)}
    for key in ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D"):
        result, expected = getattr(system, key), exact[key]
        assert result.shape == expected.shape, key
        size = max(1e-2 * floor.get(key, 1.0), np.abs(expected).max(initial=0.0))
        assert_allclose(result, expected, rtol=0, atol=rtol * size, err_msg=key)


def nearest_pairs(result, expected):
    """Both sets of numbers in one order, each expected one with the nearest that is left."""
    left, pairs = list(result), []
    for value in sorted(expected, key=abs, reverse=True):
        k = int(np.argmin([abs(other - value) for other in left]))
        pairs.append((left.pop(k), value))
    assert not left
    return np.array(pairs).reshape(-1, 2).T


def assert_same_eigenvalues(result, expected, rtol=1e-9):
    """Equal to a relative tolerance each; zeros exactly."""
    assert len(result) == len(expected)
    a, b = nearest_pairs(result, expected)
    assert not a[b == 0].any(), "eigenvalues of rigid modes are exact zeros"
    error = np.abs(a - b) / np.where(b == 0, 1.0, np.abs(b))
    assert error.max(initial=0.0) <= rtol, f"{error.max():.1e}: {a[error.argmax()]}, not {b[error.argmax()]}"


def assert_same_response(result, expected, rtol=1e-9):
    """Equal to a tolerance relative to the largest response of each output at each frequency."""
    assert result.shape == expected.shape
    if not result.size:
        return
    expected = np.where(np.abs(expected) > 1e-35, expected, 0.0)  # zeros, but for what 50 digits leave of them
    size = np.abs(expected).max(axis=1, keepdims=True)
    size = np.maximum(size, 1e-5 * size.max(axis=0, keepdims=True))
    error = np.abs(result - expected) / np.where(size > 0, size, 1.0)
    worst = np.unravel_index(error.argmax(), error.shape)
    assert error.max() <= rtol, f"{error.max():.1e} at (output, input, frequency) {worst}"


def frequencies(reference):
    """Angular frequencies below, near, between and above the natural ones."""
    omega = np.sqrt(np.abs(reference.squares[reference.squares != 0.0]))
    if not len(omega):
        return np.array([0.7, 13.0])
    return np.array([0.3 * omega[0], 0.98 * omega[0], np.sqrt(omega[0] * omega[-1]) * 1.01, 1.2 * omega[-1]])
