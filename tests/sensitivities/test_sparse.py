"""Sensitivities of some modes of sparse equations: those of the dense ones, and arrays in proportion to the bodies."""

from dataclasses import fields

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import library
from mbsvib.mechanism.changes import scale_of
from mbsvib.sensitivities.sparse_modes import nearest_indices
from tests.hunt.generate import example
from tests.hunt.sensitivities import is_place
from tests.sparse import scenes

# What a shape may lack, 1e-9, counts in the first order: in shares of the eigenvalue over the scale of the parameter.
SHAPES, LENGTH = 1e-9, 0.1


def assert_as_dense(model, count, names=None):
    dense, sparse = (model.linearize(method=method) for method in ("dense", "sparse"))
    result, every = sparse.mode_sensitivities(names, modes=count), dense.mode_sensitivities(names)
    assert result.variables == every.variables
    known = dense.modes().eigenvalues
    own = result.modes.eigenvalues
    position = nearest_indices(own, known)
    expected = every.eigenvalues[:, position]
    assert np.array_equal(np.isfinite(result.eigenvalues), np.isfinite(expected))
    scale = [LENGTH if is_place(name) else scale_of(dense.parameters, name) for name in result.variables]
    finite = np.isfinite(expected)
    off = np.abs(result.eigenvalues[finite] - expected[finite]) * (np.array(scale)[:, None] * finite)[finite]
    assert off.max() <= SHAPES * np.abs(known[position]).max()


@pytest.mark.few(2)
@pytest.mark.parametrize("model", [
    lambda: library.build("C10RF1"), scenes.dashed, scenes.braced, scenes.ring, scenes.leapfrog, scenes.floating,
    lambda n: scenes.grid(4, n // 3),
], ids=["tree", "dampers", "braces", "ring", "rigid-body mode", "free", "redundant loops"])  # fmt: skip
def test_chains_rings_and_grids(model):
    model = model(12) if model.__code__.co_argcount else model()
    assert_as_dense(model, min(5, model.linearize(method="dense").dof))


def test_a_platform_with_modes_that_coincide():
    assert_as_dense(library.stewart(), 4)
    result = library.stewart().linearize(method="sparse").mode_sensitivities("platform.inertia.xx", modes=2)
    assert len(result.modes) == 2  # of a pair that both are there


@pytest.mark.few(1)
@pytest.mark.parametrize("features", [["gear"], ["beam", "modal damping"], ["superelement"], ["rotor on body"],
                                      ["screw in loop", "rack"], ["inerter"]])  # fmt: skip
def test_elements(features):
    assert_as_dense(example(2, frozenset(features)).scene.model(), 4)


def test_what_a_loaded_model_refuses():
    model = mv.library.pendulum_chain()
    system = model.linearize(method="sparse")
    assert_as_dense(model, 2, ["m1.inertia.yy"])
    with pytest.raises(mv.ModelError, match=r"what 'gravity.z' does to its equilibrium .* use linearize\(method="):
        system.mode_sensitivities("gravity.z", modes=2)
    every = system.mode_sensitivities(modes=2)
    assert np.isnan(every.eigenvalues[every.variables.index("m1.position.z")]).all()
    with pytest.raises(mv.ResponseError, match="derivatives of shapes"):
        every.shapes.any()
    with pytest.raises(mv.ResponseError, match=r"mode_sensitivities\(parameters, modes=k\)"):
        system.mode_sensitivities()


@pytest.mark.slow
def test_nothing_is_larger_than_bodies_times_modes():
    sizes = []
    for n in (60, 120):
        result = scenes.braced(n).linearize(method="sparse").mode_sensitivities("link1.mass", modes=3)
        network = result._basis.network
        held = [getattr(part, field.name) for part in (network, network.tree.constraints) for field in fields(part)]
        sizes.append(max(array.size for array in held if hasattr(array, "size")))
    assert sizes[1] <= 2.1 * sizes[0]
