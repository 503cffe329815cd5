"""Exact steps of first-order equations, whatever the size of their inputs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mbsvib.linalg.discrete import first_order_hold


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_a_step_is_exact_for_inputs_of_any_size(size):
    """x' = -2 x + b u,  x(0) = 3: the closed form, beside an input that does nothing."""
    b, h = np.array([[0.7 * size, 0.0]]), 0.3
    transition, constant, ramp = first_order_hold(np.array([[-2.0]]), b, h)
    e = np.exp(-2.0 * h)
    assert_allclose(transition, [[e]], rtol=1e-15)
    assert_allclose(constant, b * -np.expm1(-2.0 * h) / 2.0, rtol=4e-15)
    assert_allclose(ramp, b * (h - (1.0 - e) / 2.0) / (2.0 * h), rtol=4e-15)


def test_no_time_is_no_step():
    transition, constant, ramp = first_order_hold(np.array([[0.0, 1.0], [-4.0, -0.1]]), np.array([[0.0], [5.0]]), 0.0)
    assert np.array_equal(transition, np.eye(2))
    assert not constant.any()
    assert not ramp.any()
