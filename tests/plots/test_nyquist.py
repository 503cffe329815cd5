"""Responses in the complex plane, and singular values."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import nyquist, singular_values


def test_a_lightly_damped_mode_is_a_circle(slider):
    """The velocity of a mass on a spring: a circle of diameter 1/c around 1/2c."""
    axes = nyquist(slider(damping=4.0), "v", "F").axes[0]
    x, y = axes.lines[0].get_data()
    assert "m/s" in axes.get_xlabel()
    scale = x.max() * 4.0
    np.testing.assert_allclose(np.hypot(x / scale - 0.125, y / scale), 0.125, rtol=1e-9)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), -y)


def test_the_critical_point_where_there_is_no_unit(slider):
    assert any(line.get_marker() == "+" for line in nyquist(slider(damping=4.0), "a", "ax").axes[0].lines)
    assert not any(line.get_marker() == "+" for line in nyquist(slider(damping=4.0), "x", "F").axes[0].lines)


def test_singular_values_bound_every_direction():
    system = mv.library.build("stewart").linearize()
    axes = singular_values(system).axes[0]
    assert axes.get_ylabel() == "singular values [m/N]"
    assert axes.get_title(loc="left") == "Fx, Fy, Fz → x, y, z"
    x, top = axes.lines[0].get_data()
    lowest = axes.lines[2].get_ydata()
    G = system.frequency_response(2.0 * np.pi * x)[:3, :3]
    for way in (np.eye(3)[2], np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)):
        size = np.linalg.norm(np.einsum("ijk,j->ik", G, way), axis=0)
        assert (size <= top * (1 + 1e-9)).all()
        assert (size >= lowest * (1 - 1e-9)).all()


def test_mixed_units_are_refused():
    system = mv.library.build("stewart").linearize()
    with pytest.raises(mv.ResponseError, match=r"'Fx' is in N, 'Mx' in N m"):
        singular_values(system, "x", ["Fx", "Mx"])
