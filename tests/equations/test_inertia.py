"""Inertia: factors whose square is the tensor, also of rods and plates, and of print-outs with few digits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.elements.body import TRIANGLE_SLACK
from tests.support.random_models import rotation, seeds


def mass_matrix(inertia, axis=(0, 1, 0), axis2=(0, 0, 1)):
    """Of a body that turns about two axes, so that the one along a slender rod can be left out."""
    model = mv.Model("rod")
    model.add_body("rod", 1.0, inertia)
    model.add_joint("j", "universal", "ground", "rod", position=(0, 0, 0), axis=axis, axis2=axis2)
    system = model.linearize()
    factor = system.inertia_factor
    assert_allclose(factor.T @ factor, system.M, rtol=0, atol=1e-15 * np.abs(system.M).max())
    return system.M


@given(seeds(), st.floats(-8, 8), st.booleans())
def test_tensors_of_any_size_in_any_axes(seed, size, full):
    rng = np.random.default_rng(seed)
    a, b, c = 10.0**size * rng.uniform(0.1, 1, size=3)
    turn, axes = rotation(rng), rotation(rng)
    tensor = turn @ np.diag([b + c, a + c, a + b]) @ turn.T if full else np.diag([b + c, a + c, a + b])
    tensor = (tensor + tensor.T) / 2
    model = mv.Model()
    model.add_body("b", 1.0, tensor, orientation=axes)
    result = model.linearize().M[3:, 3:]
    assert_allclose(result, axes @ tensor @ axes.T, rtol=0, atol=2e-15 * tensor.max())


@given(seeds())
def test_oblique_rods_keep_their_digits(seed):
    """The tensor of a rod is singular, and its rounding indefinite."""
    along = rotation(np.random.default_rng(seed))[:, 0]
    tensor = np.eye(3) - np.outer(along, along)
    across = np.linalg.svd(along[None, :])[2][1:]
    result = mass_matrix((tensor + tensor.T) / 2, axis=across[0], axis2=across[1])
    assert_allclose(result, np.eye(2), rtol=0, atol=3e-15)


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-9, 1e-8, 1.5e-8, 1e-7, 1e-4])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_rods_that_lie_almost_along_an_axis(tilt, order):
    """1 - cos^2 is rounded to zero or to a multiple of eps, while the product of inertia is the tilt itself."""
    along = np.array([np.cos(tilt), np.sin(tilt), 0])[list(order)]
    across, other = np.array([-np.sin(tilt), np.cos(tilt), 0])[list(order)], np.array([0, 0, 1])[list(order)]
    tensor = np.eye(3) - np.outer(along, along)
    result = mass_matrix((tensor + tensor.T) / 2, axis=across, axis2=other)
    assert_allclose(result, np.eye(2), rtol=0, atol=3e-15)
    turned = mass_matrix((tensor + tensor.T) / 2, axis=along + across, axis2=other)
    assert_allclose(turned, np.diag([0.5, 1]), rtol=0, atol=3e-15)


@pytest.mark.parametrize(("xx", "xy"), [(5e-8, 7e-4), (1e-9, 6e-4), (1e-12, 5e-4), (0.0, 1e-4), (2e-7, -5e-4)])
def test_print_outs_with_few_digits(xx, xy):
    """A slender rod a little out of line, whose small entry lost its digits: accepted, and taken as it was meant."""
    result = mass_matrix((xx, 1.0, 1.0, xy, 0.0, 0.0))
    assert_allclose(result, np.eye(2), rtol=0, atol=2 * TRIANGLE_SLACK)


def test_a_rod_does_not_disturb_the_others():
    model = mv.Model()
    model.add_body("block", 1.0, (1.0, 1.1, 1.2, 0.1, -0.2, 0.3))
    single = model.linearize().M
    model.add_body("rod", 1.0, (0, 1, 1))
    model.add_joint("j", "universal", "ground", "rod", position=(0, 0, 0), axis=(0, 1, 0), axis2=(0, 0, 1))
    both = model.linearize()
    indices = [both.coordinates.index(f"block.{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
    assert_allclose(both.M[np.ix_(indices, indices)], single, rtol=0, atol=1e-15)


def test_point_masses_swing():
    """A point mass on a string of 2 m: m l^2 about the hinge, nothing of its own."""
    model = mv.Model()
    model.add_body("bob", 3.0, (0, 0, 0), position=(0, 0, -2))
    model.add_joint("hook", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    assert_allclose(model.linearize().M, [[12.0]], rtol=1e-15)
